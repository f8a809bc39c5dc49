"""Somebody else's sniffer on a port, for `tools/measure_sniffing.py --beside PYTHON`: `PYTHON other_sniffer.py PORT`.

Runs the package modbus-sniffer (1.0.3) with its own settings for 19200 8N1, and prints a line for each frame that it
tells: who sent it by its word, and the bytes that what it tells would have. It does not pair them, so the line after a
request counts as what it says the answer is.
"""

from __future__ import annotations

import logging
import struct
import sys
from typing import Any

from modbus_sniffer.serial_snooper import SerialSnooper
from modbus_sniffer.sniffer_utils import normalize_sniffer_config


def frame(told: dict[str, Any]) -> bytes:
    """The PDU, with its address, that *told* describes."""
    head = bytes([told["slave_id"], told["function"]])
    if told["message_type"] == "request":
        if told["function"] in (3, 4):
            return head + struct.pack(">HH", told["data_address"], told["data_qty"])
        if told["function"] == 6:
            return head + struct.pack(">H", told["data_address"]) + bytes(told["data"])
        words = told["data"]
        size = struct.pack(">HHB", told["data_address"], len(words), 2 * len(words))
        return head + size + struct.pack(f">{len(words)}H", *words)
    if told["function"] in (3, 4):
        words = told["data"]
        return head + bytes([2 * len(words)]) + struct.pack(f">{len(words)}H", *words)
    if told["function"] == 6:
        return head + struct.pack(">H", told["data_address"]) + bytes(told["data"])
    return head + struct.pack(">HH", told["data_address"], told["data_qty"])


def tell(told: dict[str, Any]) -> None:
    """Prints one frame."""
    try:
        print(told["message_type"], frame(told).hex(), flush=True)
    except (KeyError, TypeError, struct.error, ValueError):
        print("other", "", flush=True)


def main() -> None:
    """Listens until it is killed."""
    log = logging.getLogger("quiet")
    log.addHandler(logging.NullHandler())
    log.propagate = False
    given = normalize_sniffer_config(sys.argv[1], 19200, "none", None)
    with SerialSnooper(
        log, given["port"], given["baudrate"], given["parity"], given["timeout"], data_handler=tell
    ) as ear:
        print("ready", flush=True)
        while True:
            ear.process_data(ear.read_raw())


if __name__ == "__main__":
    main()
