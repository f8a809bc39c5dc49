"""A simulated drive that somebody has set to obey the bus, and what is written to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from drivebus import Bus, Simulator

__all__ = ["obedient", "written"]


@contextmanager
def obedient(family: str, settings: Sequence[tuple[int, int]]) -> Iterator[Simulator]:
    """A line with unit 1 of *family*, in which *settings*, address and word, were written before."""
    with Simulator({1: family}, transport="process", clock="virtual") as simulator:
        with Bus(simulator) as bus:
            for address, word in settings:
                bus.write(1, address, word)
        simulator.drive(1).take_writes()
        yield simulator


def written(line: Simulator) -> list[tuple[int, int]]:
    """What was written to unit 1 since this was asked last: address and word."""
    return [(place, word) for _, place, word in line.drive(1).take_writes()]
