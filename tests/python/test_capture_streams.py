"""The bytes of a direction in a capture are a stream: how they are cut into records changes nothing of the frames."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.python.made_captures import block, framed, interface, packet, pcap, rtac, section

import drivebus
from drivebus.capture import Captured, line_of, read
from drivebus.capture.streams import Piece, Record, pieces
from drivebus.cli import cli

TIME = 1_772_705_732
# A read of two words and its answer, a write and its echo, a write of two words, a refusal, and a maker's own function.
ASKED, ANSWER = framed("03 03 30 00 00 02"), framed("03 03 04 03 E8 02 58")
WRITE = framed("03 06 20 01 07 D0")
MANY, TOOK = framed("03 10 20 00 00 02 04 00 01 07 D0"), framed("03 10 20 00 00 02")
REFUSED = framed("03 83 02")
OWN = framed("03 41 01 02 03 04 05")


def cut(data: bytes, *ends: int) -> list[bytes]:
    return [data[start:end] for start, end in zip((0, *ends), (*ends, len(data)), strict=True)]


def found(records: Sequence[bytes]) -> list[bytes]:
    return [piece.data for piece in pieces([Record(at, None, data) for at, data in enumerate(records)])]


def decoded(path: Path, *words: str) -> Result:
    return CliRunner().invoke(cli, [*words, "decode", str(path)])


def shown(path: Path, *words: str) -> list[str]:
    """What stands behind the times."""
    done = decoded(path, *words)
    assert done.exit_code == 0, done.output
    return [line[30:].split(", after")[0] for line in done.stdout.splitlines()]


READING = "unit 3: read 2 words at 3000H -> 3000H = 1000, 3001H = 600"


@given(st.data())
@settings(max_examples=200)
def test_frames_are_the_same_however_they_are_cut(data: st.DataObject) -> None:
    frames = data.draw(st.lists(st.sampled_from([ASKED, MANY, REFUSED, ANSWER, WRITE]), min_size=1, max_size=8))
    wire = b"".join(frames)
    ends = data.draw(st.sets(st.integers(1, len(wire) - 1), max_size=len(wire) - 1))
    assert found(cut(wire, *sorted(ends))) == frames


def test_a_function_of_the_makers_own_ends_with_a_record_or_where_a_frame_begins() -> None:
    assert found([OWN]) == [OWN]
    assert found([OWN[:3], OWN[3:]]) == [OWN]
    assert found([OWN + ASKED]) == [OWN, ASKED]
    assert found([OWN + OWN, ASKED]) == [OWN, OWN, ASKED]


def test_what_is_no_frame_is_noise_and_no_frame_behind_it_is_lost() -> None:
    damaged = b"\x03\x03\x30\x00\x00\x03" + ASKED[6:]
    assert found([b"\x00" + ASKED]) == [b"\x00", ASKED]
    assert found([damaged, ASKED]) == [damaged, ASKED]
    assert found([ASKED[:5], ASKED]) == [ASKED[:5], ASKED], "one that breaks off does not take the next one's bytes"
    assert found([damaged[:3], damaged[3:] + ASKED]) == [damaged[:3], damaged[3:], ASKED]
    assert found([]) == []


def test_a_piece_is_of_the_record_with_its_last_byte() -> None:
    records = [Record(4, 1.0, ASKED[:3]), Record(7, 2.0, ASKED[3:] + ANSWER[:2]), Record(9, 3.5, ANSWER[2:])]
    assert list(pieces(records)) == [Piece(7, 2.0, ASKED), Piece(9, 3.5, ANSWER)]


def as_rtac(*said: tuple[int, bytes]) -> bytes:
    """A capture of events, a millisecond apart."""
    blocks = (packet(TIME * 10**6 + 1000 * at, rtac(*each)) for at, each in enumerate(said))
    return section() + interface(250) + b"".join(blocks)


def test_an_answer_in_two_records_is_one_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    path.write_bytes(as_rtac((1, ASKED), (2, ANSWER[:5]), (2, ANSWER[5:])))
    found = list(read(path))
    assert [(each.data, each.asks) for each in found] == [(ASKED, True), (ANSWER, False)]
    assert [each.time for each in found] == pytest.approx([TIME, TIME + 0.002], abs=1e-6)
    assert shown(path) == [READING]


def test_directions_are_streams_of_their_own(tmp_path: Path) -> None:
    """On four wires both speak at once."""
    path = tmp_path / "a.pcapng"
    path.write_bytes(as_rtac((1, ASKED + WRITE[:4]), (2, ANSWER[:3]), (1, WRITE[4:]), (4, ANSWER[3:]), (4, WRITE)))
    assert [(each.data, each.asks) for each in read(path)] == [
        (ASKED, True),
        (WRITE, True),
        (ANSWER, False),
        (WRITE, False),
    ]


def test_events_without_bytes_are_none_and_what_is_lost_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    path.write_bytes(as_rtac((0, b""), (1, ASKED), (3, b""), (2, ANSWER), (4, b""), (6, b"")))
    assert [each.data for each in read(path)] == [ASKED, ANSWER]
    # Behind what is lost a frame begins anew.
    path.write_bytes(as_rtac((1, ASKED), (2, ANSWER[:5]), (5, b""), (8, b""), (2, ANSWER[5:]), (1, ASKED), (2, ANSWER)))
    assert [each.data for each in read(path)] == [ASKED, ANSWER[:5], ANSWER[5:], ASKED, ANSWER]
    assert "a.pcapng: the capture tells of 1 lost piece, 1 parity error.\n" in decoded(path).stderr


@pytest.mark.parametrize("masters", [True, False])
def test_who_asks_is_told_by_the_frames_and_not_by_who_captured(tmp_path: Path, masters: bool) -> None:
    path = tmp_path / "a.pcapng"
    said = [(ASKED, True), (ANSWER, False), (WRITE, True), (WRITE, False)]
    blocks = (packet(TIME * 10**6 + at, data, outbound=asks is masters) for at, (data, asks) in enumerate(said))
    path.write_bytes(section() + interface(147) + b"".join(blocks))
    assert [(each.data, each.asks) for each in read(path)] == said


def test_of_frames_that_are_alike_the_first_asks(tmp_path: Path) -> None:
    """A unit's own capture of writes: what it received comes first, and what it sent is the same."""
    path = tmp_path / "a.pcapng"
    path.write_bytes(as_rtac((2, WRITE), (1, WRITE), (2, WRITE), (1, WRITE)))
    assert [each.asks for each in read(path)] == [True, False, True, False]
    path.write_bytes(as_rtac((1, WRITE), (2, WRITE), (1, WRITE)))
    assert [each.asks for each in read(path)] == [True, False, True]


