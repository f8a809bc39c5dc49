"""Ctrl-C while the main thread waits is a KeyboardInterrupt, at whichever moment it comes."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from itertools import count
from types import FrameType
from typing import Any

import pytest

from drivebus.latch import Latch

from .conftest import NO_PTY


def interrupted_at(moment: int, action: Callable[[], object]) -> bool:
    """Whether *action* came to its *moment*-th step, where Ctrl-C broke it off."""
    steps = count()

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        frame.f_trace_opcodes = True
        if event == "opcode" and next(steps) == moment:
            raise KeyboardInterrupt
        return trace

    # What a collection calls back is traced as well, and what breaks off there reaches nobody.
    gc.disable()
    sys.settrace(trace)
    try:
        action()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
        gc.enable()
    return False


def test_a_wait_that_is_broken_off_anywhere_raises_that_alone_and_keeps_nobody() -> None:
    for moment in count():
        latch = Latch()
        came = interrupted_at(moment, lambda latch=latch: latch.wait(0.0))  # type: ignore[misc]
        other = threading.Thread(target=latch.wait)
        other.start()
        latch.set()
        other.join()
        assert latch.wait()
        if not came:
            break
    assert moment > 10


def test_an_event_would_raise_something_else() -> None:
    def wait_broken_off_everywhere() -> None:
        moment = 0
        while interrupted_at(moment, lambda: threading.Event().wait(0.0)):
            moment += 1

    with pytest.raises(RuntimeError, match="release unlocked lock"):
        wait_broken_off_everywhere()


WAITS = """
import signal, threading
from drivebus.latch import Latch
threading.Thread(target=threading.Event().wait, daemon=True).start()
# The other thread takes the signal: the main thread has it to be served, and nothing wakes it, as when a signal comes
# between its last look and its wait.
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
try:
    print("waits", flush=True)
    Latch().wait()
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@NO_PTY
def test_a_signal_that_wakes_nobody_is_served_all_the_same() -> None:
    with subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        try:
            assert program.stdout.readline() == "waits\n"
            program.send_signal(signal.SIGINT)
            assert program.stdout.readline() == "interrupted\n"
        finally:
            program.kill()


def test_a_latch_that_is_not_closed_in_time_says_so() -> None:
    latch = Latch()
    assert not latch.wait(0.0)
    latch.set()
    assert latch.wait(0.0)
    assert latch.is_set()
