"""Paths and ports that nobody means: whatever takes one says so in an error of this package, and opens nothing."""

from __future__ import annotations

import asyncio
import os
import pathlib
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import drivebus.aio
import drivebus.doctor
import drivebus.line.port_facts
from drivebus import Backup, Bus, DrivebusError, NotAllowed, Profile, Simulator
from drivebus.cli import cli

POSIX = pytest.mark.skipif(os.name == "nt", reason="names of POSIX")
SIM = "sim://gd350?clock=virtual"

NO_NAMES = {
    "a long path": "/" + "x/" * 3000,
    "a long name": "n" * 300,
    "a lone surrogate": "x\ud800y",
    "a surrogate and a NUL": "\udcff\0",
    "a NUL": "a\0b",
    "nothing": "",
    "bytes": b"/dev/null",
    "a number": 5,
    "a path object with a surrogate": pathlib.PurePosixPath("x\ud800"),
}
"""What no file and no port can be called."""

NO_URLS = [
    "socket://\ud800:1",
    "tcp://" + "x" * 5000 + ":1",
    "tcp://\x1b[31m:502",
    "hwgrep://[",
    "loop://?x=1",
    "spy://",
    "spy:///dev/null?logging=never",
    "alt://x?class=nope",
    "rfc2217://h:x",
    "sim://1" + "0" * 5000 + "=gd350",
    "sim://gd350?seed=1" + "0" * 5000,
]


@pytest.fixture
def things(tmp_path: Path) -> Iterator[dict[str, str]]:
    """What is there and is no port, by what it is."""
    plain, folder, fifo, local, circle = (tmp_path / name for name in ("plain", "folder", "fifo", "local", "circle"))
    plain.write_text("hello\n")
    folder.mkdir()
    os.mkfifo(fifo)
    circle.symlink_to(circle)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(local))
        listening.listen()
        there = (plain, folder, fifo, local, circle, plain / "under", Path("/dev/null"), Path("/dev/zero"))
        yield {path.name: str(path) for path in there} | {"no UTF-8": os.fsdecode(bytes(tmp_path) + b"/\xff")}


def opened(port: Any) -> None:
    Bus(port).close()


def awaited(port: Any) -> None:
    async def open_and_close() -> None:
        async with drivebus.aio.Bus(port):
            pass

    asyncio.run(open_and_close())


def saved(path: Any) -> None:
    with Bus(SIM) as bus:
        bus.drive(1).backup().save(path)


def with_a_drive(call: Callable[[drivebus.Drive, Any], object]) -> Callable[[Any], None]:
    def called(path: Any) -> None:
        with Bus(SIM) as bus:
            call(bus.drive(1), path)

    return called


PORTS: dict[str, Callable[[Any], object]] = {"Bus": opened, "aio.Bus": awaited}
FILES: dict[str, Callable[[Any], object]] = {
    "Profile.load": Profile.load,
    "Profile.find": Profile.find,
    "Backup.load": Backup.load,
    "Backup.save": saved,
    "drive.backup": with_a_drive(lambda drive, path: drive.backup(path)),
    "drive.backup, forced": with_a_drive(lambda drive, path: drive.backup(path, force=True)),
    "drive.restore": with_a_drive(lambda drive, path: drive.restore(path, dry_run=True)),
    "drive.diff": with_a_drive(lambda drive, path: drive.diff(path)),
    "Simulator": lambda path: Simulator({1: "gd350"}, link=path).close(),
}


@POSIX
@pytest.mark.parametrize("call", {**PORTS, **FILES}.values(), ids={**PORTS, **FILES}.keys())
@pytest.mark.parametrize("name", NO_NAMES.values(), ids=NO_NAMES.keys())
def test_what_nothing_can_be_called(call: Callable[[Any], object], name: object) -> None:
    with pytest.raises(DrivebusError) as refused:
        call(name)
    assert len(str(refused.value)) < 50_000


@pytest.mark.parametrize("call", PORTS.values(), ids=PORTS.keys())
@pytest.mark.parametrize("url", NO_URLS, ids=lambda url: url[:20])
def test_a_url_that_nobody_opens(call: Callable[[Any], object], url: str) -> None:
    with pytest.raises(DrivebusError):
        call(url)


@POSIX
@pytest.mark.parametrize("call", PORTS.values(), ids=PORTS.keys())
def test_what_is_there_and_is_no_port(call: Callable[[Any], object], things: dict[str, str]) -> None:
    for path in things.values():
        with pytest.raises(DrivebusError):
            call(path)


@POSIX
@pytest.mark.parametrize("call", FILES.values(), ids=FILES.keys())
def test_what_is_there_and_is_no_file_of_ours(call: Callable[[Any], object], things: dict[str, str]) -> None:
    # A plain file may give way to a backup, and a name that is not UTF-8 is a name.
    for name in things.keys() - {"plain", "circle", "no UTF-8"}:
        with pytest.raises(DrivebusError):
            call(things[name])


@POSIX
def test_the_doctor_says_what_is_no_port(things: dict[str, str]) -> None:
    for port in [*NO_NAMES.values(), *things.values(), *NO_URLS[:4]]:
        try:
            [finding] = drivebus.doctor.examine(port, listen=0.0)
        except NotAllowed:
            continue
        assert finding.wrong


@POSIX
@pytest.mark.parametrize("name", NO_NAMES.values(), ids=NO_NAMES.keys())
def test_what_the_system_is_asked_of_a_port_that_is_none(name: Any) -> None:
    try:
        facts = drivebus.line.port_facts.facts(name)
    except NotAllowed:
        return
    assert facts.driver is None


COMMANDS = [
    ["--port", "{}", "info"],
    ["doctor", "{}", "--listen", "0"],
    ["--profile", "{}", "describe", "x"],
    ["profiles", "check", "{}"],
    ["profiles", "show", "{}"],
    ["profiles", "new", "{}"],
    ["--port", SIM, "backup", "{}"],
    ["--port", SIM, "restore", "{}"],
    ["--port", SIM, "diff", "{}"],
    ["diff", "{}", "{}"],
    ["sim", "--link", "{}"],
    ["sim", "--units", "{}"],
]


@POSIX
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_the_command_line_says_so_in_one_line(words: list[str]) -> None:
    for name in [name for name in NO_NAMES.values() if isinstance(name, str)]:
        done = CliRunner().invoke(cli, [word.format(name) for word in words])
        assert done.exit_code in (2, 5), (done.output[:300], done.exception)
        assert isinstance(done.exception, SystemExit)
        assert "cannot be shown" not in done.output


@pytest.mark.parametrize("number", [10**5000, -(10**5000)], ids=["much", "less"])
def test_a_number_too_long_to_show_is_out_of_range(virtual_bus: Bus, number: int) -> None:
    for call in (
        lambda: virtual_bus.read(1, number),
        lambda: virtual_bus.read(number, 0),
        lambda: virtual_bus.write(1, 0, [number]),
        lambda: virtual_bus.sleep(number),
        lambda: virtual_bus.drive(1, number),  # type: ignore[arg-type]
        lambda: Bus(number),
        lambda: Bus(SIM, echo=number),  # type: ignore[arg-type]
        lambda: Bus(SIM, timeout=number),
        lambda: Bus(SIM, read_only=number),  # type: ignore[arg-type]
        lambda: Bus(SIM, baudrate=number),
        lambda: drivebus.rtu.encode_read(1, number, 1),
        lambda: drivebus.rtu.encode_write(number, 0, 1),
    ):
        with pytest.raises(NotAllowed):
            call()