def test_who_only_listens_receives_both(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    blocks = (packet((TIME * 1000 + 20 * at) * 1000, data, outbound=False) for at, data in enumerate([ASKED, ANSWER]))
    path.write_bytes(section() + interface(147) + b"".join(blocks))
    assert [each.asks for each in read(path)] == [None, None]
    assert shown(path) == [READING]


@pytest.mark.parametrize("link", [147, 150, 162])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("nanoseconds", [False, True])
def test_the_older_format_is_read_as_its_twin(tmp_path: Path, link: int, order: str, nanoseconds: bool) -> None:
    old, new = tmp_path / "a.pcap", tmp_path / "a.pcapng"
    said = [(TIME + 0.25, ASKED), (TIME + 0.265625, ANSWER[:4]), (TIME + 0.28125, ANSWER[4:])]
    old.write_bytes(pcap(link, said, order, nanoseconds=nanoseconds))
    resolution, ticks = (9, 10**9) if nanoseconds else (6, 10**6)
    blocks = (packet(int(time) * ticks + round(time % 1 * ticks), data, order) for time, data in said)
    new.write_bytes(section(order) + interface(link, order, resolution=resolution) + b"".join(blocks))
    assert list(read(old)) == [Captured(TIME + 0.25, ASKED), Captured(TIME + 0.28125, ANSWER)]
    assert list(read(old)) == list(read(new))
    assert shown(old) == shown(new) == [READING]


def test_the_older_format_has_directions_where_its_link_has(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(pcap(250, [(TIME, rtac(1, ASKED)), (TIME + 0.01, rtac(2, ANSWER))]))
    assert [each.asks for each in read(path)] == [True, False]


def test_what_gzip_packed_is_read_as_it_is(tmp_path: Path) -> None:
    for name, data in (
        ("a.pcapng", as_rtac((1, ASKED), (2, ANSWER))),
        ("a.pcap", pcap(147, [(TIME, ASKED), (TIME + 0.01, ANSWER)])),
        ("a.txt", f"{ASKED.hex(' ')}\n{ANSWER.hex(' ')}\n".encode()),
    ):
        plain, packed = tmp_path / name, tmp_path / f"{name}.gz"
        plain.write_bytes(data)
        packed.write_bytes(gzip.compress(data))
        assert list(read(packed)) == list(read(plain)) != []
        packed.write_bytes(gzip.compress(data)[:-9])
        with pytest.raises(drivebus.NotAllowed, match=r"a\.\w+\.gz breaks off"):
            list(read(packed))


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\x28\xb5\x2f\xfd" + bytes(20), "compressed by zstd"),
        (b"\x04\x22\x4d\x18" + bytes(20), "compressed by lz4"),
        (b"snoop\0\0\0" + bytes(20), "format of snoop"),
        (b"\x34\xcd\xb2\xa1" + bytes(20), "modified pcap format"),
        (pcap(147, []), "holds no frame: it has no packets"),
        (pcap(147, [(TIME, b"nothing of Modbus")]), "holds no frame: no bytes in its 1 packet match a CRC"),
        (section() + interface(147), "holds no frame: it has no packets"),
    ],
)
def test_what_has_no_frame_is_told_what_it_is(tmp_path: Path, data: bytes, why: str) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(data)
    done = decoded(path)
    assert (done.exit_code, why in done.stderr) == (2, True), done.output


