"""Cyclic polling for asyncio: the samples of `drivebus.poll`, awaited."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from types import TracebackType

from drivebus import _native
from drivebus.aio.mailbox import Mailbox
from drivebus.line.poll_samples import MOST_SAMPLES, Batch, Key, Polling, Sample, how_many, poller_of, seconds
from drivebus.plain_annotations import plain_annotations
from drivebus.strict_attributes import known_only

__all__ = ["Poll"]


@plain_annotations
@known_only
class Poll(Polling[Key]):
    """Polls the same values of the same drives until it, or its bus, is closed. `Bus.poll` makes it.

    `async for` gives each sample as it comes, and ends when the poll does; `batch` and `take` give many at once. The
    event loop is woken once for each wait, by the thread that asks. Whoever is cancelled while it waits takes no sample
    with it. Otherwise as `drivebus.Poll`.
    """

    def __init__(self, bus: object, native: _native.Bus, targets: object, interval: float | None, size: int) -> None:
        super().__init__(bus, native, targets, interval, size)
        self._native = poller_of(self)
        self._bus = native

    async def batch(self, count: int | None = None, timeout: float | None = None) -> Batch[Key]:
        """Waits for *count* samples and returns them. None waits for one, and returns all there are.

        Fewer where *timeout* seconds are over first, or where the poll has ended.

        Raises:
            NotAllowed: More than are kept.
        """
        await self._there(how_many(self, count), seconds(timeout))
        return self.take(count)

    async def __aiter__(self) -> AsyncIterator[Sample[Key]]:
        while True:
            # One at a time: who leaves the loop leaves the others where they are.
            samples = self.take(1)
            if not samples and self.closed:
                return
            for sample in samples:
                yield sample
            if not samples:
                await self._there(1, None)

    async def wait(self, timeout: float | None = None) -> bool:
        """Waits until the poll has ended, for *timeout* seconds at most; returns whether it has."""
        # More than are ever kept: only the end of the poll ends this.
        await self._there(MOST_SAMPLES + 1, seconds(timeout))
        return self.closed

    async def close(self) -> None:
        """Ends the poll. What is there can still be taken. Closing again does nothing."""
        self._native.stop()

    async def __aenter__(self) -> Poll[Key]:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _there(self, count: int, timeout: float | None) -> None:
        mailbox = Mailbox.here(asyncio.get_running_loop())
        waiting = mailbox.wait(self._native.ask(mailbox.native, count, timeout))
        if timeout is None or self._bus.virtual:
            await waiting
            return
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(waiting, timeout)
