"""Ctrl-Z: a command that is held gives its ports up first, so that others can use the line and stop its motors."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import drivebus

__all__ = ["gives_way_when_held"]


@contextmanager
def gives_way_when_held(buses: Callable[[], Sequence[drivebus.Bus]]) -> Iterator[None]:
    """A block that Ctrl-Z holds as always, but for its ports: each of *buses* gives its own up first.

    Where somebody else decides what Ctrl-Z does, as a panel or a shell without job control, that stays.
    """
    if sys.platform == "win32" or not _is_ours():
        yield
    else:
        signal.signal(signal.SIGTSTP, _holder(buses))
        try:
            yield
        finally:
            signal.signal(signal.SIGTSTP, signal.SIG_DFL)


if sys.platform != "win32":

    def _holder(buses: Callable[[], Sequence[drivebus.Bus]]) -> Callable[..., None]:
        """What Ctrl-Z does in `gives_way_when_held`."""

        def hold(*_: object) -> None:
            # Not here: this thread may have the line, and has to go on to give it up.
            threading.Thread(target=_hold, args=(list(buses()),), name="drivebus-held", daemon=True).start()

        return hold

    def _is_ours() -> bool:
        is_main = threading.current_thread() is threading.main_thread()
        return is_main and signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL

    def _hold(buses: list[drivebus.Bus]) -> None:
        """Holds this program while it has none of the ports."""
        if buses:
            buses.pop().step_aside(lambda: _hold(buses))
        else:
            os.kill(os.getpid(), signal.SIGSTOP)
