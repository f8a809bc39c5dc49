"""One drive on a line: commands, values, and what it says about itself, in the words of its family.

Each call here carries out at once what stands, once, in `drivebus.operations`. What it needs of the line and of the
profile stands in `drivebus.line.protocols`. Time is the line's clock, so everything here runs in virtual time as well.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Coroutine, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, overload

from drivebus import checks
from drivebus.backup import drive_backup
from drivebus.discovery import drive_discovery
from drivebus.errors import BadArgument
from drivebus.line.blocking import BlockingBus, at_once
from drivebus.line.protocols import BusProtocol
from drivebus.motor import Motor
from drivebus.operations import (
    bit_words,
    bus_control,
    motion,
    parameters,
    raw_words,
    registers,
    setpoints,
    state,
    waiting,
)
from drivebus.operations.by_name import by_name
from drivebus.operations.drive_base import DriveFace, blocking, documented_by, unit_of
from drivebus.operations.drive_view import DriveView
from drivebus.operations.former_names import BlockingFormerNames
from drivebus.operations.halting import WITHIN
from drivebus.operations.motor_block import MotorBlock
from drivebus.plain_annotations import plain_annotations
from drivebus.profile import Profile
from drivebus.strict_attributes import known_only
from drivebus.values import Value
from drivebus.watchdog import Watchdog

__all__ = ["Drive", "check_drive"]


@plain_annotations
@known_only
class Drive(BlockingFormerNames):
    """One drive on a line: its commands, values and state. `drivebus.Bus.drive` makes it.

    Nothing is kept between calls but what was written to RAM, how often EEPROM was written, what the drive said it is,
    and, for errors, its last state. Every call asks the drive, and so does `setpoint`. Safe from any thread; a command
    and its confirmation are several requests, between which others may come.

    Attributes:
        bus: The bus of its line.
        unit: Its address, 1..247.
        profile: What its words mean.
        unverified: Whether what no document of its family proves is done all the same, in every call.

    *identification* is what it said when it was asked what it is; None if it was not. With *trust_profile*, what it
    says against its profile does not count.
    """

    bus: BusProtocol

    def __init__(
        self,
        bus: BusProtocol,
        unit: int,
        profile: Profile,
        identification: int | None = None,
        *,
        unverified: bool = False,
        trust_profile: bool = False,
    ) -> None:
        self.bus = bus
        super().__init__(
            DriveView.create(
                BlockingBus(bus), unit, profile, identification, unverified=unverified, trust_profile=trust_profile
            )
        )

    # Names that are also rooms come after what is taken from the room.
    run = blocking(motion.run)
    jog = blocking(motion.jog)
    stop = blocking(motion.stop)
    coast = blocking(motion.coast)
    jog_stop = blocking(motion.jog_stop)
    reset_fault = blocking(motion.reset_fault)
    look = blocking(state.look)
    status = blocking(state.status)
    fault = blocking(state.fault)
    fault_history = blocking(state.fault_history)
    monitor = blocking(registers.monitor)
    snapshot = blocking(registers.snapshot)
    settled_profile = blocking(registers.settled_profile)
    read_words = blocking(raw_words.read_words)
    write_words = blocking(raw_words.write_words)
    inputs = blocking(bit_words.inputs)
    outputs = blocking(bit_words.outputs)
    set_virtual_inputs = blocking(bit_words.set_virtual_inputs)
    set_virtual_outputs = blocking(bit_words.set_virtual_outputs)
    special_control = blocking(bit_words.special_control)
    bits = blocking(bit_words.bits)
    read_setpoint = blocking(setpoints.read_setpoint)
    write_setpoint = blocking(setpoints.write_setpoint)
    check_setpoints = blocking(setpoints.check_setpoints)
    ping = blocking(state.ping)
    state = blocking(state.state)
    contradiction = blocking(registers.contradiction)
    check_speed = blocking(waiting.check_speed)
    wait_for_speed = blocking(waiting.wait_for_speed)
    wait_until_stopped = blocking(waiting.wait_until_stopped)
    check_control = blocking(bus_control.check_control)
    prepare_control = blocking(bus_control.prepare_control)
    backup = blocking(drive_backup.backup)
    restore = blocking(drive_backup.restore)
    diff = blocking(drive_backup.diff)
    discover = blocking(drive_discovery.discover)

    @property
    def setpoint(self) -> float:
        """The frequency setpoint last given over the bus, in Hz. Setting it changes the speed of a running motor.

        Reading it is `read_setpoint()`, setting it is `write_setpoint(hz)`: errors as there.
        """
        return at_once(setpoints.read_setpoint(unit_of(self)))

    @setpoint.setter
    def setpoint(self, hz: float) -> None:
        at_once(setpoints.write_setpoint(unit_of(self), hz))

    @overload
    def read(self, name: str, /, *, verify: bool = False, unverified: bool = False) -> Value: ...
    @overload
    def read(
        self, first: str, second: str, /, *more: str, verify: bool = False, unverified: bool = False
    ) -> dict[str, Value]: ...
    @documented_by(registers.read)
    def read(self, *names: str, verify: bool = False, unverified: bool = False) -> Value | dict[str, Value]:
        """Reads values by name, in the fewest requests; see `registers.read`."""
        return at_once(registers.read(unit_of(self), *names, verify=verify, unverified=unverified))

    @overload
    def write(self, name: str, value: object, *, store: bool = False, unverified: bool = False) -> None: ...
    @overload
    def write(self, name: Mapping[str, object], *, store: bool = False, unverified: bool = False) -> None: ...
    @by_name("store", after=2)
    @documented_by(parameters.write)
    def write(
        self,
        name: str | Mapping[str, object],
        value: object = None,
        *,
        store: bool = False,
        unverified: bool = False,
    ) -> None:
        """Writes one value by name, or several from a mapping; see `parameters.write`."""
        if isinstance(name, Mapping):
            at_once(parameters.write(unit_of(self), name, store=store, unverified=unverified))
        else:
            at_once(parameters.write(unit_of(self), name, value, store=store, unverified=unverified))

    @by_name("reverse", after=1)
    @contextmanager
    def running(
        self,
        hz: float | None = None,
        *,
        reverse: bool = False,
        confirm: float = 1.0,
        force: bool = False,
        unverified: bool = False,
        wait: bool = False,
        timeout: float = 60.0,
        stop_within: float = WITHIN,
    ) -> Iterator[Drive]:
        """Runs the motor inside a `with` block and stops it whatever happens there, Ctrl-C included.

        A stop that is not confirmed is sent again, and in the end the drive is told to coast. With *unverified* the end
        is proved as the start was, by states that are not verified. An error from inside the block is raised as it is;
        if the drive could not be stopped either, its note says so.

        With *wait* the block is left when the motor stands: `wait_until_stopped`, for *timeout* seconds, follows the
        stop, also where the block ended with an error. What ends the program (Ctrl-C, SystemExit) is not kept waiting.

        The end of the program stops it too: what is still inside such a block when the interpreter ends, and, while the
        main thread is inside one, SIGTERM and SIGHUP (unless the program listens to them itself), which raise
        SystemExit there. What no program sees, such as kill -9, is for `watchdog`.

        The stop is sent until the drive takes it, for *stop_within* seconds, and every fourth time it is told to
        coast instead.

        Raises:
            NotAllowed, Refused, NoAnswer, BadAnswer, PortError: From `run`, which was not sent or not taken: the
                motor is left as it was. Or from stopping, when the block itself went well.
            Unconfirmed: From `run`, after which it is stopped; or from stopping: the motor may still turn. Or it was
                told to stop, and does not stand when *timeout* is over; the message says what it does.
        """
        run = functools.partial(self.run, hz, reverse=reverse, confirm=confirm, force=force, unverified=unverified)
        standstill = timeout if checks.flag("wait", wait) else None
        with self._moving(run, motion.end_run, unverified, standstill, stop_within):
            yield self

    @by_name("reverse", after=0)
    @contextmanager
    def jogging(
        self,
        *,
        reverse: bool = False,
        confirm: float = 1.0,
        force: bool = False,
        unverified: bool = False,
        stop_within: float = WITHIN,
    ) -> Iterator[Drive]:
        """Jogs the motor inside a `with` block and ends the jog whatever happens there. Otherwise as `running`.

        It is ended by the family's jog stop, or where it has none by a stop.
        """
        jog = functools.partial(self.jog, reverse=reverse, confirm=confirm, force=force, unverified=unverified)
        with self._moving(jog, motion.end_jog, unverified, None, stop_within):
            yield self

    def motor(self, *, unverified: bool = False, stop_within: float = WITHIN) -> Motor:
        """The motor, for a block that starts and stops it more than once. It is stopped when the block ends.

            with drive.motor() as motor:
                motor.run(10.0)
                motor.stop()
                motor.run(20.0, reverse=True)

        What `running` promises for its block holds here from each start on. Nothing is sent before the first one.

        Args:
            unverified: Also where command, states or setpoint are not verified for the family.
            stop_within: Seconds, 0..3600, for which a stop is sent until the drive takes it; every fourth time it is
                told to coast instead.
        """
        return Motor(unit_of(self).trusting(unverified), stop_within)

    def watchdog(self, timeout: float, action: str = "coast", *, unverified: bool = False) -> Watchdog:
        """Makes the drive act by itself after *timeout* seconds of silence. Inside the block it is asked often enough.

            with drive.watchdog(1.0, unverified=True), drive.running(hz=10.0):
                ...

        For what no program can look after: kill -9, a computer that hangs, a cable that is cut. The drive's own
        time-out and its action (P14.04 and P14.05 of a GD350) are set in RAM and read back, and a thread asks the
        drive for its state four times within *timeout*. When the block ends, a motor that slows down is waited for,
        and the drive gets back the settings it had; where the motor goes on turning, or cannot be asked, they stay, and
        the drive acts. A drive that was switched off meanwhile has forgotten them.

        The thread keeps real time: on a line in virtual time it does not keep up.

        Args:
            timeout: Seconds, in the range and steps of the drive's parameter (GD350: 0.1 to 60.0, in tenths). Longer
                than the bus's own time-out, or one lost answer is enough.
            action: `"coast"` takes the voltage off the motor, whoever is in control, and trips a fault (GD350: CE) if
                the drive has no trip beside it; `"stop"` stops it as the drive is set to, without a fault. `"trip"` is
                all that a VFD500 can: it trips Er.485, and its own settings decide what that does to the motor, which
                may keep running.
            unverified: Also where the parameters are not verified for the family, as they are not for the GD350.

        Raises:
            NotAllowed: The family has no such thing, it is not verified, or *timeout* or *action* is not among what it
                takes. Nothing was sent.
            Refused: The drive kept what it had.
            NoAnswer, BadAnswer, PortError: The line failed. The drive may have taken the settings: then it acts when
                *timeout* is over.
            Unconfirmed: The drive took the settings and shows others; it was given back those it had.
        """
        return Watchdog(unit_of(self).trusting(unverified), timeout, action)

    @contextmanager
    def _moving(
        self,
        start: Callable[[], None],
        end: Callable[[DriveView, float], Coroutine[Any, Any, None]],
        unverified: bool,
        standstill: float | None,
        within: float,
    ) -> Iterator[None]:
        """Starts, and ends by all means."""

        async def begin() -> None:
            start()

        block = MotorBlock(unit_of(self).trusting(unverified), begin, end, standstill, within)
        try:
            at_once(block.begin())
            yield
        except BaseException as reason:
            at_once(block.fail(reason))
            raise
        at_once(block.finish())


def check_drive(drive: object, what: str) -> None:
    """Raises `NotAllowed` if *drive* is no `Drive`, or one of asyncio, which *what* cannot do with."""
    if isinstance(drive, Drive):
        return
    if isinstance(drive, DriveFace):
        raise BadArgument(
            f"{what} takes a drive whose calls block, and {checks.shown(drive)} is one of asyncio: open the line with "
            "drivebus.Bus, which may have the same port, and run it by asyncio.to_thread"
        )
    raise BadArgument(f"{what} takes a drive, such as bus.drive(1), and was given {checks.shown(drive)}")