def test_several_sections_and_resolutions_are_one_capture(tmp_path: Path) -> None:
    """Each section has its own byte order and interfaces; each of these its own ticks, and seconds to add to them."""
    path = tmp_path / "a.pcapng"
    first = section() + interface(147, resolution=0x8A, name="one") + packet(TIME << 10 | 256, ASKED)
    head = section(">") + interface(147, ">", resolution=9, offset=TIME, name="one")
    path.write_bytes(first + head + packet(750_000_000, ANSWER, ">"))
    assert [(each.time, each.data, each.line) for each in read(path)] == [
        (TIME + 0.25, ASKED, ""),
        (TIME + 0.75, ANSWER, ""),
    ]


def test_two_interfaces_may_be_the_sides_of_one_line(tmp_path: Path) -> None:
    """So a line on four wires is captured, with an adapter at each pair."""
    path = tmp_path / "a.pcapng"
    said = [(0, ASKED), (1, ANSWER[:3]), (1, ANSWER[3:]), (0, WRITE), (1, WRITE)]
    blocks = (packet((TIME * 1000 + 20 * at) * 1000, data, on=on) for at, (on, data) in enumerate(said))
    path.write_bytes(section() + interface(147, name="a") + interface(147, name="b") + b"".join(blocks))
    assert [(each.data, each.asks) for each in read(path)] == [
        (ASKED, True),
        (ANSWER, False),
        (WRITE, True),
        (WRITE, False),
    ]
    assert "interfaces 0 (a) and 1 (b) are taken for the two sides of one line" in decoded(path).stderr


def test_what_a_capture_of_several_interfaces_says_of_its_line_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    other = interface(1, name="eth0")
    path.write_bytes(section() + other + interface(147, description="9600 8N1") + packet(TIME, ASKED, on=1))
    line = line_of(path)
    assert line is not None
    assert (line.baudrate, line.parity) == (9600, "N")
    path.write_bytes(section() + other + packet(TIME, ASKED) + interface(147, description="9600 8N1"))
    assert line_of(path) is None


