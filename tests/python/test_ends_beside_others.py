"""Each row of docs/developers/ends.md where the port is shared, and where the program has forked: no motor runs on.

A real program on a pseudo-terminal, whose drive has a process and a motor of its own (`workshop`), ends in each of
these ways: alone, as a guest of another program, as the one that has the port with a guest beside it, and with a child
that lives on, forked before the bus was opened or while the motor ran. `make test` runs every seventh case,
`DRIVEBUS_MATRIX=all` all of them.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import pytest

import drivebus

from .beside import ROLES, end, goes_on, in_its_place, unguarded
from .endings import AWAITED_ENDINGS, ENDINGS, Ending
from .workshop import Said, Workshop

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill"),
    pytest.mark.usefixtures("folder"),
]

STEP = 1 if os.environ.get("DRIVEBUS_MATRIX") == "all" else 7
FORKS = {
    "os.fork": """
def fork():
    if not os.fork():
        while True: signal.pause()
""",
    "multiprocessing": """
import multiprocessing
def work():
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # by which it is ended, and waited for
    time.sleep(1000)
def fork():
    multiprocessing.get_context("fork").Process(target=work, daemon=True).start()
""",
    "subprocess": """
def fork():
    global child
    child = subprocess.Popen(["sleep", "1000"], close_fds=False)
""",
    # Python is not told of this one.
    "fork of C": """
import ctypes
def fork():
    libc = ctypes.CDLL(None)
    if not libc.fork():
        while True: libc.pause()
""",
}


class Case(NamedTuple):
    """One row of the page, and what is beside it."""

    ending: Ending
    role: str
    how: str = ""
    """Who forks."""
    when: str = ""

    def __str__(self) -> str:
        return ", ".join(filter(None, (self.ending.name, self.role, self.how, self.when)))

    @property
    def program(self) -> str:
        body = self.ending.body if self.role == "alone" else unguarded(self.ending)
        if self.when == "before":
            return f"{FORKS[self.how]}fork()\n{body}"
        return f"{FORKS[self.how]}before_it_says = fork\n{body}" if self.when else body


def cases() -> Iterator[Case]:
    """All of them."""
    awaited = (replace(ending, name=f"awaited: {ending.name}") for ending in AWAITED_ENDINGS)
    for row, ending in enumerate((*ENDINGS, *awaited)):
        yield from (Case(ending, role) for role in ROLES)
        forks = itertools.product(FORKS, ("before", "running"))
        for number, (how, when) in enumerate(forks if ending in ENDINGS else ()):
            roles = ROLES[1:] if ending.watchdog else (ROLES[(row + number) % len(ROLES)],)
            yield from (Case(ending, role, how, when) for role in roles)


def stands(said: Said) -> bool:
    return said.kind == "stands"


@pytest.mark.parametrize("case", [*cases()][::STEP], ids=str)
def test_no_motor_is_left_running(case: Case) -> None:
    shop = Workshop()
    try:
        judge(shop, case)
    finally:
        shop.close()


def judge(shop: Workshop, case: Case) -> None:
    """Ends a program so, and looks at the drive, and at who is left."""
    ending = case.ending
    with in_its_place(shop, case.program, case.role) as (one, beside):
        ran = shop.wait_for(lambda said: said.kind == "runs").at
        end(shop, one, ending)
        assert one.child.wait(timeout=60) == ending.code
        stood = shop.wait_for(stands, ran)
        assert (stood.what == "time-out") == (ending.watchdog and beside is None), stood
        # Nobody waits for ever: not who is left, and not who comes while a child lives on.
        if beside is not None:
            goes_on(beside)
        with drivebus.Bus(shop.port, timeout=1.0) as bus:
            assert bus.drive(1).state() is drivebus.State.STOPPED
        assert not [said for said in shop.said if said.kind == "runs" and said.at > stood.at]
