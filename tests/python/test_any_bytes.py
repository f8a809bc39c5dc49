"""Whatever bytes arrive instead of answers: an error of ours or what a valid frame carried, and nothing else, ever.

On the in-process line in virtual time. The simulator sends the bytes as they are, in one piece or in lumps; hypothesis
chooses them, and biases them towards what looks like an answer. What the line really carried is the simulator's trace,
and what the drive really took its own log.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import drivebus
from drivebus import Bus, Drive, Simulator

IDENTIFICATION = 0x2103
IS = 0x01A0
RAM = 0x800B
"""P00.11 in RAM: a ramp, which moves nothing."""
COMMAND = 0x2000


def framed(body: bytes) -> bytes:
    return body + drivebus.crc16(body).to_bytes(2, "little")


def words(values: Sequence[int]) -> bytes:
    return b"".join(value.to_bytes(2, "big") for value in values)


RIGHT = framed(bytes([1, 3, 2, 0x01, 0xA0]))
anything = st.binary(max_size=300)
well_formed = st.binary(min_size=2, max_size=60).map(framed)
from_unit_1 = st.binary(max_size=60).map(lambda body: framed(b"\x01" + body))
like_words = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=20).map(
    lambda values: framed(bytes([1, 3, 2 * len(values)]) + words(values))
)
like_a_confirmation = st.tuples(
    st.sampled_from([b"\x06\x80\x0b", b"\x10\x80\x0b", b"\x08\x00\x00", b"\x06\x20\x00"]), st.integers(0, 0xFFFF)
).map(lambda parts: framed(b"\x01" + parts[0] + words([parts[1]])))
a_refusal = st.tuples(st.sampled_from([3, 6, 8, 16, 0x41]), st.integers(0, 255)).map(
    lambda parts: framed(bytes([1, parts[0] | 0x80, parts[1]]))
)
like_an_answer = st.builds(
    lambda head, body, tail: head + framed(body) + tail, anything, st.binary(max_size=20), anything
)
ANY_BYTES = st.one_of(
    anything, well_formed, from_unit_1, like_words, like_a_confirmation, a_refusal, like_an_answer, st.just(RIGHT)
)


class Replies(NamedTuple):
    """What comes instead of the next answers, and which of them in lumps with pauses between; *seed* says where."""

    sent: list[bytes]
    in_lumps: list[int]
    seed: int


def only(*sent: bytes) -> Replies:
    return Replies(list(sent), [], 0)


REPLIES = st.builds(
    Replies,
    st.lists(ANY_BYTES, min_size=1, max_size=5),
    st.lists(st.integers(1, 5), max_size=3, unique=True),
    st.integers(0, 2**32),
)


class Call(NamedTuple):
    """Something that a program asks, and how what it gets shows in what the line carried."""

    ask: Callable[[Bus, Drive], object]
    carried: Callable[[object, bytes], bool]
    before: Callable[[Drive], object] = lambda _: None
    written_once: int | None = None


def no_matter(_: object, __: bytes) -> bool:
    """Its words are the drive's methods' to explain: that no other error comes is all that is looked at."""
    return True


def words_came(result: object, heard: bytes) -> bool:
    assert isinstance(result, list)
    return framed(bytes([1, 3, 2 * len(result)]) + words(result)) in heard


def frame_came(body: bytes) -> Callable[[object, bytes], bool]:
    return lambda _, heard: framed(b"\x01" + body) in heard


def pdu_came(result: object, heard: bytes) -> bool:
    assert isinstance(result, bytes)
    return framed(b"\x01" + result) in heard


def found_came(result: object, heard: bytes) -> bool:
    """Who is found without an identification says why; bytes that are no frame may be somebody all the same."""
    assert isinstance(result, list)
    known = [found.identification for found in result if found.identification is not None]
    return all(framed(bytes([1, 3, 2]) + words([code])) in heard for code in known)


def stamped_came(result: object, heard: bytes) -> bool:
    assert isinstance(result, tuple)
    return words_came(result[0], heard) and result[1] <= result[2]


def reading(name: str, scale: int) -> Call:
    """A drive's value, which one word carried."""

    def came(result: object, heard: bytes) -> bool:
        assert isinstance(result, int | float)
        return framed(bytes([1, 3, 2]) + words([round(result * scale)])) in heard

    return Call(lambda _, drive: drive.read(name), came)


