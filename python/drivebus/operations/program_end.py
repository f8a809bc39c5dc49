"""The end of the program stops the motors that it runs.

Whoever runs a motor inside a block says here how to end it. An exception ends the block by itself; this module looks
after what does not: a signal that would end the process at once, and threads and generators that nobody ends. What no
program sees (kill -9, a power cut) is for the drive's own watchdog.

It knows nothing of drives, only what is to be called, and over which line.
"""

from __future__ import annotations

import _thread
import atexit
import itertools
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType

from drivebus._native import begin_of_child, end_of_program
from drivebus.end_signals import END_SIGNALS
from drivebus.errors import NotAllowed, NotReady
from drivebus.latch import Latch
from drivebus.operations.deferred_signals import DeferredSignals

__all__ = ["Guard", "before_start", "end_over"]

_PATIENCE = 10.0
"""Seconds for which a start that is on its way is waited for, so that the stop comes after it."""

_numbers = itertools.count()
_guards: dict[int, Guard] = {}
"""All that is to be ended, oldest first. Without a lock: a signal handler may interrupt whoever holds one, and a dict
takes and gives one item at a time."""
_process = [os.getpid()]
"""Whose all this is: another one in a child whose fork Python was not told of, or not yet."""
_over: list[bool] = []
"""Not empty once the end of the program has begun."""
_starting: ContextVar[Guard | None] = ContextVar("drivebus_starting", default=None)


class Guard:
    """One thing that is to be ended before the program is.

    Args:
        end: Ends it, and returns what is left to raise. Must not mind being called twice, or from another thread.
        line: What it is ended over: when that is to be closed, it is ended before.
    """

    def __init__(self, end: Callable[[], BaseException | None], line: object = None) -> None:
        self._end = end
        self._line = line
        self._number = next(_numbers)
        self.in_main_thread = _in_main_thread()
        self.ending = False
        self.deferred: SystemExit | None = None
        self.ended_by_others = False
        self._ended = False
        self._ended_for_others = Latch()
        self._on_its_way = False
        self._begun = Latch()

    def arm(self) -> None:
        """From here on it is ended if the program is. In the main thread, signals are listened to as well.

        Raises:
            NotAllowed: The end of the program has begun: nobody would end it.
        """
        _notice_fork()
        _guards[self._number] = self
        if _over or sys.is_finalizing():
            # In this order: either the end of the program finds it, or this finds the end.
            _guards.pop(self._number, None)
            raise _too_late()
        # What is registered last is called first: motors stop before anything they were armed after is taken down.
        atexit.unregister(_end_all)
        atexit.register(_end_all)
        if self.in_main_thread:
            _listen()

    @contextmanager
    def beginning(self) -> Iterator[None]:
        """A block in which it begins: what starts it asks `before_start`."""
        token = _starting.set(self)
        try:
            yield
        finally:
            self._begun.set()
            _starting.reset(token)

    def may_start(self) -> None:
        """Called when the start is the next thing to be sent.

        Raises:
            NotAllowed, SystemExit: The program ends, and this was ended with it. Nothing was sent.
        """
        self._on_its_way = True
        if not (_over or self.ended_by_others):
            return
        self._on_its_way = False
        if _over:
            raise _too_late()
        raise SystemExit

    def keeping_interruptions(self, gone_out: Callable[[], bool]) -> DeferredSignals:
        """A block in which what a signal raises is kept until it *gone_out*, as this one's own signals are."""
        return DeferredSignals(lambda: self._ended or gone_out(), _on_signal)

    def begin_to_end(self) -> bool:
        """Whether its owner is to end it now: not where the end of the program did. A signal meanwhile waits."""
        _notice_fork()
        self.ending = True
        return not (self._ended or sys.is_finalizing())

    def leave_alone(self) -> None:
        """Nothing is to be ended here, because somebody else will."""
        self._ended = True

    def check(self) -> None:
        """Raises SystemExit where the program ends, and did so while this began: its end may have gone out before."""
        if self.ended_by_others:
            self._ended = False
            raise SystemExit

    def needs(self, line: object) -> bool:
        """Whether it is still to be ended, over *line*."""
        return self._line is line and not self._ended

    def end_for_others(self, when: str = "at the end of the program") -> None:
        """Ends it from another place than the one that runs it: *when*, for people."""
        self.ended_by_others = True
        try:
            if self._on_its_way:
                self._begun.wait(_PATIENCE)
            failure = self._end()
            if failure is None:
                self._ended = True
            elif not self._ended and sys.stderr is not None:
                print(f"drivebus: {when}: {failure}", file=sys.stderr)
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


def before_start() -> None:
    """To be called before a start is sent: inside a block of `Guard.beginning` it may be too late for one."""
    guard = _starting.get()
    if guard is not None:
        guard.may_start()


def end_over(line: object) -> None:
    """Ends all that is ended over *line*, which is to be closed."""
    with DeferredSignals(lambda: False, _on_signal):
        for guard in reversed(list(_guards.values())):
            if guard.needs(line):
                guard.end_for_others("when the bus was closed")


def _too_late() -> NotAllowed:
    return NotReady(
        "the program is ending, and nobody could stop the motor: nothing starts any more. Nothing was sent",
        why="ending",
    )


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _listen() -> None:
    for number in END_SIGNALS:
        # Whoever listens already, or wants the signal ignored, has thought of it.
        if signal.getsignal(number) == signal.SIG_DFL:
            try:
                signal.signal(number, _on_signal)
            except ValueError:  # a sub-interpreter may not
                return


def _stop_listening() -> None:
    for number in END_SIGNALS:
        if signal.getsignal(number) is _on_signal:
            signal.signal(number, signal.SIG_DFL)


def _on_signal(number: int, _: FrameType | None) -> None:
    """Unwinds the main thread, whose blocks then end what they run, and ends what other threads run."""
    if _notice_fork():
        # Nothing here is the child's. What is raised in the hooks of a fork would be lost, and the child go on.
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        return
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
    _notice_fork()
    _over.append(True)
    with DeferredSignals(lambda: False, _on_signal):
        for number, guard in reversed(list(_guards.items())):
            guard.end_for_others()
            _guards.pop(number, None)


def _end_the_rest() -> None:
    """Called last of all: what was armed when the interpreter had begun to call is not called by it."""
    _end_all()
    # Not before: until here, other threads finish what they began.
    end_of_program()


atexit.register(_end_the_rest)


def _forget() -> None:
    """In a forked child: the motors are the parent's, also where the child leaves the blocks that it was forked in."""
    _process[:] = [os.getpid()]
    for guard in _guards.values():
        guard.leave_alone()
    _guards.clear()
    _over.clear()
    begin_of_child()
    _stop_listening()


def _notice_fork() -> bool:
    """Whether this is a forked child that did not know it."""
    if _process == [os.getpid()]:
        return False
    _forget()
    return True


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
