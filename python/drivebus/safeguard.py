"""The end of the program stops the motors that it runs.

Whoever runs a motor inside a block says here how to end it. An exception ends the block by itself; this module looks
after what does not: a signal that would end the process at once, and threads and generators that nobody ends. What no
program sees (kill -9, a power cut) is for the drive's own watchdog.

It knows nothing of drives, only what is to be called.
"""

from __future__ import annotations

import _thread
import atexit
import itertools
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

__all__ = ["Guard"]

_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""What ends a process at once unless somebody listens: asked to end, and its terminal closed."""

_numbers = itertools.count()
_guards: dict[int, Guard] = {}
"""All that is to be ended, oldest first. Without a lock: a signal handler may interrupt whoever holds one, and a dict
takes and gives one item at a time."""


class Guard:
    """One thing that is to be ended before the program is.

    Args:
        end: Ends it, and returns what is left to raise. Must not mind being called twice, or from another thread.
    """

    def __init__(self, end: Callable[[], BaseException | None]) -> None:
        self._end = end
        self._number = next(_numbers)
        self.in_main_thread = _in_main_thread()
        self.ending = False
        self.deferred: SystemExit | None = None
        self.ended_by_others = False
        self._ended = False
        self._ended_for_others = threading.Event()

    def arm(self) -> None:
        """From here on it is ended if the program is. In the main thread, signals are listened to as well."""
        _guards[self._number] = self
        # What is registered last is called first: motors stop before anything they were armed after is taken down.
        atexit.unregister(_end_all)
        atexit.register(_end_all)
        if self.in_main_thread:
            _listen()

    def begin_to_end(self) -> bool:
        """Whether its owner is to end it now: not where the end of the program did. A signal meanwhile waits."""
        self.ending = True
        return not (self._ended or sys.is_finalizing())

    def leave_alone(self) -> None:
        """Nothing is to be ended here, because somebody else will."""
        self._ended = True

    def check(self) -> None:
        """Raises SystemExit where the program ends, and did so while this began: its end went out before its start."""
        if self.ended_by_others:
            self._ended = False
            raise SystemExit

    def end_for_others(self) -> None:
        """Ends it from another thread than the one that runs it."""
        self.ended_by_others = True
        try:
            failure = self._end()
            if failure is None:
                self._ended = True
            elif not self._ended and sys.stderr is not None:
                print(f"drivebus: at the end of the program: {failure}", file=sys.stderr)
        finally:
            self._ended_for_others.set()

    def disarm(self) -> None:
        """It is ended, or never began. Raises the SystemExit of a signal that waited for it."""
        _guards.pop(self._number, None)
        if _in_main_thread():
            others = list(_guards.values())
            for guard in others:
                if guard.ended_by_others:
                    # What follows here may close the line that the other one is ended over.
                    guard._ended_for_others.wait()
            if not any(guard.in_main_thread for guard in others):
                _stop_listening()
        if self.deferred is not None:
            raise self.deferred


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _listen() -> None:
    for number in _SIGNALS:
        # Whoever listens already, or wants the signal ignored, has thought of it.
        if signal.getsignal(number) == signal.SIG_DFL:
            try:
                signal.signal(number, _on_signal)
            except ValueError:  # a sub-interpreter may not
                return


def _stop_listening() -> None:
    for number in _SIGNALS:
        if signal.getsignal(number) is _on_signal:
            signal.signal(number, signal.SIG_DFL)


def _on_signal(number: int, _: FrameType | None) -> None:
    """Unwinds the main thread, whose blocks then end what they run, and ends what other threads run."""
    leave = SystemExit(128 + number)
    inside = None
    for guard in list(_guards.values()):
        if guard.in_main_thread:
            inside = guard
        else:
            # Not `threading`: its locks may be held by what this signal interrupted.
            _thread.start_new_thread(guard.end_for_others, ())
    if inside is not None and inside.ending:
        inside.deferred = leave
        return
    raise leave


def _end_all() -> None:
    """What is left when the interpreter ends: blocks in daemon threads, and generators that nobody closed."""
    for number, guard in reversed(list(_guards.items())):
        guard.end_for_others()
        _guards.pop(number, None)


def _forget() -> None:
    """In a forked child: the motors are the parent's, also where the child leaves the blocks that it was forked in."""
    for guard in _guards.values():
        guard.leave_alone()
    _guards.clear()
    _stop_listening()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
