"""Who made a unit, by its own words, and what is said of functions that few units know.

Frames: *Modbus Application Protocol* V1.1b3, §6.11, §6.13, §6.16, §6.17, §6.21.
"""

from __future__ import annotations

import asyncio
import json

import pytest
from click.testing import CliRunner

import drivebus
from drivebus import _native, aio
from drivebus.cli import cli
from drivebus.line.device import device_of
from drivebus.line.meaning import meaning
from drivebus.rtu import framed, may_write

from .odd_slave import good, on_a_terminal

KBR = bytes.fromhex("2B 0E 01 01 00 00 03 00 08") + b"KBR GmbH\x01\x12multicomp F144-3  \x02\x09 2.00r016"
"""KBR, multicomp F144-3, document 25359_EDEBDA0279-2320-1_EN, p. 63."""


def test_a_drive_that_does_not_know_it_refuses() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        with pytest.raises(drivebus.Refused) as refused:
            bus.device_identification(1)
        assert (refused.value.code, refused.value.may_have_taken) == (1, False)


def test_a_silent_unit_has_done_nothing() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual", retries=2) as bus, pytest.raises(drivebus.NoAnswer) as silent:
        bus.device_identification(9)
    assert silent.value.may_have_taken is False


def test_who_only_reads_may_ask() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual", read_only=True) as bus:
        for pdu in ("2B 0E 01 00", "11"):
            with pytest.raises(drivebus.Refused):
                bus.transact(1, bytes.fromhex(pdu))
        asked = bus.stats().requests
        for pdu in ("0F 0013 000A 02 CD01", "16 0004 00F2 0025", "17 0003 0006 000E 0001 02 00FF"):
            with pytest.raises(drivebus.NotAllowed, match="read-only"):
                bus.transact(1, bytes.fromhex(pdu))
        assert bus.stats().requests == asked


def test_the_other_face_asks_the_same() -> None:
    async def ask() -> None:
        async with aio.Bus("sim://gd350?clock=virtual") as bus:
            with pytest.raises(drivebus.Refused):
                await bus.device_identification(1)

    asyncio.run(ask())


PAGES = {
    b"\x2b\x0e\x03\x00": b"\x2b\x0e\x03\x83\xff\x02\x02\x00\x07Example\x01\x04EX-1",
    b"\x2b\x0e\x03\x02": b"\x2b\x0e\x03\x83\x00\x00\x03\x02\x02V2\x04\x03fan\x80\x02\x00\xff",
}
"""What a unit of names of our own answers, in two parts."""


def telling(asked: list[bytes], pages: dict[bytes, bytes] = PAGES):  # type: ignore[no-untyped-def]  # a plan
    """A unit that tells *pages*, refuses other identifications, and has no code that a drive has."""

    def plan(request: bytes) -> bytes:
        asked.append(request[1:])
        if request[1] != 0x2B:
            return good(request) if request[1] == 8 else framed(bytes([request[0], request[1] | 0x80, 2]))
        return framed(request[:1] + pages.get(request[1:], b"\xab\x03"))

    return plan


def test_what_follows_is_asked_for() -> None:
    asked: list[bytes] = []
    with on_a_terminal(telling(asked)) as port:
        with drivebus.Bus(port, share="never") as bus:
            device = bus.device_identification(5)
        identifications = [pdu for pdu in asked if pdu[0] == 0x2B]
        assert identifications == list(PAGES)
        assert (device.vendor, device.product_code, device.revision) == ("Example", "EX-1", "V2")
        assert (device.product_name, device.objects[0x80], device.complete) == ("fan", b"\x00\xff", True)
        assert str(device) == "unit 5: Example, fan, EX-1, V2"

        async def ask() -> drivebus.DeviceIdentification:
            async with aio.Bus(port, share="never") as bus:
                return await bus.device_identification(5)

        assert asyncio.run(ask()) == device


def test_who_refuses_all_is_asked_for_the_least() -> None:
    asked: list[bytes] = []
    with on_a_terminal(telling(asked, {b"\x2b\x0e\x01\x00": KBR})) as port, drivebus.Bus(port, share="never") as bus:
        assert bus.device_identification(5).vendor == "KBR GmbH"
    assert [pdu for pdu in asked if pdu[0] == 0x2B] == [b"\x2b\x0e\x03\x00", b"\x2b\x0e\x01\x00"]


