"""The rows about late answers, writes and idle clients: what the slave does, what clients ask, and how that ended.

Each row runs one gateway before a slave of its own. What is true comes from the slave: register *a* holds *a*, and its
log has every write that was carried out.
"""

from __future__ import annotations

import socket
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from .. import wire
from ..rows import LUMP
from ..slave import Behaviour, Reaction, Slave, ordinary
from ..verdict import ERROR, RIGHT, WRONG
from .programs import TIMEOUT, WRITTEN, Gateway
from .strict import NONE, Client, Tally

PATIENCE = 0.8
"""Seconds until a client goes on: more than the line's time-out, less than some gateways need for all their tries."""
LONG = 10.0
"""Seconds of a client that waits for whatever its gateway does."""
PAUSE = 0.1
"""Seconds between two turns of a row in which each turn stands alone: what was late in one is over by then."""
ONE_IN = 10
APART = 0.03  # seconds between a late answer and the next one: no gateway takes both for one frame
FIRST, SECOND = 100, 5000
"""Where the registers begin that one client reads, those of the other, and those that are written."""


@dataclass(frozen=True)
class Cell:
    """What a row found of one gateway."""

    text: str
    wrong: int = 0
    """What must not be, however often: wrong answers, writes that nobody should have got, clients without an answer."""
    tally: Tally | None = None


Play = Callable[[Slave, str, int], Cell]
"""Asks the gateway at HOST:PORT as often as the number says."""


@dataclass(frozen=True)
class Row:
    """One row of the table: its key, what happens, what must come of it, how often, and how it is played."""

    key: str
    name: str
    must: str
    times: int
    play: Play
    behaviour: Callable[[], Behaviour] = lambda: ordinary


def played(row: Row, gateway: Gateway, times: int | None = None) -> Cell:
    """One row with one gateway, before a slave that nobody asked yet."""
    with tempfile.TemporaryDirectory() as folder, Slave(Path(folder)) as slave, gateway.before(slave.port) as address:
        with Client(address, LONG) as client:
            client.read(1)
        slave.gap = APART
        slave.behaviour = row.behaviour()
        return row.play(slave, address, times or row.times)


def ends(tally: Tally) -> str:
    """Right / wrong / error / none."""
    return " / ".join(str(tally.ends[kind]) for kind in (RIGHT, WRONG, ERROR, NONE))


def _cell(tally: Tally) -> Cell:
    return Cell(ends(tally), tally.ends[WRONG], tally)


# --- what the slave does ------------------------------------------------------------------------------------


def _every_tenth(reaction: Callable[[bytes], Reaction]) -> Behaviour:
    """Of the reads that nobody asked before, each tenth."""
    count = 0

    def behave(request: wire.Request, before: int, reply: bytes) -> Reaction | None:
        nonlocal count
        if request.function != wire.READ or before:
            return None
        count += 1
        return None if count % ONE_IN else reaction(reply)

    return behave


def late() -> Behaviour:
    """One answer in ten comes when something else is asked, just before the answer to that."""
    return _every_tenth(lambda reply: Reaction([(0.0, reply)], held=True, past_repeats=True))


