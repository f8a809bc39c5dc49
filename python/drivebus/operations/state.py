"""What one drive is doing, as its status words say, in the fewest reads.

Which words those are, and what they mean, the profile says. What no document of the family proves is left out, and the
reason is kept: half of a status is better than none.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from drivebus.errors import BadArgument
from drivebus.look import Look
from drivebus.operations import glances, registers, unit_variants
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import read_words
from drivebus.operations.glances import glance, planned, remember
from drivebus.profile.evidence import Evidence
from drivebus.values import State

if TYPE_CHECKING:
    from drivebus.values import Fault, Status

__all__ = [
    "fault",
    "fault_history",
    "look",
    "nothing_to_ask",
    "ping",
    "read_off",
    "shown",
    "state",
    "state_of",
    "state_word",
    "status",
]


async def look(unit: DriveView, *, urgent: bool = False, unverified: bool = False) -> Look:
    """Reads the drive's status words, in one read where they stand side by side.

    Raises:
        NotAllowed: Nothing of them may be read; the message has the reason.
    """
    unit = unit.trusting(unverified)
    seen = await glance(unit, urgent=urgent)
    if planned(unit.evidence).looks.is_blind:
        what = f"nothing of the state of unit {unit.address} may be read"
        raise unit.evidence.missing(what, seen.missing["state"], Evidence.without_state)
    return seen


async def state(unit: DriveView, *, unverified: bool = False) -> State:
    """What the drive is doing: one read of its state word.

    Raises:
        NotAllowed: The family has no state word that is known, or verified. Nothing was sent.
    """
    unit = unit.trusting(unverified)
    [word] = await read_words(unit, unit.profile.address(state_word(unit, "telling the state")))
    seen = state_of(unit, word)
    remember(unit, str(seen))
    return seen


async def ping(unit: DriveView) -> None:
    """Checks that the unit answers, by one read: of its state word, if the family has one.

    Raises:
        NotAllowed: Nothing of it is known. Nothing was sent.
    """
    if unit.evidence.without_state() is None:
        await state(unit)
        return
    roles = [unit.profile.role("state"), unit.profile.role("fault")]
    named = [*roles, *unit.profile.monitor_names(), *unit.profile.names()]
    for name in unit.evidence.readable(name for name in named if name is not None):
        await read_words(unit, unit.profile.address(name))
        return
    raise nothing_to_ask(unit)


def nothing_to_ask(unit: DriveView) -> BadArgument:
    """The error for a unit of whose family nothing may be read."""
    return BadArgument(f"nothing is known that {unit.profile.title} answers, so unit {unit.address} was not asked")


async def status(unit: DriveView, *, unverified: bool = False) -> Status:
    """State, readiness, control source, frequency and fault, in two reads if the family has them side by side.

    What the family does not tell, or what is not verified, is None (the state: `State.UNKNOWN`), and `missing` has
    the reason.

    Raises:
        NoAnswer, BadAnswer, Refused: See each.
    """
    unit = unit.trusting(unverified)
    kind, told = await call_core(unit, lambda core: core.status())
    if kind != "done":
        raise unit_variants.not_settled(unit, *told)
    return shown(unit, told)


def shown(unit: DriveView, told: Any) -> Status:
    """What *unit* was doing, of which the core *told* as `_native.Unit.status`."""
    from drivebus.values import Status

    look, frequency, setpoint, asked = told
    seen = glances.shown(unit, look)
    missing = dict(seen.missing)
    for role in ("frequency", "setpoint"):
        name = unit.profile.role(role)
        reason = f"no such register of {unit.profile.title} is known"
        if name is not None:
            reason = unit.evidence.unreadable(name) or ""
        if reason:
            missing[role] = reason
    motor = seen.fields.get("motor", "")
    ready = seen.fields.get("ready")
    alarm = seen.fields.get("overload_alarm")
    for what, field in (
        ("ready", ready),
        ("source", seen.source),
        ("motor", motor or None),
        ("overload_alarm", alarm),
    ):
        if field is None:
            missing[what] = f"not available on {unit.profile.title}"
    return Status(
        state=seen.state,
        ready=None if ready is None else ready == "ready",
        source=seen.source,
        motor=int(motor.removeprefix("motor ")) if motor.startswith("motor ") else None,
        overload_alarm=None if alarm is None else alarm != "none",
        frequency=frequency,
        setpoint=setpoint,
        fault=seen.fault,
        fields=seen.fields,
        time=asked,
        missing=missing,
    )


async def fault(unit: DriveView, *, unverified: bool = False) -> Fault | None:
    """The present fault, or None.

    Raises:
        NotAllowed: The family has no fault register that is known, or verified. Nothing was sent.
    """
    unit = unit.trusting(unverified)
    reason = unit.evidence.without_fault()
    if reason is not None:
        raise unit.evidence.missing("the present fault may not be read", reason, Evidence.without_fault)
    return (await glance(unit)).fault


async def fault_history(unit: DriveView, *, unverified: bool = False) -> list[Fault]:
    """The last faults, the latest first; as many as the drive keeps.

    The latest has its `values`: what the drive saw when it tripped, where it keeps that.
    """
    unit = unit.trusting(unverified)
    names = unit.evidence.readable(unit.profile.fault_history)
    if not names:
        return []
    codes = (await registers.snapshot(unit, *names)).values()
    faults = [unit.profile.fault(int(code)) for code in codes if code]
    kept = unit.evidence.readable(unit.profile.fault_values)
    if faults and kept:
        faults[0] = replace(faults[0], values=await registers.snapshot(unit, *kept))
    return faults


def read_off(unit: DriveView, state: int | None, fault: int | None) -> tuple[State, int, bool]:
    """What the words for *state* and *fault* say: the state, the number of the fault, and whether the drive is in it.

    None is a word that is not known.
    """
    doing, number, in_fault = planned(unit.evidence).looks.read_off(state, fault)
    return State(doing), number, in_fault


def state_word(unit: DriveView, what: str) -> str:
    """The name of the state word, for what cannot be done without."""
    reason = unit.evidence.without_state()
    name = unit.profile.role("state")
    if reason is None and name is not None:
        return name
    needs = f"{what} needs a state word, and the one of {unit.profile.title} may not be used"
    raise unit.evidence.missing(needs, reason or "", Evidence.without_state)


def state_of(unit: DriveView, word: int) -> State:
    """What the state *word* says; unknown where the family has no name for it."""
    try:
        return State(unit.profile.state(word))
    except ValueError:
        return State.UNKNOWN
