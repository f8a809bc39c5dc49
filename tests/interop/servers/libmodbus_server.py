"""A libmodbus slave, unit 1, whose register *a* holds *a*: 0000H to 03FFH. Says `ready` when the port is open.

usage: libmodbus_server.py PORT LIBRARY
"""

import ctypes
import os
import sys

COUNT = 0x400


class Mapping(ctypes.Structure):
    """`modbus_mapping_t` of modbus.h, version 3.1."""

    _fields_ = [
        ("nb_bits", ctypes.c_int),
        ("start_bits", ctypes.c_int),
        ("nb_input_bits", ctypes.c_int),
        ("start_input_bits", ctypes.c_int),
        ("nb_input_registers", ctypes.c_int),
        ("start_input_registers", ctypes.c_int),
        ("nb_registers", ctypes.c_int),
        ("start_registers", ctypes.c_int),
        ("tab_bits", ctypes.POINTER(ctypes.c_uint8)),
        ("tab_input_bits", ctypes.POINTER(ctypes.c_uint8)),
        ("tab_input_registers", ctypes.POINTER(ctypes.c_uint16)),
        ("tab_registers", ctypes.POINTER(ctypes.c_uint16)),
    ]


def main(port: str, library: str) -> None:
    """Serves until it is ended."""
    lib = ctypes.CDLL(library, use_errno=True)
    lib.modbus_new_rtu.restype = ctypes.c_void_p
    lib.modbus_new_rtu.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_char, ctypes.c_int, ctypes.c_int]
    lib.modbus_mapping_new.restype = ctypes.POINTER(Mapping)
    lib.modbus_mapping_new.argtypes = [ctypes.c_int] * 4
    lib.modbus_receive.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    lib.modbus_reply.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.POINTER(Mapping)]
    lib.modbus_set_slave.argtypes = [ctypes.c_void_p, ctypes.c_int]
    for name in ("modbus_connect", "modbus_flush"):
        getattr(lib, name).argtypes = [ctypes.c_void_p]

    context = lib.modbus_new_rtu(port.encode(), 19200, b"N", 8, 1)
    mapping = lib.modbus_mapping_new(0, 0, COUNT, 0)
    for address in range(COUNT):
        mapping.contents.tab_registers[address] = address
    lib.modbus_set_slave(context, 1)
    if lib.modbus_connect(context) != 0:
        sys.exit(f"libmodbus cannot open {port}: {os.strerror(ctypes.get_errno())}")
    print("ready", flush=True)

    request = ctypes.create_string_buffer(256)
    while True:
        length = lib.modbus_receive(context, request)
        if length > 0:
            lib.modbus_reply(context, request, length, mapping)
        elif length < 0:
            # A function it does not know: it has read a part of the frame, so drop the rest and listen again.
            lib.modbus_flush(context)


main(*sys.argv[1:])
