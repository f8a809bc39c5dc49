"""Other people's masters that read and write registers one after the other, each address another value."""

from __future__ import annotations

import ctypes

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

HELD = 0x300
"""Registers that are asked for; the units have more."""


def ask_by_pymodbus(port: str, count: int, timeout: float = 1.0) -> None:
    """*count* requests by pymodbus; one that gets no answer is repeated once."""
    client = ModbusSerialClient(port, baudrate=19200, parity="N", timeout=timeout, retries=1)
    assert client.connect()
    try:
        for index in range(count):
            address = 37 * index % HELD
            try:
                if index % 4 == 3:
                    client.write_register(address, address, device_id=1)
                elif index % 4 == 2:
                    client.write_registers(address, [address, address + 1], device_id=1)
                else:
                    client.read_holding_registers(address, count=1 + index % 16, device_id=1)
            except ModbusException:
                # It closes the port when nobody answers.
                client.connect()
    finally:
        client.close()  # type: ignore[no-untyped-call]


def ask_by_libmodbus(port: str, count: int, library: str) -> None:
    """*count* requests by libmodbus, which repeats nothing."""
    lib = ctypes.CDLL(library, use_errno=True)
    lib.modbus_new_rtu.restype = ctypes.c_void_p
    lib.modbus_new_rtu.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_char, ctypes.c_int, ctypes.c_int]
    for name in ("modbus_connect", "modbus_close", "modbus_free", "modbus_flush"):
        getattr(lib, name).argtypes = [ctypes.c_void_p]
    lib.modbus_set_slave.argtypes = [ctypes.c_void_p, ctypes.c_int]
    lib.modbus_set_response_timeout.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32]
    lib.modbus_read_registers.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_void_p]
    lib.modbus_write_register.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint16]
    context = lib.modbus_new_rtu(port.encode(), 19200, b"N", 8, 1)
    lib.modbus_set_slave(context, 1)
    lib.modbus_set_response_timeout(context, 2, 0)
    assert lib.modbus_connect(context) == 0
    words = (ctypes.c_uint16 * 125)()
    try:
        for index in range(count):
            address = 37 * index % HELD
            if index % 4 == 3:
                lib.modbus_write_register(context, address, address)
            else:
                lib.modbus_read_registers(context, address, 1 + index % 16, words)
            lib.modbus_flush(context)
    finally:
        lib.modbus_close(context)
        lib.modbus_free(context)


def ask_over_tcp(port: str, count: int, timeout: float = 2.0) -> None:
    """*count* requests by pymodbus in RTU frames to *port*, which is `socket://HOST:PORT`."""
    host, _, number = port.removeprefix("socket://").rpartition(":")
    client = ModbusTcpClient(host, port=int(number), framer=FramerType.RTU, timeout=timeout, retries=0)
    assert client.connect()  # type: ignore[no-untyped-call]
    try:
        for index in range(count):
            client.read_holding_registers(37 * index % HELD, count=1 + index % 16, device_id=1)
    finally:
        client.close()  # type: ignore[no-untyped-call]
