"""Huanyang's own protocol, with the CRC of Modbus and its own lengths: named, and never taken for Modbus with errors.

Frames and their meaning: LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_modbus.c (functions 01 to 05, their lengths) and
hy_comm.c. CRCs were computed with the bit-by-bit loop of *Modbus over Serial Line* V1.02, section 6.2.2.
"""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from drivebus import BadAnswer, Bus, SerialFormat, Simulator
from drivebus.cli import cli
from drivebus.doctor.bus_noise import heard as heard_by
from drivebus.identify.scan import look_for
from drivebus.line import huanyang
from drivebus.line.asking import Read
from drivebus.sniffer import Exchange, Families
from drivebus.sniffer.pairing import Pairing

READ_STATUS = "01 04 03 00 00 00 F0 4E"
CONTROL = "01 03 01 01 31 88"
FREQUENCY = "01 05 02 13 88"


def crc(data: bytes) -> bytes:
    word = 0xFFFF
    for byte in data:
        word ^= byte
        for _ in range(8):
            word = (word >> 1) ^ (0xA001 if word & 1 else 0)
    return word.to_bytes(2, "little")


def frame(text: str) -> bytes:
    data = bytes.fromhex(text)
    return data + crc(data)


TALK = [
    ("01 04 03 00 00 00", "01 04 03 00 13 88", "read status 0 (set frequency)", "= 5000"),
    ("01 03 01 01", "01 03 01 09", "control 01H (run forward)", "control state 09H"),
    ("01 05 02 13 88", "01 05 02 13 88", "frequency 50.00 Hz", "frequency 50.00 Hz"),
    ("01 04 03 01 00 00", "01 04 03 01 00 21", "read status 1 (output frequency)", "= 33"),
    ("01 01 03 05 00 00", "01 01 03 05 9C 40", "read PD005", "= 40000"),
    ("01 02 03 05 01 90", "01 02 03 05 01 90", "write PD005 = 400", "write PD005 = 400"),
    ("01 04 01 02", "01 04 03 02 00 15", "read status 2 (output current)", "= 21"),
    ("01 03 01 08", "01 03 01 00", "control 08H (stop)", "control state 00H"),
]


def heard(pairs: list[tuple[bytes, bytes]], lump: int = 1) -> list[Exchange]:
    line = SerialFormat(9600, "N")
    pairing = Pairing(line, Families())
    found: list[Exchange] = []
    at, waiting, count = 0.0, b"", 0
    for pair in pairs:
        for data in pair:
            at += len(data) * line.char_time + 0.02
            waiting, count = waiting + data, count + 1
            if count % lump == 0:
                found += pairing.receive(at, waiting)
                waiting = b""
    return [*found, *pairing.receive(at + 0.1, waiting), *pairing.finish()]


@pytest.mark.parametrize("lump", [1, 2])
def test_each_exchange_is_whole_and_named(lump: int) -> None:
    pairs = [(frame(request), frame(answer)) for request, answer, *_ in TALK]
    found = heard(pairs, lump)
    assert [(one.request, one.answer) for one in found] == pairs
    assert {(one.protocol, one.error, one.profile, one.unit, len(one.values)) for one in found} == {
        ("huanyang", None, None, 1, 0)
    }


def test_what_modbus_has_stays_modbus() -> None:
    """A read of 17 coils at 0305H, its answer of three bytes, and a write of 03xxH: the same lengths."""
    pairs = [
        (frame("01 01 03 05 00 11"), frame("01 01 03 05 00 00")),
        (frame("01 02 03 05 00 18"), frame("01 02 03 05 01 90")),
        (frame("01 06 03 05 01 90"), frame("01 06 03 05 01 90")),
        (frame("01 04 03 00 00 01"), frame("01 04 02 13 88")),
        (frame("01 03 30 00 00 01"), frame("01 03 02 13 88")),
    ]
    assert [(one.protocol, one.error, one.request) for one in heard(pairs)] == [
        ("modbus", None, request) for request, _ in pairs
    ]


def test_both_on_one_line() -> None:
    modbus = (frame("02 03 30 00 00 01"), frame("02 03 02 13 88"))
    foreign = [(frame(request), frame(answer)) for request, answer, *_ in TALK]
    found = heard([pair for one in foreign for pair in (modbus, one)])
    assert [(one.unit, one.protocol, one.error) for one in found] == [(2, "modbus", None), (1, "huanyang", None)] * len(
        foreign
    )


