"""What a signal handler raises while a port of pyserial waits comes out as it is, and the port stays usable."""

from __future__ import annotations

import os
import signal

import pytest

from .ends import FORWARD, STOP, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill")

PORTS = ("native", "serial.Serial", "spy", "rfc2217")

RAISED = """
class Raised(Exception):
    pass

def handler(number, frame):
    raise {what}

signal.signal(signal.SIGALRM, handler)
with open_bus(retries=0, echo="no") as bus:
    say(bus.read(1, 0x2103))
    for _ in range(5):
        threading.Thread(target=lambda: (time.sleep(0.1), os.kill(os.getpid(), signal.SIGALRM))).start()
        try:
            bus.read(9, 0x2100)
        except BaseException as error:
            say(type(error).__name__, error)
        say(bus.read(1, 0x2103))
"""


@pytest.mark.parametrize("kind", PORTS)
@pytest.mark.parametrize(
    ("what", "said"),
    [
        ('TimeoutError("alarm")', "TimeoutError alarm"),
        ("SystemExit(7)", "SystemExit 7"),
        ("KeyboardInterrupt()", "KeyboardInterrupt "),
        ('Raised("mine")', "Raised mine"),
    ],
)
def test_what_a_handler_raises_comes_out_as_it_is(kind: str, what: str, said: str) -> None:
    with line(kind) as there, there.start(RAISED.format(what=what), timeout=30.0) as program:
        assert program.ends() == (0, ["[416]", *[said, "[416]"] * 5], "")


BLOCK = """
signal.signal(signal.SIGINT, signal.SIG_IGN)
def alarm(number, frame):
    raise TimeoutError("alarm")
signal.signal(signal.SIGALRM, alarm)
with open_bus() as bus:
    with bus.drive(1).running(10.0):
        say("running")
        while True:
            bus.read(9, 0x2100)
"""


@pytest.mark.parametrize("kind", PORTS)
def test_sigterm_stops_the_motor_where_ctrl_c_is_ignored(kind: str) -> None:
    with line(kind) as there, there.start(BLOCK, timeout=30.0) as program:
        program.says("running")
        program.child.send_signal(signal.SIGINT)
        program.child.send_signal(signal.SIGTERM)
        assert program.ends() == (128 + signal.SIGTERM, [], "")
        assert there.commands() == [FORWARD, STOP]


@pytest.mark.parametrize("kind", PORTS)
def test_an_alarm_stops_the_motor(kind: str) -> None:
    with line(kind) as there, there.start(BLOCK, timeout=30.0) as program:
        program.says("running")
        program.child.send_signal(signal.SIGALRM)
        code, _, said = program.ends()
        assert there.commands() == [FORWARD, STOP]
        assert code == 1
        assert said.endswith("TimeoutError: alarm\n")
