"""Once the end of the program has begun no block starts a motor, whoever begins it, and whenever."""

from __future__ import annotations

import os

import pytest

from .ends import FORWARD, STOP, line

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal")

IN_A_THREAD = """
bus = open_bus()
drive = bus.drive(1)
{before}
ending, told = threading.Event(), threading.Event()

def begin_a_block():
    ending.wait()
    try:
        with drive.running(10.0):
            say("it runs")
            told.set()
            threading.Event().wait()
    except drivebus.NotAllowed as error:
        say(str(error).partition(":")[0])
        told.set()

threading.Thread(target=begin_a_block, daemon=True).start()

@atexit.register
def while_it_ends():
    ending.set()
    told.wait()
"""

IN_AN_EVENT_LOOP = """
{before}
ending, told = threading.Event(), threading.Event()

async def begin_a_block():
    bus = await open_bus(drivebus.aio.Bus)
    drive = await bus.drive(1)
    told.set()
    while not ending.is_set():
        await asyncio.sleep(0.001)
    try:
        async with drive.running(10.0):
            say("it runs")
            told.set()
            await asyncio.Event().wait()
    except drivebus.NotAllowed as error:
        say(str(error).partition(":")[0])
        told.set()

threading.Thread(target=lambda: asyncio.run(begin_a_block()), daemon=True).start()
told.wait()
told.clear()

@atexit.register
def while_it_ends():
    ending.set()
    told.wait()
"""

ONE_BEFORE = """
with open_bus() as other, other.drive(1).running(10.0):
    pass
"""


@pytest.mark.parametrize("where", [IN_A_THREAD, IN_AN_EVENT_LOOP], ids=["thread", "event loop"])
def test_a_block_that_begins_while_callbacks_at_exit_are_called_is_ended(where: str) -> None:
    """Nobody had a block before, so what ends them is called last."""
    with line("native") as there, there.start(where.format(before="")) as program:
        assert program.ends() == (0, ["it runs"], "")
        assert there.commands() == [FORWARD, STOP]


AFTER = {
    # It is called after what ends blocks: that was registered before.
    IN_A_THREAD: IN_A_THREAD.replace("{before}", "").replace("@atexit.register", "@first_of_all"),
    IN_AN_EVENT_LOOP: IN_AN_EVENT_LOOP.replace("{before}", "").replace("@atexit.register", "@first_of_all"),
}
REGISTERED_FIRST = """
callbacks = []

@atexit.register
def call():
    for callback in callbacks:
        callback()

first_of_all = callbacks.append
"""


@pytest.mark.parametrize("where", AFTER, ids=["thread", "event loop"])
def test_a_block_that_begins_later_is_refused(where: str) -> None:
    body = REGISTERED_FIRST + ONE_BEFORE + AFTER[where]
    with line("native") as there, there.start(body) as program:
        assert program.ends() == (0, ["the program is ending, and nobody could stop the motor"], "")
        assert there.commands() == [FORWARD, STOP], "of the block before"


AT_ANY_MOMENT = """
bus = open_bus()
drive = bus.drive(1)
begun = threading.Event()

def begin_blocks():
    while True:
        try:
            with drive.running(10.0, confirm=0):
                begun.set()
        except drivebus.NotAllowed:
            return

threading.Thread(target=begin_blocks, daemon=True).start()
begun.wait()
{wait}
"""


@pytest.mark.parametrize("wait", [0.0, 0.02, 0.04])
def test_a_program_that_ends_at_any_moment_leaves_no_motor_running(wait: float) -> None:
    with line("native") as there, there.start(AT_ANY_MOMENT.format(wait=f"time.sleep({wait})")) as program:
        code, _, said = program.ends()
        # On a busy machine the answer to what it sent last may be late, which is told.
        assert code == 0
        assert said == "" or "no answer within" in said
        assert there.commands()[-1] == STOP
