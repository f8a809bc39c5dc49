"""`drivebus sim ctl`: what another window tells a simulation that runs, and what nobody may."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

pytestmark = pytest.mark.skipif(os.name == "nt", reason="programs meet over a Unix socket")


@pytest.fixture(autouse=True, scope="class")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the windows of one test, or of one class of tests, meet."""
    place = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DRIVEBUS_RUNTIME_DIR", str(place))
        yield place / "drivebus"


@pytest.fixture(scope="class")
def simulation(folder: Path) -> Iterator[dict[str, Any]]:  # noqa: ARG001 - it has to be there first
    """One that a class of tests shares."""
    with served() as simulation:
        yield simulation


@contextmanager
def served(*words: str) -> Iterator[dict[str, Any]]:
    """What a simulation in a window of its own says of itself, while it runs."""
    command = [sys.executable, "-m", "drivebus", "--json", "sim", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        try:
            yield {**json.loads(child.stdout.readline()), "pid": child.pid}
        finally:
            child.terminate()
            assert child.wait(timeout=100) == 0


def ctl(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--json", "sim", "ctl", *words])


def told(*words: str) -> Any:
    """What is so after an order that was obeyed."""
    result = ctl(*words)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def drive_of(now: Any, unit: int) -> Any:
    return next(drive for drive in now["units"] if drive["unit"] == unit)


def test_each_order_does_what_it_says() -> None:
    with (
        served("--units", "1=gd350,2=vfd500") as simulation,
        drivebus.Bus(simulation["port"], retries=0) as bus,
    ):
        assert simulation["units"] == {"1": "gd350", "2": "vfd500"}
        now = told("status")
        assert (now["port"], now["settings"], now["plugged"]) == (simulation["port"], "19200 8E1", True)
        assert [drive["family"] for drive in now["units"]] == ["gd350", "vfd500"]

        drive = bus.drive(1)
        drive.prepare_control()
        assert drive_of(told("trip", "1", "OL1"), 1)["fault_name"] == "OL1"
        assert (drive.state(), drive.fault()) == ("fault", drive.profile.fault_named("OL1"))
        assert drive_of(told("trip", "2", "11"), 2)["fault"] == 11
        drive.reset_fault()
        assert drive_of(told("load", "1", "80%"), 1)["load"] == 0.8
        assert drive_of(told("load", "1", "1.5"), 1)["load"] == 1.5

        assert told("faults", "silence=1", "late=0.25")["faults"] == {"silence": 1.0, "late": 0.25}
        with pytest.raises(drivebus.NoAnswer):
            bus.read(1, 0x2103)
        assert told("faults", "off")["faults"] == {}
        assert told("faults")["faults"] == {}
        assert bus.read(1, 0x2103) == [0x01A0]

        usual = drive.read("P00.11")
        drive.write("P00.11", 2.5)
        assert drive.read("P00.11") == 2.5
        told("power-cycle", "1")
        assert drive.read("P00.11") == usual, "what was in RAM is lost"


def test_an_adapter_is_pulled_and_put_back(tmp_path: Path) -> None:
    link = str(tmp_path / "drive")
    with served("--link", link) as simulation, drivebus.Bus(link) as bus:
        assert (simulation["port"], str(Path(link).readlink())) == (link, simulation["leads_to"])
        assert bus.read(1, 0x2103) == [0x01A0]
        assert told("unplug")["plugged"] is False
        with pytest.raises(drivebus.PortError):
            bus.read(1, 0x2103)
        now = told("replug")
        assert (now["plugged"], now["port"], now["leads_to"]) == (True, link, str(Path(link).readlink()))
        assert bus.read(1, 0x2103) == [0x01A0]


@pytest.mark.parametrize("transport", ["pty", "tcp"])
def test_settings_make_a_wrong_baud_rate_without_hardware(transport: str) -> None:
    with served("--transport", transport) as simulation:
        port = simulation["port"]
        with drivebus.Bus(port, timeout=0.1, retries=0) as bus:
            assert bus.read(1, 0x2103) == [0x01A0]
            assert told("settings", "8n1", "9600")["settings"] == "9600 8N1"
            with pytest.raises(drivebus.NoAnswer):
                bus.read(1, 0x2103)
        if transport == "pty":
            with drivebus.Bus(port, baudrate=9600, parity="N") as bus:
                assert bus.read(1, 0x2103) == [0x01A0]
        assert told("settings")["settings"] == "9600 8N1"
        told("settings", "19200", "8E1")
        with drivebus.Bus(port) as bus:
            assert bus.read(1, 0x2103) == [0x01A0]


def test_people_see_the_line_and_each_drive() -> None:
    with served("--units", "1=gd350,7=vfd500"):
        shown = CliRunner().invoke(cli, ["sim", "ctl", "load", "7", "80%"]).stdout.splitlines()
        assert re.fullmatch(r"port +/dev/pts/\d+", shown[0])
        assert shown[1:3] == ["settings     19200 8E1", "line faults  none"]
        assert shown[4].split() == ["unit", "family", "state", "frequency", "load", "fault"]
        assert [line.split() for line in shown[5:]] == [
            ["1", "gd350", "stopped", "0.00", "Hz", "30", "%", "none"],
            ["7", "vfd500", "stopped", "0.00", "Hz", "80", "%", "none"],
        ]


def test_of_several_one_is_chosen() -> None:
    assert "start one in another window: `drivebus sim`" in ctl("status").stderr
    with served() as one, served("--units", "5=gd600") as two:
        several = ctl("status")
        assert several.exit_code == 2
        assert "2 simulations run; choose one with --of" in several.stderr
        assert one["port"] in several.stderr
        assert told("--of", two["port"], "status")["units"][0]["unit"] == 5
        assert told("--of", str(one["pid"]), "status")["units"][0]["unit"] == 1
    assert ctl("status").exit_code == 2


def say(folder: Path, sent: bytes) -> bytes:
    [path] = folder.glob("sim-*.sock")
    with socket.socket(socket.AF_UNIX) as window:
        window.connect(str(path))
        window.settimeout(100)
        try:
            window.sendall(sent)
            window.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # it was sent away before it had said all
        return window.makefile("rb").readline()


class TestWrongOrders:
    """An order that makes no sense changes nothing, whether it was typed or sent by something else."""

    @pytest.mark.parametrize(
        ("words", "said"),
        [
            (["trip", "2", "OL1"], "no unit 2 is simulated"),
            (["trip", "1", "XYZ"], 'gd350 has no fault "XYZ"'),
            (["trip", "1", "0"], "fault 0 is out of range; allowed is 1 to 65535"),
            (["trip", "1", "99999999"], "fault 99999999 is out of range"),
            (["trip", "999", "OL1"], "unit 999 is out of range"),
            (["load", "1", "80"], "did you mean 80%?"),
            (["load", "1", "nan"], "out of range"),
            (["load", "1", "much"], "write 80% or 0.8"),
            (["faults", "rain=0.1"], '"rain" is unknown'),
            (["faults", "late"], "write KIND=RATE, such as late=0.02"),
            (["faults", "late=2"], "rate of late 2.0 is out of range"),
            (["faults", "unplug=0.1"], '"unplug" by rate needs'),
            (["settings", "9600", "4800"], "one speed and one format"),
            (["settings", "1"], "baud rate 1 is not a number from 50 to 10000000"),
            (["settings", "fast"], "give data bits"),
            (["--of", "/dev/nowhere", "status"], 'no simulation is called "/dev/nowhere"; there are /dev/pts/'),
        ],
    )
    @pytest.mark.usefixtures("simulation")
    def test_what_is_wrong_is_named_and_nothing_changes(self, words: list[str], said: str) -> None:
        before = told("status")
        result = ctl(*words)
        assert (result.exit_code, said in result.stderr) == (2, True), result.stderr
        assert told("status") == before

    @pytest.mark.parametrize(
        "sent",
        [
            b"",
            b"\n",
            b"\x00\xff\xfe\n",
            b"[]\n",
            b"5\n",
            b"[" * 4000 + b"\n",
            b"9" * 4000 + b"\n",
            b"x" * 100_000,
            b'{"order": ["trip"]}\n',
            b'{"order": {}}\n',
            b'{"order": "trip"}\n',
            b'{"order": "trip", "unit": "1", "fault": 1}\n',
            b'{"order": "trip", "unit": 1, "fault": []}\n',
            b'{"order": "load", "unit": 1, "share": NaN}\n',
            b'{"order": "load", "unit": 1, "share": "1"}\n',
            b'{"order": "load", "unit": 1e400, "share": 1}\n',
            b'{"order": "faults", "rates": [1]}\n',
            b'{"order": "faults", "rates": {"late": {}}}\n',
            b'{"order": "settings", "baudrate": []}\n',
            b'{"order": "settings", "parity": 5}\n',
            b'{"order": "settings", "stopbits": 99999999999999999999999}\n',
            b'{"order": "shutdown"}\n',
        ],
    )
    @pytest.mark.usefixtures("simulation")
    def test_no_words_break_it(self, folder: Path, sent: bytes) -> None:
        before = told("status")
        answer = json.loads(say(folder, sent))
        assert list(answer) == ["error"], answer
        assert told("status") == before


class TestHostileWindows:
    """Whatever comes into the socket is answered in words; the simulation goes on."""

    def test_windows_that_say_nothing_keep_nobody_out_for_long(self, folder: Path) -> None:
        with served():
            [path] = folder.glob("sim-*.sock")
            silent = [socket.socket(socket.AF_UNIX) for _ in range(8)]
            for window in silent:
                window.connect(str(path))
            # Eight may talk at once, each for two seconds.
            assert b"8 others talk" in say(folder, b'{"order": "about"}\n')
            for window in silent:
                window.settimeout(100)
                assert b"error" in window.makefile("rb").readline()
                window.close()
            assert told("status")["plugged"] is True

    def test_only_this_user_reaches_it(self, folder: Path) -> None:
        with served():
            [path] = folder.glob("sim-*.sock")
            assert (folder.stat().st_mode & 0o777, path.stat().st_mode & 0o777) == (0o700, 0o600)

    def test_what_a_killed_one_left_is_cleared_away(self, folder: Path) -> None:
        with subprocess.Popen([sys.executable, "-m", "drivebus", "sim"], stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            child.stdout.readline()
            child.kill()
        assert len(list(folder.glob("sim-*.sock"))) == 1
        assert "start one in another window" in ctl("status").stderr
        assert list(folder.glob("sim-*.sock")) == []

    def test_something_else_at_the_place_is_no_simulation(self, folder: Path) -> None:
        folder.mkdir(mode=0o700, exist_ok=True)
        with socket.socket(socket.AF_UNIX) as other:
            other.bind(str(folder / "sim-1.sock"))
            other.listen()
            assert ctl("status").exit_code == 2
