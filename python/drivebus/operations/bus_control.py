"""Whether a drive is set to obey the bus, and to heed what the bus tells it, and setting the parameters that takes.

The profile knows the parameters and the values. A value that no document of the family prints is shown as such, and is
written only for who says so.
"""

from __future__ import annotations

from drivebus import checks
from drivebus.advice import Advice, Text, argument, call
from drivebus.errors import BadAnswer, NoAnswer, NotReady, PortError, Refused, Unconfirmed
from drivebus.operations import parameter_writes, parameters, registers
from drivebus.operations.by_name import by_name
from drivebus.operations.drive_view import DriveView
from drivebus.operations.in_parts import in_parts
from drivebus.profile.evidence import not_verified
from drivebus.profile.facts import Setting
from drivebus.values import Control, ControlItem

__all__ = [
    "check_control",
    "check_heeded",
    "check_set",
    "prepare_control",
    "wanted_always",
    "wanted_for",
    "wanted_of_commands",
    "why_ignored",
]


async def check_control(unit: DriveView, setpoint: str | None = None, *, unverified: bool = False) -> Control:
    """Checks whether the drive is set to obey the bus: a list that is true if every item is as required.

    Args:
        setpoint: Which setpoint the bus is to give, such as `"torque"` or `"pid"`; None is the frequency.
        unverified: Also read parameters that are not verified; without it such an item has no actual value.

    Raises:
        NotAllowed: The family has no such setpoint; the message has those it has. Nothing was sent.
        NoAnswer, BadAnswer, Refused: See each.
    """
    unit = unit.trusting(unverified)
    return await _check_items(unit, wanted_for(unit, setpoint))


@by_name("store", after=0)
@in_parts
async def prepare_control(
    unit: DriveView, *, store: bool = False, setpoint: str | None = None, unverified: bool = False
) -> Control:
    """Sets the drive to obey the bus. Writes only the settings that differ, and returns what `check_control` says then.

    To RAM: the drive forgets it when it is switched off, unless *store*, which keeps what this object set in RAM
    before as well.

    Args:
        store: Keep it in EEPROM.
        setpoint: Which setpoint the bus is to give; None is the frequency.
        unverified: Also write values that are not verified. One that the drive has already is not written.

    Raises:
        NotAllowed: What has to be written is not verified for the family, or not to RAM. Nothing was written.
        Refused: The drive kept what it had; parameters are locked while it runs, or by a password.
        Unconfirmed: It took the values, and shows others.
    """
    store = checks.flag("store", store)
    unit = unit.trusting(unverified)
    wanted = wanted_for(unit, setpoint)
    needed = {}
    for row, item in zip(wanted, await _check_items(unit, wanted), strict=True):
        if item.ok and not (store and parameter_writes.is_in_ram(unit, item.code)):
            continue
        if item.actual is not None and row.by_hand:
            raise NotReady(
                Text(
                    f"{item.code} of unit {unit.address} is {int(item.actual)}, and must be {int(item.wanted)} "
                    f"({item.label}). ",
                    call("prepare_control"),
                    f" does not set it: {item.note} Nothing was written. If {int(item.wanted)} is meant, ",
                    call("write"),
                    f" {item.code} first, with ",
                    argument("store", True),
                ),
                why="settings",
                unit=unit.address,
            )
        if item.actual is None or not (item.verified or unit.unverified):
            what = f"setting {item.code} ({item.label}) of {unit.profile.title} to {int(item.wanted)}"
            raise not_verified(what, item.note, unit.address)
        needed[item.code] = item.wanted
    if needed:
        await parameters.write(unit, needed, store=store)
    control = await _check_items(unit, wanted)
    if not control:
        raise Unconfirmed(
            f"unit {unit.address} took the settings and shows others:\n{control}",
            unit=unit.address,
        )
    return control


async def check_heeded(unit: DriveView, setpoint: str, register: str) -> None:
    """Raises `NotAllowed` if the drive would not heed *setpoint*, because it takes that from elsewhere."""
    control = await _check_items(unit, unit.profile.needs(setpoint))
    if not control:
        raise NotReady(
            Text(
                f"unit {unit.address} would ignore its {setpoint.replace('_', ' ')} setpoint:\n{control}\nNothing was "
                "sent. ",
                Advice("prepare_control", setpoint, f'prepare_control(setpoint="{setpoint}")'),
                " sets it so; ",
                Advice("write", register, f'write("{register}", …)'),
                " writes it anyway",
            ),
            why="settings",
            unit=unit.address,
        )


async def check_set(unit: DriveView, wanted: list[Setting], what: str) -> None:
    """Raises `NotAllowed` if one of *wanted* is surely not as it must be: then the unit does *what* is said.

    What no document proves, or may not be read, keeps nobody from starting a motor.
    """
    sure = [row for row in wanted if row.verified or unit.unverified]
    wrong = Control(item for item in await _check_items(unit, sure) if item.actual is not None and not item.ok)
    if len(wrong):
        raise NotReady(
            Text(
                f"unit {unit.address} {what}:\n{wrong}\nNothing that moves it was sent. ",
                call("prepare_control"),
                " sets what is needed",
            ),
            why="settings",
            unit=unit.address,
        )


async def why_ignored(unit: DriveView) -> str:
    """Which settings keep the drive from taking commands from the bus; empty where none is known to, or none tells."""
    wanted = [row for row in wanted_of_commands(unit) if row.verified or unit.unverified]
    try:
        items = await _check_items(unit, wanted)
    except (NoAnswer, BadAnswer, Refused, PortError):
        return ""
    return ", ".join(
        f"{item.code} is {int(item.actual)}, needs {int(item.wanted)}"
        for item in items
        if item.actual is not None and not item.ok
    )


def wanted_of_commands(unit: DriveView) -> list[Setting]:
    """What must be set for commands alone, whatever the setpoints."""
    names = unit.profile.setpoint_names()
    of_setpoints = {row.code for name in names for row in unit.profile.needs(name)}
    return [row for row in unit.profile.control() if row.code not in of_setpoints]


def wanted_always(unit: DriveView) -> list[Setting]:
    """What must be set in any case, or the words of the profile are not where it has them."""
    return [row for row in unit.profile.control() if row.always]


def wanted_for(unit: DriveView, setpoint: str | None) -> list[Setting]:
    """What must be set for *setpoint*, in the order in which to set it."""
    known = unit.profile.setpoint_names()
    if setpoint is not None:
        checks.one_of("setpoint", setpoint, known)
    of_frequency = unit.profile.needs("frequency") if "frequency" in known else []
    needs = of_frequency if setpoint is None else unit.profile.needs(setpoint)
    told = {row.code for row in (*of_frequency, *needs)}
    return [*(row for row in unit.profile.control() if row.code not in told), *needs]


async def _check_items(unit: DriveView, wanted: list[Setting]) -> Control:
    codes = unit.evidence.readable(row.code for row in wanted)
    actual = await registers.snapshot(unit, *codes) if codes else {}
    return Control(
        ControlItem(
            code=row.code,
            wanted=registers.value(unit, row.code, row.value),
            actual=actual.get(row.code),
            ok=row.code in actual and actual[row.code] == row.value,
            verified=row.verified,
            label=row.label,
            note=(None if row.code in actual else unit.evidence.unreadable(row.code)) or row.note or "",
        )
        for row in wanted
    )
