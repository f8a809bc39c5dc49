"""Commands that move a motor, and the proof that they did.

Three rules hold for every command. What can be checked is checked before anything is sent. The command is sent once,
and never repeated unless it halts. Success is what the drive's own state says afterwards; if that cannot be learnt, the
caller is told so.
"""

from __future__ import annotations

from drivebus import checks
from drivebus.advice import Text, call
from drivebus.errors import BadArgument
from drivebus.operations import not_commanded
from drivebus.operations.by_name import by_name
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import WITHIN, Halt
from drivebus.operations.in_parts import in_parts

__all__ = [
    "coast",
    "end_jog",
    "end_run",
    "halting",
    "has_jog_stop",
    "jog",
    "jog_stop",
    "reset_fault",
    "run",
    "stop",
]


@by_name("reverse", after=1)
@in_parts
async def run(
    unit: DriveView,
    hz: float | None = None,
    *,
    reverse: bool = False,
    confirm: float = 1.0,
    force: bool = False,
    unverified: bool = False,
) -> None:
    """Starts the motor. With *hz*, the setpoint is in the same frame, if the drive takes both together.

    Returns when the state word shows it running, not when it has reached its speed: see `wait_for_speed`. Where the
    family has no state that may be used, when the drive has confirmed the command and shows no fault.

    Args:
        hz: Setpoint in Hz, 0 to the drive's own maximum; None keeps the one it has.
        reverse: Turn the other way.
        confirm: Seconds until the state word must show it; 0 does not look. So too for each of the words that some
            families want before it; those are looked at once in any case.
        force: Start although the link is bad. Then it may be impossible to stop the motor over the bus.
        unverified: Also where command, states or setpoint are not verified for the family. What ends it then needs
            no such word.

    Where two or more of the last ten exchanges failed, the link is proved first, by ten looks at the state.

    A stop wins over it: once the drive was told to stop or coast, by whomever on this line, what is under way here is
    not sent any more.

    Raises:
        NotAllowed: It was told to stop meanwhile (`NotReady`, whose `why` is `"halted"`); the drive is in fault, not
            under bus control, or takes its speed from elsewhere; *hz* is above its maximum; the link is bad; another
            drive answers at this address since the port was opened again; or something is not verified for the
            family: the command, or both ways to stop what it starts. Nothing was sent that moves it.
        Refused: The drive did not start, and does not turn as far as its state can be read.
        NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
        Unconfirmed: The command was sent; the message names the state seen last. It is not repeated. Or the family
            wants other words before it, and the drive does not show one of them: then the command was not sent.
    """
    hz = None if hz is None else checks.number("setpoint", hz, 0.0)
    await _start(unit.trusting(unverified), False, hz, reverse, confirm, force)


@by_name("reverse", after=0)
@in_parts
async def jog(
    unit: DriveView, *, reverse: bool = False, confirm: float = 1.0, force: bool = False, unverified: bool = False
) -> None:
    """Jogs the motor at the drive's jog frequency, until `jog_stop`. Checks and errors are those of `run`.

    A motor that turns already is not jogged (`NotAllowed`): its state would look like a jog, and `jog_stop` would
    not end it.
    """
    await _start(unit.trusting(unverified), True, None, reverse, confirm, force)


async def stop(unit: DriveView, *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False) -> None:
    """Stops the motor as the drive is set to stop it, usually by a ramp. Sent at once, whatever the state is.

    Returns after half a second and a hertz of the drive's own ramp, where the motor ran at its setpoint and only
    the bus tells it what to do (docs/developers/guarantees.md has the rule); else when the drive is stopped.
    `wait_until_stopped` waits for that in any case. Where the family has no state that may be used, returns when the
    drive has confirmed the command.

    A frequency that falls is looked at beyond *confirm*: for as long as it falls, and a minute at most, or where
    the drive's ramp is known half as long again as that takes. A drive that tells none is looked at for *confirm*.

    It overtakes whatever else waits for the line, as do the reads that confirm it, and goes out to a drive that
    seems deaf too. It is sent again until the drive takes it, for *within* seconds: a frame that was lost, and one
    that was refused, stops nothing.

    A unit that has not said yet what it is on this line is asked before, where the word may start a drive of another
    family: a few words, in some 0.1 s. One that shows another family is stopped as that family is.

    Args:
        confirm: Seconds for which the state is looked at; 0 does not look.
        within: Seconds, 0..3600, for which it is sent until the drive takes it. A unit that answers, but has not said
            yet what it is, is asked for two seconds in any case.
        unverified: Also where the command is not verified for the family.

    Raises:
        NotAllowed: The command is not verified for the family, and nothing was started as *unverified* either. Or
            the unit may be of another family, which it would start. It was not sent.
        Refused: The drive did not take it, in all that time; it still runs if it ran.
        PortError: It could not be sent; the drive goes on as it was.
        Unconfirmed: It was sent, and the drive does not show it: the motor may still turn.
    """
    await _halt(unit.trusting(unverified), "stop", confirm, within)


