"""One drive on a line, for asyncio: the same operations, to be awaited."""

from __future__ import annotations

import functools
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import overload

from drivebus import checks
from drivebus.aio.awake import Awake
from drivebus.aio.motor import Motor
from drivebus.aio.watchdog import Watchdog
from drivebus.backup import drive_backup
from drivebus.discovery import drive_discovery
from drivebus.line.protocols import AwaitableBus
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
from drivebus.operations.drive_base import awaited, documented_by, unit_of
from drivebus.operations.drive_view import DriveView
from drivebus.operations.former_names import AwaitedFormerNames
from drivebus.operations.halting import WITHIN
from drivebus.operations.motor_block import MotorBlock
from drivebus.plain_annotations import plain_annotations
from drivebus.profile import Profile
from drivebus.strict_attributes import known_only
from drivebus.values import Value

__all__ = ["Drive"]


@plain_annotations
@known_only
class Drive(AwaitedFormerNames):
    """A drive, as `drivebus.aio.Bus.drive` gives it: what `drivebus.Drive` has, awaitable.

    Who cancels a command does not take it back: once its request has left, the drive does it. After that, ask for the
    state. A block of `running` or `jogging` stops the motor also where its task is cancelled, and again.
    """

    bus: AwaitableBus

    def __init__(
        self,
        bus: AwaitableBus,
        unit: int,
        profile: Profile,
        identification: int | None = None,
        *,
        unverified: bool = False,
        trust_profile: bool = False,
    ) -> None:
        self.bus = bus
        super().__init__(
            DriveView.create(bus, unit, profile, identification, unverified=unverified, trust_profile=trust_profile)
        )

    # Names that are also rooms come after what is taken from the room.
    run = awaited(motion.run)
    jog = awaited(motion.jog)
    stop = awaited(motion.stop)
    coast = awaited(motion.coast)
    jog_stop = awaited(motion.jog_stop)
    reset_fault = awaited(motion.reset_fault)
    look = awaited(state.look)
    status = awaited(state.status)
    fault = awaited(state.fault)
    fault_history = awaited(state.fault_history)
    monitor = awaited(registers.monitor)
    snapshot = awaited(registers.snapshot)
    settled_profile = awaited(registers.settled_profile)
    read_words = awaited(raw_words.read_words)
    write_words = awaited(raw_words.write_words)
    inputs = awaited(bit_words.inputs)
    outputs = awaited(bit_words.outputs)
    set_virtual_inputs = awaited(bit_words.set_virtual_inputs)
    set_virtual_outputs = awaited(bit_words.set_virtual_outputs)
    special_control = awaited(bit_words.special_control)
    bits = awaited(bit_words.bits)
    read_setpoint = awaited(setpoints.read_setpoint)
    write_setpoint = awaited(setpoints.write_setpoint)
    check_setpoints = awaited(setpoints.check_setpoints)
    ping = awaited(state.ping)
    state = awaited(state.state)
    contradiction = awaited(registers.contradiction)
    check_speed = awaited(waiting.check_speed)
    wait_for_speed = awaited(waiting.wait_for_speed)
    wait_until_stopped = awaited(waiting.wait_until_stopped)
    check_control = awaited(bus_control.check_control)
    prepare_control = awaited(bus_control.prepare_control)
    backup = awaited(drive_backup.backup)
    restore = awaited(drive_backup.restore)
    diff = awaited(drive_backup.diff)
    discover = awaited(drive_discovery.discover)

    @overload
    async def read(self, name: str, /, *, verify: bool = False, unverified: bool = False) -> Value: ...
    @overload
    async def read(
        self, first: str, second: str, /, *more: str, verify: bool = False, unverified: bool = False
    ) -> dict[str, Value]: ...
    @documented_by(registers.read)
    async def read(self, *names: str, verify: bool = False, unverified: bool = False) -> Value | dict[str, Value]:
        """See `registers.read`."""
        return await registers.read(unit_of(self), *names, verify=verify, unverified=unverified)

    @overload
    async def write(self, name: str, value: object, *, store: bool = False, unverified: bool = False) -> None: ...
    @overload
    async def write(self, name: Mapping[str, object], *, store: bool = False, unverified: bool = False) -> None: ...
    @by_name("store", after=2)
    @documented_by(parameters.write)
    async def write(
        self,
        name: str | Mapping[str, object],
        value: object = None,
        *,
        store: bool = False,
        unverified: bool = False,
    ) -> None:
        """See `parameters.write`."""
        if isinstance(name, Mapping):
            await parameters.write(unit_of(self), name, store=store, unverified=unverified)
        else:
            await parameters.write(unit_of(self), name, value, store=store, unverified=unverified)

    @by_name("reverse", after=1)
    @asynccontextmanager
    async def running(
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
    ) -> AsyncIterator[Drive]:
        """Runs the motor inside an `async with` block and stops it whatever happens there, cancellation included.

        While it is stopped nothing gives that up: a cancellation that comes meanwhile is raised afterwards. The end of
        the program stops it too, and where the event loop is gone by then, without one. A cancellation is not kept
        waiting by *wait*. Otherwise as `drivebus.Drive.running`.
        """
        run = functools.partial(self.run, hz, reverse=reverse, confirm=confirm, force=force, unverified=unverified)
        standstill = timeout if checks.flag("wait", wait) else None
        block = MotorBlock(unit_of(self).trusting(unverified), run, motion.end_run, standstill, stop_within)
        async with _block(block):
            yield self

    @by_name("reverse", after=0)
    @asynccontextmanager
    async def jogging(
        self,
        *,
        reverse: bool = False,
        confirm: float = 1.0,
        force: bool = False,
        unverified: bool = False,
        stop_within: float = WITHIN,
    ) -> AsyncIterator[Drive]:
        """Jogs the motor inside an `async with` block and ends the jog by all means. Otherwise as `running`."""
        jog = functools.partial(self.jog, reverse=reverse, confirm=confirm, force=force, unverified=unverified)
        block = MotorBlock(unit_of(self).trusting(unverified), jog, motion.end_jog, None, stop_within)
        async with _block(block):
            yield self

    def motor(self, *, unverified: bool = False, stop_within: float = WITHIN) -> Motor:
        """The motor, for an `async with` block that starts and stops it more than once. See `drivebus.Drive.motor`."""
        return Motor(unit_of(self).trusting(unverified), stop_within)

    def watchdog(self, timeout: float, action: str = "coast", *, unverified: bool = False) -> Watchdog:
        """Makes the drive act by itself when it hears nothing for *timeout* seconds, and keeps it from that until then.

            async with drive.watchdog(1.0, unverified=True), drive.running(hz=10.0):
                ...

        or `watchdog = await drive.watchdog(1.0, …)`, and in the end `await watchdog.close()`. A task asks the drive for
        its state four times within *timeout*: where the event loop hangs, the drive acts. Otherwise as
        `drivebus.Drive.watchdog`.
        """
        return Watchdog(unit_of(self).trusting(unverified), timeout, action)


@asynccontextmanager
async def _block(block: MotorBlock) -> AsyncIterator[None]:
    """Starts, and ends by all means."""
    awake = Awake()
    try:
        await block.begin()
        yield
    except BaseException as reason:
        await block.fail(reason)
        raise
    else:
        await block.finish()
    finally:
        awake.end()
