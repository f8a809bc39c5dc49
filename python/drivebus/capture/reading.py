"""Reads a capture, whatever it is: pcapng, pcap, or hex text of any tool."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from drivebus._native import SerialFormat
from drivebus.capture import pcapng
from drivebus.capture.contents import Contents
from drivebus.capture.frame import Captured
from drivebus.capture.opened import opened, packets_of
from drivebus.errors import BadArgument, NotAllowed

__all__ = ["line_of", "read"]

_LINE = re.compile(r"(?P<baud>[0-9]{2,8}) (?P<bits>[78])(?P<parity>[NEO])(?P<stop>[12])")
"""What our own captures say of their line, such as 9600 8N1."""
_MOST_TEXT = 64 * 1024 * 1024


def read(path: str | os.PathLike[str], say: Callable[[str], object] | None = None) -> Iterator[Captured]:
    """The frames of the capture at *path*, in its order, line by line where it is of several.

    Args:
        path: A pcapng or pcap file, or the text of any tool; also packed by gzip.
        say: Is given what is to be known of the file, a line each: what was left out, and what it is where it is not of
            a serial line.

    Raises:
        NotAllowed: It cannot be read, is not a capture, holds no Modbus, or breaks off; what came before was yielded.
    """
    name = os.fspath(path)
    with opened(Path(path), name) as (magic, stream):
        packets = packets_of(magic)
        if packets is None:
            yield from _text(stream.read(_MOST_TEXT + 1), name, say or _silently)
            return
        contents, broken = Contents(name), None
        try:
            for packet in packets(stream, name):
                contents.take(packet)
        except (NotAllowed, OSError, EOFError, zlib.error) as error:
            # What came before it breaks off is told.
            broken = error
        yield from contents.frames(say or _silently, broken)
        if broken is not None:
            raise broken


def _silently(_text: str) -> None:
    pass


def line_of(path: str | os.PathLike[str]) -> SerialFormat | None:
    """The speed and the characters of the line that the capture at *path* is of; None where it does not say.

    Raises:
        NotAllowed: It cannot be read, or is damaged before it says so.
    """
    name = os.fspath(path)
    with opened(Path(path), name) as (magic, stream):
        told = pcapng.descriptions(stream, name) if magic == pcapng.MAGIC else ()
        found = next((match for text in told if (match := _LINE.fullmatch(text))), None)
    if found is None:
        return None
    try:
        return SerialFormat(int(found["baud"]), found["parity"], int(found["stop"]), int(found["bits"]))
    except ValueError:
        return None


def _text(data: bytes, name: str, say: Callable[[str], object]) -> Iterator[Captured]:
    if len(data) > _MOST_TEXT:
        raise BadArgument(f"{name} is not a pcapng file, and too long to be hex text: {_MOST_TEXT >> 20} MiB at most")
    # What reads text takes a while to load, and who listens to a line needs none of it.
    from drivebus.capture import text
    from drivebus.capture.encoding import decoded

    found, said = text.heard(decoded(data))
    has_frame = any(frame.is_frame for frame in found)
    for remark in said if has_frame else ():
        say(remark)
    yield from found
    if not has_frame:
        why = "".join(f"; {remark}" for remark in said)
        raise BadArgument(
            f"{name} holds no frame: it is neither a pcapng file nor hex text with a frame in it; "
            f"{text.LOOKED_FOR}{why}"
        )
