"""Each way to end a program leaves no motor running: what the drive was told, and not what the program says.

All of them on a serial port; on the other kinds of port those that take another way there.
"""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

import pytest

from .endings import AWAITED_ENDINGS, ENDINGS, Ending
from .ends import DEAD, FORWARD, STOP, Line, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill")

PAGE = Path(__file__).parents[2] / "docs" / "developers" / "ends.md"
KINDS = ("serial.Serial", "spy", "rfc2217", "socket")
ELSEWHERE = ("Ctrl-C", "SIGTERM, Ctrl-C ignored", "a handler of one's own that raises", "a daemon thread")
BOTH = [
    *(pytest.param(ending, id=ending.name) for ending in ENDINGS),
    *(pytest.param(ending, id=f"awaited: {ending.name}") for ending in AWAITED_ENDINGS),
]


def judge(there: Line, ending: Ending) -> None:
    """Ends a program so, and looks at the drive."""
    pause = threading.Event()
    before = len(there.told())
    with there.start(ending.body, timeout=1.0) as program:
        program.says("running")
        while ending.storm and not there.asked(DEAD):
            pause.wait(0.001)
        for number in ending.signals:
            program.child.send_signal(number)
        code, _, said = program.ends()
    told = there.commands()[before:]
    if ending.watchdog:
        while there.runs_on():  # the limit is the test's own
            pause.wait(0.01)
        assert told == [FORWARD]
    else:
        assert told[0] == FORWARD
        assert told[1:]
        assert set(told[1:]) == {STOP}, said
    assert code == ending.code, said


@pytest.mark.parametrize("ending", BOTH)
def test_no_motor_is_left_running(ending: Ending) -> None:
    with line("native") as there:
        judge(there, ending)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ELSEWHERE)
def test_nor_on_another_kind_of_port(kind: str, name: str) -> None:
    with line(kind) as there:
        judge(there, next(ending for ending in ENDINGS if ending.name == name))


def test_the_page_has_each_of_them() -> None:
    rows = re.findall(r"^\| ([^|]+?) +\| ", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    named = {re.sub(r", \d+ times", ", again and again", ending.name) for ending in (*ENDINGS, *AWAITED_ENDINGS)}
    assert named <= {row.replace("`", "") for row in rows}
