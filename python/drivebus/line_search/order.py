"""What is tried, and in what order, where nobody knows how a drive is set: the likeliest first."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus.line_search.settings import Settings
from drivebus.profile import Profile, profiles

__all__ = ["LIKELY_UNITS", "candidates", "factory", "longest_delay"]

LIKELY_UNITS = range(1, 17)
"""Addresses that lines of drives have: 1 from the factory, then counted up."""

_SPEEDS = (19200, 9600, 38400, 115200, 57600, 4800)
_ALL_SPEEDS = (*_SPEEDS, 2400, 1200)
"""What the families can be set to: P14.01 of a Goodrive, P30.02 of a VFD500."""

_FORMATS = (("E", 1), ("N", 1), ("O", 1))
_ALL_FORMATS = (*_FORMATS, ("N", 2), ("E", 2), ("O", 2))


def candidates(given: Settings, full: bool) -> Iterator[Settings]:
    """Other settings than *given*, the likeliest first: those of factories, the same speed, the rest."""
    speeds, formats = (_ALL_SPEEDS, _ALL_FORMATS) if full else (_SPEEDS, _FORMATS)
    same_speed = [Settings(given.baudrate, 8, parity, stop) for parity, stop in formats]
    rest = [Settings(speed, 8, parity, stop) for parity, stop in formats for speed in speeds]
    # A dict keeps the order and each of them once.
    yield from (other for other in dict.fromkeys((*factory(), *same_speed, *rest)) if other != given)


def factory() -> list[Settings]:
    """The settings that drives leave their factories with, by their profiles; those of most families first.

    Each costs a question to every address. Those that one family has, and no page of it, are tried with all the others.
    """
    known = [serial for serial in (Profile.builtin(name).serial() for name in profiles()) if serial is not None]
    each = [Settings(row.baud_rate, int(row.format[0]), row.format[1], int(row.format[2])) for row in known]
    printed = {settings for settings, row in zip(each, known, strict=True) if row.verified}
    likely = [settings for settings in dict.fromkeys(each) if settings in printed or each.count(settings) > 1]
    return sorted(likely, key=each.count, reverse=True)


def longest_delay() -> float:
    """Seconds that a drive as it leaves its factory takes at most before it answers."""
    known = (Profile.builtin(name).serial() for name in profiles())
    return max(serial.response_delay or 0.0 for serial in known if serial is not None)
