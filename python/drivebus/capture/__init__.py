"""Captures: the frames of a line in a file that Wireshark opens, or in the text of any tool.

`frame` says what is in one, and whether bytes are a frame. `opened` tells formats apart: `pcapng` and `pcap` give
`packets`, all else is a text. `contents` sorts packets: `links` says what is in one of a `serial_line`, `network` finds
TCP connections in those of a network and `modbus_tcp` what of these is Modbus, `streams` finds frames in bytes.

Of a text, `encoding` makes letters of its bytes and `tokens` numbers of the letters. `layout` says what stands beside
the bytes, `finding` finds the frames, `speakers` says who sent each, and `text` is all of that.

`reading` reads any of them, `writer` makes one.
"""

from drivebus.capture.frame import Captured
from drivebus.capture.reading import line_of, read
from drivebus.capture.streams import answers
from drivebus.capture.writer import Writer
from drivebus.rtu import is_frame

__all__ = ["Captured", "Writer", "answers", "is_frame", "line_of", "read"]
