"""Ctrl-C again and again while a motor is to be stopped, beside another thread that waits for a dead unit."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from .ends import DEAD, FORWARD, STOP, STORM, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a whole console")


@pytest.mark.parametrize(
    ("kind", "presses", "timeout"),
    [("native", 6, 2.0), ("native", 20, 0.2), ("serial.Serial", 6, 2.0), ("spy", 20, 1.0), ("socket", 2, 2.0)],
)
def test_a_storm_of_ctrl_c_stops_the_motor_once(kind: str, presses: int, timeout: float) -> None:
    pause = threading.Event()
    with line(kind) as there, there.start(STORM.format(dead=DEAD), timeout=timeout) as program:
        program.says("running")
        # The other thread has the line, for the dead unit.
        while not there.asked(DEAD):
            pause.wait(0.001)
        for _ in range(presses):
            program.child.send_signal(signal.SIGINT)
            pause.wait(0.02)
        code, _, said = program.ends()
        assert there.commands()[:2] == [FORWARD, STOP], said
        assert code == -signal.SIGINT, said
        assert said.endswith("KeyboardInterrupt\n"), said
