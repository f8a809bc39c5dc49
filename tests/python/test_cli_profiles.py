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
            "total": 11, "sourced": 10, "unsourced": 1, "unverified": 2, "assumed": 1,
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

    def test_nothing_that_comes_near(self) -> None:
        result = run("--profile", EX9, "describe", "out_curent")
        assert (result.exit_code, "output_current" in result.stderr) == (2, True)

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
