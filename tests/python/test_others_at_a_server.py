"""Several masters at one serial server, which copies each answer to all of them: a value is that of its own question.

The server is a real one, on a socket; each word that it gives says which register it was read from.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator

import pytest

from drivebus import BadAnswer, Bus, DrivebusError, Refused

from .serial_server import END, READ, UNIT, WRITE, WRITE_MANY, Foreign, SerialServer, place_of, read_pdu

READS = 60
OURS, THEIRS = 0x000, 0x200


@pytest.fixture
def server() -> Iterator[SerialServer]:
    with SerialServer() as server:
        yield server


def open_bus(server: SerialServer) -> Bus:
    """A master of its own, which shares its port with nobody."""
    return Bus(server.url, share="never")


def count_wrong(bus: Bus, first: int, count: int, reads: int = READS) -> int:
    """How many of so many reads gave words of other registers than were asked for; a few may give none."""
    wrong = none = 0
    for number in range(reads):
        address = first + number % 40
        try:
            words = bus.read(UNIT, address, count)
        except BadAnswer:
            none += 1
        else:
            wrong += [place_of(word) for word in words] != [*range(address, address + count)]
    assert none <= reads // 10
    return wrong


def theirs(count: int) -> list[bytes]:
    return [read_pdu(THEIRS + place, count) for place in range(40)]


@pytest.mark.parametrize("pause", [0.0, 0.02], ids=["at once", "50 a second"])
@pytest.mark.parametrize("loop_back", [True, False], ids=["echoes", "no echo"])
@pytest.mark.parametrize("count", [1, 3])
def test_beside_a_foreign_master_no_value_is_anothers(pause: float, loop_back: bool, count: int) -> None:
    with SerialServer(loop_back=loop_back) as server, Foreign(server, theirs(count), pause), open_bus(server) as bus:
        assert count_wrong(bus, OURS, count) == 0
        hints = bus.stats().hints
    assert any("another master" in hint for hint in hints), hints


@pytest.mark.parametrize("pause", [0.0, 0.02], ids=["at once", "50 a second"])
def test_one_that_comes_later_is_noticed_with_its_first_answer(server: SerialServer, pause: float) -> None:
    with open_bus(server) as bus:
        assert count_wrong(bus, OURS, 1) == 0
        with Foreign(server, theirs(1), pause):
            # Its very first answer, of the length that is waited for just then, cannot be told.
            assert count_wrong(bus, OURS, 1) <= 1


@pytest.mark.parametrize("count", [1, 3])
def test_two_of_this_kind_find_lengths_of_their_own(server: SerialServer, count: int) -> None:
    wrong: dict[int, int] = {}

    def read(bus: Bus, first: int) -> None:
        wrong[first] = count_wrong(bus, first, count)

    with open_bus(server) as one, open_bus(server) as other:
        threads = [threading.Thread(target=read, args=each) for each in ((one, OURS), (other, THEIRS))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    # Both may choose one length at once: again the very first answer of that length.
    assert max(wrong.values()) <= 1, wrong


def test_where_no_other_length_is_left_the_call_ends_and_says_why(server: SerialServer) -> None:
    with Foreign(server, theirs(16)), open_bus(server) as bus:
        for _ in range(3):
            with pytest.raises(BadAnswer, match="another master asks the same of this unit"):
                bus.read(UNIT, OURS, 16)
        assert count_wrong(bus, OURS, 4, 10) == 0, "they do not ask for four"


def test_what_came_in_between_two_calls_is_heard(server: SerialServer) -> None:
    with open_bus(server) as bus:
        bus.read(UNIT, OURS, 1)
        before = len(server.asked)
        server.say(UNIT, struct.pack(">BBH", READ, 2, THEIRS))
        assert place_of(bus.read(UNIT, OURS, 1)[0]) == OURS
    counts = [struct.unpack(">H", frame[4:6])[0] for _, frame in server.asked[before:]]
    assert 1 not in counts


def test_alone_each_read_is_one_request_but_the_first(server: SerialServer) -> None:
    with open_bus(server) as bus:
        bus.read(UNIT, OURS, 1)
        before = len(server.asked)
        assert count_wrong(bus, OURS, 1) == 0
        assert len(server.asked) == before + READS
        # No length is given that is longer: what is as long as the one before is parted from it.
        for _ in range(2):
            bus.read(UNIT, OURS, 16)
    assert len(server.asked) == before + READS + 3


def test_their_refusals_refuse_nothing_of_ours(server: SerialServer) -> None:
    with Foreign(server, [read_pdu(END, 1)], 0.01), open_bus(server) as bus:
        assert count_wrong(bus, OURS, 1, 20) == 0
        with pytest.raises(Refused):
            bus.read(UNIT, END + 1, 1)


def test_their_writes_confirm_none_of_ours(server: SerialServer) -> None:
    many = struct.pack(">BHHBHH", WRITE_MANY, THEIRS, 2, 4, 7, 8)
    one = struct.pack(">BHH", WRITE, THEIRS + 5, 9)
    with Foreign(server, [many, one], 0.01), open_bus(server) as bus:
        for value in range(20):
            bus.write(UNIT, OURS, value)
            assert server.kept[OURS] == value
            bus.write(UNIT, OURS + 1, [value, value + 1])
            assert (server.kept[OURS + 1], server.kept[OURS + 2]) == (value, value + 1)


def test_a_write_that_looks_like_theirs_is_looked_up_or_not_known(server: SerialServer) -> None:
    with open_bus(server) as bus:
        bus.write(UNIT, OURS, [1, 2])
        bus.read(UNIT, OURS, 1)
        server.say(UNIT, struct.pack(">BHH", WRITE_MANY, OURS, 2))
        before = len(server.asked)
        bus.write(UNIT, OURS, [3, 4], read_back=OURS)
        assert (server.kept[OURS], server.kept[OURS + 1]) == (3, 4)
        # Read back, and one read more that proves the length.
        assert [frame[1] for _, frame in server.asked[before:]] == [WRITE_MANY, READ, READ]
        with pytest.raises(BadAnswer, match="the unit may have taken it"):
            bus.write(UNIT, OURS, [5, 6])
        assert (server.kept[OURS], server.kept[OURS + 1]) == (5, 6)


def test_reads_and_writes_of_all_kinds_at_once(server: SerialServer) -> None:
    pdus = [*theirs(1)[:3], *theirs(2)[:3], read_pdu(END, 2), struct.pack(">BHH", WRITE, THEIRS + 5, 9)]
    failed = 0
    with Foreign(server, pdus, 0.005), open_bus(server) as bus:
        for number in range(20):
            for count in (1, 2, 5):
                try:
                    assert count_wrong(bus, OURS + number, count, 1) == 0
                except DrivebusError:
                    failed += 1
            bus.write(UNIT, 0x100, number)
            assert server.kept[0x100] == number
    assert failed == 0
