"""Every way in which a program may end while it runs a motor: the rows of docs/developers/ends.md, as programs.

Who judges looks at the drive: it was told to stop, or, where nobody is left to tell it, its own watchdog has acted.
`tools/measure_ends.py` runs them many times, on each kind of port.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass

from .ends import DEAD, STORM

SIGHUP = getattr(signal, "SIGHUP", signal.SIGTERM)
SIGALRM = getattr(signal, "SIGALRM", signal.SIGTERM)
SIGQUIT = getattr(signal, "SIGQUIT", signal.SIGTERM)
SIGKILL = getattr(signal, "SIGKILL", signal.SIGTERM)

BLOCK = """
{before}
with open_bus() as bus, bus.drive(1).running(10.0):
    say("running")
    {inside}
"""
GUARDED = """
{before}
with open_bus() as bus, bus.drive(1).watchdog(1.0, unverified=True), bus.drive(1).running(10.0):
    say("running")
    {inside}
"""
AWAITED = """
{before}
async def main():
    async with open_bus(drivebus.aio.Bus) as bus:
        drive = await bus.drive(1)
        async with drive.running(10.0):
            say("running")
            {inside}

asyncio.run(main())
"""
AWAITED_STORM = """
async def wait_for_the_dead(bus):
    while True:
        try:
            await bus.read({dead}, 0x2100)
        except drivebus.DrivebusError:
            pass

async def main():
    async with open_bus(drivebus.aio.Bus) as bus:
        drive = await bus.drive(1)
        async with drive.running(10.0):
            other = asyncio.create_task(wait_for_the_dead(bus))
            say("running")
            await asyncio.sleep(60)

asyncio.run(main())
"""
IN_A_THREAD = """
bus = open_bus()
drive = bus.drive(1)
begun = threading.Event()

def work():
    with drive.running(10.0):
        begun.set()
        {inside}

threading.Thread(target=work, daemon={daemon}).start()
begun.wait()
say("running")
{after}
"""
HANG = "while True: time.sleep(1)"
AWAITED_HANG = "await asyncio.sleep(60)"


@dataclass(frozen=True)
class Ending:
    """One way to end.

    Attributes:
        name: As in the page.
        body: The program.
        signals: What is sent to it once it runs the motor.
        code: What it exits with.
        watchdog: Whether only the drive itself is left to stop the motor.
        storm: Whether the other thread must have the line, for the dead unit, before the signals come.
    """

    name: str
    body: str
    code: int = 0
    signals: tuple[int, ...] = ()
    watchdog: bool = False
    storm: bool = False


def handler(number: str, body: str) -> str:
    """Sets a handler of the program's own."""
    return f"def handler(number, frame):\n    {body}\nsignal.signal(signal.{number}, handler)"


def storm(presses: int) -> Ending:
    """Ctrl-C again and again, beside a thread that waits for a dead unit."""
    return Ending(
        f"Ctrl-C, {presses} times", STORM.format(dead=DEAD), -signal.SIGINT, (signal.SIGINT,) * presses, storm=True
    )


def awaited_storm(presses: int) -> Ending:
    """The same for a task of an event loop."""
    return Ending(
        f"Ctrl-C, {presses} times",
        AWAITED_STORM.format(dead=DEAD),
        -signal.SIGINT,
        (signal.SIGINT,) * presses,
        storm=True,
    )


