"""What masters asked on a simulated line, byte by byte."""

from __future__ import annotations

from drivebus import Simulator
from drivebus.rtu import framed

_WRITES = ("05", "06", "0F", "10")


def asked(simulator: Simulator) -> list[str]:
    """Each request without unit and CRC, which is right."""
    sent = [frame for _, side, frame in simulator.line.trace() if side == "master"]
    assert all(framed(frame[:-2]) == frame for frame in sent)
    return [frame[1:-2].hex(" ").upper() for frame in sent]


def written(simulator: Simulator) -> list[str]:
    """Those of Modbus that write."""
    return [pdu for pdu in asked(simulator) if pdu[:2] in _WRITES]
