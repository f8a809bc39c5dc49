"""Wireshark opens what drivebus captures and takes each frame apart as drivebus does."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.interop.conftest import TOOLS, lacking, library_folders

import drivebus
from drivebus.capture import Captured, Writer, read
from drivebus.sniffer import exchanges_in

FRAMES = 10_000
AS_UNITS = ("-o", "mbrtu.tcp.port:502")
"""What tells Wireshark which end is the unit; without it a write and its answer look alike to it."""

Row = dict[str, list[str]]
Tshark = Callable[..., list[Row]]
FIELDS = (
    "frame.protocols",
    "mbrtu.unit_id",
    "modbus.func_code",
    "modbus.reference_num",
    "modbus.word_cnt",
    "modbus.regval_uint16",
    "modbus.data",
    "modbus.exception_code",
    "modbus.diagnostic.return_query_data.request",
    "modbus.diagnostic.return_query_data.echo",
)


@pytest.fixture(scope="session")
def tshark() -> Tshark:
    """Reads a capture and gives the fields of each frame."""
    program = shutil.which("tshark", path=os.pathsep.join([str(TOOLS / "usr/bin"), os.environ.get("PATH", "")]))
    if program is None:
        lacking("tshark", "tshark")
    env = {**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(map(str, library_folders()))}

    def run(path: Path, *options: str) -> list[Row]:
        fields = [word for field in FIELDS for word in ("-e", field)]
        command = [program, "-r", str(path), *options, "-T", "json", *fields]
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=100, check=True)
        rows: list[dict[str, Any]] = json.loads(done.stdout)
        return [row["_source"]["layers"] for row in rows]

    return run


@pytest.fixture(scope="session")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The frames of a bus that reads, writes, echoes and is refused, again and again."""
    path = tmp_path_factory.mktemp("capture") / "demo.pcapng"
    line = drivebus.SerialFormat()
    exchanges = [
        (drivebus.rtu.encode_read(1, 0x2100, 4), "01 03 08 00 03 0C 41 00 00 01 A0"),
        (drivebus.rtu.encode_write(1, 0x2001, 2000), "01 06 20 01 07 D0"),
        (drivebus.rtu.encode_write(17, 0x000B, [100, 200, 300]), "11 10 00 0B 00 03"),
        (drivebus.rtu.encode_echo(2, 0x12AB), "02 08 00 00 12 AB"),
        (drivebus.rtu.encode_read(1, 0x9999, 1), "01 83 02"),
    ]
    time = 1_700_000_000.0
    with path.open("wb") as stream:
        writer = Writer(stream, "/dev/ttyUSB0", "19200 8E1")
        for index in range(FRAMES // 2):
            request, answer = exchanges[index % len(exchanges)]
            for asks, data in ((True, request), (False, framed(bytes.fromhex(answer)))):
                time += len(data) * line.char_time + line.t35
                writer.write(Captured(time, data, asks))
    return path


def framed(body: bytes) -> bytes:
    return body + drivebus.crc16(body).to_bytes(2, "little")


def test_each_frame_is_modbus_rtu_without_a_setting(tshark: Tshark, capture: Path) -> None:
    rows = tshark(capture)
    ours = list(read(capture))
    assert len(rows) == len(ours) == FRAMES
    for row, frame in zip(rows, ours, strict=True):
        assert row["frame.protocols"] == ["exported_pdu:mbrtu:modbus"]
        assert row["mbrtu.unit_id"] == [str(frame.data[0])]
        assert row["modbus.func_code"] == [str(frame.data[1] & 0x7F)]


def test_what_wireshark_finds_in_a_frame_is_what_drivebus_finds(tshark: Tshark, capture: Path) -> None:
    for row, frame in zip(tshark(capture, *AS_UNITS), read(capture), strict=True):
        told = drivebus.rtu.decode(frame.data)
        found: dict[str, object] = {}
        if told.code is not None:
            found["modbus.exception_code"] = [str(told.code)]
        if told.address is not None:
            found["modbus.reference_num"] = [str(told.address)]
        if told.kind in ("read", "write_many", "write_many_answer"):
            found["modbus.word_cnt"] = [str(told.count)]
        if told.words is not None:
            found["modbus.regval_uint16"] = list(map(str, told.words))
        if told.value is not None:
            found["modbus.data"] = [f"{told.value:04x}"]
        if told.data is not None:
            side = "request" if frame.asks else "echo"
            found[f"modbus.diagnostic.return_query_data.{side}"] = [f"{told.data:04x}"]
        theirs = {name: row.get(name, []) for name in found}
        assert {name: normal(value) for name, value in theirs.items()} == found, (frame, row)


def normal(values: list[str]) -> list[str]:
    return [value.replace(":", "").removeprefix("0x") for value in values]


def test_wireshark_opens_what_a_bus_traced(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "bus.pcapng"
    with drivebus.Bus("sim://gd350?clock=virtual", trace=path) as bus:
        drive = bus.drive(1)
        drive.monitor()
        drive.write("P00.11", 5.0)
        with pytest.raises(drivebus.Refused):
            bus.read(1, 0x9999)
        requests = bus.stats()["requests"]
    rows = tshark(path, *AS_UNITS)
    assert len(rows) == 2 * requests
    assert all(row["frame.protocols"] == ["exported_pdu:mbrtu:modbus"] for row in rows)
    exchanges = list(exchanges_in(read(path), drivebus.SerialFormat()))
    assert [exchange.unit for exchange in exchanges] == [1] * requests
    assert exchanges[-1].error is not None
    assert exchanges[0].profile == "gd350"


def test_the_other_link_type_is_decoded_on_request(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "rtac.pcapng"
    asked, answer = drivebus.rtu.encode_read(1, 0x2100, 1), framed(bytes.fromhex("01 03 02 00 03"))
    with path.open("wb") as stream:
        writer = Writer(stream, "COM3", "9600 8N1", "rtac")
        writer.write(Captured(1_700_000_000.25, asked, True))
        writer.write(Captured(1_700_000_000.26, answer, False))
    rows = tshark(path, "-d", "rtacser.data,mbrtu")
    assert [row["modbus.func_code"] for row in rows] == [["3"], ["3"]]
    assert [(frame.data, frame.asks) for frame in read(path)] == [(asked, True), (answer, False)]
    assert [frame.time for frame in read(path)] == pytest.approx([1_700_000_000.25, 1_700_000_000.26], abs=1e-6)
