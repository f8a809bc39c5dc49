"""`drivebus profiles`, `describe` and `faults`: what a technician and the author of a profile type."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

EX9 = Path(__file__).resolve().parent.parent / "vectors/profiles/ex9"


def run(*words: str | Path) -> Result:
    result = CliRunner().invoke(cli, [str(word) for word in words], prog_name="drivebus", env={"DRIVEBUS_PORT": None})
    assert "Traceback" not in result.output
    return result


def rows(*words: str | Path) -> list[dict[str, Any]]:
    result = run("--json", *words)
    assert result.exit_code == 0, result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


class TestShow:
    def test_all_rules_are_said(self) -> None:
        """What the made-up manual of the EX-9 says, in words."""
        text = run("profiles", "show", EX9).stdout
        for said in (
            "ex9: Example Drives EX-9",
            "inverter, profile version 3",
            "03H, 06H, 08H, 10H; 16 words",
            "9600 bit/s 8N1, unit 1",
            "0901H is EX-9, wall type",
            "7 reset fault",
            "9 immediate stop",
            "2 = communication",
            "bit 15",
            "not usable without --unverified: Printed for the EX-8 only.",
            "P00.01 = 2",
            "needs P00.06 = 8",
            "--variant speed_unit=Hz",
            "after P14.04",
            "line: P14.00, P14.04, P14.05",
            "motor: P02.01",
        ):
            assert said in text, said

    def test_the_same_for_programs(self) -> None:
        [known] = rows("profiles", "show", EX9)
        assert known["commands"]["coast"] == 6
        assert known["command_codes"]["9"] == "immediate stop"
        assert known["memory"]["reason"] == "Printed for the EX-8 only."
        assert known["counts"]["registers"] == {
            "total": 12, "sourced": 11, "unsourced": 1, "unverified": 2, "assumed": 1,
        }  # fmt: skip

    @pytest.mark.parametrize("family", drivebus.profiles())
    def test_every_family_can_be_shown(self, family: str) -> None:
        [known] = rows("profiles", "show", family)
        assert known["name"] == family
        text = run("profiles", "show", family).stdout
        assert drivebus.Profile.builtin(family).title in text
        # Each code that a command has, on its own line.
        for name, code in drivebus.Profile.builtin(family).commands().items():
            assert re.search(rf"^ +{code} {name.replace('_', ' ')}\b", text, re.MULTILINE)

    def test_a_name_that_is_none(self) -> None:
        result = run("profiles", "show", "gd351")
        assert (result.exit_code, "gd350" in result.stderr) == (2, True)

    def test_the_list_has_them_all(self) -> None:
        known = {row["name"]: row for row in rows("profiles")}
        assert list(known) == drivebus.profiles()
        assert known["gd350"]["kind"] == "inverter"
        # The manual of the H100 names no maker.
        assert [name for name, row in known.items() if not row["maker"]] == ["h100"]
        assert (known["ms300"]["maker"], known["ms300"]["models"]) == ("Delta", ["VFD-MS300"])
        assert known["chf100a"]["aliases"] == ["Huanyang GT", "Fuling DZB200"]

    @pytest.mark.parametrize(
        ("called", "family"),
        [
            ("VFD-MS300", "ms300"),
            ("altivar 312", "atv312"),
            ("huanyang GT", "chf100a"),
            ("omron mx2", "wj200"),
            ("StepperOnline V70", "h100"),
        ],
    )
    def test_what_stands_on_a_drive_is_a_name_too(self, called: str, family: str) -> None:
        [known] = rows("profiles", "show", called)
        assert known["name"] == family
        assert drivebus.Profile.find(called) is drivebus.Profile.builtin(family)
        assert called.lower() in run("profiles", "show", family).stdout.lower().replace("schneider ", "")


class TestNew:
    @pytest.mark.parametrize(
        "options", [[], *([how, family] for how in ("--like", "--overlay") for family in drivebus.profiles())]
    )
    def test_what_it_writes_is_sound(self, tmp_path: Path, options: list[str]) -> None:
        folder = tmp_path / "My drive (2)"
        result = run("profiles", "new", folder, *options)
        assert result.exit_code == 0, result.output
        assert rows("profiles", "check", folder) == []
        profile = drivebus.Profile.load(folder)
        assert profile.name == "my-drive-2"
        assert profile.family == (options[1] if "--overlay" in options else "my-drive-2")

    @pytest.mark.parametrize("options", [[], ["--like", "gd350"], ["--overlay", "gd350"]])
    def test_what_it_points_to_is_there(self, tmp_path: Path, options: list[str]) -> None:
        """An installed drivebus has no docs/."""
        run("profiles", "new", tmp_path / "mine", *options)
        text = (tmp_path / "mine" / "profile.toml").read_text(encoding="utf-8")
        assert "docs/" not in text
        assert {"profile.schema.json", "registers.csv"} < {path.name for path in (tmp_path / "mine").iterdir()}
        for words in re.findall(r"^#   drivebus (profiles (?:check|show) .*)$", text, re.MULTILINE):
            what = str(tmp_path / "mine") if words.endswith("mine") else words.split()[-1]
            assert run(*words.split()[:2], what).exit_code == 0

    def test_what_it_leaves_out_is_sound_too(self, tmp_path: Path) -> None:
        """The rows that stand in comments, made rows: each key of them is known."""
        run("profiles", "new", tmp_path / "mine")
        path = tmp_path / "mine" / "profile.toml"
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r"^# (?=[\[a-z}\]]|    )", "", text, flags=re.MULTILINE), encoding="utf-8")
        problems = drivebus.Profile.check(tmp_path / "mine")
        assert problems
        for problem in problems:
            assert "unknown key" not in problem["reason"]
            assert "invalid type" not in problem["reason"]

    def test_nothing_is_overwritten(self, tmp_path: Path) -> None:
        (tmp_path / "faults.csv").write_text("mine", encoding="utf-8")
        result = run("profiles", "new", tmp_path)
        assert (result.exit_code, "faults.csv" in result.stderr) == (2, True)
        assert [path.name for path in tmp_path.iterdir()] == ["faults.csv"]
        assert (tmp_path / "faults.csv").read_text(encoding="utf-8") == "mine"

    def test_a_place_where_nothing_can_be_written(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("", encoding="utf-8")
        result = run("profiles", "new", tmp_path / "file" / "mine")
        assert (result.exit_code, str(tmp_path / "file") in result.stderr) == (2, True)

    @pytest.mark.parametrize("options", [["--like", "gd351"], ["--like", "gd350", "--overlay", "gd350"]])
    def test_a_base_that_cannot_be(self, tmp_path: Path, options: list[str]) -> None:
        assert run("profiles", "new", tmp_path / "mine", *options).exit_code == 2
        assert not (tmp_path / "mine").exists()


class TestDescribe:
    def test_a_name_a_code_and_an_address(self) -> None:
        for text in ("output_current", "3001H", "0x3001"):
            [known] = rows("--profile", EX9, "describe", text)
            assert (known["name"], known["address"], known["evidence"]) == ("output_current", "3001H", "verified")
        for text in ("P14.04", "p14.04", "bus_timeout"):
            [known] = rows("--profile", EX9, "describe", text)
            assert (known["code"], known["high"]) == ("P14.04", 60.0)

    def test_what_is_not_certain_says_why(self) -> None:
        text = run("--profile", EX9, "describe", "fan_hours").stdout
        assert "assumed" in text
        assert "Seen in a forum." in text
        [known] = rows("--profile", EX9, "describe", "heat_sink_temperature")
        assert known["address"] is None

    def test_anything_else_is_searched(self) -> None:
        """Best first: a name, then a label, then a choice."""
        found = [row["name"] for row in rows("--profile", EX9, "describe", "frequency")]
        assert found[:2] == ["set_frequency", "running_frequency"]
        assert "maximum_frequency" in found
        assert [row["name"] for row in rows("--profile", EX9, "describe", "heat", "sink")] == ["heat_sink_temperature"]
        assert [row["name"] for row in rows("--profile", EX9, "describe", "keypad")] == [
            "status_word",
            "command_source",
            "frequency_source",
        ]

    def test_a_word_without_its_underscore_and_a_unit_are_found(self) -> None:
        assert [row["name"] for row in rows("--profile", EX9, "describe", "setfrequency")] == ["set_frequency"]
        assert [row["name"] for row in rows("--profile", "gd350", "describe", "rpm")] == ["rotation_speed"]

    def test_a_misspelt_word_and_what_the_field_calls_it_are_found(self) -> None:
        for text, name in (("out_curent", "output_current"), ("amps", "output_current"), ("P14-04", "P14.04")):
            assert name in [row["code"] or row["name"] for row in rows("--profile", EX9, "describe", text)][:3]
        found = run("--profile", "gd350", "describe", "dc", "link").stdout
        assert found.startswith('gd350 has nothing called that, but 2 near matches for "dc link":')

    def test_nothing_that_comes_near(self) -> None:
        result = run("--profile", EX9, "describe", "frobnicate")
        assert (result.exit_code, 'no "frobnicate"; `drivebus list` shows' in result.stderr) == (2, True)

    def test_a_variant_decides_the_unit(self) -> None:
        [plain] = rows("--profile", EX9, "describe", "set_speed")
        [hz] = rows("--profile", EX9, "--variant", "speed_unit=Hz", "describe", "set_speed")
        assert (plain["variant"], hz["unit"], hz["high"]) == ("speed_unit", "Hz", 600.0)
        for wrong in ("speed_unit=knots", "sped_unit=Hz", "Hz", "speed_unit="):
            result = run("--profile", EX9, "--variant", wrong, "describe", "set_speed")
            assert (result.exit_code, bool(result.stderr)) == (2, True)


def test_all_faults_with_causes_and_remedies() -> None:
    known = {row["code"]: row for row in rows("--profile", EX9, "faults", "--all")}
    assert known[2]["remedy"] == "Make the ramp longer, or fit a resistor"
    assert known[18]["verified"] is False


class TestOneFault:
    """What a keypad shows, looked up; numbers and mnemonics from the fault list of the GD350's chapter 9.4."""

    @pytest.mark.parametrize(
        ("typed", "numbers"),
        [(["OL1"], [11]), (["ol1"], [11]), (["11"], [11]), (["STo"], [35]), (["STO"], [40]), (["sto"], [35, 40])],
    )
    def test_by_number_and_by_what_is_displayed(self, typed: list[str], numbers: list[int]) -> None:
        assert [row["code"] for row in rows("--profile", "gd350", "faults", *typed)] == numbers

    def test_by_words(self) -> None:
        found = rows("--profile", "gd350", "faults", "overcurrent")
        assert [row["mnemonic"] for row in found] == ["OC1", "OC2", "OC3"]

    def test_one_alone_is_told_with_its_note(self) -> None:
        text = run("--profile", "gd350", "faults", "STO").stdout
        assert text.startswith("STO (40)")
        assert "remedy" in text
        assert "35 (STo)" in text  # it is not that one

    def test_describe_says_where_a_fault_is_told(self) -> None:
        result = run("--profile", "gd350", "describe", "ol1")
        assert (result.exit_code, result.stdout) == (2, "")
        assert "but a fault: `drivebus faults OL1`" in result.stderr

    @pytest.mark.parametrize("unknown", [["999"], ["OLX"], ["1e3"]])
    def test_an_unknown_one_is_said(self, unknown: list[str]) -> None:
        result = run("--profile", "gd350", "faults", *unknown)
        assert (result.exit_code, result.stdout) == (2, "")
        assert f'gd350 names no fault "{unknown[0]}"' in result.stderr


