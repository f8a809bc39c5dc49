"""From the first screen to the last motor: the panel runs, and whatever ends it, what it started is stopped.

A signal cannot wait for a screen that hangs, such as one whose terminal is gone. So a thread of its own stops the
motors, asks the screen to end, and ends the process where the screen does not.
"""

from __future__ import annotations

import _thread
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from types import FrameType

import drivebus
from drivebus.cli.panel.app import Panel
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.members import Member, opened
from drivebus.cli.panel.motors import stop_all, wait_for_all
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session
from drivebus.cli.signals import heeded
from drivebus.end_signals import END_SIGNALS

__all__ = ["Ended", "run"]

_PATIENCE = 1.0
"""Seconds that the screen is given to end after a signal, once the motors stand."""


@dataclass
class Ended:
    """How the panel ended.

    Attributes:
        signal: The signal that ended it; 0 for none.
        failures: Which drives it could not stop, and why.
        mistake: What nobody foresaw and ended it; None for nothing.
    """

    signal: int = 0
    failures: list[tuple[str, drivebus.DrivebusError]] = field(default_factory=list)
    mistake: Exception | None = None


def run(session: Session, watchdog: float | None) -> Ended:
    """Runs the panel to its end, and stops what it started.

    Raises:
        PortError: A port is not there, busy or not permitted; no screen was opened.
        NotAllowed: What drives these are, none of them said surely enough.
    """
    journal = Journal()
    with opened(session, journal, watchdog) as members:
        app = Panel(members, journal)
        ended = Ended()
        with _heeding_signals(app, ended), _heeding_threads(app):
            try:
                app.run(mouse=False)
            except Exception as error:  # a screen that could not even be opened
                app.fail(error)
            finally:
                _end(members)
        ended.failures = [
            (member.called, member.motor.failure) for member in members if member.motor.failure is not None
        ]
        if app.terminal_lost.is_set() and not ended.signal:
            ended.signal = getattr(signal, "SIGHUP", signal.SIGTERM)
        if isinstance(app.error, drivebus.DrivebusError):
            raise app.error
        ended.mistake = app.error
    return ended


def _end(members: Sequence[Member]) -> None:
    """Stops what was started, and waits until it is."""
    motors = [member.motor for member in members]
    turning = [motor.called for motor in motors if motor.started]
    stop_all(motors)
    if turning:
        # Whoever would read it may have gone.
        with suppress(OSError):
            remark(f"Stopping {', '.join(turning)} …")
    wait_for_all(motors)


@contextmanager
def _heeding_threads(app: Panel) -> Iterator[None]:
    """A block in which what nobody foresaw in a thread ends the screen, and is not written across it."""
    before = threading.excepthook

    def hook(failed: threading.ExceptHookArgs) -> None:
        if isinstance(failed.exc_value, Exception):
            app.fail(failed.exc_value)
            app.end_soon()

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


@contextmanager
def _heeding_signals(app: Panel, ended: Ended) -> Iterator[None]:
    """A block in which a signal stops the motors and ends the screen."""
    over = threading.Event()
    motors = [member.motor for member in app.members]

    def end() -> None:
        stop_all(motors)
        app.end_soon()
        wait_for_all(motors)
        if not over.wait(_PATIENCE):
            os._exit(128 + ended.signal)

    def on_signal(number: int, _: FrameType | None) -> None:
        first = not ended.signal
        ended.signal = ended.signal or number
        if first:
            # Not `threading`: its locks may be held by what this signal interrupted.
            _thread.start_new_thread(end, ())

    with heeded((signal.SIGINT, *END_SIGNALS), on_signal):
        try:
            yield
        finally:
            over.set()
