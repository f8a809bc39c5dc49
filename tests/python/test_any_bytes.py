"""Whatever bytes arrive instead of an answer: an error of ours or the right value, and nothing else, ever.

On the in-process line in virtual time. The simulator sends the bytes as they are; hypothesis chooses them, and biases
them towards what looks like an answer.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import drivebus
from drivebus import Bus, Drive, Simulator

IDENTIFICATION = 0x2103
IS = 0x01A0


def framed(body: bytes) -> bytes:
    return body + drivebus.crc16(body).to_bytes(2, "little")


RIGHT = framed(bytes([1, 3, 2, 0x01, 0xA0]))
anything = st.binary(max_size=300)
well_formed = st.binary(min_size=2, max_size=60).map(framed)
from_unit_1 = st.binary(max_size=60).map(lambda body: framed(b"\x01" + body))
like_an_answer = st.builds(
    lambda head, body, tail: head + framed(body) + tail, anything, st.binary(max_size=20), anything
)
ANY_BYTES = st.one_of(anything, well_formed, from_unit_1, like_an_answer)


def only_one_answer_is_possible(sent: bytes) -> bool:
    """Whether no valid answer of unit 1 to a one-word read is hidden in *sent*, other than the right one."""
    found = {
        sent[start : start + 7]
        for start in range(len(sent) - 6)
        if sent[start : start + 3] == b"\x01\x03\x02" and framed(sent[start : start + 5]) == sent[start : start + 7]
    }
    return found <= {RIGHT}


@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sent=ANY_BYTES)
@example(b"")
@example(b"\x00")
@example(b"\x01\x03")
@example(b"\x01\x83\x02\xc0\xf1")
@example(framed(b"\x01\x83\x00"))
@example(framed(b"\x01\x83"))
@example(framed(b"\x01\x03\x04\x01\xa0\x01\xa0"))
@example(framed(b"\x01\x03\x01\x01"))
@example(framed(b"\x02\x03\x02\x12\x34"))
@example(framed(b"\x01\x04\x02\x12\x34"))
@example(RIGHT + RIGHT)
@example(b"\xff" * 300)
def test_a_read(virtual: Simulator, sent: bytes) -> None:
    virtual.line.clear()
    with Bus(virtual, timeout=0.25, retries=0) as bus:
        bus.read(1, 0x2100)  # first contact is over
        virtual.line.answer_with(sent)
        try:
            words = bus.read(1, IDENTIFICATION)
        except drivebus.DrivebusError:
            pass
        else:
            if only_one_answer_is_possible(sent):
                assert words == [IS]
        virtual.line.clear()
        assert bus.read(1, IDENTIFICATION) == [IS]


CALLS: list[Callable[[Bus, Drive], object]] = [
    lambda bus, _: bus.write(1, 0x800B, 50),
    lambda bus, _: bus.write(1, 0x800B, [50, 50]),
    lambda bus, _: bus.echo(1),
    lambda bus, _: bus.transact(1, b"\x03\x21\x03\x00\x01"),
    lambda bus, _: bus.transact(1, b"\x41\x00"),
    lambda bus, _: list(bus.scan([1])),
    lambda bus, _: bus.drive(1),
    lambda _, drive: drive.status(),
    lambda _, drive: drive.monitor(),
    lambda _, drive: drive.fault_history(),
    lambda _, drive: drive.run(5.0),
    lambda _, drive: drive.stop(),
    lambda _, drive: drive.write("P00.11", 5.0, store=True),
]


@pytest.mark.parametrize("call", CALLS, ids=range(len(CALLS)))
@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sent=ANY_BYTES)
def test_everything_else(virtual: Simulator, call: Callable[[Bus, Drive], object], sent: bytes) -> None:
    virtual.line.clear()
    with Bus(virtual, timeout=0.25, retries=0) as bus:
        drive = bus.drive(1)
        virtual.line.answer_with(sent)
        with contextlib.suppress(drivebus.DrivebusError):
            call(bus, drive)
        virtual.line.clear()
        assert bus.read(1, IDENTIFICATION) == [IS]