def test_the_shell_completes_all_families() -> None:
    from click.shell_completion import ShellComplete

    completion = ShellComplete(cli, {}, "drivebus", "_DRIVEBUS_COMPLETE")

    def complete(*words: str) -> list[str]:
        *before, begun = words
        return [item.value for item in completion.get_completions(before, begun)]

    assert complete("--profile", "") == drivebus.profiles()
    assert complete("profiles", "show", "gd35") == [name for name in drivebus.profiles() if name.startswith("gd35")]
    assert complete("sim", "--units", "1=gd350,2=vf") == [
        f"1=gd350,2={name}" for name in drivebus.profiles() if name.startswith("vf")
    ]
    assert "bus_timeout=" in complete("--profile", str(EX9), "write", "bus_t")
    assert complete("--profile", str(EX9), "--variant", "speed_unit=") == ["speed_unit=Hz", "speed_unit=rpm"]


def test_help_names_all_families() -> None:
    for words in (["--help"], ["sim", "--help"]):
        text = " ".join(run(*words).stdout.split())
        for family in drivebus.profiles():
            assert family in text


def at(port: str, *words: str, **options: Any) -> Result:
    """A command to a simulated drive, in virtual time."""
    result = CliRunner().invoke(cli, ["--port", f"sim://{port}?clock=virtual", *words], prog_name="drivebus", **options)
    assert "Traceback" not in result.output
    return result


