"""A scan of a line: which units are asked, how long each is given, and what is told of one that answers.

It asks with the settings that the line has. Other speeds and formats are tried by `line_search`.

A drive of Huanyang that speaks the maker's own protocol hears each request of Modbus, too, and nobody documents how it
ends a frame. Its command is `03 01` and a code, so a read of holding registers 0100H to 01FFH begins as one, and its
write of a parameter is `02 03`, its number and a word: byte for byte a read of discrete inputs 0300H to 03FFH. Nothing
that is sent to a unit of which nothing is known may look so.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable

from drivebus import checks
from drivebus.errors import BadAnswer, BadArgument, NoAnswer, Refused
from drivebus.identify.identify import identify
from drivebus.identify.profile_choice import usable
from drivebus.identify.results import Found
from drivebus.line import huanyang
from drivebus.line.addresses import Addresses
from drivebus.line.asking import Ask, Read
from drivebus.line.frames import frames_in, may_be_of
from drivebus.line.scan_order import PROTOCOLS

__all__ = ["look_for", "look_for_huanyang", "protocol_of", "speaks_otherwise", "time_for", "units"]

_OTHERWISE = f"it speaks {huanyang.NAME}, which is no Modbus: name it {huanyang.PROFILE}"

_TIMEOUT = 0.1
"""Seconds a unit is given in a scan: over ten times the factory response delay, and 247 units in half a minute."""


def units(given: Iterable[int], addresses: Addresses) -> list[int]:
    """The units of a scan, which may be asked as *addresses* says."""
    if not isinstance(given, Iterable):
        raise BadArgument(f"units is {checks.shown(given)}; give addresses from 1 to 247, such as range(1, 248) or [5]")
    return [addresses.unit(unit) for unit in given]


def time_for(timeout: float | None, of_bus: float) -> float:
    """Seconds each unit is given in a scan: *timeout*, or if that is None no more than the time-out *of_bus*."""
    limit = min(_TIMEOUT, of_bus) if timeout is None else timeout
    return checks.number("timeout", limit, 0.0, 3600.0, above=True)


def protocol_of(given: str) -> str:
    """The protocol of a scan."""
    return checks.one_of("protocol", given, PROTOCOLS)


async def look_for_huanyang(
    ask: Callable[[int, bytes, int], Awaitable[bytes]], now: Callable[[], float], unit: int, is_first: bool
) -> Found | None:
    """The drive at *unit* that answers in Huanyang's own protocol, if one does.

    *ask* sends what it is given, once, although the unit may owe an answer of Modbus, which does not look like this
    one, and is told how many bytes the answer has. Where it *is_first* on its line, it is asked twice: an adapter that
    echoes is known by the first echo, and what comes behind that may be lost.
    """
    for _ in range(2 if is_first else 1):
        started = now()
        try:
            told = await ask(unit, huanyang.STATUS_READ, len(huanyang.STATUS_READ))
        except NoAnswer:
            continue
        except (BadAnswer, Refused):
            return None  # noise, or somebody who speaks Modbus
        return _foreign(unit, now() - started) if huanyang.tells_status(told) else None
    return None


def speaks_otherwise(unit: int, error: NoAnswer | BadAnswer) -> str | None:
    """That what came of *unit*, which was asked in Modbus, is of Huanyang's own protocol; None where it is not."""
    return _OTHERWISE if any(frame[0] == unit and huanyang.is_sure(frame) for frame in frames_in(error.raw)) else None


def _foreign(unit: int, took: float) -> Found:
    return Found(unit, None, None, took, _OTHERWISE, candidates=(huanyang.PROFILE,), protocol="huanyang")


async def look_for(ask: Ask, now: Callable[[], float], unit: int) -> Found | None:
    """Who answers at *unit*, if somebody does. *ask* asks once; *now* tells the time in seconds."""
    started = now()
    took: list[float] = []

    async def timed(read: Read) -> list[int]:
        try:
            return await ask(read)
        finally:
            took.append(now() - started)

    try:
        found = await identify(timed, unit)
    except (NoAnswer, BadAnswer) as error:
        if speaks_otherwise(unit, error) is not None:
            return _foreign(unit, took[0])
        if isinstance(error, NoAnswer) or not may_be_of(unit, error.raw):
            return None  # silence, noise, or somebody else's
        return Found(unit, None, None, took[0], str(error))
    family = usable(found, unverified=True) or found.family
    problem = found.reason if found.certainty == "unknown" and found.code is None else None
    return Found(unit, family, found.code, took[0], problem, found.certainty, found.candidates)
