"""What a signal handler raises while a port of pyserial waits comes out as it is, and the port stays usable."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from .ends import DEAD, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill")

RAISED = """
class Raised(Exception):
    pass

raised = [TimeoutError("alarm"), SystemExit(7), KeyboardInterrupt(), Raised("mine")]

def handler(number, frame):
    raise raised[0]

signal.signal(signal.SIGALRM, handler)
with open_bus(retries=0, echo="no") as bus:
    say(bus.read(1, 0x2103))
    while raised:
        sys.stdin.readline()
        try:
            bus.read({dead}, 0x2100)
        except BaseException as error:
            say(type(error).__name__, error, error is raised.pop(0))
        say(bus.read(1, 0x2103))
"""


@pytest.mark.parametrize("kind", ["native", "serial.Serial", "spy", "rfc2217"])
def test_what_a_handler_raises_comes_out_as_it_is(kind: str) -> None:
    pause = threading.Event()
    with line(kind) as there, there.start(RAISED.format(dead=DEAD), timeout=30.0) as program:
        program.says("[416]")
        for said in ("TimeoutError alarm True", "SystemExit 7 True", "KeyboardInterrupt  True", "Raised mine True"):
            asked = there.asked(DEAD)
            program.goes_on()
            # It waits for an answer, for half a minute if nothing came in between.
            while there.asked(DEAD) == asked:
                pause.wait(0.001)
            program.child.send_signal(signal.SIGALRM)
            program.says(said, "[416]")
        assert program.ends() == (0, [], "")
