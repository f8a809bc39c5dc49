"""Who answers on a line, and the profile of who does."""

from __future__ import annotations

import os
import warnings
from collections.abc import Awaitable, Callable, Iterable, Mapping

from drivebus import checks
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, SharedCodeWarning, level_of_the_program
from drivebus.identify.identify import identify, one_of, usable
from drivebus.identify.results import Found, Identification
from drivebus.profile import Profile, profiles
from drivebus.protocols import AwaitableBus

__all__ = ["identified", "look_for", "profile_of", "time_for", "units"]

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
    first: list[float] = []

    async def timed(unit: int, address: int) -> list[int]:
        try:
            return await read(unit, address)
        finally:
            first.append(now() - started)

    try:
        found = await identify(timed, unit)
    except NoAnswer:
        return None
    except BadAnswer as error:
        return Found(unit, None, None, first[0], str(error))
    family = usable(found, unverified=True) or found.family
    problem = found.reason if found.certainty == "unknown" and found.code is None else None
    return Found(unit, family, found.code, first[0], problem, found.certainty, found.candidates)


async def identified(bus: AwaitableBus, unit: int) -> Identification:
    """What the unit is, as far as it tells."""
    return await identify(bus.read, unit)


async def profile_of(
    bus: AwaitableBus,
    unit: int,
    profile: str | os.PathLike[str] | Profile | None,
    variants: Mapping[str, str] | None,
    unverified: bool,
) -> tuple[Profile, int | None]:
    """The profile that *profile* means, or else that of the drive at *unit*, and the code that it gave if asked."""
    if variants is not None and not isinstance(variants, Mapping):
        raise NotAllowed(f'variants {variants!r} are none; give a mapping, such as {{"speed_unit": "Hz"}}')
    code: int | None = None
    if profile is None:
        found = await identified(bus, unit)
        name, code = usable(found, checks.flag("unverified", unverified)), found.code
        if name is None:
            raise _not_sure(found)
        known = Profile.builtin(name)
        if found.certainty == "shared":
            warnings.warn(
                f"unit {unit} is taken for a {name}, the only one of them with a profile: {found.reason}. If it is "
                f'one, say so: bus.drive({unit}, profile="{name}") (`--profile {name}`)',
                SharedCodeWarning,
                stacklevel=level_of_the_program(),
            )
    else:
        known = Profile.find(profile)
    return known if variants is None else known.with_variants(variants), code


def _not_sure(found: Identification) -> NotAllowed:
    shipped = [name for name in found.candidates if name in profiles()]
    if found.candidates and not shipped:
        known = f"it says {found.code:04X}H, which is a {found.candidates[0]}, a family without a profile yet"
    elif found.candidates:
        known = f"it may be {one_of(found.candidates)}"
    else:
        known = "what it is, is not known"
    with_one = (
        ", or unverified=True (`--unverified`) to take it for that"
        if len(found.candidates) == len(shipped) == 1
        else ""
    )
    like = shipped[0] if len(shipped) == 1 else f"one of {', '.join(shipped or profiles())}"
    return NotAllowed(
        f"unit {found.unit} is not surely of one family: {known} ({found.certainty}: {found.reason}). The registers "
        f"and command codes of another family may differ; if you know that it behaves like {like}, "
        f"give profile=… (`--profile`){with_one}",
        unit=found.unit,
    )
