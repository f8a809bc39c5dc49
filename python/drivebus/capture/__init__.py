"""Captures: the frames of a line in a file that Wireshark opens, or as hex text.

`frame` says what is in one. `opened` tells formats apart: `pcapng` and `pcap` give `packets`, `text` says what hex of
any tool means. `contents` sorts packets: `links` says what is in one of a `serial_line`, `network` finds TCP
connections in those of a network and `modbus_tcp` what of these is Modbus, `streams` finds frames in bytes. `reading`
reads any of them, `writer` makes one.
"""

from drivebus.capture.frame import Captured
from drivebus.capture.reading import line_of, read
from drivebus.capture.streams import answers, is_frame
from drivebus.capture.writer import Writer

__all__ = ["Captured", "Writer", "answers", "is_frame", "line_of", "read"]
