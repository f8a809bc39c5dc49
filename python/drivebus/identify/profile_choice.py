"""The profile of the drive at an address: the one that was named, or what the unit says surely enough that it is."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING

from drivebus import _native, checks
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed, SharedCodeWarning, WrongDrive, level_of_the_program
from drivebus.identify.families import drive_as, one_of, shipped
from drivebus.line.asking import asking
from drivebus.line.protocols import AwaitableBus
from drivebus.line.units import units_of
from drivebus.profile import Profile, profiles

if TYPE_CHECKING:
    from drivebus.identify.results import Identification

__all__ = ["profile_of", "usable"]


async def profile_of(
    bus: AwaitableBus,
    unit: int,
    profile: str | os.PathLike[str] | Profile | None,
    variants: Mapping[str, str] | None,
    unverified: bool,
    urgent: bool = False,
) -> tuple[Profile, int | None]:
    """The profile that *profile* means, or else that of the drive at *unit*, and the code that it gave if asked."""
    if variants is not None and not isinstance(variants, Mapping):
        raise BadArgument(
            f'variants is {checks.shown(variants)}, not a mapping; give one, such as {{"speed_unit": "Hz"}}'
        )
    code: int | None = None
    if profile is None:
        from drivebus.identify.identify import identify

        connection = bus.reconnects
        found = await identify(asking(bus, urgent=checks.flag("urgent", urgent)), unit)
        known, code = _sure_enough(found, checks.flag("unverified", unverified)), found.code
        if found.certainty == "by answers":
            # The whole signature of that family and of no other: a halt need not ask for it again.
            said = units_of(getattr(bus, "line", bus)).record(unit).identity(known, connection)
            said.settle(connection, bus.now())
    else:
        known = Profile.find(profile)
    return known if variants is None else known.with_variants(variants), code


def usable(found: Identification, unverified: bool) -> str | None:
    """The profile that *found* is sure enough of to command a motor by it; with *unverified*, the only candidate."""
    return _native.usable(found.certainty, found.candidates, unverified)


def _sure_enough(found: Identification, unverified: bool) -> Profile:
    """The profile that is `usable` of *found*, with a warning where others share its code."""
    name = usable(found, unverified)
    if name is None:
        raise _not_sure(found)
    if found.certainty == "shared":
        warnings.warn(
            SharedCodeWarning(
                Text(
                    f"unit {found.unit} is taken for a {name}, the only one of them with a profile: {found.reason}. If "
                    "it is one, say so: ",
                    drive_as(found.unit, name),
                )
            ),
            stacklevel=level_of_the_program(),
        )
    return Profile.builtin(name)


def _not_sure(found: Identification) -> NotAllowed:
    """Why no profile is taken by *found*, and how to name one."""
    known = shipped(found.candidates)
    if found.candidates and not known:
        what = f"it may be a {found.candidates[0]}, a family without a profile yet; "
    elif found.candidates:
        what = f"it may be {one_of(found.candidates)}; "
    else:
        what = ""
    is_one = len(found.candidates) == len(known) == 1
    with_one = Text(", or ", argument("unverified", True), " to take it for that") if is_one else ""
    like = known[0] if len(known) == 1 else f"one of {', '.join(known or profiles())}"
    return WrongDrive(
        Text(
            f"unit {found.unit} answers, but could not be identified for sure: {what}{found.reason} "
            f"({found.certainty}). Registers and command codes differ between families; if you know that it behaves "
            f"like {like}, give ",
            argument("profile"),
            with_one,
        ),
        unit=found.unit,
    )
