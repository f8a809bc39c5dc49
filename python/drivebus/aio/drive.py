"""One drive on a line, for asyncio: the operations themselves, to be awaited."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Generator
from contextlib import asynccontextmanager
from typing import Any

from drivebus.aio.watchdog import Watchdog
from drivebus.moving import Moving
from drivebus.operations import Operations

__all__ = ["Drive"]


class _Setpoint:
    """The setpoint, once it is awaited."""

    def __init__(self, ask: Callable[[], Awaitable[float]]) -> None:
        self._ask = ask

    def __await__(self) -> Generator[Any, None, float]:
        return self._ask().__await__()


class Drive(Operations):
    """A drive, as `drivebus.aio.Bus.drive` gives it: what `drivebus.Drive` has, awaitable.

    Who cancels a command does not take it back: once its request has left, the drive does it. After that, ask for the
    state. A block of `running` or `jogging` stops the motor also where its task is cancelled, and again.
    """

    def __repr__(self) -> str:
        return f"<Drive {self.unit}: {self.profile.name}>"

    @property
    def setpoint(self) -> Awaitable[float]:
        """The setpoint last given over the bus, in Hz: `await drive.setpoint`. `set_setpoint` gives another."""
        return _Setpoint(self.ask_setpoint)

    @asynccontextmanager
    async def running(
        self, hz: float | None = None, reverse: bool = False, *, confirm: float = 1.0, force: bool = False
    ) -> AsyncIterator[Drive]:
        """Runs the motor inside an `async with` block and stops it whatever happens there, cancellation included.

        While it is stopped nothing gives that up: a cancellation that comes meanwhile is raised afterwards. The end of
        the program stops it too, and where the event loop is gone by then, without one. Otherwise as
        `drivebus.Drive.running`.
        """
        moving = Moving(self, lambda: self.run(hz, reverse, confirm=confirm, force=force), Operations.stop)
        async with _block(moving):
            yield self

    @asynccontextmanager
    async def jogging(
        self, reverse: bool = False, *, confirm: float = 1.0, force: bool = False
    ) -> AsyncIterator[Drive]:
        """Jogs the motor inside an `async with` block and ends the jog by all means. Otherwise as `running`."""
        moving = Moving(self, lambda: self.jog(reverse, confirm=confirm, force=force), Operations.jog_stop)
        async with _block(moving):
            yield self

    def watchdog(self, timeout: float, action: str = "coast") -> Watchdog:
        """Makes the drive act by itself when it hears nothing for *timeout* seconds, and keeps it from that until then.

            async with drive.watchdog(1.0), drive.running(hz=10.0):
                ...

        or `watchdog = await drive.watchdog(1.0)`, and in the end `await watchdog.close()`. A task asks the drive for
        its state four times within *timeout*: where the event loop hangs, the drive acts. Otherwise as
        `drivebus.Drive.watchdog`.
        """
        return Watchdog(self, timeout, action)


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
