"""What is on a line while nobody of ours speaks: nothing, noise, or another master with its units."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus import rtu
from drivebus._native import crc16
from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.doctor.search import describe
from drivebus.errors import BadAnswer

__all__ = ["OTHER_MASTER", "UNKNOWN", "frames_in", "heard_findings", "is_frame", "overheard"]

OTHER_MASTER = "other_master"
UNKNOWN = "unknown_traffic"

_LONGEST = 2048
"""Bytes that are looked at: over a second of a line at 19200 bit/s."""

_SHOWN = 3
"""Frames that are shown."""

_IDLE = frozenset({0x00, 0xFF})
"""What a line that nothing holds at rest is read as."""


def heard_findings(bus: Bus, seconds: float) -> Iterator[Finding]:
    """Listens for *seconds*, and says what was heard. Sends nothing."""
    heard = b"".join(piece for _, piece in bus.listen(seconds))
    values = {"seconds": seconds, "bytes": len(heard)}
    if not heard:
        yield Finding("line", "quiet", Severity.OK, f"nothing was heard in {seconds:g} s before asking", values=values)
        return
    frames = frames_in(heard[:_LONGEST])
    if frames:
        yield _other_master(frames, seconds, bus)
        return
    idle = sum(byte in _IDLE for byte in heard)
    if 2 * idle >= len(heard):
        yield Finding(
            "line",
            "no_bias",
            Severity.WARNING,
            f"{len(heard)} bytes came in {seconds:g} s while nobody spoke, {idle} of them 00 or FF: nothing holds the "
            "line at rest",
            "add bias at one place, best at the master: 450 to 650 ohm from + (D1) to 5 V and from - (D0) to common; "
            "look for a wire that is off, and for 120 ohm at both ends and nowhere else",
            values={**values, "idle_bytes": idle},
            error=BadAnswer,
        )
        return
    yield Finding(
        "line",
        UNKNOWN,
        Severity.WARNING,
        f"{len(heard)} bytes that make no frame came in {seconds:g} s while nothing was asked: "
        f"{heard[:16].hex(' ').upper()}",
        "another master at another baud rate or parity, or interference: stop it; keep the cable away from motor "
        "cables, earth its shield",
        values=values,
        error=BadAnswer,
    )


def overheard(bus: Bus, seconds: float) -> Finding | None:
    """Another master, if one is heard within *seconds* at the settings of *bus*."""
    frames = frames_in(b"".join(piece for _, piece in bus.listen(seconds))[:_LONGEST])
    return _other_master(frames, seconds, bus) if frames else None


def _other_master(frames: list[bytes], seconds: float, bus: Bus) -> Finding:
    shown = "; ".join(f"{frame.hex(' ').upper()} = {_said(frame)}" for frame in frames[:_SHOWN])
    return Finding(
        "line",
        OTHER_MASTER,
        Severity.FAULT,
        f"{len(frames)} whole frames came in {seconds:g} s at {describe(bus)} while nothing was asked: {shown}",
        "another master uses the line, and a line has one: nothing was asked, so as not to spoil its frames. Stop "
        "it, and call the doctor again",
        values={
            "seconds": seconds,
            "settings": describe(bus),
            "frames": [frame.hex(" ").upper() for frame in frames[:_SHOWN]],
        },
        error=BadAnswer,
    )


def frames_in(data: bytes) -> list[bytes]:
    """The whole frames in *data*, whatever stands between them: their CRC tells them from chance."""
    frames = []
    at = 0
    while at < len(data):
        frame = next(
            (
                data[at : at + length]
                for length in _lengths(data, at)
                if at + length <= len(data) and is_frame(data[at : at + length])
            ),
            None,
        )
        if frame is None:
            at += 1
        else:
            frames.append(frame)
            at += len(frame)
    return frames


def _lengths(data: bytes, at: int) -> Iterator[int]:
    """How long a frame that begins at *at* may be, by its function: request or answer."""
    head = data[at : at + 7]
    if len(head) < 4 or head[0] > 247:
        return
    function = head[1]
    if function & 0x80:
        yield 5
    elif function in (0x03, 0x04):
        yield 5 + head[2]
        yield 8
    elif function in (0x05, 0x06, 0x08):
        yield 8
    elif function in (0x0F, 0x10):
        yield 8
        if len(head) == 7:
            yield 9 + head[6]


def is_frame(data: bytes) -> bool:
    """Whether *data* ends with its own CRC."""
    return len(data) >= 4 and crc16(data[:-2]) == int.from_bytes(data[-2:], "little")


def _said(frame: bytes) -> str:
    fields = {name: value for name, value in vars(rtu.decode(frame)).items() if value is not None and name != "crc"}
    return ", ".join(f"{name} {value}" for name, value in fields.items())
