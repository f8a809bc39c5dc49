"""Captures: the frames of a line in a file that Wireshark opens, or as hex text.

`frame` says what is in one, `pcapng` how its blocks look, `links` how a frame lies in a packet, `text` what hex of any
tool means. `reading` opens any of them, `writer` makes one.
"""

from drivebus.capture.frame import Captured
from drivebus.capture.reading import line_of, read
from drivebus.capture.writer import Writer

__all__ = ["Captured", "Writer", "line_of", "read"]