def silent_then_late() -> Behaviour:
    """A read of the first client's registers is not answered, nor are its repeats, until something else is asked."""

    def behave(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
        if request.function == wire.READ and FIRST <= request.address < SECOND:
            return Reaction([(0.0, reply)], held=True, past_repeats=True)
        return None

    return behave


def in_place() -> Behaviour:
    """One answer in ten comes when something else is asked, and the answer to that never."""
    owed: list[wire.Request] = []
    tenth = late()

    def behave(request: wire.Request, before: int, reply: bytes) -> Reaction | None:
        if owed and request != owed[0]:
            owed.clear()
            return Reaction()
        reaction = tenth(request, before, reply)
        if reaction is not None:
            owed.append(request)
        return reaction

    return behave


def stalled(apart: float) -> Callable[[], Behaviour]:
    """One answer in ten comes in pieces of four bytes."""

    def pieces(reply: bytes) -> Reaction:
        return Reaction([(apart if at else 0.0, reply[at : at + LUMP]) for at in range(0, len(reply), LUMP)])

    return lambda: _every_tenth(pieces)


def lost_confirmations() -> Behaviour:
    """A write is carried out, and its answer never comes."""
    return lambda request, _before, _reply: Reaction() if request.function == wire.WRITE else None


def slow_reads() -> Behaviour:
    """A read of the first client's registers takes more than half of the time-out."""

    def behave(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
        if request.function == wire.READ and FIRST <= request.address < SECOND:
            return Reaction([(0.6 * TIMEOUT, reply)])
        return None

    return behave


# --- what the clients ask -----------------------------------------------------------------------------------


def two_clients(_: Slave, address: str, times: int) -> Cell:
    """Two at once, each reads registers of its own, and goes on when its patience ends."""

    def one(first: int) -> Tally:
        with Client(address, PATIENCE) as client:
            for at in range(first, first + times):
                client.read(at)
            client.listen(PATIENCE)
            return client.tally

    with ThreadPoolExecutor(2) as clients:
        tallies = list(clients.map(one, (FIRST, SECOND)))
    return _cell(tallies[0] + tallies[1])


def one_after_the_other(_slave: Slave, address: str, times: int) -> Cell:
    """One reads what the unit is silent about, which is an error at best; then the other reads."""
    with Client(address, LONG) as first, Client(address, LONG) as second:
        for turn in range(times):
            first.read(FIRST + turn)
            second.read(SECOND + turn)
            time.sleep(PAUSE)
        first.listen(PATIENCE)
        return _cell(first.tally + second.tally)


def old_value(slave: Slave, address: str, times: int) -> Cell:
    """The unit is silent on a register, whose value changes then; the old one comes first when it is asked again."""
    owed: list[bytes] = []
    silent = threading.Event()

    def behave(request: wire.Request, _before: int, reply: bytes) -> Reaction | None:
        if not request.is_read(FIRST):
            return None
        if silent.is_set():
            owed.append(reply)
            return Reaction()
        late = [(0.0, each) for each in owed[-1:]]
        owed.clear()
        return Reaction([*late, (APART, reply)])

    slave.behaviour = behave
    with Client(address, LONG) as first, Client(address, LONG) as second:
        for turn in range(times):
            silent.set()
            first.read(FIRST)
            slave.change(FIRST, FIRST + 1 + turn)
            silent.clear()
            second.read(FIRST, values=[FIRST + 1 + turn])
            time.sleep(PAUSE)
        return _cell(second.tally)


def writes(slave: Slave, address: str, times: int) -> Cell:
    """Writes, one after the other, each another value: how often was each carried out?"""
    with Client(address, LONG) as client:
        said = {client.write(WRITTEN[turn], turn) for turn in range(times)}
    slave.settle()
    often = sorted({slave.log.written(WRITTEN[turn], turn) for turn in range(times)})
    told = ", ".join(sorted(end.detail or end.kind for end in said))
    carried = (
        {1: "once"}.get(often[-1], f"{often[-1]} times") if len(often) == 1 else f"{often[0]} to {often[-1]} times"
    )
    return Cell(f"{carried}; told {told}", wrong=sum(often[-1:]) > 1)


def hangs_up(slave: Slave, address: str, times: int) -> Cell:
    """One has the line; a write of another waits behind it, and its client hangs up. Is it sent afterwards?"""
    with Client(address, LONG) as first, ThreadPoolExecutor(1) as beside:
        for turn in range(times):
            reading = beside.submit(first.read, FIRST + turn)
            _is_asked(slave, FIRST + turn)
            with Client(address, 0.2 * TIMEOUT) as writer:
                writer.write(WRITTEN[turn], turn)
            reading.result()
            first.read(SECOND + turn)
            slave.settle()
    sent = sum(slave.log.written(WRITTEN[turn], turn) > 0 for turn in range(times))
    return Cell(f"{sent} of {times} are sent", wrong=sent)


def beside_idle_ones(_slave: Slave, address: str, times: int) -> Cell:
    """Some are connected and say nothing, some have sent half a header; another one reads."""
    host, _, port = address.rpartition(":")
    idle = [socket.create_connection((host, int(port))) for _ in range(8)]
    for each in idle[::2]:
        each.sendall(b"\x00\x01\x00")
    time.sleep(0.1)
    with Client(address, LONG) as client:
        for turn in range(times):
            client.read(FIRST + turn)
        tally = client.tally
    for each in idle:
        each.close()
    return replace(_cell(tally), wrong=times - tally.ends[RIGHT])


def _is_asked(slave: Slave, register: int) -> None:
    """Waits until *register* is read, for a second at most: a gateway may not send it at all."""
    end = time.monotonic() + 1.0
    while not any(request.is_read(register) for request in slave.log.requests[-4:]) and time.monotonic() < end:
        time.sleep(0.002)


def long_reads(_: Slave, address: str, times: int) -> Cell:
    """One client reads 16 registers at a time."""
    with Client(address, LONG) as client:
        for turn in range(times):
            client.read(FIRST + turn, 16)
        return _cell(client.tally)


RIGHT_ONES = "all right"
NOT_WRONG = "none wrong"
HALF_RIGHT = "half right, none wrong"

NAMES = {
    "late-answers": "one answer in ten comes when another register is asked, before the answer to that",
    "silent-then-late": "the unit is silent on a client through all tries, and answers when the other client asks",
    "old-value": "the unit is silent on a register through all tries; asked again, it says the old value, then the new",
    "in-place": "one answer in ten comes in place of the answer to the next register",
    "lumps": "one answer in ten of 37 bytes comes in pieces of 4, 16 ms apart",
    "stalled": "the same, 300 ms apart",
    "lost-confirmation": "a write (06H) is carried out and its answer is lost: it is carried out",
    "hung-up": "a write waits while another client has the line, and its client hangs up",
    "idle": "4 clients say nothing, and 4 have sent half a header: reads of another one",
}


def _row(key: str, must: str, times: int, play: Play, behaviour: Callable[[], Behaviour] = lambda: ordinary) -> Row:
    return Row(key, NAMES[key], must, times, play, behaviour)


ROWS: Sequence[Row] = (
    _row("late-answers", NOT_WRONG, 200, two_clients, late),
    _row("silent-then-late", HALF_RIGHT, 100, one_after_the_other, silent_then_late),
    _row("old-value", NOT_WRONG, 50, old_value),
    _row("in-place", NOT_WRONG, 200, two_clients, in_place),
    _row("lumps", RIGHT_ONES, 100, long_reads, stalled(0.016)),
    _row("stalled", NOT_WRONG, 100, long_reads, stalled(0.3)),
    _row("lost-confirmation", "once", 20, writes, lost_confirmations),
    _row("hung-up", "not sent", 100, hangs_up, slow_reads),
    _row("idle", RIGHT_ONES, 50, beside_idle_ones),
)
