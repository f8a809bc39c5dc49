"""Captures are read whatever made them, and what is broken in one is said; nothing is taken for whole that is not."""

from __future__ import annotations

import io
import os
import struct
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus.capture import Captured, Writer, line_of, read
from drivebus.capture.pcapng import packets
from drivebus.capture.text import frames
from drivebus.cli import cli
from drivebus.sniffer import Families, exchanges_in

# GD350 manual: the state word of unit 1 is read, and is 3 (stopped).
ASKED, ANSWER = bytes.fromhex("01 03 21 00 00 01 8E 36"), bytes.fromhex("01 03 02 00 03 F8 45")
TIME = 1_795_000_000.123456


def written(path: Path, *pieces: Captured, link: str = "upper") -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream, "COM3", "19200 8E1", link)
        for piece in pieces:
            writer.write(piece)
    return path


@pytest.mark.parametrize("link", ["upper", "rtac"])
def test_what_is_written_is_read(tmp_path: Path, link: str) -> None:
    pieces = [Captured(TIME, ASKED, True), Captured(TIME + 0.01, ANSWER, False), Captured(TIME + 1, b"\x00\xff", None)]
    found = list(read(written(tmp_path / "a.pcapng", *pieces, link=link)))
    assert [piece.data for piece in found] == [piece.data for piece in pieces]
    assert [piece.asks for piece in found][:2] == [True, False]
    assert [piece.time for piece in found] == pytest.approx([piece.time for piece in pieces], abs=1e-6)


def test_a_file_of_the_other_byte_order_is_read(tmp_path: Path) -> None:
    def block(kind: int, body: bytes) -> bytes:
        return struct.pack(">II", kind, len(body) + 12) + body + struct.pack(">I", len(body) + 12)

    # Link type 147 (user), time stamps of 2^-10 s, and a block that nobody knows.
    head = block(0x0A0D0D0A, struct.pack(">IHHq", 0x1A2B3C4D, 1, 0, -1))
    line = block(1, struct.pack(">HHI", 147, 0, 0) + struct.pack(">HHBxxxHH", 9, 1, 0x8A, 0, 0))
    unknown = block(0xBAD, b"1234")
    packet = block(6, struct.pack(">IIIII", 0, 0, 1536, 8, 8) + ASKED)
    path = tmp_path / "big.pcapng"
    path.write_bytes(head + line + unknown + packet)
    assert list(read(path)) == [Captured(1.5, ASKED, None)]


@pytest.mark.parametrize("cut", [3, 9, 30, 100, 170])
def test_a_file_that_breaks_off_says_so(tmp_path: Path, cut: int) -> None:
    path = written(tmp_path / "a.pcapng", Captured(TIME, ASKED, True), Captured(TIME, ANSWER, False))
    path.write_bytes(path.read_bytes()[:-cut])
    found: list[Captured] = []
    with pytest.raises(drivebus.NotAllowed, match=r"a\.pcapng (breaks off|has a block|holds no frame|is neither)"):
        found.extend(read(path))
    assert len(found) < 2


def test_what_is_not_a_capture_of_a_serial_line_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "eth.pcapng", Captured(TIME, ASKED, True))
    path.write_bytes(path.read_bytes().replace(struct.pack("<HHI", 252, 0, 0), struct.pack("<HHI", 1, 0, 0)))
    for name, data, why in [
        ("old.pcap", b"\xd4\xc3\xb2\xa1" + bytes(19), "breaks off in its head"),
        ("noise.bin", bytes(range(128, 256)), "neither a pcapng file nor hex text"),
        ("words.txt", b"nothing of that kind\n", "holds no frame"),
        ("empty.txt", b"", "holds no frame"),
    ]:
        (tmp_path / name).write_bytes(data)
        with pytest.raises(drivebus.NotAllowed, match=why):
            list(read(tmp_path / name))
    with pytest.raises(drivebus.NotAllowed, match=r"link type 1 \(Ethernet\), which is not a serial line"):
        list(read(path))
    with pytest.raises(drivebus.NotAllowed, match=r"nowhere\.pcapng cannot be read: there is no such file"):
        list(read(tmp_path / "nowhere.pcapng"))
    with pytest.raises(drivebus.NotAllowed, match="cannot be read: Is a directory"):
        list(read(tmp_path))


@given(st.binary(max_size=400), st.booleans())
def test_no_bytes_break_the_reader(data: bytes, as_pcapng: bool) -> None:
    head = io.BytesIO()
    Writer(head, "COM3", "19200 8E1").write(Captured(TIME, ASKED, True))
    try:
        for packet in packets(io.BytesIO(head.getvalue() + data if as_pcapng else data), "name"):
            assert packet.data is not None
    except drivebus.NotAllowed:
        return


