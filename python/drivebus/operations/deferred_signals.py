"""What a signal would raise is kept while a motor is told to stop, and raised once the stop has gone out.

A handler raises in the main thread, between any two steps of a stop: a second Ctrl-C would leave the motor running. So
the handlers of the program wait meanwhile. A signal that ends the process at once is not held up here.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

__all__ = ["DeferredSignals"]

_Handler = Callable[[int, "FrameType | None"], Any]

# The one that comes most often is the first to be held up, and the last to be let go.
_SIGNALS = [signal.SIGINT, *sorted(signal.valid_signals() - {signal.SIGINT})]

_open: list[DeferredSignals] = []
"""Those in force, in the main thread; an event loop may stop several motors at once."""
_formers: dict[int, _Handler] = {}
"""Whose handlers wait. One that is not put back yet works as it did."""
_came: dict[int, FrameType | None] = {}
"""What came meanwhile, once each."""


class DeferredSignals:
    """A block in which the program's own handlers of signals wait, until the stop has gone out.

    What came until then is handled when the block ends, and raises there what it raises; after that Ctrl-C cuts short
    what still proves the stop. In another thread than the main one, where no handler runs, nothing is changed.

    Args:
        gone_out: Whether the stop has.
        passes: A handler that does not wait: it knows of stops by itself.
    """

    def __init__(self, gone_out: Callable[[], bool], passes: _Handler) -> None:
        self._gone_out = gone_out
        self._passes = passes

    @property
    def gone_out(self) -> bool:
        """Whether the stop has."""
        return self._gone_out()

    def __enter__(self) -> DeferredSignals:
        if threading.current_thread() is not threading.main_thread():
            return self
        _open.append(self)
        for number in _SIGNALS:
            handler = signal.getsignal(number)
            if callable(handler) and handler not in (_wait, self._passes, signal.SIG_DFL, signal.SIG_IGN):
                _formers[number] = handler
                try:
                    signal.signal(number, _wait)
                except ValueError:  # a sub-interpreter may not
                    break
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self not in _open:
            return
        _open.remove(self)
        if _open:
            return
        try:
            for number in reversed(_SIGNALS):
                if signal.getsignal(number) is _wait:
                    signal.signal(number, _formers[number])
        finally:
            _handle()


def _wait(number: int, frame: FrameType | None) -> None:
    if all(kept.gone_out for kept in _open):
        _formers[number](number, frame)
    else:
        _came[number] = frame


def _handle() -> None:
    """Handles what came, each of them, whatever the one before raises."""
    if _came:
        number, frame = _came.popitem()
        try:
            _formers[number](number, frame)
        finally:
            _handle()
