"""Waiting until a motor has reached its speed, or stands.

What is asked meanwhile, and what ends the wait, is decided in the core (`crates/drive`); here are its words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drivebus import checks
from drivebus.errors import BadArgument, DrivebusError, NotAllowed, NotReached, Unconfirmed
from drivebus.operations import state, unit_variants
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import refusal_of

if TYPE_CHECKING:
    from drivebus.values import Status

__all__ = ["check_speed", "check_standstill", "wait_for_speed", "wait_until_stopped"]

_SPEED = "waiting for the speed"
_STANDSTILL = "waiting for the standstill"


async def wait_for_speed(
    unit: DriveView, hz: float | None = None, tolerance: float = 0.1, timeout: float = 60.0, *, unverified: bool = False
) -> Status:
    """Waits until the output frequency is *hz*; None: the active setpoint.

    Args:
        hz: Wanted output frequency in Hz. Where the drive tells which way the motor turns, that is the way in which
            this program started it last: a motor that is reversed runs through its new speed before it turns round.
        tolerance: How far off it may be, in Hz.
        timeout: Seconds of the line's clock.
        unverified: Also by words that are not verified for the family.

    Raises:
        NotAllowed: State or frequency of the family are not known, or not verified. Nothing was sent.
        NotReached: The time was up; it is an `Unconfirmed` and a `TimeoutError`. The message says where the drive
            stands. It keeps running if it ran.
        Unconfirmed: The drive tripped meanwhile.
        NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
    """
    wanted = None if hz is None else checks.number("frequency", hz, 0.0)
    tolerance = checks.number("tolerance", tolerance, 0.0)
    timeout = checks.number("timeout", timeout, 0.0)
    goal = "its setpoint" if wanted is None else f"{wanted:g} Hz"
    unit = unit.trusting(unverified)
    kind, told = await call_core(unit, lambda core: core.wait_for_speed(wanted, tolerance, timeout))
    if kind != "done":
        raise _in_words(unit, _SPEED, f"{goal} was not reached within {timeout:g} s", kind, told)
    return state.shown(unit, told)


async def wait_until_stopped(unit: DriveView, timeout: float = 60.0, *, unverified: bool = False) -> Status:
    """Waits until the drive is stopped and its output frequency is zero.

    A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.

    Raises:
        NotAllowed: The state of the family is not known, or not verified. Nothing was sent.
        NotReached: The time was up; it is an `Unconfirmed` and a `TimeoutError`.
        Unconfirmed: The drive tripped meanwhile.
        NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
    """
    timeout = checks.number("timeout", timeout, 0.0)
    unit = unit.trusting(unverified)
    kind, told = await call_core(unit, lambda core: core.wait_until_stopped(timeout))
    if kind != "done":
        raise _in_words(unit, _STANDSTILL, f"it did not stop within {timeout:g} s", kind, told)
    return state.shown(unit, told)


async def check_speed(unit: DriveView, hz: float | None = None, *, unverified: bool = False) -> None:
    """Checks that `wait_for_speed` can look, for who starts a motor and waits for it. Nothing is sent.

    Args:
        hz: As `wait_for_speed` will have it: with None, the setpoint must be told, too.
        unverified: Also by words that are not verified for the family.

    Raises:
        NotAllowed: State, frequency or setpoint of the family are not known, or not verified.
    """
    unit = unit.trusting(unverified)
    state.state_word(unit, _SPEED)
    for role in ("frequency", "setpoint") if hz is None else ("frequency",):
        name = unit.profile.role(role)
        if name is None or unit.evidence.unreadable(name) is not None:
            raise _untold(unit, _SPEED, role)


def check_standstill(unit: DriveView, timeout: float) -> None:
    """Raises `NotAllowed` if `wait_until_stopped` would, before anything moves."""
    checks.number("timeout", timeout, 0.0)
    state.state_word(unit, _STANDSTILL)


def _in_words(unit: DriveView, what: str, late: str, kind: str, told: Any) -> DrivebusError:
    """Why *what* came to nothing, which was *late*: *kind* and *told* as `_native.Unit` has them."""
    if kind == "not_settled":
        return unit_variants.not_settled(unit, *told)
    why, of_it = told
    if why in ("unseen", "untold"):
        return _untold(unit, what, of_it)
    if why == "tripped":
        was_before, seen = of_it
        when = "before the wait" if was_before else "while waiting"
        fault = state.shown(unit, seen).fault or "fault not named"
        return Unconfirmed(f"unit {unit.address} tripped {when}: {fault}", unit=unit.address)
    return NotReached(f"unit {unit.address}: {late}; it is {state.shown(unit, of_it)}", unit=unit.address)


def _untold(unit: DriveView, what: str, role: str | None) -> NotAllowed:
    """Why *what* needs the *role*, None: the state, of a family that does not tell it."""
    if role is None:
        return refusal_of(state.state_word, unit, what)
    name = unit.profile.role(role)
    if name is not None:
        return refusal_of(unit.evidence.require_readable, [name])
    then = "; give the speed: wait_for_speed(hz)" if role == "setpoint" else ""
    return BadArgument(
        f"{what} of unit {unit.address} needs its {role}, and {unit.profile.title} has no register of it that is "
        f"known{then}. Nothing was sent, and the motor goes on as it was",
        unit=unit.address,
    )
