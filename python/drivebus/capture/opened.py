"""Opens the file of a capture and tells of which format it is, compressed or not."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from drivebus import checks
from drivebus.capture import pcap, pcapng
from drivebus.capture.packets import Packet
from drivebus.errors import BadArgument

__all__ = ["opened", "packets_of"]

_GZIP = b"\x1f\x8b"
_OTHERS = {
    b"\x28\xb5\x2f\xfd": "compressed by zstd; unpack it first (zstd -d)",
    b"\x04\x22\x4d\x18": "compressed by lz4; unpack it first (lz4 -d)",
    b"\xfd7zX": "compressed by xz; unpack it first (xz -d)",
    b"BZh9": "compressed by bzip2; unpack it first (bunzip2)",
    b"PK\x03\x04": "a zip archive; unpack it first",
    b"snoo": "a capture in the format of snoop; save it as pcapng (Wireshark: Save As)",
    b"\xa1\xb2\xcd\x34": "a capture in a modified pcap format; save it as pcapng (Wireshark: Save As)",
    b"\x34\xcd\xb2\xa1": "a capture in a modified pcap format; save it as pcapng (Wireshark: Save As)",
}
"""How files begin that people take for captures and that are not read, and what they are."""


@contextmanager
def opened(path: Path, name: str) -> Iterator[tuple[bytes, BinaryIO]]:
    """The first four bytes of the file at *path*, unpacked, and all of it; *name* is for messages.

    Raises:
        NotAllowed: It cannot be read, now or while it is; or it is of a format that is known and not read.
    """
    try:
        with path.open("rb") as file:
            is_packed = file.read(2) == _GZIP
            file.seek(0)
            stream = cast("BinaryIO", gzip.GzipFile(fileobj=file)) if is_packed else file
            magic = stream.read(4)
            stream.seek(0)
            if magic in _OTHERS:
                raise BadArgument(f"{name} is {_OTHERS[magic]}")
            yield magic, stream
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BadArgument(f"{name} breaks off: what gzip packed is not whole ({error})") from None
    except OSError as error:
        raise checks.unread(name, error) from None


def packets_of(magic: bytes) -> Callable[[BinaryIO, str], Iterator[Packet]] | None:
    """What reads the packets of a file that begins with *magic*; None where it is no capture."""
    return pcapng.packets if magic == pcapng.MAGIC else pcap.packets if magic in pcap.MAGICS else None
