"""Programs that share a port with one that ends, each in a session of its own with all that it forks.

A program says a word, and goes on when it is told to. Its port is a `Workshop`, whose drive says what became of its
motor.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

from .endings import Ending
from .ends import DEAD, PRELUDE, Program
from .workshop import Workshop

ROLES = ("alone", "a guest", "the owner")
SAYS = """
def say(word):
    before_it_says()
    print(word, flush=True)
    sys.stdin.readline()

def before_it_says(): pass
"""
OTHER = """
with open_bus() as bus:
    say("open")
    say(bus.drive(1).state().name)
"""
"""Has the port open and asks for nothing, until it is told to look at the motor."""


@contextmanager
def program(shop: Workshop, text: str) -> Iterator[Program]:
    """One that runs."""
    child = subprocess.Popen(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", PRELUDE + SAYS + text, "native", shop.port, "1.0"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield Program(child)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.communicate()


@contextmanager
def other(shop: Workshop) -> Iterator[Program]:
    """One that has the port open, or comes in."""
    with program(shop, OTHER) as beside:
        beside.says("open")
        yield beside


@contextmanager
def in_its_place(shop: Workshop, text: str, role: str) -> Iterator[tuple[Program, Program | None]]:
    """A program that runs the motor, in its *role*, and who is beside it."""
    with ExitStack() as stack:
        beside = stack.enter_context(other(shop)) if role == "a guest" else None
        one = stack.enter_context(program(shop, text))
        one.says("running")
        if role == "the owner":
            beside = stack.enter_context(other(shop))
        yield one, beside


def end(shop: Workshop, one: Program, ending: Ending) -> None:
    """Has a program end that has said that it runs."""
    if ending.storm:
        one.goes_on()
        shop.wait_for(lambda said: said.kind == "frame" and said.what.startswith(f"{DEAD:02x}"))
    # To one that waits for the word to go on: a loop that is about to wait would hear them when that is over.
    for number in ending.signals:
        one.child.send_signal(number)
    if not ending.storm:
        with suppress(BrokenPipeError):  # it is gone already
            one.goes_on()


def goes_on(beside: Program) -> None:
    """Who is left is not held up, and sees the motor stand."""
    beside.goes_on()
    beside.says("STOPPED")
    beside.goes_on()
    assert beside.ends() == (0, [], "")


def unguarded(ending: Ending) -> str:
    """The program of *ending* without a watchdog, so that only another program is left to halt the drive."""
    return ending.body.replace("bus.drive(1).watchdog(1.0, unverified=True), ", "")