def test_each_interface_is_a_line_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    said = [(0, ASKED, True), (1, ASKED, True), (1, REFUSED, False), (0, ANSWER, False)]
    blocks = (packet((TIME * 1000 + at) * 1000, data, on=on, outbound=asks) for at, (on, data, asks) in enumerate(said))
    path.write_bytes(section() + interface(147, name="ttyUSB0") + interface(147) + b"".join(blocks))
    done = decoded(path)
    assert [line[30:].split(", after")[0] or line for line in done.stdout.splitlines()] == [
        "0 (ttyUSB0):",
        READING,
        "1:",
        "unit 3: read 2 words at 3000H -> refused: exception 02H",
    ]


def test_interfaces_that_are_not_serial_are_left_out_with_a_word(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    other = b"".join(packet(TIME * 10**6, bytes(60), on=0) for _ in range(3))
    blocks = packet(TIME * 10**6, ASKED, on=1) + packet((TIME * 1000 + 20) * 1000, ANSWER, on=1)
    path.write_bytes(section() + interface(1, name="eth0") + interface(147) + other + blocks)
    done = decoded(path)
    assert done.exit_code == 0
    assert done.stdout.count("\n") == 1
    assert READING in done.stdout
    assert done.stderr == (
        f"{path}: interface 0 (eth0) is left out with 3 packets: link type 1 (Ethernet) is no serial line.\n"
    )
    assert len(list(read(path))) == 2


@pytest.mark.parametrize(
    ("link", "name"),
    [(0, "BSD loopback"), (105, "Wi-Fi"), (189, "usbmon"), (220, "usbmon"), (249, "USBPcap"), (227, "CAN"), (999, "")],
)
@pytest.mark.parametrize("is_old", [True, False])
def test_what_is_no_serial_line_is_named(tmp_path: Path, link: int, name: str, is_old: bool) -> None:
    path = tmp_path / "a.pcapng"
    data = bytes(27) + ASKED
    path.write_bytes(pcap(link, [(TIME, data)]) if is_old else section() + interface(link) + packet(TIME, data))
    done = decoded(path)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert f"a.pcapng is a capture of link type {link}" in done.stderr
    assert name in done.stderr
    assert "which is not a serial line" in done.stderr
    assert ("capture at the port itself" in done.stderr) is name.startswith(("usb", "USB"))


def test_what_the_capture_cut_short_is_not_joined(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    many, took = framed("03 10 20 00 00 02 04 00 01 07 D0"), framed("03 10 20 00 00 02")
    path.write_bytes(pcap(147, [(TIME, many), (TIME + 0.02, took)], longest=8))
    assert [each.data for each in read(path)] == [many[:8], took]
    assert "the capture tells of 1 packet that it cut short" in decoded(path).stderr
    path = tmp_path / "a.pcapng"
    # A simple packet has no time, and is cut by what its interface says.
    simple = block(3, struct.pack("<I", len(many)) + many[:8]) + block(3, struct.pack("<I", len(took)) + took)
    path.write_bytes(section() + interface(147, longest=8) + simple)
    assert [(each.time, each.data) for each in read(path)] == [(None, many[:8]), (None, took)]


def test_an_obsolete_packet_block_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    stamp = TIME * 10**6
    head = struct.pack("<HHIIII", 0, 5, stamp >> 32, stamp & 0xFFFF_FFFF, len(ASKED), len(ASKED))
    path.write_bytes(section() + interface(147) + block(2, head + ASKED))
    assert list(read(path)) == [Captured(TIME, ASKED)]


def test_what_came_before_a_file_breaks_off_is_shown(tmp_path: Path) -> None:
    for name, data in (
        ("a.pcap", pcap(147, [(TIME, ASKED), (TIME + 0.02, ANSWER), (TIME + 0.1, ASKED)])),
        ("a.pcapng", as_rtac((1, ASKED), (2, ANSWER), (1, ASKED))),
    ):
        path = tmp_path / name
        path.write_bytes(data[:-3])
        done = decoded(path)
        assert READING in done.stdout
        assert done.exit_code == 2
        assert "breaks off behind its packet 2" in done.stderr
