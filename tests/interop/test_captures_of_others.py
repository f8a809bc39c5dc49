"""Captures that Wireshark's own programs wrote are read, and mean to drivebus what they mean to tshark."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from tests.interop.conftest import TOOLS, lacking, library_folders
from tests.python.made_captures import framed, rtac

from drivebus.capture import read

Program = Callable[..., str]

TIME = "2026-03-05 09:15:"
ASKED, ANSWER = framed("03 03 30 00 00 02"), framed("03 03 04 03 E8 02 58")
MANY, TOOK = framed("03 10 20 00 00 02 04 00 01 07 D0"), framed("03 10 20 00 00 02")
SAID = [(ASKED, True), (ANSWER, False), (MANY, True), (TOOK, False)]


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs one of Wireshark's programs and gives what it prints."""
    folders = [*map(str, library_folders()), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
    env = {**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(folders)}

    def run(name: str, *words: object) -> str:
        found = shutil.which(name, path=os.pathsep.join([str(TOOLS / "usr/bin"), os.environ.get("PATH", "")]))
        if found is None:
            lacking(name, "tshark wireshark-common")
        return subprocess.run([found, *map(str, words)], env=env, capture_output=True, text=True, check=True).stdout

    return run


def dump(path: Path, packets: Sequence[tuple[bytes, bool]]) -> Path:
    """What text2pcap reads: directions, times ten milliseconds apart, and hex."""
    lines = [
        f"{'I' if asks else 'O'} {TIME}{30 + at * 0.01:09.6f}\n000000 {data.hex(' ')}\n"
        for at, (data, asks) in enumerate(packets)
    ]
    path.write_text("".join(lines))
    return path


def dumped(program: Program, path: Path, link: int, packets: Sequence[tuple[bytes, bool]], *words: object) -> Path:
    text = dump(path.with_suffix(".txt"), packets)
    program("text2pcap", "-q", "-D", "-t", "%Y-%m-%d %H:%M:%S.%f", "-l", link, *words, text, path)
    return path


def told(path: Path) -> list[tuple[bytes, bool | None]]:
    return [(each.data, each.asks) for each in read(path)]


def theirs(program: Program, path: Path, *words: str) -> list[str]:
    """The functions of the Modbus that tshark finds, in its order."""
    rows: list[dict[str, Any]] = json.loads(
        program("tshark", "-r", path, *words, "-Y", "modbus", "-T", "json", "-e", "modbus.func_code")
    )
    return [code for row in rows for code in row["_source"]["layers"]["modbus.func_code"]]


def functions(path: Path) -> list[str]:
    return [str(each.data[1]) for each in read(path)]


@pytest.mark.parametrize("form", ["pcap", "nsecpcap", "pcapng"])
def test_a_user_link_is_read_in_every_format_that_editcap_writes(program: Program, tmp_path: Path, form: str) -> None:
    first = dumped(program, tmp_path / "a.pcapng", 147, SAID)
    path = tmp_path / f"b.{form}"
    program("editcap", "-F", form, first, path)
    # Directions are lost in the older formats, and worked out.
    assert [data for data, _ in told(path)] == [data for data, _ in SAID]
    assert [asks for _, asks in told(path)] == ([True, False, True, False] if form == "pcapng" else [None] * 4)
    assert [each.time for each in read(path)] == pytest.approx([each.time for each in read(first)], abs=1e-6)
    as_modbus = ("-o", 'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""')
    assert theirs(program, path, *as_modbus) == functions(path)
    packed = tmp_path / f"b.{form}.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert told(packed) == told(path)


def test_pieces_of_a_direction_are_what_they_are_whole(program: Program, tmp_path: Path) -> None:
    whole = [(rtac(1 if asks else 2, data), asks) for data, asks in SAID]
    path = dumped(program, tmp_path / "whole.pcapng", 250, whole)
    assert theirs(program, path, "-d", "rtacser.data,mbrtu") == functions(path) == ["3", "3", "16", "16"]
    assert told(path) == SAID
    cut = [(rtac(1 if asks else 2, part), asks) for data, asks in SAID for part in (data[:3], data[3:])]
    assert told(dumped(program, tmp_path / "cut.pcapng", 250, cut)) == SAID


def test_modbus_in_tcp_is_what_tshark_finds(program: Program, tmp_path: Path) -> None:
    # text2pcap makes heads of IP and TCP, with numbers that go on; by direction the ports change places.
    over_tcp = ("-4", "10.0.0.9,10.0.0.2", "-T", "50000,502")
    path = dumped(program, tmp_path / "rtu.pcapng", 1, SAID, *over_tcp)
    assert theirs(program, path, "-d", "tcp.port==502,mbrtu") == functions(path) == ["3", "3", "16", "16"]
    assert told(path) == SAID
    tcp = [(bytes([0, at // 2, 0, 0, 0, len(data) - 2]) + data[:-2], asks) for at, (data, asks) in enumerate(SAID)]
    path = dumped(program, tmp_path / "tcp.pcapng", 1, tcp, *over_tcp)
    assert theirs(program, path) == functions(path) == ["3", "3", "16", "16"]
    assert told(path) == SAID


def test_a_merged_capture_has_its_serial_lines(program: Program, tmp_path: Path) -> None:
    serial = dumped(program, tmp_path / "serial.pcapng", 147, SAID)
    other = dumped(program, tmp_path / "eth.pcapng", 1, [(bytes(60), True)] * 3)
    path = tmp_path / "both.pcapng"
    program("mergecap", "-w", path, other, serial)
    said: list[str] = []
    assert [(each.data, each.asks) for each in read(path, said.append)] == SAID
    assert len(said) == 1
    assert "is left out with 3 packets: link type 1 (Ethernet) is no serial line." in said[0]
    # One file behind the other: two sections, and one line.
    twice = tmp_path / "twice.pcapng"
    twice.write_bytes(serial.read_bytes() + serial.read_bytes())
    assert told(twice) == SAID + SAID
    assert len(program("tshark", "-r", twice).splitlines()) == 2 * len(SAID)


def test_packets_cut_by_editcap_are_not_joined(program: Program, tmp_path: Path) -> None:
    path = tmp_path / "cut.pcap"
    program("editcap", "-F", "pcap", "-s", 9, dumped(program, tmp_path / "a.pcapng", 147, SAID), path)
    assert [data for data, _ in told(path)] == [ASKED, ANSWER, MANY[:9], TOOK]
