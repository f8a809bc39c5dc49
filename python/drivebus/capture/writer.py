"""Writes a capture that Wireshark opens, while it is made."""

from __future__ import annotations

from typing import BinaryIO

from drivebus import _native, checks
from drivebus.capture import links, pcapng
from drivebus.capture.frame import Captured

__all__ = ["Writer"]


class Writer:
    """A pcapng file that grows. Each frame is written whole and at once: a pipe has it, and a kill loses none.

    Args:
        stream: Where it goes, opened for bytes.
        port: The name of the line.
        settings: Its speed and characters, such as "19200 8E1".
        link: `"upper"` (Modbus RTU in Wireshark without a setting) or `"rtac"`; see `drivebus.capture.links`.
    """

    def __init__(self, stream: BinaryIO, port: str, settings: str, link: str = "upper") -> None:
        self._stream = stream
        self._link = checks.one_of("link", link, tuple(links.LINKS))
        head = pcapng.section(f"drivebus {_native.__version__}")
        self._put(head + pcapng.interface(links.LINKS[self._link], port, settings))

    def write(self, frame: Captured) -> None:
        """Writes *frame*.

        Raises:
            OSError: The disk is full, or who read the pipe has gone.
        """
        self._put(pcapng.packet(frame.time or 0.0, links.packed(frame, self._link, frame.is_frame), frame.asks))

    def _put(self, block: bytes) -> None:
        self._stream.write(block)
        self._stream.flush()