def told(port: str, *words: str) -> list[dict[str, Any]]:
    result = at(port, "--json", *words)
    assert result.exit_code == 0, result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


HINT = "No proved register of this family has the frequency; --unverified shows more."


class TestSureness:
    """Each family says what it is as far as its manuals go, and no command falls over what is not known of it."""

    def test_a_status_shows_what_is_assumed_and_says_so(self) -> None:
        hint = "! assumed: no document of this family proves it; --unverified uses it for commands too."
        for words, told_so in (([], True), (["--unverified"], False)):
            result = at("vfd500", "--profile", "vfd500", *words, "status")
            assert (hint in result.stdout) == told_so
            assert ("stopped !" in result.stdout) == told_so
        [told] = [
            json.loads(line) for line in at("vfd500", "--profile", "vfd500", "--json", "status").stdout.splitlines()
        ]
        assert (told["state"], told["assumed"]["state"]) == ("unknown", "stopped")

    @pytest.mark.parametrize("family", drivebus.profiles())
    @pytest.mark.parametrize("command", [["info"], ["status"], ["faults"], ["monitor", "--count", "1"], ["scan"]])
    def test_every_command_that_looks(self, family: str, command: list[str]) -> None:
        for options in ([], ["--json"], ["--unverified"]):
            result = at(family, "--profile", family, *options, *command)
            # Of a rectifier nothing may be known that could be watched.
            assert result.exit_code in ((0, 2) if command[0] == "monitor" else (0,)), result.output
            said = result.stderr.replace(f"{HINT}\n", "")
            assert bool(said) == bool(result.exit_code)

    @pytest.mark.parametrize(
        ("family", "code", "certainty"),
        [
            # GD350 manual, section 9.4.5: 01A0H, 0108H, 0109H; 010AH is the GD300L's as well.
            ("gd350", "0x01a0", "certain"),
            ("gd35", "0x0108", "certain"),
            ("gd35-h1", "0x0109", "certain"),
            ("gd300", "0x010a", "shared"),
            # GD10 manual, p. 90; GD20 manual, p. 140; GD200A manual V2.6, p. 147.
            ("gd10", "0x010d", "certain"),
            ("gd20", "0x0106", "certain"),
            ("gd100", "0x010b", "certain"),
            ("gd200a", "0x0107", "certain"),
            ("vfd500", None, "by answers"),
            ("gd600", None, "unknown"),
        ],
    )
    def test_info_says_how_sure_it_is(self, family: str, code: str | None, certainty: str) -> None:
        first = told(family, "--profile", family, "info")[0]
        assert (first["profile"], first["identification"], first["certainty"]) == (family, code, certainty)
        assert first["reason"]

    def test_info_shows_what_it_found_where_that_is_not_enough(self) -> None:
        result = at("vfd500", "info")
        assert result.exit_code == 2
        assert "by answers" in result.stdout
        assert "vfd500" in result.stderr

    def test_a_code_that_several_report_is_said_by_every_command(self) -> None:
        """GD300L manual, p. 130; GD310-UL manual, p. 211."""
        others = "Goodrive300L lift drive", "Goodrive310-UL"
        for command in ("info", "status", "faults"):
            result = at("gd300", command)
            assert result.exit_code == 0
            [warning] = result.stderr.splitlines()
            assert warning.startswith("Warning: unit 1 is taken for a gd300, the only one of them with a profile")
            assert all(other in warning for other in (*others, "--profile gd300"))
            assert at("gd300", "--profile", "gd300", command).stderr == ""
        assert f"unit 1: gd300 (or {' or '.join(others)}), identification 0x010a, shared" in at("gd300", "scan").stdout

    def test_info_of_a_drive_that_is_taken_for_another(self) -> None:
        result = at("gd35", "--profile", "gd350", "info")
        assert (result.exit_code, "named gd350 (INVT Goodrive350), and it reports 0108H" in result.stderr) == (0, True)

    def test_status_says_what_it_cannot_tell_and_why(self) -> None:
        [status] = told("vfd500", "--profile", "vfd500", "status")
        assert status["state"] == "unknown"
        assert "address" in status["missing"]["state"]
        text = at("vfd500", "--profile", "vfd500", "status").stdout
        assert "Missing:" in text
        assert "unknown" not in text.partition("Missing:")[0]

    def test_an_overlay_makes_the_state_usable(self, tmp_path: Path) -> None:
        """With the very addresses that the profile only assumes, and so the simulated drive has."""
        run("profiles", "new", tmp_path / "ours", "--overlay", "vfd500")
        with (tmp_path / "ours/parameters.csv").open("a", encoding="utf-8") as file:
            file.write("r27.18,status_word_1,What the motor does,,1,no,,,,,,,ro,,yes,,Our manual\n")
        [status] = told("vfd500", "--profile", str(tmp_path / "ours"), "status")
        assert status["state"] == "stopped"

    def test_a_stop_to_who_does_not_say_what_it_is(self) -> None:
        for command in ("stop", "coast"):
            result = at("gd600", command)
            assert result.exit_code == 2
            for said in (f"not told to {command}", "--profile", "gd600", "emergency stop"):
                assert said in result.stderr

    def test_doubtful_values_are_marked(self) -> None:
        [row] = told("gd35", "--profile", "gd35", "read", "P00.03")
        assert row["evidence"] == "unverified"
        assert "unverified" in at("gd35", "--profile", "gd35", "read", "P00.03").stdout
        assert "verified" not in at("gd350", "read", "P00.03").stdout
        [sample] = told("vfd500", "--profile", "vfd500", "--unverified", "monitor", "--count", "1")
        assert sample["evidence"]["status_word_1"] == "assumed"

    def test_what_may_not_be_read_says_why_and_how(self) -> None:
        result = at("vfd500", "--profile", "vfd500", "read", "status_word_1")
        assert (result.exit_code, "--unverified" in result.stderr) == (2, True)
        [row] = told("vfd500", "--profile", "vfd500", "--unverified", "read", "status_word_1")
        assert row["evidence"] == "assumed"
        env = {"DRIVEBUS_UNVERIFIED": "1"}
        assert at("vfd500", "--profile", "vfd500", "read", "status_word_1", env=env).exit_code == 0

    def test_a_unit_that_a_parameter_decides_has_to_be_said(self) -> None:
        """P30.14 of a VFD500 makes a speed Hz, percent or rpm; its numbers are not printed."""
        words = ["--profile", "vfd500", "write", "speed_reference=25", "--yes"]
        result = at("vfd500", *words)
        assert (result.exit_code, "--variant" in result.stderr) == (2, True)
        for env in ({"DRIVEBUS_VARIANT": "speed_unit=Hz"}, {}):
            result = at("vfd500", *([] if env else ["--variant", "speed_unit=Hz"]), "--json", *words, env=env)
            assert result.exit_code == 0, result.output
            assert json.loads(result.stdout)["unit"] == "Hz"