CALLS: dict[str, Call] = {
    "read one": Call(lambda bus, _: bus.read(1, IDENTIFICATION), words_came),
    "read several": Call(lambda bus, _: bus.read(1, 0x3000, 5), words_came),
    "read stamped": Call(lambda bus, _: bus.read_stamped(1, IDENTIFICATION), stamped_came),
    "read urgently": Call(lambda bus, _: bus.read(1, IDENTIFICATION, urgent=True), words_came),
    "read and verify": Call(lambda bus, _: bus.read(1, IDENTIFICATION, verify=True), words_came),
    "write one": Call(
        lambda bus, _: bus.write(1, RAM, 50), frame_came(b"\x06\x80\x0b\x00\x32"), written_once=RAM & 0x7FFF
    ),
    "write several": Call(
        lambda bus, _: bus.write(1, RAM, [50, 50]),
        frame_came(b"\x10\x80\x0b\x00\x02"),
        written_once=RAM & 0x7FFF,
    ),
    "write urgently": Call(lambda bus, _: bus.write(1, RAM, 50, urgent=True), frame_came(b"\x06\x80\x0b\x00\x32")),
    "write and read back": Call(
        lambda bus, _: bus.write(1, RAM, 50, read_back=RAM & 0x7FFF),
        lambda _, heard: any(
            framed(b"\x01" + body) in heard for body in (b"\x06\x80\x0b\x00\x32", b"\x03\x02\x00\x32")
        ),
    ),
    "echo": Call(lambda bus, _: bus.echo(1, 0x1234), frame_came(b"\x08\x00\x00\x12\x34")),
    "transact": Call(lambda bus, _: bus.transact(1, b"\x03\x21\x03\x00\x01"), pdu_came),
    "transact, length given": Call(lambda bus, _: bus.transact(1, b"\x03\x21\x03\x00\x01", 4), pdu_came),
    "transact, unknown": Call(lambda bus, _: bus.transact(1, b"\x41\x00"), pdu_came),
    "broadcast": Call(lambda bus, _: bus.broadcast(RAM, 50), no_matter),
    "scan": Call(lambda bus, _: list(bus.scan([1])), found_came),
    "identify": Call(lambda bus, _: bus.drive(1), no_matter),
    "status": Call(lambda _, drive: drive.status(), no_matter),
    "fault": Call(lambda _, drive: drive.fault(), no_matter),
    "fault history": Call(lambda _, drive: drive.fault_history(), no_matter),
    "monitor": Call(lambda _, drive: drive.monitor(), no_matter),
    "read by name": reading("bus_voltage", 10),
    "setpoint": Call(
        lambda _, drive: drive.setpoint,
        lambda hz, heard: isinstance(hz, float) and framed(bytes([1, 3, 2]) + words([round(hz * 100)])) in heard,
    ),
    "set the setpoint": Call(lambda _, drive: setattr(drive, "setpoint", 7.0), no_matter),
    "write by name": Call(lambda _, drive: drive.write("P00.11", 5.0, store=True), no_matter),
    "check control": Call(lambda _, drive: drive.check_control(), no_matter),
    "prepare control": Call(lambda _, drive: drive.prepare_control(), no_matter),
    "run": Call(lambda _, drive: drive.run(5.0), no_matter, written_once=COMMAND),
    "jog": Call(lambda _, drive: drive.jog(), no_matter, written_once=COMMAND),
    "reset": Call(lambda _, drive: drive.reset_fault(), no_matter, written_once=COMMAND),
    "stop": Call(lambda _, drive: drive.stop(), no_matter, before=lambda drive: drive.run(5.0)),
    "coast": Call(lambda _, drive: drive.coast(), no_matter, before=lambda drive: drive.run(5.0)),
    "end a jog": Call(lambda _, drive: drive.jog_stop(), no_matter, before=lambda drive: drive.jog()),
    "wait for speed": Call(
        lambda _, drive: drive.wait_for_speed(5.0, timeout=2.0), no_matter, before=lambda drive: drive.run(5.0)
    ),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
@settings(max_examples=40)
@given(replies=REPLIES)
@example(only(b""))
@example(only(b"\x00"))
@example(only(b"\x01\x03"))
@example(only(b"\x01\x83\x02\xc0\xf1"))
@example(only(framed(b"\x01\x83\x00")))
@example(only(framed(b"\x01\x83")))
@example(only(framed(b"\x01\x03\x04\x01\xa0\x01\xa0")))
@example(only(framed(b"\x01\x03\x01\x01")))
@example(only(framed(b"\x02\x03\x02\x12\x34")))
@example(only(framed(b"\x01\x04\x02\x12\x34")))
@example(only(RIGHT + RIGHT))
@example(only(RIGHT, RIGHT, RIGHT, RIGHT, RIGHT))
@example(only(b"\xff" * 300))
@example(only(b"", b"", b"", b"", b""))
def test_any_replies(call: Call, replies: Replies) -> None:
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual", seed=replies.seed) as simulator,
        Bus(simulator, timeout=0.25, retries=1) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        call.before(drive)
        simulator.drive(1).take_writes()
        carried = len(simulator.line.trace())
        for sent in replies.sent:
            simulator.line.answer_with(sent)
        simulator.line.script([(number, "split") for number in replies.in_lumps])
        with contextlib.suppress(drivebus.DrivebusError):
            result = call.ask(bus, drive)
            heard = b"".join(data for _, side, data in simulator.line.trace()[carried:] if side == "unit")
            assert call.carried(result, heard), f"{result!r} from {heard.hex(' ')}"
        if call.written_once is not None:
            taken = [address for _, address, _ in simulator.drive(1).take_writes()]
            assert taken.count(call.written_once) <= 1
        simulator.line.clear()
        assert bus.read(1, IDENTIFICATION) == [IS]
