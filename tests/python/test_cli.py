"""The command line: what it prints, what it refuses, what it exits with."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

FULL = Path("/dev/full")
"""A disk that is full."""

SIM = "sim://gd350?clock=virtual"


def run(*words: str, port: str | None = SIM, **options: Any) -> Result:
    """One command in this process; no terminal."""
    arguments = [*(["--port", port] if port else []), *words]
    return CliRunner().invoke(cli, arguments, prog_name="drivebus", **options)


def rows(result: Result) -> list[dict[str, Any]]:
    assert result.exit_code == 0, result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.fixture
def pty() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350"}, transport="tcp" if os.name == "nt" else "pty") as simulator:
        yield simulator


class TestLooking:
    def test_status(self) -> None:
        [status] = rows(run("--json", "status"))
        assert status["state"] == "stopped"
        assert status["frequency"] == 0.0
        assert status["fault"] is None
        assert "stopped" in run("status").stdout

    def test_scan_finds_the_drive(self) -> None:
        [found] = rows(run("--json", "scan", "--units", "1-3"))
        assert (found["unit"], found["profile"], found["identification"]) == (1, "gd350", "0x01a0")
        assert "unit 1: gd350" in run("scan", "--units", "1-3").stdout
        assert run("scan", "-u", "1-2").stdout.splitlines()[1].startswith("1 unit, 1 silent")
        assert "leave one of them out" in run("scan", "-u", "1-2", "--units", "3").stderr

    def test_scan_without_an_answer_exits_3(self) -> None:
        result = run("scan", "--units", "5-6")
        assert result.exit_code == 3
        assert "no unit answered" in result.stderr
        assert f"`drivebus --port '{SIM}' scan --search`" in result.stderr

    def test_info(self) -> None:
        first, *control = rows(run("--json", "info"))
        assert first["identification"] == "0x01a0"
        assert first["obeys_bus"] is False
        assert [item["code"] for item in control] == ["P00.01", "P00.02", "P00.06"]

    @pytest.mark.parametrize("name", ["bus_voltage", "3002H", "0x3002"])
    def test_read_takes_names_and_addresses(self, name: str) -> None:
        [row] = rows(run("--json", "read", name))
        assert (row["name"], row["unit"]) == ("bus_voltage", "V")
        assert 200 < row["value"] < 800

    @pytest.mark.parametrize("name", ["P00.03", "p00.03", "0003h"])
    def test_read_takes_parameter_codes(self, name: str) -> None:
        [row] = rows(run("--json", "read", name))
        assert (row["name"], row["value"]) == ("P00.03", 50.0)

    def test_what_a_parameter_decides_is_read_in_its_unit(self) -> None:
        """Of an FC 51, 4000H is what 3-03 says, 50 Hz: 30 Hz are 9830 counts of 16384, and those 29.9988 Hz."""
        with drivebus.Simulator({1: "fc51"}, transport="tcp" if os.name == "nt" else "pty") as simulator:
            named = ("--profile", "fc51", "--unverified")
            with drivebus.Bus(simulator.port) as bus:
                bus.drive(1, "fc51", unverified=True).setpoint = 30
            [row] = rows(run(*named, "--json", "read", "bus_reference", port=simulator.port))
            assert (row["value"], row["unit"]) == (29.999, "Hz")
            said = run(*named, "read", "bus_reference", port=simulator.port).stdout.splitlines()[1]
            assert said.split()[:3] == ["bus_reference", "29.999", "Hz"]

    @pytest.mark.skipif(sys.platform == "win32", reason="over TCP a new line is asked more than once in any case")
    def test_read_can_ask_twice(self, pty: drivebus.Simulator) -> None:
        asked = []
        for words in (["read", "P00.03", "3002H"], ["read", "--verify", "P00.03", "3002H"]):
            before = pty.line.requests
            assert [row["name"] for row in rows(run("--json", *words, port=pty.port))] == ["P00.03", "bus_voltage"]
            asked.append(pty.line.requests - before)
        assert asked[1] - asked[0] == 2

    def test_what_the_drive_refuses_keeps_the_others_from_nobody(self) -> None:
        # A GD350 has nothing at 6300H, and says so with exception 02H.
        result = run("read", "P00.03", "6300H", "bus_voltage")
        assert result.exit_code == 4
        assert [line.split()[0] for line in result.stdout.splitlines()] == ["name", "P00.03", "bus_voltage"]
        [said] = result.stderr.splitlines()
        assert said.startswith("Error: 6300H: unit 1 refused to read 1 word at 6300H: exception 02H, illegal_address")

    def test_what_the_drive_refuses_has_its_place_in_json(self) -> None:
        result = run("--json", "read", "P00.03", "6300H", "bus_voltage")
        first, refused, last = map(json.loads, result.stdout.splitlines())
        assert (result.exit_code, first["value"], last["name"]) == (4, 50.0, "bus_voltage")
        assert (refused["name"], refused["value"], refused["exit_code"]) == ("6300H", None, 4)
        assert "exception 02H" in refused["error"]
        assert "error" not in first
        assert "error" not in last

    def test_where_nothing_comes_no_empty_table_does(self) -> None:
        result = run("read", "6300H", "6301H")
        assert (result.exit_code, result.stdout, len(result.stderr.splitlines())) == (4, "", 2)

    @pytest.mark.parametrize("wrong", ["output_curent", "P02.01"])
    def test_a_name_that_cannot_be_read_is_refused_before_any_is(self, pty: drivebus.Simulator, wrong: str) -> None:
        asked = []
        for words in (["P00.03", wrong], [wrong]):
            before = pty.line.requests
            result = run("--profile", "gd350", "read", *words, port=pty.port)
            assert (result.exit_code, result.stdout, wrong in result.stderr) == (2, "", True)
            asked.append(pty.line.requests - before)
        assert asked == [0, 0]

    def test_silence_is_told_of_each(self) -> None:
        result = run("--profile", "gd350", "--unit", "9", "--json", "read", "P00.03", "bus_voltage")
        assert result.exit_code == 3
        assert [row["exit_code"] for row in map(json.loads, result.stdout.splitlines())] == [3, 3]

    def test_an_unknown_name_shows_the_closest(self) -> None:
        result = run("read", "output_curent")
        assert result.exit_code == 2
        assert "output_current" in result.stderr
        assert "Traceback" not in result.output

    def test_describe_needs_no_port_with_a_profile(self) -> None:
        [known] = rows(run("--profile", "gd350", "--json", "describe", "output_current", port=None))
        assert (known["address"], known["unit"]) == ("3004H", "A")
        assert known["source"]

    def test_faults(self) -> None:
        assert "No fault now." in run("faults").stdout
        known = rows(run("--profile", "gd350", "--json", "faults", "--all", port=None))
        assert {row["mnemonic"]: row["code"] for row in known}["OL1"] == 11

    def test_profiles_and_ports(self) -> None:
        assert [row["name"] for row in rows(run("--json", "profiles", port=None))] == drivebus.profiles()
        assert run("ports", port=None).exit_code == 0


class TestFrames:
    def test_decode(self) -> None:
        # GD350 manual, chapter 9.4.1.
        [frame] = rows(run("--json", "decode", "01 03 00 04 00 02 85 CA", port=None))
        assert (frame["kind"], frame["unit"], frame["address"], frame["count"]) == ("read", 1, 4, 2)
        assert run("decode", "01,03,00,04,00,02,85,CA", port=None).exit_code == 0

    def test_decode_refuses_a_wrong_crc(self) -> None:
        result = run("decode", "01 03 00 04 00 02 85 CB", port=None)
        assert result.exit_code == 6
        assert "85 CB" in result.stderr
        assert "85 CA" in result.stderr

    def test_raw_shows_both_frames(self) -> None:
        sent, answer = rows(run("--json", "raw", "01", "03", "21", "03", "00", "01"))
        assert sent["hex"].startswith("01 03 21 03 00 01")
        assert answer["words"] == [0x01A0]

    def test_raw_shows_a_refusal_and_exits_4(self) -> None:
        result = run("raw", "01 03 63 00 00 01")
        assert result.exit_code == 4
        assert "01 83 02" in result.stdout

    def test_raw_asks_before_it_writes(self) -> None:
        result = run("raw", "01 06 20 00 00 01")
        assert result.exit_code == 2
        assert "--yes" in result.stderr

    @pytest.mark.parametrize("text", ["0", "xyz", "01 0"])
    def test_what_is_not_hex_is_refused(self, text: str) -> None:
        assert run("decode", text, port=None).exit_code == 2


class TestMoving:
    def test_without_a_terminal_it_needs_yes(self) -> None:
        for command in (["run", "10"], ["jog"], ["reset"]):
            result = run(*command)
            assert result.exit_code == 2
            assert "--yes" in result.stderr

    def test_a_drive_that_does_not_obey_is_exit_2(self) -> None:
        result = run("run", "10", "--yes")
        assert result.exit_code == 2
        assert "`drivebus prepare`" in result.stderr

    def test_prepare_sets_the_drive_to_obey(self, pty: drivebus.Simulator) -> None:
        before = rows(run("--json", "info", port=pty.port))[0]
        set_now = {row["code"]: row["is"] for row in rows(run("--json", "prepare", port=pty.port))}
        assert (before["obeys_bus"], set_now["P00.01"]["value"], set_now["P00.06"]["value"]) == (False, 2, 8)
        assert rows(run("--json", "info", port=pty.port))[0]["obeys_bus"] is True
        assert pty.drive(1).eeprom_writes == 0

    def test_what_was_not_stored_is_said(self, pty: drivebus.Simulator) -> None:
        run("prepare", port=pty.port)
        result = run("prepare", "--store", port=pty.port)
        assert "P00.01, P00.02, P00.06: the value was there already" in result.stderr
        result = run("write", "--store", "P00.11=5.0", port=pty.port)
        assert (result.stderr, pty.drive(1).eeprom_writes) == ("", 1)
        result = run("write", "--store", "P00.11=5.0", port=pty.port)
        assert ("P00.11: the value was there already" in result.stderr, pty.drive(1).eeprom_writes) == (True, 1)

    def test_the_environment_answers_no_question(self, pty: drivebus.Simulator) -> None:
        run("prepare", port=pty.port)
        result = run("run", "5", port=pty.port, env={"DRIVEBUS_RUN_YES": "1"})
        assert (result.exit_code, pty.drive(1).state) == (2, "stopped")
        run("write", "P00.11=5.0", port=pty.port, env={"DRIVEBUS_WRITE_STORE": "1"})
        assert pty.drive(1).eeprom_writes == 0

    def test_options_stand_in_the_environment(self) -> None:
        env = {"DRIVEBUS_PORT": SIM, "DRIVEBUS_UNIT": "1", "DRIVEBUS_BAUD": "9600", "DRIVEBUS_JSON": "1"}
        facts, *_ = rows(run("info", port=None, env={**env, "DRIVEBUS_FORMAT": "8N2", "DRIVEBUS_PROFILE": "gd350"}))
        assert facts["line"] == "9600 8N2"

    def test_one_name_takes_one_value(self) -> None:
        result = run("write", "P00.11=5.0", "000BH=6.0")
        assert (result.exit_code, "P00.11 is given twice" in result.stderr) == (2, True)

    def test_a_jog_that_was_not_sent_is_not_ended(self, pty: drivebus.Simulator) -> None:
        pty.line.drop_answers(1000)
        assert run("--profile", "gd350", "jog", "--yes", port=pty.port).exit_code == 3
        assert pty.drive(1).writes() == []

    @pytest.mark.parametrize(
        "words",
        [
            ["jog", "--seconds", "nan"],
            ["jog", "--seconds", "61"],
            ["run", "--wait", "nan"],
            ["run", "--wait", "inf"],
            ["run", "nan"],
        ],
    )
    def test_a_number_that_is_none_moves_nothing(self, pty: drivebus.Simulator, words: list[str]) -> None:
        run("prepare", port=pty.port)
        assert run(*words, "--yes", port=pty.port).exit_code == 2
        assert [value for _, address, value in pty.drive(1).writes() if address == 0x2000] == []

    def test_a_jog_whose_end_is_lost_coasts(self, monkeypatch: pytest.MonkeyPatch, pty: drivebus.Simulator) -> None:
        run("prepare", port=pty.port)
        wait = drivebus.Bus.sleep

        def deaf(bus: drivebus.Bus, seconds: float) -> None:
            pty.line.drop_answers(1000)
            wait(bus, seconds)

        # The jog itself is what waits first.
        monkeypatch.setattr(drivebus.Bus, "sleep", deaf)
        assert run("jog", "--seconds", "0", "--yes", port=pty.port).exit_code == 7
        codes = [value for _, address, value in pty.drive(1).writes() if address == 0x2000]
        assert codes[:5] == [3, 8, 8, 8, 6]
        assert codes.count(3) == 1

    @pytest.mark.skipif(os.name == "nt", reason="no signal but kill")
    def test_a_terminal_that_is_closed_ends_a_jog(self, pty: drivebus.Simulator) -> None:
        run("prepare", port=pty.port)
        words = [sys.executable, "-m", "drivebus", "--port", pty.port, "jog", "--seconds", "60", "--yes"]
        with subprocess.Popen(words, stderr=subprocess.PIPE) as child:
            pause = threading.Event()
            while pty.drive(1).state != "forward":  # the limit is the test's own
                pause.wait(0.01)
            child.send_signal(signal.SIGHUP)
            child.communicate(timeout=60)
        assert child.returncode == 129
        assert [value for _, address, value in pty.drive(1).writes() if address == 0x2000] == [3, 8]

    @pytest.mark.parametrize("command", ["stop", "coast"])
    def test_a_stop_that_did_not_go_out_is_told(self, pty: drivebus.Simulator, command: str) -> None:
        run("--profile", "gd350", "prepare", port=pty.port)  # a family that is named is not remembered
        pty.line.drop_answers(1000)
        unknown = run(command, port=pty.port)
        assert (unknown.exit_code, f"not told to {command}" in unknown.stderr) == (3, True)
        known = run("--profile", "gd350", command, port=pty.port)
        assert (known.exit_code, f"{command} was sent" in known.stderr) == (7, True)
        code = {"stop": 5, "coast": 6}[command]
        assert {value for _, address, value in pty.drive(1).writes() if address == 0x2000} == {code}

    @pytest.mark.parametrize("words", [["run", "5"], ["jog", "--seconds", "0"]])
    def test_a_bad_link_starts_only_by_force(
        self, monkeypatch: pytest.MonkeyPatch, pty: drivebus.Simulator, words: list[str]
    ) -> None:
        run("prepare", port=pty.port)
        monkeypatch.setattr(drivebus.Bus, "link", lambda *_: drivebus.Link(6, 10))
        refused = run(*words, "--yes", port=pty.port)
        assert (refused.exit_code, "6 of the last 10" in refused.stderr) == (2, True)
        assert [value for _, address, value in pty.drive(1).writes() if address == 0x2000] == []
        assert run(*words, "--yes", "--force", port=pty.port).exit_code == 0

    def test_what_changes_a_motor_that_turns_asks_first(self, pty: drivebus.Simulator) -> None:
        assert run("write", "set_frequency=5", port=pty.port).exit_code == 0
        run("prepare", port=pty.port)
        assert run("run", "--yes", port=pty.port).exit_code == 0
        result = run("write", "set_frequency=20", port=pty.port)
        assert (result.exit_code, "--yes" in result.stderr) == (2, True)
        assert pty.drive(1).register(0x2001) == 500
        assert run("write", "set_frequency=20", "--yes", port=pty.port).exit_code == 0
        assert pty.drive(1).register(0x2001) == 2000

    def test_write_checks_before_it_sends(self) -> None:
        result = run("write", "P00.11=5.0", "P00.12=9999")
        assert result.exit_code == 2
        assert "P00.12" in result.stderr
        result = run("write", "P00.11")
        assert result.exit_code == 2
        assert "NAME=VALUE" in result.stderr

    def test_write_shows_what_then_stands_there(self) -> None:
        written = rows(run("--json", "write", "P00.11=5.0", "P00.12=6"))
        assert [(row["name"], row["value"]) for row in written] == [("P00.11", 5.0), ("P00.12", 6.0)]

    def test_a_whole_job_through_another_program(self, pty: drivebus.Simulator) -> None:
        def command(*words: str) -> dict[str, Any]:
            done = subprocess.run(
                [sys.executable, "-m", "drivebus", "--json", *words],
                env={**os.environ, "DRIVEBUS_PORT": pty.port},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            [row] = [json.loads(line) for line in done.stdout.splitlines()][-1:]
            assert isinstance(row, dict)
            return row

        command("write", "--unverified", "P00.01=2", "P00.02=0", "P00.06=8", "P00.11=1", "P00.12=1")
        assert command("run", "5", "--yes", "--wait", "10")["state"] == "forward"
        assert pty.drive(1).frequency == pytest.approx(5.0, abs=0.1)
        assert command("stop", "--wait", "10")["state"] == "stopped"
        assert command("jog", "--seconds", "0.1", "--yes")["command"] == "jog"
        command("coast")
        assert pty.drive(1).frequency == 0.0
        pty.drive(1).trip("OL1")
        assert command("faults")["mnemonic"] == "OL1"
        assert command("reset", "--yes")["fault"] is None


class TestUnits:
    @pytest.mark.parametrize("units", ["0-3", "3-1", "240-248", "1-99999999999", "a", "1,,2"])
    def test_units_that_cannot_be_are_refused(self, units: str) -> None:
        result = run("scan", "--units", units)
        assert result.exit_code == 2
        assert "Traceback" not in result.output

    @pytest.mark.parametrize("unit", ["00", "F8"])
    def test_raw_goes_to_one_unit(self, unit: str) -> None:
        result = run("raw", unit, "06 20 00 00 05", "--yes")
        assert (result.exit_code, result.stdout) == (2, "")

    def test_raw_names_the_unit_it_writes_to(self) -> None:
        assert "(unit 9 on" in run("raw", "09 06 20 00 00 05").stderr


class TestExitCodes:
    @pytest.mark.parametrize(
        ("port", "words", "code"),
        [
            pytest.param(SIM, ["status"], 0, id="done"),
            pytest.param(None, ["status"], 2, id="no port"),
            pytest.param(SIM, ["statsu"], 2, id="no such command"),
            pytest.param(SIM, ["--unit", "300", "status"], 2, id="no such unit"),
            pytest.param(SIM, ["--format", "8X1", "status"], 2, id="no such format"),
            pytest.param(SIM, ["--profile", "gd355", "status"], 2, id="no such profile"),
            pytest.param(SIM, ["--unit", "9", "status"], 3, id="no answer"),
            pytest.param("/dev/drivebus-is-not-here", ["status"], 5, id="no such port"),
        ],
    )
    def test_each_says_whose_fault_it_is(self, port: str | None, words: list[str], code: int) -> None:
        result = run(*words, port=port, env={"DRIVEBUS_PORT": None})
        assert result.exit_code == code, result.output
        assert bool(result.stderr) == bool(code)
        assert "Traceback" not in result.output

    def test_every_error_has_one(self) -> None:
        from drivebus.cli.present.errors import exit_code

        codes = {
            drivebus.NotAllowed: 2,
            drivebus.NoAnswer: 3,
            drivebus.Refused: 4,
            drivebus.PortError: 5,
            drivebus.BadAnswer: 6,
            drivebus.CrcError: 6,
            drivebus.Unconfirmed: 7,
        }
        assert {kind: exit_code(kind("x")) for kind in codes} == codes


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts(shell: str) -> None:
    result = run("completion", shell, port=None)
    assert result.exit_code == 0
    assert "_DRIVEBUS_COMPLETE" in result.stdout


def test_every_command_has_help() -> None:
    for name in cli.commands:
        result = run(name, "--help", port=None)
        assert result.exit_code == 0
        assert len(result.stdout.splitlines()) > 3


def test_the_demonstration_holds() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "drivebus", "demo"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=110,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "OL1" in done.stdout
    assert "drivebus --port /dev/ttyUSB0 scan" in done.stdout


@pytest.mark.skipif(not FULL.exists(), reason="only Linux has it")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk_behind_standard_output_is_said(unbuffered: str) -> None:
    with FULL.open("w") as full:
        words = [sys.executable, "-m", "drivebus", "profiles"]
        env = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False, env=env)
    assert (done.returncode, done.stderr) == (1, "Error: what was done cannot be shown: No space left on device\n")