def test_a_request_that_nobody_answers_is_told() -> None:
    found = heard([(frame("01 03 01 01"), b""), (frame("01 05 02 13 88"), frame("01 05 02 13 88"))])
    assert [(one.request, str(one.error)) for one in found] == [
        (frame("01 03 01 01"), "unit 1 did not answer"),
        (frame("01 05 02 13 88"), "None"),
    ]


def test_decode_names_a_frame_and_a_file(tmp_path: Path) -> None:
    for text, said in ((READ_STATUS, "read status 0 (set frequency)"), (CONTROL, "control 01H (run forward)")):
        result = CliRunner().invoke(cli, ["decode", text])
        assert result.exit_code == 0
        assert said in result.stdout
        assert "Huanyang's own protocol, no Modbus" in result.stdout
    file = tmp_path / "line.txt"
    lines = [
        f"{'TX' if at == 0 else 'RX'} {frame(text).hex(' ').upper()}"
        for pair in TALK
        for at, text in enumerate(pair[:2])
    ]
    file.write_text("\n".join(lines) + "\n")
    shown = CliRunner().invoke(cli, ["decode", str(file)])
    assert shown.exit_code == 0, shown.output
    for _, _, asked, told in TALK:
        assert asked in shown.stdout
        assert told in shown.stdout
    assert "CRC" not in shown.stdout
    records = [
        json.loads(line) for line in CliRunner().invoke(cli, ["--json", "decode", str(file)]).stdout.splitlines()
    ]
    assert [record["protocol"] for record in records] == ["huanyang"] * len(TALK)


def test_every_cut_and_every_changed_byte_is_heard_without_an_end() -> None:
    pairs = [(frame(request), frame(answer)) for request, answer, *_ in TALK]
    whole = b"".join(request + answer for request, answer in pairs)
    line = SerialFormat(9600, "N")
    for data in [whole[:end] for end in range(len(whole))] + [
        whole[:at] + bytes([whole[at] ^ 0x21]) + whole[at + 1 :] for at in range(len(whole))
    ]:
        pairing = Pairing(line, Families())
        list(pairing.receive(1.0, data))
        list(pairing.finish())


def test_a_frame_is_sure_only_where_modbus_has_none_like_it() -> None:
    sure = ["01 03 01 01", "01 05 02 13 88", "01 04 03 00 00 00", "01 04 01 00", "01 04 03 00 13 88", "01 06 02 00 01"]
    unsure = ["01 01 03 05 00 00", "01 02 03 05 01 90", "01 04 03 00 00 7D", "01 06 03 00 00 01", "01 01 02 05 01"]
    no_form = ["01 03 02 00 01", "01 05 FF 00 00", "01 10 01 00", "01 03 01"]
    assert [huanyang.is_sure(frame(text)) for text in sure] == [True] * len(sure)
    assert [huanyang.has_form(frame(text)) and not huanyang.is_sure(frame(text)) for text in unsure] == [True] * 5
    assert [huanyang.has_form(frame(text)) for text in no_form] == [False] * len(no_form)
    assert not huanyang.has_form(bytes.fromhex("01 03 01 01 31 89"))


def test_a_scan_names_a_unit_that_answers_so() -> None:
    """Whatever it is asked, such a unit answers in its own frames, or not at all."""

    async def ask(read: Read) -> list[int]:
        raise BadAnswer("unit 1 answered otherwise", unit=read.unit, raw=frame("01 03 01 09"))

    found = asyncio.run(look_for(ask, time.monotonic, 1))
    assert found is not None
    assert (found.profile, found.protocol) == (None, "huanyang")
    assert "speaks Huanyang's own protocol" in str(found.problem)


def test_the_doctor_names_what_it_hears(monkeypatch: pytest.MonkeyPatch) -> None:
    came = b"".join(frame(text) for pair in TALK for text in pair[:2])
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        monkeypatch.setattr(bus, "listen", lambda _: [(0.0, came)])
        finding = heard_by(bus, 1.0)
    assert finding.values["protocol"] == "huanyang"
    assert "of Huanyang's own protocol: 01 04 03 00 00 00 F0 4E = unit 1: read status 0 (set frequency)" in finding.text
    assert "no Modbus" in finding.text
