"""Who is asked in a scan, one after the other, and in which protocol. Sends nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

__all__ = ["PROTOCOLS", "asked"]

PROTOCOLS = ("auto", "modbus", "huanyang")
"""In which units are asked: `"auto"` is Modbus, and then the other one where nobody has answered."""

_IN_BOTH = 16
"""How many are asked in both, where all are silent: each costs a time-out, and lines of drives are numbered from 1."""


def asked(units: Sequence[int], protocol: str, found: Sequence[object]) -> Iterator[tuple[int, bool]]:
    """Who is asked, and whether in Huanyang's own protocol. *found* has, by then, who answered."""
    if protocol == "huanyang":
        yield from ((unit, True) for unit in units)
        return
    yield from ((unit, False) for unit in units)
    if protocol == "auto" and not found:
        yield from ((unit, True) for unit in units[:_IN_BOTH])
