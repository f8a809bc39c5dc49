"""What the tests of backup and restore share: values to give back, and what a simulated drive then kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from drivebus import Drive, Simulator

Store = Callable[[Drive, Mapping[str, object]], None]
"""The fixture `store`."""
RAM = 0x8000
"""The bit of an INVT address that keeps a value out of the EEPROM."""
OTHER = {"P00.03": 60.0, "P00.04": 55.0, "P00.11": 3.0, "P00.12": 4.0, "P01.20": 1.5, "P09.01": -12.5}
"""Values that are not those of the factory."""


def stored(simulator: Simulator) -> list[int]:
    """The addresses of EEPROM of a GD350 that were written since it was asked last, in their order."""
    return [address for _, address, _ in simulator.drive(1).take_writes() if not address & RAM]


def times_stored(simulator: Simulator) -> Counter[int]:
    """How often each address of any family was written since it was asked last."""
    return Counter(address for _, address, _ in simulator.drive(1).take_writes())


def once(drive: Drive, codes: Iterable[str]) -> dict[int, int]:
    """The same where each of *codes* was kept once, and nothing else was written."""
    return dict.fromkeys((drive.profile.address(code, store=True) for code in codes), 1)
