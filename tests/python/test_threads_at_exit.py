"""Threads that are in the middle of a call when the interpreter ends do not crash it.

Python before 3.14 ends each thread that wants the GIL back then, wherever it stands. Where it stands is chance: each
program is run until it would have crashed with near certainty.
"""

from __future__ import annotations

import os

import pytest

from .ends import DEAD, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal")

LOOPING = """
bus = open_bus(retries=0)
{before}
sys.setswitchinterval(1e-6)

def ask():
    while True:
        try:
            bus.read({unit}, 0x2100)
        except drivebus.DrivebusError:
            pass

for _ in range({threads}):
    threading.Thread(target=ask, daemon=True).start()
time.sleep({wait})
"""


@pytest.mark.parametrize(
    ("kind", "unit", "before", "programs"),
    [
        ("serial.Serial", 1, "", 3),
        ("serial.Serial", DEAD, "", 3),
        ("spy", 1, "", 3),
        ("native", 1, "bus.close()", 8),
    ],
    ids=["answers", "none", "another object", "a closed bus"],
)
def test_a_program_ends_while_its_threads_ask(kind: str, unit: int, before: str, programs: int) -> None:
    for number in range(programs):
        body = LOOPING.format(before=before, unit=unit, threads=4, wait=number / 300)
        # pyserial sets parity on a pseudo-terminal once only.
        with line(kind) as there, there.start(body, timeout=0.05) as program:
            assert program.ends() == (0, [], "")


LAST = """
import atexit

@atexit.register
def last_of_all():
    {last}

"""


@pytest.mark.parametrize("kind", ["native", "serial.Serial"])
def test_the_main_thread_asks_to_the_very_end(kind: str) -> None:
    """What was registered before drivebus was imported is called after all that drivebus does."""
    last = LAST.format(
        last=f"""
    say(len(bus.read(1, 0x2100)))
    try:
        bus.read({DEAD}, 0x2100)
    except drivebus.NoAnswer:
        say("no answer")
    bus.close()
"""
    )
    with line(kind) as there, there.start("bus = open_bus()", timeout=0.05, before=last) as program:
        assert program.ends() == (0, ["1", "no answer"], "")


@pytest.mark.parametrize("kind", ["native", "serial.Serial"])
def test_another_thread_can_be_waited_for_to_the_very_end(kind: str) -> None:
    """Nothing that it holds stays held."""
    body = f"""
bus = open_bus(retries=0)
held, enough = threading.Lock(), threading.Event()

def ask():
    with held:
        while not enough.is_set():
            try:
                bus.read({DEAD}, 0x2100)
            except drivebus.DrivebusError:
                pass

asking = threading.Thread(target=ask, daemon=True)
asking.start()
"""
    last = LAST.format(last="enough.set(); asking.join(); say(held.locked())")
    with line(kind) as there, there.start(body, timeout=0.05, before=last) as program:
        assert program.ends() == (0, ["False"], "")


def test_a_child_that_is_forked_at_the_very_end_asks_as_before() -> None:
    last = LAST.format(
        last="""
    child = os.fork()
    if child:
        say(os.waitpid(child, 0)[1])
        return
    try:
        asking = threading.Thread(target=asks)
        asking.start()
        asking.join()
    finally:
        sys.stdout.flush()
        os._exit(0)
"""
    )
    body = """
bus = open_bus()

def asks():
    try:
        bus.read(1, 0x2100)
    except drivebus.DrivebusError as error:
        say(type(error).__name__)
"""
    with line("native") as there, there.start(body, before=last) as program:
        assert program.ends() == (0, ["PortError", "0"], "")
