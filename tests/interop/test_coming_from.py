"""The tables "Coming from …" of docs/coming-from.md: each pair of calls asks the same of a drive."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import minimalmodbus
import pytest
from pymodbus.client import ModbusSerialClient

import drivebus
from drivebus.sim import Simulator

PAGE = Path(__file__).resolve().parent.parent.parent / "docs/coming-from.md"


def rows(begins: str) -> list[tuple[str, str]]:
    """The calls of the table whose left side begins so, and what they are here."""
    page = PAGE.read_text(encoding="utf-8")
    row = re.compile(rf"^\| `({re.escape(begins)}[^`]*)`[^|]*\| `([^`]*)`", re.MULTILINE)
    # What is named only, with arguments left out, is not there to be called.
    return [(match[1], match[2]) for match in row.finditer(page) if "…" not in match[1]]


def request(simulator: Simulator) -> bytes:
    """What a master sent last. A bus that was just opened makes sure of the line before."""
    return next(frame for _, who, frame in reversed(simulator.line.trace()) if who == "master")


def words(result: Any) -> object:
    """What was read, as plain words."""
    return list(result) if isinstance(result, (list, tuple)) else result


@pytest.mark.parametrize(("theirs", "ours"), rows("instrument."), ids=lambda text: str(text))
def test_minimalmodbus(simulator: Simulator, theirs: str, ours: str) -> None:
    instrument = minimalmodbus.Instrument(simulator.port, 1, close_port_after_each_call=True)
    instrument.serial.timeout = 1  # 50 ms from its factory, which a busy machine may need
    _compare(simulator, {"instrument": instrument}, theirs, ours)


@pytest.fixture
def client(simulator: Simulator) -> Iterator[ModbusSerialClient]:
    client = ModbusSerialClient(simulator.port, parity="N", retries=0)
    yield client
    client.close()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(("theirs", "ours"), rows("client."), ids=lambda text: str(text))
def test_pymodbus(simulator: Simulator, client: ModbusSerialClient, theirs: str, ours: str) -> None:
    assert client.connect()
    _compare(simulator, {"client": client}, theirs, ours)


def _compare(simulator: Simulator, other: dict[str, object], theirs: str, ours: str) -> None:
    """Both calls send the same request, and give the same words."""
    given = eval(theirs, dict(other))
    asked = request(simulator)
    for each in other.values():
        getattr(each, "close", lambda: None)()
    with drivebus.Bus(simulator.port, parity="N") as bus:
        names = {"bus": bus, "drive": bus.drive(1, "gd350")}
        result = eval(ours, names)
    assert request(simulator) == asked
    if "read" in theirs:
        assert words(given) == words(result)


def test_there_are_rows() -> None:
    assert len(rows("instrument.")) == 6
    assert len(rows("client.")) == 4


def test_what_is_named_here_is_there() -> None:
    section = PAGE.read_text(encoding="utf-8")
    with drivebus.Bus("sim://gd350") as bus:
        names = {"drivebus": drivebus, "bus": bus, "drive": bus.drive(1)}
        for row in re.findall(r"^\|[^|]*\|([^|]*)\|$", section, re.MULTILINE):
            for owner, name in re.findall(r"\b(drivebus|bus|drive)\.([a-z_]+)\(", row):
                assert callable(getattr(names[owner], name)), f"{owner}.{name}"
    for name in re.findall(r"`(NoAnswer|BadAnswer|Refused)`", section):
        assert issubclass(getattr(drivebus, name), drivebus.DrivebusError)
    for name in ("NoResponseError", "InvalidResponseError", "SlaveReportedException"):
        assert name in section
        assert issubclass(getattr(minimalmodbus, name), OSError)
