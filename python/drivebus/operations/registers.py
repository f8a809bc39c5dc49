"""Registers and parameters of one unit by name, read in engineering units in the fewest requests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, overload

from drivebus.advice import Text
from drivebus.errors import BadArgument
from drivebus.line.asking import Read
from drivebus.operations import unit_variants
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import explained
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence
from drivebus.profile.plan import labelled

if TYPE_CHECKING:
    from drivebus.values import Snapshot, Value

__all__ = ["contradiction", "monitor", "monitored", "read", "readable", "settled_profile", "snapshot", "value"]


def value(unit: DriveView, name: str, raw: int) -> Value:
    """The word *raw* of *name* in engineering units."""
    return labelled(unit.profile.describe(name), unit.profile.decode(name, raw))


@overload
async def read(unit: DriveView, name: str, /, *, verify: bool = False, unverified: bool = False) -> Value: ...
@overload
async def read(
    unit: DriveView, first: str, second: str, /, *more: str, verify: bool = False, unverified: bool = False
) -> dict[str, Value]: ...
async def read(
    unit: DriveView, *names: str, verify: bool = False, unverified: bool = False
) -> Value | dict[str, Value]:
    """Reads registers or parameters in the fewest requests.

    One name gives its value, several give a dict in the order asked. Values are floats in engineering units, ints
    where the drive counts, and `Choice` where the profile has a name for what came.

    With *verify* each request is repeated until the same words came twice in a row: for values on which much
    depends, where even a damaged answer whose CRC is right by chance (one in 65 536) must not pass.

    With *unverified* also what no document of the family prints.

    Raises:
        NotAllowed: No name, an unknown one, or one that is not verified; nothing was sent.
        NoAnswer, BadAnswer, Refused: See each. With *verify* also where the words change all the time.
    """
    if not names:
        raise BadArgument("read() needs at least one name, such as 'output_current' or 'P00.11'")
    values = await snapshot(unit.trusting(unverified), *names, verify=verify)
    return values[names[0]] if len(names) == 1 else dict(values)


async def snapshot(unit: DriveView, *names: str, verify: bool = False, unverified: bool = False) -> Snapshot:
    """Reads *names* in the fewest requests, under one time stamp. *verify* and *unverified* as for `read`."""
    from drivebus.values import Snapshot

    unit = unit.trusting(unverified)
    unit.evidence.require_readable(names)
    unit = await unit_variants.settled(unit, *names)
    plan = unit.profile.compile(names)
    answers: list[list[int]] = []
    started = ended = 0.0
    for place, count in plan.reads:
        with explained(unit):
            came, sent, ended = await unit.bus.ask_stamped(Read.at(unit.address, place, count, verify=verify))
        started = started if answers else sent
        answers.append(came)
    values = dict(zip(plan.names, plan.values(answers, unit=unit.address), strict=True))
    return Snapshot(values, plan.units, started, ended - started)


async def monitor(unit: DriveView, *names: str, unverified: bool = False) -> Snapshot:
    """Reads *names*, or all monitor registers of the family, in the fewest requests, under one time stamp.

    The result is a mapping whose names are attributes too: `drive.monitor().output_current`; its `units` say in
    what each is. Without names, what is not verified is left out.

    Raises:
        NotAllowed: An unknown name, or one that is not verified; nothing was sent.
        NoAnswer, BadAnswer, Refused: See each.
    """
    unit = unit.trusting(unverified)
    return await snapshot(unit, *(names or readable(unit)))


def readable(unit: DriveView, *names: str) -> list[str]:
    """See `Drive.readable`."""
    if not names:
        # The same each time, and looked up for every sample of a monitor.
        return monitored(unit.evidence)
    unit.evidence.require_readable(names)
    for name in names:
        if unit_variants.is_open(unit, name):
            variant = unit.profile.describe(name).variant or ""
            rule = unit_variants.rules(unit)[variant]
            raise BadArgument(
                Text(
                    f"what {name} means depends on {rule.parameter} of unit {unit.address}: give ",
                    unit_variants.given(unit, variant),
                ),
                unit=unit.address,
            )
    return list(names)


async def settled_profile(unit: DriveView, *names: str, unverified: bool = False) -> Profile:
    """What the words of *names* mean as this drive is set, where one of its parameters decides their unit or scale.

    The drive is asked for that parameter; where none decides, nothing is sent. Afterwards somebody may set it anew.

    Args:
        names: Registers or parameters, by name.
        unverified: Also where that is not verified for the family.

    Raises:
        NotAllowed: An unknown name; or what decides its meaning is not verified, or says nothing known.
        NoAnswer, BadAnswer, Refused, PortError: The drive was only asked; nothing changed.
    """
    return (await unit_variants.settled(unit.trusting(unverified), *names)).profile


async def contradiction(unit: DriveView) -> str | None:
    """How the unit's own answer contradicts its profile, and what to do; None if it does not.

    Reads, as the first write does. For a *trust_profile* too.

    Raises:
        NoAnswer, BadAnswer, PortError: It did not tell.
    """
    return await unit.identity.contradiction(unit.bus)


def monitored(evidence: Evidence) -> list[str]:
    """The monitor registers that may be read of a unit of whose family that is known, and whose meaning is."""
    return list(evidence.cached(_monitored))


def _monitored(evidence: Evidence) -> Sequence[str]:
    known, undecided = evidence.readable(evidence.profile.monitor_names()), evidence.cached(unit_variants.undecided)
    return [name for name in known if evidence.profile.describe(name).variant not in undecided]
