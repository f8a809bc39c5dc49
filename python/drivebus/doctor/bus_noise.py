"""What is on a line while nobody of ours speaks: nothing, noise, or another master with its units."""

from __future__ import annotations

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import BadAnswer
from drivebus.line import huanyang
from drivebus.line.frames import frames_in, in_words
from drivebus.line.seven_bits import SevenBits, ascii_in
from drivebus.line_search.settings import Settings

__all__ = ["OTHER_MASTER", "UNKNOWN", "heard", "overheard"]

OTHER_MASTER = "other_master"
"""The name of the finding that somebody else asks units of this line."""

UNKNOWN = "unknown_traffic"
"""The name of the finding that bytes come which make no frame."""

_LONGEST = 2048
"""Bytes that are looked at: over a second of a line at 19200 bit/s."""

_SHOWN = 3
"""Frames that are shown."""

_IDLE = frozenset({0x00, 0xFF})
"""What a line that nothing holds at rest is read as."""


def heard(bus: Bus, seconds: float) -> Finding:
    """What is heard on *bus* within *seconds*. Sends nothing."""
    came = _listened(bus, seconds)
    frames = frames_in(came[:_LONGEST])
    idle = sum(byte in _IDLE for byte in came)
    if not came:
        return _quiet(seconds)
    if frames:
        return _other_master(frames, seconds, bus)
    sent = ascii_in(came[:_LONGEST])
    if sent is not None:
        return _ascii_master(sent, seconds, bus)
    if 2 * idle >= len(came):
        return _no_bias(came, idle, seconds)
    return _unknown(came, seconds)


def overheard(bus: Bus, seconds: float) -> Finding | None:
    """Another master, if one is heard within *seconds* at the settings of *bus*."""
    came = _listened(bus, seconds)[:_LONGEST]
    frames = frames_in(came)
    if frames:
        return _other_master(frames, seconds, bus)
    sent = ascii_in(came)
    return None if sent is None else _ascii_master(sent, seconds, bus)


def _listened(bus: Bus, seconds: float) -> bytes:
    return b"".join(piece for _, piece in bus.listen(seconds))


def _quiet(seconds: float) -> Finding:
    return Finding(
        "line",
        "quiet",
        Severity.OK,
        f"nothing was heard in {seconds:g} s before asking",
        values={"seconds": seconds, "bytes": 0},
    )


def _other_master(frames: list[bytes], seconds: float, bus: Bus) -> Finding:
    settings = str(Settings.of(bus))
    shown = [(frame.hex(" ").upper(), in_words(frame)) for frame in frames[:_SHOWN]]
    foreign = [frame for frame in frames if huanyang.is_sure(frame)]
    if foreign:
        return Finding(
            "line",
            OTHER_MASTER,
            Severity.FAULT,
            f"{len(frames)} whole frames came in {seconds:g} s at {settings} while nothing was asked, of "
            f"{huanyang.NAME}: " + "; ".join(f"{wire} = {words}" for wire, words in shown),
            f"another program speaks to unit {foreign[0][0]} there, in a protocol that has the CRC of Modbus and "
            "nothing else of it. Units for Modbus need a line of their own, or that program stopped and that drive off",
            values={
                "seconds": seconds,
                "settings": settings,
                "frames": [wire for wire, _ in shown],
                "protocol": "huanyang",
            },
            error=BadAnswer,
        )
    return Finding(
        "line",
        OTHER_MASTER,
        Severity.FAULT,
        f"{len(frames)} whole frames came in {seconds:g} s at {settings} while nothing was asked: "
        + "; ".join(f"{wire} = {words}" for wire, words in shown),
        "another master uses the line, and a line has one: nothing was asked, so as not to spoil its frames. Stop "
        "it, and call the doctor again",
        values={"seconds": seconds, "settings": settings, "frames": [wire for wire, _ in shown]},
        error=BadAnswer,
    )


def _ascii_master(sent: SevenBits, seconds: float, bus: Bus) -> Finding:
    settings = Settings.of(bus)
    text = bytes(byte & 0x7F for byte in sent.wire).decode("ascii").strip()
    return Finding(
        "line",
        OTHER_MASTER,
        Severity.FAULT,
        f"{sent} came in {seconds:g} s at {settings.baudrate} bit/s while nothing was asked, such as {text}, of unit "
        f"{sent.unit}",
        "another program speaks Modbus ASCII there, which drivebus does not: nothing was asked, so as not to spoil it. "
        "Units for Modbus RTU need a line of their own; or stop that program, and set its units to RTU with 8N1 or 8E1",
        values={
            "seconds": seconds,
            "settings": str(settings),
            "frames": [sent.wire.hex(" ").upper()],
            "protocol": "modbus-ascii",
            "format": sent.format,
        },
        error=BadAnswer,
    )


def _no_bias(came: bytes, idle: int, seconds: float) -> Finding:
    return Finding(
        "line",
        "no_bias",
        Severity.WARNING,
        f"{len(came)} bytes came in {seconds:g} s while nobody spoke, {idle} of them 00 or FF: nothing holds the "
        "line at rest",
        "add bias at one place, best at the master: 450 to 650 ohm from + (D1) to 5 V and from - (D0) to common; "
        "look for a wire that is off, and for 120 ohm at both ends and nowhere else",
        values={"seconds": seconds, "bytes": len(came), "idle_bytes": idle},
        error=BadAnswer,
    )


def _unknown(came: bytes, seconds: float) -> Finding:
    return Finding(
        "line",
        UNKNOWN,
        Severity.WARNING,
        f"{len(came)} bytes that make no frame came in {seconds:g} s while nothing was asked: "
        f"{came[:16].hex(' ').upper()}",
        "another master at another baud rate or parity, or interference: stop it; keep the cable away from motor "
        "cables, earth its shield",
        values={"seconds": seconds, "bytes": len(came)},
        error=BadAnswer,
    )
