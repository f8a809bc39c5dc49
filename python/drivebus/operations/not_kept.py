"""Why values are not known to be written, in words; the core has the kind of the reason."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drivebus import checks
from drivebus.advice import Advice, Text, argument, call, joined
from drivebus.errors import BadArgument, DrivebusError, NotReady, Unconfirmed
from drivebus.operations import not_written, unit_variants
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import refusal_of
from drivebus.values import State

__all__ = ["in_words", "not_stored", "written_before"]


def in_words(unit: DriveView, kind: str, told: Any, *, store: bool = False, given: Any = None) -> DrivebusError:
    """Why values were not written to *unit*.

    Args:
        unit: The unit.
        kind: Of which kind the reason is, as `_native.Values.write` has it.
        told: What is told of it.
        store: Whether they were to be kept in EEPROM.
        given: What was to be written, by name.
    """
    if kind == "not_planned":
        return _not_planned(unit, *told, store=store)
    if kind == "decides":
        name, depends = told
        return BadArgument(
            f"{name} decides what {depends} means; nothing was sent to unit {unit.address}. Write {name} by itself, "
            "and first",
            unit=unit.address,
        )
    if kind == "unsays":
        return _unsays(unit, *told, given=given)
    if kind == "not_settled":
        return unit_variants.not_settled(unit, *told)
    if kind == "running":
        names, doing = told
        return NotReady(
            f"{', '.join(names)} can be written only while the drive is stopped, and unit {unit.address} runs "
            f"({State(doing)}); nothing was written",
            why="turning",
            unit=unit.address,
        )
    if kind == "beyond":
        return _beyond(unit, *told)
    if kind == "not_written":
        names, why, in_force = told
        error = not_written.in_words(unit, *why)
        if in_force is not None:
            _add_note(error, _in_force(names, *in_force))
        return error
    if kind == "not_stored":
        return not_stored(unit, *told)
    failed: DrivebusError = told
    return failed


def not_stored(unit: DriveView, kind: str, told: Any) -> Unconfirmed:
    """Why *unit*, which has all values in RAM, is not known to have stored them: *kind* and *told*."""
    memory = unit.profile.memory()
    register = None if memory is None else memory.store_register
    cause: DrivebusError | None = None
    if kind == "may_not":
        why = f"it was not told to: {told}"
    elif kind == "not_idle":
        found, idle = told
        why = (
            f"it was not told to: {register} is {found:04X}H, and only at {idle:04X}H does storing change nothing else"
        )
    elif kind == "late":
        why = f"it took the word for {register}, which is at {told:04X}H and should be back where it was"
    elif kind == "not_written":
        cause = not_written.in_words(unit, *told)
        why = f"the word for {register}: {cause}"
    else:
        cause = told
        was_told = "it was not told to" if kind == "unread" else "it was told to"
        why = f"{was_told}, and {register} could not be read: {cause}"
    error = Unconfirmed(
        f"unit {unit.address} has all values, in RAM, and is not known to have stored them: {why}. What is not stored "
        "is lost with the power",
        unit=unit.address,
    )
    error.__cause__ = cause
    return error


def written_before(error: DrivebusError, done: Sequence[str]) -> DrivebusError:
    """The same *error*, which says what was *done* before it."""
    if done:
        _add_note(error, f"written before it: {', '.join(done)}")
    return error


def _add_note(error: DrivebusError, note: str) -> None:
    # Python 3.10 knows no notes.
    if hasattr(error, "add_note"):
        error.add_note(note)


def _not_planned(unit: DriveView, name: str, kind: str, word: int | None, *, store: bool) -> DrivebusError:
    known = unit.profile.describe(name)
    if kind == "read_only":
        return BadArgument(f"{name} ({known.label}) is read-only; nothing was sent", unit=unit.address)
    if kind == "moves":
        return BadArgument(
            Text(
                f"{name} ({known.label}) can move the motor, so write() refuses it; use ",
                joined(map(call, ("run", "stop", "coast", "jog", "reset_fault")), ", ", " or "),
                Advice("own_methods", None, ", or for terminals and the special control word their own methods"),
            ),
            unit=unit.address,
        )
    if kind == "stores":
        return BadArgument(
            Text(
                f"{name} ({known.label}) stores all that was set; nothing was sent to unit {unit.address}. It is "
                "written after values that are written with ",
                argument("store", True),
            ),
            unit=unit.address,
        )
    if kind == "only_stored":
        return BadArgument(
            Text(
                f"no way to write {name} to RAM alone is known of {unit.profile.title}, so every write may wear its "
                f"EEPROM; nothing was sent to unit {unit.address}. Use ",
                argument("store", True),
                " to keep it there",
            ),
            unit=unit.address,
        )
    if kind == "no_range":
        return refusal_of(unit.evidence.require_writable_word, name, word or 0)
    if kind == "may_not_keep":
        return refusal_of(unit.evidence.require_kept, name, store=store)
    return refusal_of(unit.evidence.require_writable, name)


def _unsays(unit: DriveView, name: str, variant: str, chosen: str, *, given: Any) -> BadArgument:
    return BadArgument(
        Text(
            f"{name} = {checks.shown(given[name])} would change the {variant} of unit {unit.address}, which was said "
            f"to be {chosen}; nothing was sent. Write it without ",
            Advice("variants", variant, "variants=…"),
        ),
        unit=unit.address,
    )


def _beyond(
    unit: DriveView, wanted: tuple[str, float, str], limit: tuple[str, float, str], is_below: bool
) -> BadArgument:
    name, value, counted_in = wanted
    other, bound, bound_in = limit
    label, narrow = unit.profile.describe(name).label, unit.profile.describe(other).label
    return BadArgument(
        f"{name} ({label}) = {value:g} {counted_in} is {'below' if is_below else 'above'} {other} ({narrow}), which is "
        f"{bound:g} {bound_in} in unit {unit.address}; nothing was written. Write {other} first, or before it in the "
        "same call",
        unit=unit.address,
    )


def _in_force(names: Sequence[str], kind: str, told: Any) -> str:
    """What the drive shows of *names*, which shared a request that it refused, for people."""
    together = f"{', '.join(names)} shared that request"
    if kind == "unread":
        return f"{together}; what the drive took of it could not be read: {told}"
    values = (f"{name} = {value:g} {counted_in}".rstrip() for name, value, counted_in in told)
    return f"{together}. In force in the drive now: {', '.join(values)}"
