"""Cyclic polling: a bus that asks the same again and again by itself, and gives what comes as samples.

The asking is the compiled core's, in a thread of its own and without Python. Here one waits for samples, or has a
function called with them.
"""

from __future__ import annotations

import atexit
import math
import threading
import warnings
import weakref
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

from drivebus import _native, checks
from drivebus.errors import BadArgument, DrivebusWarning, level_of_the_program
from drivebus.line.poll_samples import MOST_SAMPLES, Batch, Key, Polling, Sample, how_many, poller_of, seconds
from drivebus.plain_annotations import plain_annotations
from drivebus.strict_attributes import known_only

__all__ = ["Poll"]


@plain_annotations
@known_only
class Poll(Polling[Key]):
    """Polls the same values of the same drives until it, or its bus, is closed. `Bus.poll` makes it.

    Iterating over it gives each sample as it comes, and ends when the poll does; `batch` and `take` give many at once.
    Samples that nobody takes are kept, the latest *size* of them. Everything is safe from any thread.

    On a line in virtual time nothing is asked by itself: whoever waits for samples does the asking, and meanwhile time
    moves. Starts of cycles that passed while nobody waited count as late; where nobody ever waits, a `DrivebusWarning`
    at the end says so.

    Attributes as those of `Polling`.
    """

    def __init__(
        self,
        bus: object,
        native: _native.Bus,
        targets: object,
        interval: float | None,
        size: int,
        callback: Callable[[Sample[Key]], object] | None,
    ) -> None:
        if callback is not None and not callable(callback):
            raise BadArgument(
                f"callback is {checks.shown(callback)}, which cannot be called; give a function that takes a sample"
            )
        super().__init__(bus, native, targets, interval, size)
        self._native = poller_of(self)
        self._bus = native
        self._callback = callback
        self._error: BaseException | None = None
        self._closing = False
        self._thread: threading.Thread | None = None
        # In virtual time: since when nobody has waited.
        self._idle_since = native.now() if native.virtual else math.inf
        _polls.add(self)
        # In virtual time a thread would let time run away: there, `wait` calls it.
        if callback is not None and not native.virtual:
            self._thread = threading.Thread(target=self._deliver, name="drivebus poll", daemon=True)
            self._thread.start()

    def batch(self, count: int | None = None, timeout: float | None = None) -> Batch[Key]:
        """Waits for *count* samples and returns them. None waits for one, and returns all there are.

        Fewer where *timeout* seconds of the line's clock are over first, or where the poll has ended.

        Raises:
            NotAllowed: More than are kept, or the poll has a callback, which gets the samples.
            PortError: The poll belongs to the parent of this process.
        """
        self._not_called_back()
        self._wait(how_many(self, count), seconds(timeout))
        return self.take(count)

    def __iter__(self) -> Iterator[Sample[Key]]:
        self._not_called_back()
        # One at a time: who leaves the loop leaves the others where they are.
        while self._wait(1, None):
            yield from self.take(1)

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until the poll has ended, for *timeout* seconds of the line's clock at most; returns whether it has.

        On a line in virtual time this is what lets a poll go on, with or without a callback.

        Raises:
            BaseException: What the callback raised, which ended the poll. It is raised once.
        """
        limit = seconds(timeout)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(limit)
        elif self._callback is not None and self._thread is None:
            self._deliver(limit)
        else:
            # More than are ever kept: only the end of the poll ends this.
            self._wait(MOST_SAMPLES + 1, limit)
        self._raise()
        return self.closed

    def close(self) -> None:
        """Ends the poll, after the exchange that is under way. What is there can still be taken.

        A callback that is under way is waited for, unless it is the one that calls this. Closing again does nothing.
        """
        if not self._closing and not self.cycles and (due := never_run(self)):
            text = f"a poll in virtual time goes on only while somebody waits: {due} due and never run; call `wait`"
            warnings.warn(text, DrivebusWarning, stacklevel=level_of_the_program())
        self._closing = True
        self._native.close()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def __enter__(self) -> Poll[Key]:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        if error is None:
            self._raise()

    def _wait(self, count: int, timeout: float | None) -> int:
        there = self._native.wait(count, timeout)
        if self._bus.virtual:
            self._idle_since = self._bus.now()
        return there

    def _not_called_back(self) -> None:
        if self._callback is not None:
            raise BadArgument("this poll gives its samples to its callback; make another one to take them yourself")

    def _deliver(self, timeout: float | None = None) -> None:
        """Calls the callback for each sample, until the poll ends or *timeout* is over."""
        assert self._callback is not None
        deadline = math.inf if timeout is None else self._bus.now() + timeout
        try:
            while not self._closing:
                left = None if timeout is None else max(deadline - self._bus.now(), 0.0)
                if not self._wait(1, left):
                    return
                for sample in self.take():
                    if self._closing:
                        return
                    self._callback(sample)
        except BaseException as error:
            self._error = error
            self._native.close()

    def _raise(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error


def never_run(polling: Poll[Any]) -> str:
    """The cycles that were due on a line in virtual time while nobody waited, in words; empty where none was."""
    idle = polling._bus.now() - polling._idle_since
    if polling.closed or idle <= 0:
        return ""
    if polling.interval is None:
        return "its cycles were"
    # The first is due at once.
    count = int(idle / polling.interval) + (polling.cycles == 0)
    return f"{checks.counted(count, 'cycle')} {'was' if count == 1 else 'were'}" if count else ""


_polls: weakref.WeakSet[Poll[Any]] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """No thread may be left inside the core, or inside Python, when the interpreter ends."""
    for poll in list(_polls):
        poll.close()
