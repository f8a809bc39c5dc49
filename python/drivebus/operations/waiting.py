"""Waiting until a motor has reached its speed, or stands."""

from __future__ import annotations

from collections.abc import Callable

from drivebus import checks
from drivebus.errors import BadArgument, NotReached, Unconfirmed
from drivebus.look import STANDSTILL
from drivebus.operations import state
from drivebus.operations.drive_view import DriveView
from drivebus.operations.glances import POLL_INTERVAL
from drivebus.values import State, Status

__all__ = ["check_standstill", "wait_for_speed", "wait_until_stopped"]


async def wait_for_speed(
    unit: DriveView, hz: float | None = None, tolerance: float = 0.1, timeout: float = 60.0, *, unverified: bool = False
) -> Status:
    """Waits until the output frequency is *hz*; None: the active setpoint.

    Args:
        hz: Wanted output frequency in Hz, whichever way the motor turns.
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
    goal = "its setpoint" if wanted is None else f"{wanted:g} Hz"

    def reached(status: Status) -> bool:
        target = status.setpoint if wanted is None else wanted
        if status.frequency is None or target is None:
            return False
        # Hundredths are what drives count in; binary floats must not turn 0.1 into a miss.
        return status.state.running and abs(status.frequency - target) <= tolerance + 1e-9

    unit = unit.trusting(unverified)
    _check_told(unit, "waiting for the speed", "frequency", *(["setpoint"] if wanted is None else []))
    return await _wait(unit, reached, f"{goal} was not reached", timeout)


def _check_told(unit: DriveView, what: str, *roles: str) -> None:
    """Raises `NotAllowed` if the family does not tell its state, or one of *roles*."""
    state.state_word(unit, what)
    for role in roles:
        name = unit.profile.role(role)
        if name is None:
            raise BadArgument(
                f"{what} of unit {unit.address} needs its {role}, and {unit.profile.title} has no register of it that "
                "is known",
                unit=unit.address,
            )
        unit.evidence.require_readable([name])


async def wait_until_stopped(unit: DriveView, timeout: float = 60.0, *, unverified: bool = False) -> Status:
    """Waits until the drive is stopped and its output frequency is zero.

    A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.

    Raises:
        NotAllowed: The state of the family is not known, or not verified. Nothing was sent.
        NotReached: The time was up; it is an `Unconfirmed` and a `TimeoutError`.
        Unconfirmed: The drive tripped meanwhile.
        NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
    """

    def stopped(status: Status) -> bool:
        turns = status.frequency is not None and status.frequency > STANDSTILL
        return status.state.at_rest and not turns

    unit = unit.trusting(unverified)
    check_standstill(unit, timeout)
    return await _wait(unit, stopped, "it did not stop", timeout)


def check_standstill(unit: DriveView, timeout: float) -> None:
    """Raises `NotAllowed` if `wait_until_stopped` would, before anything moves."""
    checks.number("timeout", timeout, 0.0)
    _check_told(unit, "waiting for the standstill")


async def _wait(unit: DriveView, reached: Callable[[Status], bool], otherwise: str, timeout: float) -> Status:
    timeout = checks.number("timeout", timeout, 0.0)
    deadline = unit.bus.now() + timeout
    tripped = "tripped before the wait"
    while True:
        status = await state.status(unit)
        if status.state is State.FAULT or status.fault is not None:
            raise Unconfirmed(f"unit {unit.address} {tripped}: {status.fault or 'fault not named'}", unit=unit.address)
        tripped = "tripped while waiting"
        if reached(status):
            return status
        if unit.bus.now() >= deadline:
            raise NotReached(
                f"unit {unit.address}: {otherwise} within {timeout:g} s; it is {status}",
                unit=unit.address,
            )
        await unit.bus.sleep(POLL_INTERVAL)