ENDINGS = (
    Ending("the block returns", BLOCK.format(before="", inside="pass")),
    Ending("an exception", BLOCK.format(before="", inside="raise RuntimeError"), 1),
    Ending("sys.exit", BLOCK.format(before="", inside="sys.exit(9)"), 9),
    Ending("Ctrl-C", BLOCK.format(before="", inside=HANG), -signal.SIGINT, (signal.SIGINT,)),
    storm(6),
    Ending("SIGTERM", BLOCK.format(before="", inside=HANG), 128 + signal.SIGTERM, (signal.SIGTERM,)),
    Ending("SIGHUP", BLOCK.format(before="", inside=HANG), 128 + SIGHUP, (SIGHUP,)),
    Ending(
        "SIGTERM, Ctrl-C ignored",
        BLOCK.format(before="signal.signal(signal.SIGINT, signal.SIG_IGN)", inside=HANG),
        128 + signal.SIGTERM,
        (signal.SIGINT, signal.SIGTERM),
    ),
    Ending(
        "SIGTERM ignored, then Ctrl-C",
        BLOCK.format(before="signal.signal(signal.SIGTERM, signal.SIG_IGN)", inside=HANG),
        -signal.SIGINT,
        (signal.SIGTERM, signal.SIGINT),
    ),
    Ending(
        "a handler of one's own that raises",
        BLOCK.format(before=handler("SIGALRM", "raise TimeoutError"), inside="while True: bus.read(9, 0x2100)"),
        1,
        (SIGALRM,),
    ),
    Ending(
        "a handler of one's own that does not",
        BLOCK.format(
            before="heard = []\n" + handler("SIGTERM", "heard.append(number)"),
            inside="while not heard: bus.sleep(0.01)",
        ),
        0,
        (signal.SIGTERM,),
    ),
    Ending("a thread goes on", IN_A_THREAD.format(daemon=False, inside="time.sleep(0.2)", after="")),
    Ending(
        "a thread goes on, sys.exit",
        IN_A_THREAD.format(daemon=False, inside="time.sleep(0.2)", after="sys.exit(9)"),
        9,
    ),
    Ending(
        "an exception in a thread",
        IN_A_THREAD.format(daemon=False, inside="time.sleep(0.2); raise RuntimeError", after=""),
    ),
    Ending("a daemon thread", IN_A_THREAD.format(daemon=True, inside=HANG, after="")),
    Ending(
        "a daemon thread, an exception",
        IN_A_THREAD.format(daemon=True, inside=HANG, after="raise RuntimeError"),
        1,
    ),
    Ending("a daemon thread, the bus closed", IN_A_THREAD.format(daemon=True, inside=HANG, after="bus.close()")),
    Ending(
        "a block that nobody left",
        'bus = open_bus()\nblock = bus.drive(1).running(10.0)\nblock.__enter__()\nsay("running")',
    ),
    Ending(
        "a generator that was thrown away",
        """
def blocks():
    with bus.drive(1).running(10.0):
        yield

bus = open_bus()
thrown = blocks()
next(thrown)
say("running")
del thrown
""",
    ),
    Ending(
        "a child is forked and ends",
        BLOCK.format(
            before="",
            inside="child = os.fork()\n    if not child:\n        sys.exit(7)\n    os.waitpid(child, 0)",
        ),
    ),
    Ending(
        "a child is spawned and ends",
        BLOCK.format(before="", inside='subprocess.run([sys.executable, "-c", "import drivebus"], check=True)'),
    ),
    Ending("kill -9", GUARDED.format(before="", inside=HANG), -SIGKILL, (SIGKILL,), watchdog=True),
    Ending("SIGQUIT", GUARDED.format(before="", inside=HANG), -SIGQUIT, (SIGQUIT,), watchdog=True),
    Ending("os._exit", GUARDED.format(before="", inside="os._exit(3)"), 3, watchdog=True),
    Ending(
        "os.exec",
        GUARDED.format(before="", inside='os.execv(sys.executable, [sys.executable, "-c", "raise SystemExit(4)"])'),
        4,
        watchdog=True,
    ),
)
"""Of `drivebus.Bus`, on whatever port."""

AWAITED_ENDINGS = (
    Ending("the block returns", AWAITED.format(before="", inside="pass")),
    Ending("an exception", AWAITED.format(before="", inside="raise RuntimeError"), 1),
    Ending("sys.exit", AWAITED.format(before="", inside="sys.exit(9)"), 9),
    Ending("Ctrl-C", AWAITED.format(before="", inside=AWAITED_HANG), -signal.SIGINT, (signal.SIGINT,)),
    awaited_storm(6),
    Ending("SIGTERM", AWAITED.format(before="", inside=AWAITED_HANG), 128 + signal.SIGTERM, (signal.SIGTERM,)),
    Ending("SIGHUP", AWAITED.format(before="", inside=AWAITED_HANG), 128 + SIGHUP, (SIGHUP,)),
    Ending(
        "the event loop is closed",
        AWAITED.format(before="", inside="asyncio.get_running_loop().stop(); await asyncio.sleep(60)"),
        1,
    ),
    Ending(
        "a daemon thread",
        """
begun = threading.Event()

async def main():
    bus = await open_bus(drivebus.aio.Bus)
    drive = await bus.drive(1)
    async with drive.running(10.0):
        begun.set()
        await asyncio.sleep(60)

threading.Thread(target=lambda: asyncio.run(main()), daemon=True).start()
begun.wait()
say("running")
""",
    ),
)
"""Of `drivebus.aio.Bus`."""
