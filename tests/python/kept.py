"""What the tests of backup and restore share: values to give back, and what a simulated drive then kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest

from drivebus import Bus, Drive, Simulator

Store = Callable[[Drive, Mapping[str, object]], None]
"""The fixture `store`."""
RAM = 0x8000
"""The bit of an INVT address that keeps a value out of the EEPROM."""
OTHER = {"P00.03": 60.0, "P00.04": 55.0, "P00.11": 3.0, "P00.12": 4.0, "P01.20": 1.5, "P09.01": -12.5}
"""Values that are not those of the factory."""


def stored(simulator: Simulator) -> list[int]:
    """The addresses of EEPROM of a GD350 that were written since it was asked last, in their order."""
    return [address for _, address, _ in simulator.drive(1).take_writes() if not address & RAM]


def times_stored(simulator: Simulator, drive: Drive) -> Counter[int]:
    """How often each address of a *drive* of any family was written since asked last, but for what stores all."""
    memory = drive.profile.memory()
    store = None if memory is None or memory.store_register is None else drive.profile.address(memory.store_register)
    return Counter(address for _, address, _ in simulator.drive(1).take_writes() if address != store)


def once(drive: Drive, codes: Iterable[str]) -> dict[int, int]:
    """The same where each of *codes* was kept once, and nothing else was written."""
    return dict.fromkeys((drive.profile.address(code, store=True) for code in codes), 1)


class Spoilt:
    """Spoils what a line answers to requests for one address, in the line's own way: each time, or some times.

    Args:
        patch: What undoes it.
        simulator: Whose line it is.
    """

    def __init__(self, patch: pytest.MonkeyPatch, simulator: Simulator) -> None:
        self._patch, self._line = patch, simulator.line

    def read(self, address: int, what: int | str, times: int = 1 << 30, unit: int = 1) -> None:
        """Reads that cover *address* are refused with the exception *what*, or end as that kind of fault."""
        self._spoil("read", address, what, times, bytes((unit, 0x83)))

    def write(self, address: int, what: int | str, times: int = 1 << 30, unit: int = 1) -> None:
        """Writes to *address* are: whatever the answer says, the drive has taken them."""
        self._spoil("write", address, what, times, bytes((unit, 0x86)))

    def _spoil(self, how: str, address: int, what: int | str, times: int, head: bytes) -> None:
        call, line, left = getattr(Bus, how), self._line, [times]
        answer = what if isinstance(what, str) else framed(head + bytes((what,)))

        def spoilt(bus: Bus, unit: int, first: int, rest: Any = 1, /, **options: Any) -> Any:
            count = rest if how == "read" else 1
            if not first <= address < first + count or not left[0]:
                return call(bus, unit, first, rest, **options)
            left[0] -= 1
            # As often as the bus itself asks again for this one call.
            line.script([(number, answer) for number in range(1, 100)])
            try:
                return call(bus, unit, first, rest, **options)
            finally:
                line.clear()

        self._patch.setattr(Bus, how, spoilt)


def framed(body: bytes) -> bytes:
    """*body* with its CRC, by the book: *Modbus over Serial Line* V1.02, section 6.2.2."""
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return body + crc.to_bytes(2, "little")
