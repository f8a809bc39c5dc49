"""Opens a capture, whatever it is: pcapng, or hex text of any tool."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from drivebus import checks
from drivebus._native import SerialFormat
from drivebus.capture import links, pcapng, text
from drivebus.capture.frame import Captured
from drivebus.errors import NotAllowed

__all__ = ["line_of", "read"]

_OLD_PCAP = (b"\xa1\xb2\xc3\xd4", b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\x3c\x4d", b"\x4d\x3c\xb2\xa1")
_LINE = re.compile(r"(?P<baud>[0-9]{2,8}) (?P<bits>[78])(?P<parity>[NEO])(?P<stop>[12])")
"""What our own captures say of their line, such as 9600 8N1."""
_MOST_TEXT = 64 * 1024 * 1024


def read(path: str | os.PathLike[str]) -> Iterator[Captured]:
    """The frames of the capture at *path*, in its order.

    Raises:
        NotAllowed: It cannot be read, is not a capture, is one of another kind of line, or breaks off; what came before
            was yielded.
    """
    name = os.fspath(path)
    try:
        with Path(path).open("rb") as stream:
            magic = stream.read(4)
            stream.seek(0)
            if magic == pcapng.MAGIC:
                for packet in pcapng.packets(stream, name):
                    yield links.captured(packet, name)
                return
            if magic in _OLD_PCAP:
                raise NotAllowed(
                    f"{name} is a capture in the older pcap format; save it as pcapng (Wireshark: Save As)"
                )
            data = stream.read(_MOST_TEXT + 1)
    except OSError as error:
        raise checks.unread(name, error) from None
    yield from _text(data, name)


def line_of(path: str | os.PathLike[str]) -> SerialFormat | None:
    """The speed and the characters of the line that the capture at *path* is of; None where it does not say.

    Raises:
        NotAllowed: It cannot be read, or is damaged before it says so.
    """
    name = os.fspath(path)
    try:
        with Path(path).open("rb") as stream:
            if stream.read(4) != pcapng.MAGIC:
                return None
            stream.seek(0)
            told = pcapng.description(stream, name)
    except OSError as error:
        raise checks.unread(name, error) from None
    found = _LINE.fullmatch(told or "")
    if found is None:
        return None
    try:
        return SerialFormat(int(found["baud"]), found["parity"], int(found["stop"]), int(found["bits"]))
    except ValueError:
        return None


def _text(data: bytes, name: str) -> Iterator[Captured]:
    if len(data) > _MOST_TEXT:
        raise NotAllowed(f"{name} is not a pcapng file, and too long to be hex text: {_MOST_TEXT >> 20} MiB at most")
    try:
        written = data.decode()
    except UnicodeDecodeError:
        raise NotAllowed(f"{name} is neither a pcapng file nor hex text") from None
    found = False
    for frame in text.frames(written):
        found = True
        yield frame
    if not found:
        raise NotAllowed(f"{name} holds no frame: it is neither a pcapng file nor hex text with a frame on a line")
