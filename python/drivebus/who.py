"""Who answers on a line, and what they say they are."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable

from drivebus import checks
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, Refused
from drivebus.profile import Profile, identify, profiles
from drivebus.protocols import AwaitableBus
from drivebus.values import Found

__all__ = ["ask", "look_for", "time_for", "units"]

_IDENTIFICATION = "identification_code"
_SCAN_TIMEOUT = 0.1
"""Seconds a unit is given in a scan: over ten times the factory response delay, and 247 units in half a minute."""


def units(given: Iterable[int]) -> list[int]:
    """The units of a scan."""
    if not isinstance(given, Iterable):
        raise NotAllowed(f"units {given!r} are no units; give several of 1..247, such as range(1, 248) or [5]")
    return [checks.unit(unit) for unit in given]


def time_for(timeout: float | None, of_bus: float) -> float:
    """Seconds each unit is given in a scan."""
    limit = min(_SCAN_TIMEOUT, of_bus) if timeout is None else timeout
    return checks.number("timeout", limit, 0.0, 3600.0, above=True)


async def look_for(
    read: Callable[[int, int], Awaitable[list[int]]], now: Callable[[], float], unit: int
) -> Found | None:
    """Who answers at *unit*, if somebody does. *read* asks for one word, once."""
    started = now()
    code: int | None = None
    problem: str | None = None
    try:
        [code] = await read(unit, _identification_address())
    except NoAnswer:
        return None
    except (Refused, BadAnswer) as error:
        problem = str(error)
    family = None if code is None else identify(code)
    return Found(unit, family, code, now() - started, problem)


async def ask(bus: AwaitableBus, unit: int) -> tuple[Profile, int]:
    """The profile of the drive at *unit*, and what it says it is."""
    [code] = await bus.read(unit, _identification_address())
    return _profile_of(unit, code), code


def _profile_of(unit: int, code: int) -> Profile:
    family = identify(code)
    if family not in profiles():
        known = "no list names" if family is None else f"is a {family}, a family without a profile yet"
        raise NotAllowed(
            f"unit {unit} identifies itself as {code:04X}H, which {known}; the registers and command codes of "
            "another family may differ. If you know that it behaves like one of "
            f"{', '.join(profiles())}, give profile=…",
            unit=unit,
        )
    return Profile.builtin(family)


def _identification_address() -> int:
    """Where a drive says what it is. All shipped families use one register."""
    return Profile.builtin(profiles()[0]).address(_IDENTIFICATION)