def test_info_asks_a_unit_that_nobody_knows_who_made_it() -> None:
    asked: list[bytes] = []
    with on_a_terminal(telling(asked)) as port:
        told = CliRunner().invoke(cli, ["--port", port, "--json", "info"], prog_name="drivebus")
    facts = json.loads(told.stdout.splitlines()[0])
    assert (facts["vendor"], facts["product"]) == ("Example", "fan, EX-1, V2")
    assert told.exit_code != 0, "no family"
    assert [pdu for pdu in asked if pdu[0] == 0x2B] == list(PAGES)


def test_info_asks_no_drive_that_is_known() -> None:
    told = CliRunner().invoke(cli, ["--port", "sim://gd350?clock=virtual", "--json", "info"], prog_name="drivebus")
    assert (told.exit_code, "vendor" in told.stdout) == (0, False)


def test_what_a_unit_tells_is_one_value() -> None:
    question = _native.DeviceQuestion()
    assert question.pdu() == b"\x2b\x0e\x03\x00"
    assert question.refused(3)
    assert question.pdu() == b"\x2b\x0e\x01\x00"
    question.heard(KBR)
    assert question.pdu() is None
    device = device_of(7, question)
    assert str(device) == "unit 7: KBR GmbH, multicomp F144-3, 2.00r016"
    assert (device.vendor, device.product_code, device.revision) == ("KBR GmbH", "multicomp F144-3", "2.00r016")
    assert (device.vendor_url, device.conformity, device.complete) == (None, 1, True)
    assert device == device_of(7, question)
    assert hash(device) == hash(device_of(7, question))
    assert device.objects[2] == b" 2.00r016"


@pytest.mark.parametrize(
    ("request_pdu", "asks", "answer_pdu", "answers"),
    [
        ("0F 0013 0003 01 05", "write coil 0013H = 1", "0F 0013 0003", "took 3 coils at 0013H"),
        ("11", "say what it is", "11 03 4142FF", "says that it is 41 42 FF"),
        (
            "16 0004 00F2 0025",
            "change bits of 0004H: and 00F2H, or 0025H",
            "16 0004 00F2 0025",
            "changed bits of 0004H: and 00F2H, or 0025H",
        ),
        ("17 0003 0002 000E 0001 02 00FF", "write 000EH = 255, then read", "17 04 0005 0006", "0003H = 5, 0004H = 6"),
        ("2B 0E 01 00", "say who made it", KBR.hex(), 'says that it is "KBR GmbH", "multicomp F144-3", "2.00r016"'),
        ("2B 0E 03 80", "say who made it, from object 80H", "AB 01", "refuses function 2BH: exception 01H"),
        ("2B 0E 01", "function 2BH", "2B 0D 00", "answers function 2BH"),
    ],
)
def test_what_is_asked_and_answered_has_words(request_pdu: str, asks: str, answer_pdu: str, answers: str) -> None:
    asked, came = (framed(b"\x05" + bytes.fromhex(pdu)) for pdu in (request_pdu, answer_pdu))
    assert asks in meaning(asked, True)
    assert answers in meaning(came, False, asked)


def test_what_a_mask_may_leave_is_held_against_commands() -> None:
    assert may_write(bytes.fromhex("16 0004 00F2 0025")) == [(4, [0x0005]), (4, [0x00F7])]
    assert may_write(bytes.fromhex("16 0004 0000 0025")) == [(4, [0x0025])]
    assert may_write(bytes.fromhex("17 0003 0001 000E 0001 02 00FF")) == [(14, [255])]
    assert may_write(bytes.fromhex("03 0003 0001")) == []


@pytest.mark.parametrize("pdu", ["16 2000 FFF0 0001", "17 2000 0001 2000 0001 02 0063"])
def test_no_family_is_commanded_what_it_does_not_define(pdu: str) -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        bus.drive(1)
        before = bus.stats().requests
        with pytest.raises(drivebus.NotAllowed, match="not a command"):
            bus.transact(1, bytes.fromhex(pdu))
        assert bus.stats().requests == before
        # Whoever means it may send it, once; this drive knows neither function.
        with pytest.raises(drivebus.Refused):
            bus.transact(1, bytes.fromhex(pdu), force=True)
        assert bus.stats().requests == before + 1
