"""Whether a drive is set to obey the bus, and to heed what the bus tells it, and setting the parameters that takes.

The profile knows the parameters and the values. A value that no document of the family prints is shown as such, and is
written only for who says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from drivebus import _native, checks
from drivebus.advice import Advice, Text, argument, call
from drivebus.errors import DrivebusError, NotReady, Unconfirmed
from drivebus.operations import not_kept, registers
from drivebus.operations.by_name import by_name
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.in_parts import in_parts
from drivebus.profile.evidence import not_verified

if TYPE_CHECKING:
    from drivebus.values import Control, ControlItem

__all__ = ["check_control", "ignored", "item_of", "prepare_control", "preparing", "shown"]


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
    return shown(unit, await _settings(unit, setpoint))


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
    _check_known(unit, setpoint)
    wanted = setpoint or "frequency"
    kind, told = await call_core(unit, lambda core: _native.Values(core).prepare(wanted, store))
    if kind != "done":
        raise _not_prepared(unit, *told, store=store)
    return shown(unit, told)


def _not_prepared(unit: DriveView, kind: str, told: Any, *, store: bool) -> DrivebusError:
    """Why *unit* is not set to obey the bus: *kind* and *told* as `_native.Values.prepare` has them."""
    if kind == "not_kept":
        done, *why = told
        return not_kept.written_before(not_kept.in_words(unit, *why, store=store), done)
    if kind == "unshown":
        return Unconfirmed(
            f"unit {unit.address} took the settings and shows others:\n{shown(unit, told)}", unit=unit.address
        )
    item = item_of(unit, told)
    if kind == "may_not":
        what = f"setting {item.code} ({item.label}) of {unit.profile.title} to {int(item.wanted)}"
        return not_verified(what, item.note, unit.address)
    by_name = (f". If {int(item.wanted)} is meant, ", call("write"), f" {item.code} first, with ")
    return NotReady(
        Text(
            f"{item.code} of unit {unit.address} is {int(item.actual or 0)}, and must be {int(item.wanted)} "
            f"({item.label}). ",
            call("prepare_control"),
            f" does not set it: {item.note} Nothing was written",
            # A word of which only some bits count has others that are somebody else's.
            *(() if told[-1] else (*by_name, argument("store", True))),
        ),
        why="settings",
        unit=unit.address,
    )


def ignored(unit: DriveView, setpoint: str, register: str, rows: Iterable[Sequence[Any]]) -> NotReady:
    """Why the drive would not heed *setpoint*: it takes that from elsewhere, as the settings in *rows* say."""
    return NotReady(
        Text(
            f"unit {unit.address} would ignore its {setpoint.replace('_', ' ')} setpoint:\n{shown(unit, rows)}\n"
            "Nothing was sent. ",
            Advice("prepare_control", setpoint, f'prepare_control(setpoint="{setpoint}")'),
            " sets it so; ",
            Advice("write", register, f'write("{register}", …)'),
            " writes it anyway",
        ),
        why="settings",
        unit=unit.address,
    )


def item_of(unit: DriveView, row: Sequence[Any]) -> ControlItem:
    """A setting of *unit*, of which the core told this *row*."""
    from drivebus.values import ControlItem

    code, wanted, actual, label, note, verified, *_ = row
    return ControlItem(
        code=code,
        wanted=registers.value(unit, code, wanted),
        actual=None if actual is None else registers.value(unit, code, actual & 0xFFFF),
        ok=actual == wanted,
        verified=verified,
        label=label,
        note=(unit.evidence.unreadable(code) if actual is None else None) or note,
    )


async def _settings(unit: DriveView, setpoint: str | None) -> list[Sequence[Any]]:
    """What must be set for *setpoint*, in the order in which to set it, and what is set, as the core tells it."""
    _check_known(unit, setpoint)
    _, rows = await call_core(unit, lambda core: core.control(setpoint or "frequency"))
    settings: list[Sequence[Any]] = rows
    return settings


def _check_known(unit: DriveView, setpoint: str | None) -> None:
    if setpoint is not None:
        checks.one_of("setpoint", setpoint, unit.profile.setpoint_names())


def shown(unit: DriveView, settings: Iterable[Sequence[Any]]) -> Control:
    """The *settings* of *unit*, of each of which the core told a row."""
    from drivebus.values import Control

    return Control(item_of(unit, row) for row in settings)


def preparing(unit: DriveView) -> tuple[str | Advice, ...]:
    """How to call what makes *unit* obey the bus. A family without a way to RAM alone has to be told to store."""
    named = call("prepare_control")
    return (named,) if unit.profile.memory() else (named, " with ", argument("store", True))
