"""One drive on a line, for asyncio: the operations themselves, to be awaited."""

from __future__ import annotations

import functools
from collections.abc import AsyncIterator, Awaitable, Callable, Generator
from contextlib import asynccontextmanager
from typing import Any, overload

from drivebus.aio.watchdog import Watchdog
from drivebus.operations.motor_block import Moving
from drivebus.operations.setpoints import SETPOINTS
from drivebus.operations.waiting import Operations

__all__ = ["Drive"]


class _Asked:
    """A setpoint, once it is awaited."""

    def __init__(self, ask: Callable[[], Awaitable[float]]) -> None:
        self._ask = ask

    def __await__(self) -> Generator[Any, None, float]:
        return self._ask().__await__()


class _Setpoint:
    """One thing that a drive is told besides commands: `await drive.torque`, `await drive.set_torque(…)`."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.__doc__ = SETPOINTS[name]

    @overload
    def __get__(self, drive: None, owner: type[Drive]) -> _Setpoint: ...
    @overload
    def __get__(self, drive: Drive, owner: type[Drive]) -> Awaitable[float]: ...
    def __get__(self, drive: Drive | None, owner: type[Drive]) -> Awaitable[float] | _Setpoint:
        return self if drive is None else _Asked(lambda: drive.ask(self._name))


class Drive(Operations):
    """A drive, as `drivebus.aio.Bus.drive` gives it: what `drivebus.Drive` has, awaitable.

    Who cancels a command does not take it back: once its request has left, the drive does it. After that, ask for the
    state. A block of `running` or `jogging` stops the motor also where its task is cancelled, and again.
    """

    def __repr__(self) -> str:
        return f"<Drive {self.unit}: {self.profile.name}{', unverified' if self.unverified else ''}>"

    @property
    def setpoint(self) -> Awaitable[float]:
        """The setpoint last given over the bus, in Hz: `await drive.setpoint`. `set_setpoint` gives another."""
        return _Asked(self.ask_setpoint)

    torque = _Setpoint("torque")
    pid = _Setpoint("pid")
    pid_feedback = _Setpoint("pid_feedback")
    forward_limit = _Setpoint("forward_limit")
    reverse_limit = _Setpoint("reverse_limit")
    motoring_torque_limit = _Setpoint("motoring_torque_limit")
    braking_torque_limit = _Setpoint("braking_torque_limit")
    vf_voltage = _Setpoint("vf_voltage")
    analog_output_1 = _Setpoint("analog_output_1")
    analog_output_2 = _Setpoint("analog_output_2")

    @asynccontextmanager
    async def running(
        self,
        hz: float | None = None,
        reverse: bool = False,
        *,
        confirm: float = 1.0,
        force: bool = False,
        unverified: bool = False,
    ) -> AsyncIterator[Drive]:
        """Runs the motor inside an `async with` block and stops it whatever happens there, cancellation included.

        While it is stopped nothing gives that up: a cancellation that comes meanwhile is raised afterwards. The end of
        the program stops it too, and where the event loop is gone by then, without one. Otherwise as
        `drivebus.Drive.running`.
        """
        run = functools.partial(self.run, hz, reverse, confirm=confirm, force=force, unverified=unverified)
        moving = Moving(self.trusting(unverified), run, Operations.stop)
        async with _block(moving):
            yield self

    @asynccontextmanager
    async def jogging(
        self, reverse: bool = False, *, confirm: float = 1.0, force: bool = False, unverified: bool = False
    ) -> AsyncIterator[Drive]:
        """Jogs the motor inside an `async with` block and ends the jog by all means. Otherwise as `running`."""
        jog = functools.partial(self.jog, reverse, confirm=confirm, force=force, unverified=unverified)
        moving = Moving(self.trusting(unverified), jog, Operations.end_jog)
        async with _block(moving):
            yield self

    def watchdog(self, timeout: float, action: str = "coast", *, unverified: bool = False) -> Watchdog:
        """Makes the drive act by itself when it hears nothing for *timeout* seconds, and keeps it from that until then.

            async with drive.watchdog(1.0, unverified=True), drive.running(hz=10.0):
                ...

        or `watchdog = await drive.watchdog(1.0, …)`, and in the end `await watchdog.close()`. A task asks the drive for
        its state four times within *timeout*: where the event loop hangs, the drive acts. Otherwise as
        `drivebus.Drive.watchdog`.
        """
        return Watchdog(self.trusting(unverified), timeout, action)


@asynccontextmanager
async def _block(moving: Moving) -> AsyncIterator[None]:
    """Starts, and ends by all means."""
    try:
        await moving.begin()
        yield
    except BaseException as reason:
        await moving.fail(reason)
        raise
    await moving.finish()
