"""Whatever a log looks like, its frames come out: none is lost, none is added, and who sent each is right.

Frames are made here, and their CRC is that of the loop of *Modbus over Serial Line* V1.02, §6.2.2.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivebus._native import judge
from drivebus.capture.encoding import decoded
from drivebus.capture.text import heard


def whole(body: bytes) -> bytes:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return body + struct.pack("<H", crc)


UNITS, WORDS = st.integers(1, 247), st.integers(0, 0xFFFF)


@st.composite
def exchanges(draw: st.DrawFn) -> list[bytes]:
    """A request and its answer."""
    unit, address = draw(UNITS), draw(st.integers(0, 0xFF00))
    kind = draw(st.sampled_from(["read", "write", "write_many", "refused"]))
    words = draw(st.lists(WORDS, min_size=1, max_size=12))
    read = whole(struct.pack(">BBHH", unit, 3, address, len(words)))
    data = struct.pack(f">{len(words)}H", *words)
    if kind == "read":
        return [read, whole(bytes([unit, 3, len(data)]) + data)]
    if kind == "write":
        return [whole(struct.pack(">BBHH", unit, 6, address, words[0]))] * 2
    if kind == "write_many":
        head = struct.pack(">BBHH", unit, 16, address, len(words))
        return [whole(head + bytes([len(data)]) + data), whole(head)]
    return [read, whole(bytes([unit, 0x83, draw(st.integers(1, 11))]))]


def joined(separator: str, each: Callable[[int], str]) -> Callable[[bytes], str]:
    return lambda data: separator.join(map(each, data))


RADICES = {
    "two digits": joined(" ", "{:02X}".format),
    "two small digits": joined(" ", "{:02x}".format),
    "one or two digits": joined(" ", "{:x}".format),
    "colons": joined(":", "{:02X}".format),
    "dashes": joined("-", "{:02X}".format),
    "points": joined(".", "{:02X}".format),
    "commas": joined(", ", "{:02X}".format),
    "semicolons": joined(";", "{:02X}".format),
    "wide": joined("  ", "{:02X}".format),
    "tabs": joined("\t", "{:02X}".format),
    "0x": joined(" ", "0x{:02x}".format),
    "0x and one digit": joined(" ", "0x{:x}".format),
    "0x and commas": joined(",", "0x{:02X}".format),
    "dollars": joined(" ", "${:02X}".format),
    "H behind": joined(" ", "{:02X}H".format),
    "h behind, commas": joined(",", "{:02x}h".format),
    "escapes": joined("", "\\x{:02x}".format),
    "brackets": lambda data: "".join(f"[{byte:02X}]" for byte in data),
    "angles": lambda data: "".join(f"<{byte:02X}>" for byte in data),
    "glued": lambda data: data.hex(),
    "groups of two": lambda data: data.hex(" ", -2),
    "groups of four": lambda data: data.hex(" ", -4).upper(),
    "decimal": joined(" ", str),
    "decimal and commas": joined(", ", str),
    "decimal of three": joined(" ", "{:03d}".format),
    "decimal in brackets": lambda data: str(list(data)),
    "decimal with a sign": lambda data: str([byte - 256 if byte > 127 else byte for byte in data]),
    "Python": lambda data: repr(bytes(data)),
    "C, in octal": lambda data: '"' + "".join(f"\\{byte:03o}" for byte in data) + '"',
    "binary": joined(" ", "{:08b}".format),
}
STAMPS = [
    "",
    "12:00:01.250 ",
    "[09:15:30] ",
    "2026-03-05 09:15:30,120 ",
    "2026-03-05T09:15:30.120Z ",
    "05.03.2026 09:15:30 ",
    "3/5/2026 9:15:30 AM ",
    "Mar  5 09:15:30 host prog[812]: ",
    "[1592057251.127557] ",
    "0.004512 s: ",
    "+12 ms ",
    "D (2054) MODBUS: ",
]
LABELS = [
    ("TX: ", "RX: "),
    ("RX: ", "TX: "),
    (">> ", "<< "),
    ("Send: ", "Recv: "),
    ("-> ", "<- "),
    ("[Tx] ", "[Rx] "),
    ("master: ", "slave: "),
    ("request=", "response="),
    ("", ""),
]
NUMBERS = ["", "{} ", "{}: ", "#{} ", "{:04d} ", "({}) "]
ENDS = ["", "   ", " (8 bytes)", " ; ok", "\r"]


@settings(deadline=None, max_examples=200)
@given(
    talk=st.lists(exchanges(), min_size=1, max_size=4),
    radix=st.sampled_from(sorted(RADICES)),
    stamp=st.sampled_from(STAMPS),
    labels=st.sampled_from(LABELS),
    number=st.sampled_from(NUMBERS),
    end=st.sampled_from(ENDS),
    first=st.integers(1, 300),
)
@example(
    # Read as hexadecimal, the third line has the head of a Modbus TCP frame: length 2, unit 60, function 11.
    talk=[
        [whole(b"\1\3\0\0\0\1"), whole(b"\1\3\2\0\0")],
        [whole(b"\1\3\0\0\0\2"), whole(b"\1\3\4\0\0\0\0")],
    ],
    radix="decimal with a sign",
    stamp="",
    labels=("TX: ", "RX: "),
    number="",
    end="",
    first=1,
)
def test_a_log_of_any_form_gives_its_frames(
    talk: list[list[bytes]],
    radix: str,
    stamp: str,
    labels: tuple[str, str],
    number: str,
    end: str,
    first: int,
) -> None:
    frames = [(frame, asks) for exchange in talk for frame, asks in zip(exchange, (True, False), strict=True)]
    lines = [
        f"{number.format(first + at)}{stamp}{labels[0 if asks else 1]}{RADICES[radix](frame)}{end}"
        for at, (frame, asks) in enumerate(frames)
    ]
    found = [frame for frame in heard("\n".join(lines))[0] if frame.is_frame]
    assert [frame.data for frame in found] == [frame for frame, _ in frames], lines
    told = [(frame.asks, asks) for frame, (_, asks) in zip(found, frames, strict=True)]
    # Without labels a write by itself may be either.
    assert all(one == other or (one is None and not labels[0]) for one, other in told), lines


@settings(deadline=None, max_examples=200)
@given(
    talk=st.lists(exchanges(), min_size=1, max_size=4),
    width=st.sampled_from([1, 3, 8, 16, 32]),
    address=st.sampled_from(["", "{:04x}  ", "{:08x}: ", "{:06X} ", "0x{:04x}:  "]),
    text=st.sampled_from(["", "  |{}|", "   {}"]),
    separator=st.sampled_from([" ", ", "]),
)
def test_frames_over_several_lines_are_whole(
    talk: list[list[bytes]], width: int, address: str, text: str, separator: str
) -> None:
    frames = [frame for exchange in talk for frame in exchange]
    data = b"".join(frames)
    lines = []
    for at in range(0, len(data), width):
        part = data[at : at + width]
        shown = "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in part)
        lines.append(
            address.format(at) + separator.join(f"{byte:02x}" for byte in part).ljust(3 * width) + text.format(shown)
        )
    found = [frame.data for frame in heard("\n".join(lines))[0] if frame.is_frame]
    assert found == frames, lines


@settings(deadline=None, max_examples=200)
@given(
    talk=exchanges(),
    radix=st.sampled_from(sorted(RADICES)),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"]),
    end=st.sampled_from(["\n", "\r\n", "\r", "\0\n"]),
)
def test_every_encoding_is_read(talk: list[bytes], radix: str, encoding: str, end: str) -> None:
    text = "".join(f"Gerät: {RADICES[radix](frame)}{end}" for frame in talk)
    found = heard(decoded(text.encode(encoding)))[0]
    assert [frame.data for frame in found if frame.is_frame] == talk


@settings(deadline=None, max_examples=200)
@given(talk=exchanges(), radix=st.sampled_from(sorted(RADICES)), at=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_no_damage_makes_a_frame(talk: list[bytes], radix: str, at: int, byte: int) -> None:
    text = "\n".join(f"TX: {RADICES[radix](frame)}" for frame in talk).encode()
    at %= len(text)
    for damaged in (text[:at], text[:at] + bytes([byte]) + text[at + 1 :]):
        for frame in heard(decoded(damaged))[0]:
            # What is called a frame has its CRC; where nothing is wrong inside, it is one of those that were written.
            assert not frame.is_frame or whole(frame.data[:-2]) == frame.data
            assert not frame.is_frame or frame.data in talk or judge(frame.data)[2] is not None
