"""Huanyang's own protocol, on the same wires and with the same CRC as Modbus, and none: what its frames mean.

A frame is the unit, a function (01 to 06), how many bytes of data follow, those, and the CRC; request and answer look
alike. What is one is decided in the core (`crates/rtu`). After LinuxCNC,
src/hal/user_comps/huanyang-vfd/hy_modbus.c (functions, lengths and data):

| function | bytes of data | what |
| --- | --- | --- |
| 01, 02 | 3; an answer also 2 | reads, writes a parameter: its number, and its word |
| 03 | 1 | control: 01 runs forward, 11 in reverse, 08 stops |
| 04 | 3; a request also 1 | reads a status: its number, and its word |
| 05 | 2 | the frequency, in 0.01 Hz |
| 06 | 1 to 3 | reserved |

Nothing here sends; `drivebus.identify.scan` asks for a status. The drives that speak it are the older HY series; later
ones of the maker speak Modbus.
"""

from __future__ import annotations

from collections.abc import Iterator

from drivebus._native import huanyang_form

__all__ = [
    "NAME",
    "PROFILE",
    "REMARK",
    "STATUS_READ",
    "belong",
    "frames_in",
    "has_form",
    "is_sure",
    "tells_status",
    "words",
]

NAME = "Huanyang's own protocol"
PROFILE = "huanyang-hy"
"""The profile of drives that speak it."""
REMARK = f" ({NAME}, no Modbus)"
"""Stands behind the words of a frame."""
STATUS_READ = bytes((0x04, 0x03, 0x00, 0x00, 0x00))
"""Asks a unit for its status 0, the set frequency. A unit that speaks Modbus is asked by it for no input register, and
refuses."""

_CONTROL = {0x01: "run forward", 0x11: "run in reverse", 0x08: "stop"}
_STATUS = (
    "set frequency",
    "output frequency",
    "output current",
    "speed",
    "DC voltage",
    "AC voltage",
    "counter",
    "temperature",
)


def has_form(data: bytes) -> bool:
    """Whether *data* is a whole frame of this protocol; some of those are frames of Modbus, too."""
    return huanyang_form(data)[0]


def is_sure(data: bytes) -> bool:
    """Whether *data* is a frame of this protocol, and none that Modbus has, whoever sent it."""
    return huanyang_form(data)[1]


def belong(request: bytes, answer: bytes) -> bool:
    """Whether *answer* may be the one to *request*, which both have the form."""
    return request[:2] == answer[:2] and (request[1] in (3, 5, 6) or request[3] == answer[3])


def tells_status(pdu: bytes) -> bool:
    """Whether *pdu* answers `STATUS_READ`: no words of Modbus have three bytes."""
    return len(pdu) == len(STATUS_READ) and pdu.startswith(STATUS_READ[:3])


def frames_in(data: bytes) -> list[bytes] | None:
    """The frames of which *data* consists, in their order; None if there is anything else in it."""
    frames, at = [], 0
    while at < len(data):
        count = data[at + 2] if at + 2 < len(data) else 0
        frame = data[at : at + 5 + count]
        if not has_form(frame):
            return None
        frames.append(frame)
        at += len(frame)
    return frames or None


def words(frame: bytes, sent: bool) -> str:
    """What *frame* means, which a master *sent* or a unit."""
    return f"unit {frame[0]}{':' if sent else ''} {' '.join(_said(frame, sent))}{REMARK}"


def _said(frame: bytes, sent: bool) -> Iterator[str]:
    function, data = frame[1], frame[3:-2]
    word = int.from_bytes(data[1:], "big")
    if function in (1, 2):
        yield f"{'read' if function == 1 else 'write'} PD{data[0]:03d}"
        if function == 2 or not sent:
            yield f"= {word}"
    elif function == 3:
        # A unit answers with its state, in other bits than the command.
        yield f"{'control' if sent else 'control state'} {data[0]:02X}H"
        if sent and data[0] in _CONTROL:
            yield f"({_CONTROL[data[0]]})"
    elif function == 4:
        yield f"read status {data[0]}"
        if data[0] < len(_STATUS):
            yield f"({_STATUS[data[0]]})"
        if not sent and len(data) > 1:
            yield f"= {word}"
    elif function == 5:
        yield f"frequency {int.from_bytes(data, 'big') / 100:.2f} Hz"
    else:
        yield f"function 06 {data.hex(' ').upper()}"
