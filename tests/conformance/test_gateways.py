"""drivebus's gateway through every row, and the client that judges by what it must find wrong."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable

import pytest

if os.name == "nt":
    pytest.skip("no pty", allow_module_level=True)

from . import wire
from .gateways import crowd, crowd_clients
from .gateways.measure import Column, names, spoilt
from .gateways.programs import GATEWAYS, OURS
from .gateways.report import NOT_HERE, replaced, section
from .gateways.rows import ROWS, Row, played
from .gateways.strict import NONE, Client, End
from .verdict import ERROR, RIGHT, WRONG

Answer = Callable[[int, int, bytes], bytes]
"""What a gateway sends, given transaction, unit and request."""


def frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def asked(answer: Answer, questions: int = 1) -> list[End]:
    """How reads of registers 7 and 8 end where a gateway answers so; then, what still came."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            line, _ = server.accept()
            with line, contextlib.suppress(OSError):  # the client may be gone
                while len(came := line.recv(12, socket.MSG_WAITALL)) == 12:
                    transaction, _, _, unit = struct.unpack(">HHHB", came[:7])
                    line.sendall(answer(transaction, unit, came[7:]))

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        with Client(f"127.0.0.1:{server.getsockname()[1]}", timeout=0.3) as client:
            found = [client.read(7, 2) for _ in range(questions)]
        thread.join(10)
    return found


WORDS = b"\x03\x04\x00\x07\x00\x08"
UNTRUE: dict[str, Answer] = {
    "other values": lambda transaction, unit, _: frame(transaction, unit, b"\x03\x04\x00\x08\x00\x09"),
    "another count": lambda transaction, unit, _: frame(transaction, unit, b"\x03\x02\x00\x07"),
    "a count that lies": lambda transaction, unit, _: frame(transaction, unit, b"\x03\x02\x00\x07\x00\x08"),
    "another function": lambda transaction, unit, _: frame(transaction, unit, b"\x04\x04\x00\x07\x00\x08"),
    "another unit": lambda transaction, unit, _: frame(transaction, unit + 1, WORDS),
    "another transaction": lambda transaction, unit, _: frame(transaction + 1, unit, WORDS),
}


@pytest.mark.parametrize("answer", UNTRUE.values(), ids=UNTRUE)
def test_the_judge_finds_an_untrue_answer_wrong(answer: Answer) -> None:
    assert [end.kind for end in asked(answer)] == [WRONG]


def test_the_judge_finds_a_second_answer_wrong() -> None:
    ends = asked(lambda transaction, unit, _: 2 * frame(transaction, unit, WORDS), questions=2)
    assert [end.kind for end in ends] == [RIGHT, WRONG]


def test_the_judge_knows_an_error_from_silence() -> None:
    assert asked(lambda transaction, unit, _: frame(transaction, unit, b"\x83\x0b")) == [End(ERROR, "0BH")]
    assert asked(lambda *_: b"") == [End(NONE)]


def test_an_answer_that_comes_after_the_client_went_on_is_its_own_transaction_s() -> None:
    owed: list[bytes] = []

    def one_late(transaction: int, unit: int, pdu: bytes) -> bytes:
        assert pdu[0] == wire.READ
        owed.append(frame(transaction, unit, WORDS))
        return b"" if len(owed) == 1 else b"".join(owed)

    assert [end.kind for end in asked(one_late, questions=2)] == [NONE, RIGHT]


@pytest.mark.parametrize("row", ROWS, ids=[row.key for row in ROWS])
def test_drivebus_is_not_wrong_in_any_row(row: Row) -> None:
    cell = played(row, OURS, times=max(row.times // 20, 3))
    assert cell.wrong == 0, cell


def test_no_fault_of_the_simulator_makes_an_answer_through_drivebus_wrong() -> None:
    assert spoilt("late", OURS, reads=60).wrong == 0


def test_no_two_questions_of_a_crowd_have_the_same_answer() -> None:
    from drivebus.sim import Simulator

    with Simulator(crowd.FAMILIES, transport="process", clock="virtual") as simulator:
        questions = crowd.questions(simulator)
    assert len({tuple(each.words) for each in questions}) == len(questions) > 100
    assert {each.unit for each in questions} == set(crowd.FAMILIES)


def test_a_crowd_is_of_twenty_whoever_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    for there in (list(crowd.CROWD), ["strict"]):
        monkeypatch.setattr(crowd_clients, "here", lambda there=there: there)
        assert sum(crowd.crowd().values()) == 20


def test_a_page_says_for_how_long_each_crowd_asked() -> None:
    ours, other = Column(OURS, version="1"), Column(GATEWAYS[1], version="1")
    ends = {make: Counter({RIGHT: 2}) for make in crowd.crowd()}
    ours.crowds[crowd.HOSTILE] = crowd.Crowd(ends, 3600.4)
    other.crowds[crowd.HOSTILE] = crowd.Crowd(ends, 20.0)
    assert f"| {crowd.HOSTILE} | for | 3600 s | 20 s |" in section([ours, other])


def test_a_section_takes_the_place_of_its_own_and_of_nothing_else() -> None:
    page = "# Page\n\n## One\n\n1\n\n## Two\n\n2\n\n## Three\n\n3\n"
    assert replaced(page, "## Two\n\nnew\n") == "# Page\n\n## One\n\n1\n\n## Two\n\nnew\n\n## Three\n\n3\n"
    assert replaced(page, "## Three\n\nnew\n") == "# Page\n\n## One\n\n1\n\n## Two\n\n2\n\n## Three\n\nnew\n"
    assert replaced(page, "## Four\n\n4\n") == page + "\n## Four\n\n4\n"


def test_each_row_has_a_name_of_its_own() -> None:
    assert len(set(names())) == len(names())


def test_a_gateway_that_is_not_here_is_a_column_that_says_so() -> None:
    text = section([Column(OURS, version="1.2.3"), Column(GATEWAYS[1], missing="nobody built it")])
    assert f"| {GATEWAYS[1].title} | {NOT_HERE} | nobody built it |" in text
    for row in ROWS:
        assert f"| {row.name} | {row.must} | - | {NOT_HERE} |" in text
