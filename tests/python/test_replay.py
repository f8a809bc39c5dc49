"""Playing a capture again: what its units answered, what they would have, and what nobody knows."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner
from tests.python.conftest import NO_PTY
from tests.python.test_sniff import LINE, frame, kept, talk

import drivebus
from drivebus.capture import read
from drivebus.cli import cli, demonstration
from drivebus.cli.commands.replay import Missing
from drivebus.cli.present.output import Output
from drivebus.sim import Simulator
from drivebus.sniffer import exchanges_in
from drivebus.sniffer.replay import Replay


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return kept(
        tmp_path / "seen.pcapng",
        ">01 03 21 00 00 01", "<01 03 02 00 03", ">01 06 20 01 07 D0", "<01 06 20 01 07 D0",
        ">01 03 21 00 00 01", "<01 03 02 00 01", ">09 03 21 00 00 01", ">01 03 99 99 00 01", "<01 83 02",
    )  # fmt: skip


@contextmanager
def opened(port: str) -> Iterator[int]:
    """A descriptor of what *port* names."""
    if port.startswith("socket://"):
        host, _, number = port.removeprefix("socket://").rpartition(":")
        with socket.create_connection((host, int(number))) as connection:
            yield connection.fileno()
    else:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        yield descriptor
        os.close(descriptor)


@pytest.mark.parametrize("transport", [pytest.param("pty", marks=NO_PTY), "tcp"])
def test_a_capture_answers_as_its_units_did(capture: Path, transport: str) -> None:
    exchanges = list(exchanges_in(read(capture), LINE))
    with Replay(exchanges, LINE, transport) as units, opened(units.port) as port:

        def ask(body: str) -> str:
            os.write(port, frame(body))
            ready, _, _ = select.select([port], [], [], 0.3)
            return os.read(port, 256)[:-2].hex(" ").upper() if ready else ""

        state = [ask("01 03 21 00 00 01") for _ in range(3)]
        assert state == ["01 03 02 00 03", "01 03 02 00 01", "01 03 02 00 01"], "in their order, then the last"
        assert ask("01 06 20 01 07 D0") == "01 06 20 01 07 D0"
        assert ask("01 03 99 99 00 01") == "01 83 02"
        assert ask("01 08 00 00 AB CD") == "01 08 00 00 AB CD", "an echo is new each time"
        assert ask("09 03 21 00 00 01") == "", "as in the capture"
        assert ask("01 03 30 00 00 01") == ""
    assert units.unknown == {frame("01 03 30 00 00 01")}


def test_a_read_that_is_not_in_the_capture_is_answered_from_what_others_read_there() -> None:
    exchanges = talk(
        ">03 03 30 00 00 03", "<03 03 06 00 01 00 02 00 03", ">03 06 30 01 00 07", "<03 06 30 01 00 07",
        ">03 03 30 00 00 03", "<03 03 06 00 04 00 07 00 06", ">03 03 40 00 00 01", "<03 83 02",
        ">03 06 20 00 00 01", "<03 06 20 00 00 01", ">03 04 50 00 00 01", "<03 04 02 00 09",
    )  # fmt: skip
    told: list[bytes] = []
    with Replay(exchanges_in(exchanges, LINE), LINE, told=told.append) as units, opened(units.port) as port:

        def ask(body: str) -> str:
            os.write(port, frame(body))
            ready, _, _ = select.select([port], [], [], 0.3)
            return os.read(port, 256)[:-2].hex(" ").upper() if ready else ""

        part = "03 03 30 01 00 02"
        assert ask(part) == "03 03 04 00 02 00 03", "nothing was asked yet: the first there is"
        assert ask("03 03 30 00 00 03") == "03 03 06 00 01 00 02 00 03"
        assert ask(part) == "03 03 04 00 02 00 03"
        assert ask("03 06 30 01 00 07") == "03 06 30 01 00 07"
        assert ask(part) == "03 03 04 00 07 00 03", "a write that was taken"
        assert ask("03 03 30 00 00 03") == "03 03 06 00 04 00 07 00 06"
        assert ask(part) == "03 03 04 00 07 00 06"
        missing = [
            "03 03 30 02 00 02", "01 03 30 00 00 01", "03 04 30 00 00 01", "03 03 20 00 00 01",
            "03 03 50 00 00 01", "03 06 30 01 00 08", "03 10 30 00 00 01 02 00 01", "03 2B 0E 01 00",
        ]  # fmt: skip
        assert [ask(body) for body in missing] == [""] * len(missing)
    assert told == [frame(body) for body in missing]
    assert units.unknown == set(told)


def test_what_a_replay_lacks_is_told_as_often_as_one_can_read() -> None:
    said: list[str] = []
    now = 100.0
    missing = Missing(said.append, lambda: now)
    asked = [frame(f"03 03 30 {address:02X} 00 01") for address in range(7)]
    for request in [asked[0], asked[0], *asked]:
        missing.take(request)
    assert said == [f"not in the capture: unit 3, read 1 word at 30{address:02X}H" for address in range(5)]
    said.clear()
    now += 1.0
    for request in [*asked, frame("03 10 20 00 00 02 04 00 01 00 02"), frame("03 2B 0E 01 00")]:
        missing.take(request)
    assert said == [
        "not in the capture: unit 3, read 1 word at 3005H",
        "not in the capture: unit 3, read 1 word at 3006H",
        "not in the capture: unit 3, write 2 words at 2000H",
        "not in the capture: unit 3, function 2BH",
    ]
    now += 10.0
    missing.take(asked[0])
    assert said[-1].endswith("3000H"), "it is still asked for"


def test_the_command_says_what_its_capture_lacks(capture: Path) -> None:
    command = [sys.executable, "-m", "drivebus", "-f", "8N1", "replay", str(capture)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        port = process.stdout.readline().strip()
        assert process.stderr.readline().startswith("4 answers of ")
        with opened(port) as descriptor:
            os.write(descriptor, frame("01 03 30 04 00 01"))
        assert process.stderr.readline() == "not in the capture: unit 1, read 1 word at 3004H\n"
        process.send_signal(signal.SIGINT)
        assert process.stderr.readline().startswith(f"1 request is not in {capture} and got no answer: 01 03 30 04")
    assert process.returncode == 0


class Hurried(drivebus.Bus):
    """A bus whose program does not wait between two looks: a replay has no motor that takes its time."""

    def sleep(self, seconds: float) -> None:
        """Nothing."""


# Over TCP drivebus asks more than the capture of a serial port has.
@NO_PTY
def test_a_program_gets_the_same_answers_from_its_capture(tmp_path: Path) -> None:
    def program(bus: drivebus.Bus) -> list[object]:
        with bus:
            drive = bus.drive(1)
            drive.prepare_control()
            with drive.running(hz=5.0):
                drive.wait_for_speed(timeout=30)
                seen = [drive.status().state, drive.monitor("running_frequency", "bus_voltage"), drive.setpoint]
            drive.wait_until_stopped(timeout=30)
            return [*seen, drive.status().state]

    path = tmp_path / "job.pcapng"
    # What it asks hangs on the time, so nothing here takes any: no busy machine makes it ask for something else.
    with Simulator({1: "gd350"}, parity="N", transport="process", clock="virtual") as simulator:
        first = program(drivebus.Bus(simulator, trace=path))
    with Replay(exchanges_in(read(path), LINE), LINE) as units:
        assert program(Hurried(units.port, parity="N", share="never", timeout=10.0)) == first
        assert not units.unknown


def test_what_cannot_be_replayed_is_said(tmp_path: Path) -> None:
    (tmp_path / "silent.txt").write_text("TX: 01 03 21 00 00 01 8E 36\n")
    done = CliRunner().invoke(cli, ["replay", str(tmp_path / "silent.txt"), "--for", "0"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "no request in the capture has an answer" in done.stderr


@NO_PTY
def test_the_whole_demonstration_gets_the_same_answers_from_its_capture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line, path = drivebus.SerialFormat(), tmp_path / "demo.pcapng"

    def said_on(bus: drivebus.Bus) -> list[dict[str, object]]:
        """What it shows of the drive; it fails where something is not as it must be."""
        with bus:
            demonstration._Job(Output(as_json=True), simulator, bus).whole()
        rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        # How long it took and how often it asked is the line's business.
        shown = [row for row in rows if "title" not in row and "requests" not in row]
        return [{name: value for name, value in row.items() if name != "round_trip"} for row in shown]

    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        first = said_on(drivebus.Bus(simulator, trace=path))
        with Replay(exchanges_in(read(path), line), line) as units:
            assert said_on(Hurried(units.port, share="never", timeout=10.0)) == first
            assert not units.unknown
    assert [row["value"] for row in first if row.get("register") == "running_frequency"] == [25.0]
