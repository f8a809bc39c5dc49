"""The rows about one exchange or a few: what the slave does, what the library is asked, and what of that is judged.

The slave knows what was asked of it and keeps a log, so "written twice" and "confirmed but not written" are decided
there.
"""

from __future__ import annotations

import statistics
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from . import wire
from .child import Child, Outcome
from .slave import UNIT, Behaviour, Reaction, Slave, ordinary
from .verdict import ERROR, HUNG, RIGHT, WRONG, Verdict, of_read, of_write

OTHER_VALUE = 0xBAD
APART = 0.020  # seconds between a foreign frame and the reply
LUMP, LUMP_EVERY = 4, 0.016  # bytes and seconds, as USB adapters deliver
THREADS, READS = 3, 60
ABSENT = 0.5  # seconds without the port

Play = Callable[[Slave, Child], Verdict]


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Args:
        key: What it is called in tests.
        name: What happens on the line.
        play: Asks the library and judges how that ended.
        behaviour: What the slave does.
        must: What drivebus must do: `right`, or the names of the errors that tell the truth.
        fresh: Nothing was asked on this port before.
        retries: None for each library's own default.
        echo: The adapter hands back what it sends.
    """

    key: str
    name: str
    play: Play
    behaviour: Behaviour = ordinary
    must: str | tuple[str, ...] = RIGHT
    fresh: bool = False
    retries: int | None = 0
    echo: bool = False


def read(address: int, count: int = 1) -> Play:
    return lambda _, child: of_read(child.read(address, count), address, count)


def late_then_read(first: int, second: int) -> Play:
    """A read of 100 whose reply is late, then a read of 200. Judged is the second."""

    def play(_: Slave, child: Child) -> Verdict:
        child.read(100, first)
        return of_read(child.read(200, second), 200, second)

    return play


def overtaken_then_read(_: Slave, child: Child) -> Verdict:
    """A read of 100 whose reply is late, a read of two that is answered, then a read of 200: judged is that."""
    child.read(100)
    child.read(300, 2)
    return of_read(child.read(200), 200, 1)


def queued_then_read(slave: Slave, child: Child) -> Verdict:
    child.read(100)
    slave.release()
    return of_read(child.read(200), 200, 1)


def stale_at_first_contact(_: Slave, child: Child) -> Verdict:
    return of_read(child.read(200), 200, 1)


def late_then_write(slave: Slave, child: Child) -> Verdict:
    child.write(100, 5)
    outcome = child.write(200, 6)
    return of_write(outcome, 200, 6, slave.log.written(200, 6))


def late_write(slave: Slave, child: Child) -> Verdict:
    outcome = child.write(100, 5)
    slave.release()
    return of_write(outcome, 100, 5, slave.log.written(100, 5))


def write(slave: Slave, child: Child) -> Verdict:
    outcome = child.write(200, 6)
    return of_write(outcome, 200, 6, slave.log.written(200, 6))


def broadcast(slave: Slave, child: Child) -> Verdict:
    outcome = child.order("broadcast", [100, 7])
    slave.settle()
    return of_write(outcome, 100, 7, slave.log.written(100, 7))


def refusal(_: Slave, child: Child) -> Verdict:
    ends = [child.read(9999) for _ in range(5)]
    if any(each.hung for each in ends):
        return Verdict(HUNG, "", child.bound)
    if any(each.returned for each in ends):
        return Verdict(WRONG, "no error", ends[0].seconds)
    return Verdict(ERROR, ends[0].error or "", statistics.median(each.seconds for each in ends))


def in_threads(_: Slave, child: Child) -> Verdict:
    outcome: Outcome = child.order("threads", [THREADS, READS], bound=THREADS * READS * 0.5)
    if not outcome.returned:
        return Verdict(HUNG if outcome.hung else ERROR, outcome.error or "", outcome.seconds)
    ends: dict[str, int] = outcome.result
    total = THREADS * READS
    if wrong := ends.get(WRONG, 0):
        return Verdict(WRONG, f"{wrong} of {total}", outcome.seconds)
    errors = {end: count for end, count in ends.items() if end.startswith(ERROR)}
    if errors:
        names = ", ".join(sorted(name.removeprefix("error: ") for name in errors))
        return Verdict(ERROR, f"{names}, {sum(errors.values())} of {total}", outcome.seconds)
    return Verdict(RIGHT, "", outcome.seconds)


def vanished(slave: Slave, child: Child) -> Verdict:
    slave.vanish()
    back = threading.Timer(ABSENT, slave.appear)
    back.start()
    verdict = of_read(child.read(200), 200, 1)
    back.join()
    return verdict


# --- what the slave does ------------------------------------------------------------------------------------


def late(request: wire.Request, before: int, reply: bytes) -> Reaction | None:
    """The first reply about 100 goes out when the next request is in, whatever that asks."""
    if before == 0 and (request.is_read(100) or request.is_write(100)):
        return Reaction([(0.0, reply)], held=True)
    return None


def overtaken(request: wire.Request, before: int, reply: bytes) -> Reaction | None:
    """The first reply about 100 is passed by others and goes out when 200 is read."""
    if before == 0 and request.is_read(100):
        return Reaction([(0.0, reply)], held=True, until=200)
    return None


def late_and_lost(request: wire.Request, before: int, reply: bytes) -> Reaction | None:
    """The same, and the write of 200 never reaches the unit."""
    return Reaction(lost=True) if request.is_write(200) else late(request, before, reply)


def lost_writes(request: wire.Request, _before: int, _reply: bytes) -> Reaction | None:
    return Reaction(lost=True) if request.is_write(200) else None


def around(before: bytes, after: bytes) -> Behaviour:
    """Every reply about 200 has bytes beside it."""

    def behave(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
        return Reaction([(0.0, before + reply + after)]) if request.is_read(200) else None

    return behave


def short(request: wire.Request, _before: int, _reply: bytes) -> Reaction | None:
    """One register where two were asked for."""
    if request.is_read(200) and request.count == 2:
        return Reaction([(0.0, wire.read_reply(UNIT, [200]))])
    return None


def foreign(unit: int, function: int) -> Behaviour:
    """A valid frame that is not the answer, then the answer."""

    def behave(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
        if not request.is_read(200):
            return None
        other = wire.read_reply(unit, [OTHER_VALUE] * request.count, function)
        return Reaction([(0.0, other), (APART, reply)])

    return behave


def refuses(request: wire.Request, _before: int, _reply: bytes) -> Reaction | None:
    if request.is_read(9999):
        return Reaction([(0.0, wire.exception(request, wire.ILLEGAL_ADDRESS))])
    return None


def in_lumps(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
    if not request.is_read(200):
        return None
    pieces = [reply[at : at + LUMP] for at in range(0, len(reply), LUMP)]
    return Reaction([(LUMP_EVERY if number else 0.0, piece) for number, piece in enumerate(pieces)])


NOT_KNOWN = ("NoAnswer", "Unconfirmed")  # of a write that went out: the caller is told that it may have happened

ROWS: Sequence[Row] = (
    Row("late reply", "read 100 times out; its reply comes during read 200", late_then_read(1, 1), late),
    Row("late, other length", "the same, read 100 asks for two registers", late_then_read(2, 1), late),
    Row(
        *("late write", "write 100=5 times out, its reply comes during write 200=6, which the unit carries out"),
        *(late_then_write, late),
    ),
    Row(
        *("late write, next lost", "the same, but write 200=6 does not reach the unit"),
        *(late_then_write, late_and_lost),
        must=NOT_KNOWN,
    ),
    Row("late, queued", "read 100 times out; its reply waits in the port before read 200", queued_then_read, late),
    Row(
        *("overtaken", "read 100 times out; other requests are answered, then its reply comes during read 200"),
        *(overtaken_then_read, overtaken),
    ),
    Row(
        *("first contact", "port just opened; the reply to another program's read of 100 comes during read 200"),
        stale_at_first_contact,
        fresh=True,
    ),
    Row("00 before", "one 00 before the reply", read(200, 2), around(b"\x00", b"")),
    Row("FF before", "one FF before the reply", read(200, 2), around(b"\xff", b"")),
    Row("00 after", "one 00 after the reply", read(200, 2), around(b"", b"\x00")),
    Row("short", "reply with one register, two asked for, CRC good", read(200, 2), short, must=("BadAnswer",)),
    Row("function 04", "a reply with function 04 to the 03 request, then the reply", read(200, 2), foreign(UNIT, 4)),
    Row("other unit", "a reply from unit 2, then the reply", read(200, 2), foreign(2, wire.READ)),
    Row("exception", "exception 02: time until the call ends", refusal, refuses, must=("Refused",)),
    Row("lumps", "reply in pieces of 4 bytes, 16 ms apart", read(200, 16), in_lumps),
    Row("threads", f"{THREADS} threads, each {READS} reads, on one port", in_threads),
    Row(
        "port vanishes",
        "a read while the port is away for 0.5 s; it returns under another name behind its link",
        vanished,
        must=("PortError",),
    ),
    Row("broadcast", "broadcast write", broadcast),
    Row("echo, read", "the adapter hands back what it sends: a read", read(200, 2), echo=True),
    Row(
        "echo, lost write",
        "the same: a write that does not reach the unit",
        write,
        lost_writes,
        must=NOT_KNOWN,
        echo=True,
    ),
    Row(
        "late, default retries",
        "default retries: a read whose first reply comes during the next request",
        read(100),
        late,
        retries=None,
    ),
    Row(
        "overtaken, default retries",
        "default retries: read 100 is repeated and answered; the reply to its first request comes during read 200",
        overtaken_then_read,
        overtaken,
        retries=None,
    ),
    Row(
        *("late write, default retries", "default retries: a write whose reply comes during the next request"),
        *(late_write, late),
        must=NOT_KNOWN,
        retries=None,
    ),
)
