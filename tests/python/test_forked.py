"""A forked child: its parent's bus tells it nothing, and keeps it waiting for nothing."""

from __future__ import annotations

import os
import sys

import pytest

from .ends import line

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="nobody forks here")

HAMMERED = """
bus = open_bus(retries=0)
over = threading.Event()

def hammer(call):
    while not over.is_set():
        call()

for call in (bus.stats, bus.stats, lambda: bus.configure(1, gap=0.0), lambda: bus.read(1, 0x2103)):
    threading.Thread(target=hammer, args=(call,), daemon=True).start()

hung = wrong = 0
for _ in range({forks}):
    child = os.fork()
    if not child:
        signal.alarm(2)  # ends one that hangs
        bus.configure(1, timeout=1.0)
        told = (bus.reconnects, bus.stats().requests, bus.closed)
        try:
            bus.read(1, 0x2103)
        except drivebus.PortError as error:
            told += (error.ended,)
        os._exit(0 if told == (0, 0, True, None) else 1)
    status = os.waitpid(child, 0)[1]
    hung += os.WIFSIGNALED(status)
    wrong += os.WIFEXITED(status) and os.WEXITSTATUS(status)
over.set()
say(hung, wrong)
"""


def test_nothing_hangs_in_a_child_whatever_other_threads_were_doing() -> None:
    with line("native") as there, there.start(HAMMERED.format(forks=200)) as program:
        assert program.ends(100) == (0, ["0 0"], "")


SLACK = """
import ctypes
PR_SET_TIMERSLACK, PR_GET_TIMERSLACK = 29, 30
prctl = ctypes.CDLL(None).prctl
prctl(PR_SET_TIMERSLACK, 77_000, 0, 0, 0)

def slack():
    return prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0)

with open_bus() as bus:
    bus.stats()
    say("asked for statistics", slack())
    bus.read(1, 0x2103)
    bus.sleep(0.01)
    say("waited", slack())
    child = os.fork()
    if not child:
        say("a child", slack())
        os._exit(0)
    os.waitpid(child, 0)
say("closed", slack())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has timer slack")
def test_a_thread_that_waited_has_its_slack_again_in_children_and_when_it_closed_the_bus() -> None:
    with line("native") as there, there.start(SLACK) as program:
        said = ["asked for statistics 77000", "waited 1", "a child 77000", "closed 77000"]
        assert program.ends() == (0, said, "")