@pytest.mark.parametrize(
    "line",
    [
        "01 03 21 00 00 01 8E 36",
        "010321000001 8E36".replace(" ", ""),
        "12:00:01.250 TX: 01 03 21 00 00 01 8E 36",
        "[01][03][21][00][00][01][8E][36]",
        "send: 0x1 0x3".replace("0x1 0x3", "0x01,0x03,0x21,0x00,0x00,0x01,0x8e,0x36"),
        "2026-11-23 14:00:00,123 DEBUG -> 01-03-21-00-00-01-8e-36  # state",
    ],
)
def test_hex_of_any_tool_is_understood(line: str) -> None:
    [frame] = frames(line)
    assert frame.data == ASKED
    assert frame.asks in (None, True)


def test_marks_of_a_direction_are_taken() -> None:
    text = "TX: 01 03 21 00 00 01 8E 36\nRX: 01 03 02 00 03 F8 45\n<- 01 03 02 00 03 F8 45\nbytes of 12:00:00 only\n"
    assert [frame.asks for frame in frames(text)] == [True, False, False]


def test_exchanges_of_a_capture_have_names_and_times(tmp_path: Path) -> None:
    line = drivebus.SerialFormat()
    path = written(tmp_path / "a.pcapng", Captured(TIME, ASKED, True), Captured(TIME + 0.02, ANSWER, False))
    [exchange] = exchanges_in(read(path), line, Families("gd350"))
    assert dict(exchange.values) == {"status_word_1": 3}
    assert (exchange.unit, exchange.profile, exchange.error) == (1, "gd350", None)
    assert exchange.turnaround == pytest.approx(0.02 - 7 * line.char_time, abs=1e-6)
    # Without directions and times it is worked out.
    [exchange] = exchanges_in([Captured(None, ASKED), Captured(None, ANSWER)], line, Families({1: "gd350"}))
    assert dict(exchange.values) == {"status_word_1": 3}


def test_a_capture_says_of_which_line_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    # Times are those of last characters. At 9600 8N1 the answer has 7 characters of 10 bits: 7.292 ms.
    for settings, said in [
        ("9600 8N1", "after 12.71 ms"),
        ("115200 8E2", "after 19.27 ms"),
        ("a line", "after 15.99 ms"),
    ]:
        with path.open("wb") as stream:
            writer = Writer(stream, "COM3", settings)
            writer.write(Captured(TIME, ASKED, True))
            writer.write(Captured(TIME + 0.02, ANSWER, False))
        told = line_of(path)
        assert (None if told is None else f"{told.baudrate} {told.bytesize}{told.parity}{told.stopbits}") == (
            None if settings == "a line" else settings
        )
        shown = CliRunner().invoke(cli, ["decode", str(path)]).output
        assert said in shown, shown


def test_a_bus_writes_what_it_sends_and_hears(tmp_path: Path) -> None:
    path = tmp_path / "bus.pcapng"
    with drivebus.Bus("sim://gd350?clock=virtual", trace=path) as bus:
        assert bus.read(1, 0x2100) == [3]
        # Who reads it meanwhile has all that was said.
        assert [frame.data for frame in read(path)][-2:] == [ASKED, ANSWER]
    assert [frame.asks for frame in read(path)][-2:] == [True, False]


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be removed there")
def test_a_trace_whose_file_is_removed_says_so_and_the_line_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "bus.pcapng"
    with drivebus.Bus("sim://gd350?clock=virtual", trace=path) as bus:
        bus.read(1, 0x2100)
        path.unlink()
        poll = bus.poll({bus.drive(1): ["status_word_1"]}, 0.1)
        with pytest.warns(drivebus.DrivebusWarning, match=r"bus\.pcapng was not there any more: it was removed"):
            poll.wait(1.5)
        poll.close()
        assert bus.read(1, 0x2100) == [3]
    assert not path.exists()
    bus = drivebus.Bus("sim://gd350?clock=virtual", trace=path)
    (tmp_path / "other").write_text("mine")
    (tmp_path / "other").replace(path)
    with pytest.warns(drivebus.DrivebusWarning, match="another file stands there"):
        bus.close()
    assert path.read_text() == "mine"


def test_a_trace_that_cannot_be_written_opens_nothing(tmp_path: Path) -> None:
    for wrong in (tmp_path, tmp_path / "no" / "where.pcapng", "", 3, "a\0b"):
        with pytest.raises(drivebus.NotAllowed, match=r"trace is|cannot be written"):
            drivebus.Bus("sim://gd350", trace=wrong)  # type: ignore[arg-type]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no full disk to try")  # noqa: PTH110
def test_a_full_disk_ends_the_trace_and_not_the_line() -> None:
    with pytest.raises(drivebus.NotAllowed, match="cannot be written: No space left on device"):
        drivebus.Bus("sim://gd350", trace="/dev/full")