async def coast(unit: DriveView, *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False) -> None:
    """Switches the output off: the motor freewheels to a stop. Arguments and errors as for `stop`.

    Returns when the drive reports that it is stopped: a coast has no ramp.
    """
    await _halt(unit.trusting(unverified), "coast", confirm, within)


async def jog_stop(unit: DriveView, *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False) -> None:
    """Ends a jog by the jog's own ramp. As `stop`; where there is no such command, the error says what ends it."""
    unit = unit.trusting(unverified)
    if "jog_stop" not in unit.profile.commands():
        jogs = "jog_forward" in unit.profile.commands()
        halts = Text(": ", call("stop"), " ends it along the ramp, ", call("coast"), " takes the voltage off")
        ends = halts if jogs else ", nor one to jog"
        raise BadArgument(
            Text(
                f"{unit.profile.title} has no command that ends a jog alone",
                ends,
                f"; nothing was sent to unit {unit.address}",
            ),
            unit=unit.address,
        )
    await _halt(unit, "jog_stop", confirm, within)


async def end_run(unit: DriveView, within: float = WITHIN, *, confirm: float = 1.0) -> None:
    """Stops a motor by all means: by a stop, and where that is not taken now and then by a coast. As `stop`."""
    await _halt(unit, "stop", confirm, within, coasts=True)


async def end_jog(unit: DriveView, within: float = WITHIN) -> None:
    """Ends a jog by all means, by its jog stop or else by a stop. Errors as for `stop`."""
    await _halt(unit, "jog_stop" if has_jog_stop(unit) else "stop", 1.0, within, coasts=True)


def has_jog_stop(unit: DriveView) -> bool:
    """Whether the family has a command that ends a jog alone, and it may be given."""
    return halting(unit, "jog_stop").evidence.unusable("jog_stop") is None


async def reset_fault(unit: DriveView, *, confirm: float = 1.0, unverified: bool = False) -> None:
    """Resets a fault after its cause is gone. Sends nothing if there is no fault.

    Raises:
        NotAllowed: The command is not verified for the family, or another drive answers at this address since the
            port was opened again. Nothing was sent.
        Refused: The drive did not take it.
        NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
        Unconfirmed: It was sent, once, and the fault is still there: its cause is, most likely, or the drive does not
            obey the bus, which the message says. Or nothing is known of it.
    """
    confirm = checks.number("confirm", confirm, 0.0, 3600.0)
    unit = unit.trusting(unverified)
    kind, told = await call_core(unit, lambda core: core.reset_fault(confirm))
    if kind != "done":
        raise not_commanded.in_words(unit, *told, confirm=confirm)


async def _start(unit: DriveView, jogs: bool, hz: float | None, reverse: bool, confirm: float, force: bool) -> None:
    confirm = checks.number("confirm", confirm, 0.0, 3600.0)
    force, reverse = checks.flag("force", force), checks.flag("reverse", reverse)
    kind, told = await call_core(unit, lambda core: core.start(jogs, reverse, hz, confirm, force))
    if kind != "done":
        raise not_commanded.in_words(unit, *told, hz=hz or 0.0, confirm=confirm)


async def _halt(unit: DriveView, command: str, confirm: float, within: float, *, coasts: bool = False) -> None:
    confirm = checks.number("confirm", confirm, 0.0, 3600.0)
    within = checks.number("within", within, 0.0, 3600.0)
    unit = halting(unit, command)
    unit.evidence.require_command(command)
    can_coast = coasts and unit.evidence.unusable("coast") is None
    await Halt(unit, command, confirm, within, coasts=can_coast).carry_out()


def halting(unit: DriveView, command: str) -> DriveView:
    """The same unit; where a start was forced on what is not verified, as *command* is, with the same trust."""
    return unit.trusting(unit.record.started_unverified and unit.evidence.unusable(command) is not None)