class TestForce:
    """5 stops an INVT drive; a VFD500 coasts by it, and knows no 9."""

    @pytest.mark.parametrize(
        ("profile", "frame", "allowed"),
        [
            ([], "01 06 70 00 00 05", True),
            ([], "01 06 70 00 00 09", False),
            ([], "01 10 70 00 00 01 02 00 09", False),
            (["--profile", "vfd500"], "01 06 70 00 00 06", True),
            (["--profile", "vfd500"], "01 06 70 00 00 09", False),
            (["--profile", "vfd500"], "01 06 20 00 00 05", False),
        ],
    )
    def test_raw_sends_no_command_that_there_is_not(self, profile: list[str], frame: str, allowed: bool) -> None:
        result = at("vfd500", *profile, "raw", frame, "--yes")
        assert ("--force" in result.stderr) is not allowed
        assert (result.exit_code == 0) is allowed, result.output
        assert bool(result.stdout) is allowed
        assert "sent" in at("vfd500", *profile, "raw", frame, "--yes", "--force").stdout

    def test_write_to_an_address_without_a_name(self) -> None:
        result = at("gd350", "write", "4000H=5", "--yes")
        assert (result.exit_code, "--force" in result.stderr) == (2, True)
        # The drive has nothing there either.
        result = at("gd350", "write", "4000H=5", "--yes", "--force")
        assert (result.exit_code, "illegal_address" in result.stderr) == (4, True)
        assert at("gd350", "write", "4000H=5", "--force").exit_code == 2
        for value in ("65536", "-1", "0.5", "on"):
            assert at("gd350", "write", f"4000H={value}", "--yes", "--force").exit_code == 2

    def test_write_does_not_read_what_can_only_be_written(self) -> None:
        [row] = told("vfd500", "--profile", "vfd500", "--unverified", "write", "torque_setting=10", "--yes")
        assert (row["name"], row["value"]) == ("torque_setting", 10)
