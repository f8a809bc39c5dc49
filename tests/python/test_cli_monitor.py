"""`drivebus monitor`: at its rate, with what is missing, until it is interrupted."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli
from drivebus.cli.present.output import Output

from .screens import SIZES, on_a_terminal

SIM = "sim://gd350?clock=virtual"


def monitor(*words: str, before: tuple[str, ...] = ("--json",)) -> Result:
    arguments = ["--port", SIM, "--profile", "gd350", *before, "monitor", *words]
    return CliRunner().invoke(cli, arguments, prog_name="drivebus")


def samples(result: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def moments(result: Result) -> list[float]:
    """When each sample was asked for, as seconds."""
    return [datetime.fromisoformat(sample["time"]).timestamp() for sample in samples(result)]


def lose(monkeypatch: pytest.MonkeyPatch, *lost: int) -> None:
    """Has the samples of these numbers end as if nobody had answered."""
    made = drivebus.Sample.__init__
    numbers = iter(range(1000))

    def make(sample: Any, target: Any, time: float, answered: float, late: int, values: Any, missing: Any) -> None:
        if next(numbers) in lost:
            values, missing = None, drivebus.NoAnswer("unit 1, read 3004H: no answer within 500 ms")
        made(sample, target, time, answered, late, values, missing)

    monkeypatch.setattr(drivebus.Sample, "__init__", make)


def test_as_many_samples_as_asked() -> None:
    result = monitor("--count", "3", "output_current")
    assert (result.exit_code, result.stderr) == (0, "")
    assert [sample.keys() for sample in samples(result)] == [{"time", "output_current", "units"}] * 3
    assert samples(result)[0]["units"] == {"output_current": "A"}


def test_a_file_or_a_pipe_gets_csv() -> None:
    rows = list(csv.DictReader(io.StringIO(monitor("--count", "2", before=()).stdout)))
    assert [row["output_current [A]"] for row in rows] == ["0.0", "0.0"]
    assert [row["missing"] for row in rows] == ["", ""]
    assert rows[0]["analog_input_2 [V, unverified]"] == "0.00"
    assert not any("identification" in name for name in rows[0])
    assert [datetime.fromisoformat(row["time"]).utcoffset() for row in rows] == [timedelta(0)] * 2


def test_the_rate_does_not_drift() -> None:
    """An exchange and the showing take their time; the beats are where they would be without."""
    times = moments(monitor("--interval", "0.25", "--count", "41"))
    # The first may have to wait for the silence after what was asked before.
    assert [time - times[1] for time in times[1:]] == pytest.approx([0.25 * beat for beat in range(40)], abs=1e-5)


def test_as_fast_as_the_line() -> None:
    """19200 8E1: 8 characters there, 7 back, two silences of 3.5; the drive's own delay is P14.03, 5 ms."""
    times = moments(monitor("--interval", "0", "--count", "5", "output_current"))
    assert times[4] - times[1] == pytest.approx(3 * (22 * 11 / 19_200 + 0.005), rel=0.05)


def test_an_interval_that_the_line_cannot_carry() -> None:
    result = monitor("--interval", "0.01", "output_current")
    assert (result.exit_code, result.stdout) == (2, "")
    # 22 characters of 11 bits at 19200 bit/s, rounded up.
    assert "at least 0.012605 s" in result.stderr


def test_a_sample_that_is_missing_does_not_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lose(monkeypatch, 1)
    result = monitor("--count", "3", "output_current")
    first, missing, last = samples(result)
    assert (result.exit_code, first["output_current"], last["output_current"]) == (0, 0.0, 0.0)
    assert missing.keys() == {"time", "missing", "exit_code"}
    assert (missing["missing"], missing["exit_code"]) == ("unit 1, read 3004H: no answer within 500 ms", 3)
    assert result.stderr == "1 of 3 samples is missing.\n"
    lose(monkeypatch, 0)
    first, second = csv.DictReader(io.StringIO(monitor("--count", "2", before=()).stdout))
    assert (first["output_current [A]"], second["missing"]) == ("", "")
    assert first["missing"] == "unit 1, read 3004H: no answer within 500 ms"


def test_where_nothing_comes_the_exit_code_says_why() -> None:
    result = monitor("--count", "3", "output_current", before=("--unit", "9", "--json"))
    assert (result.exit_code, [sample["exit_code"] for sample in samples(result)]) == (3, [3, 3, 3])
    assert "3 of 3 samples are missing" in result.stderr


@pytest.mark.parametrize(("words", "code"), [([], 0), (["--count", "9"], 130)])
def test_ctrl_c_is_how_it_ends(monkeypatch: pytest.MonkeyPatch, words: list[str], code: int) -> None:
    shown: list[object] = []

    def show(_: Output, values: object) -> None:
        shown.append(values)
        if len(shown) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(Output, "record", show)
    result = monitor(*words, "output_current")
    assert (result.exit_code, result.output, len(shown)) == (code, "", 2)


@pytest.mark.skipif(os.name == "nt", reason="no signal but kill")
def test_ctrl_c_while_it_waits() -> None:
    with drivebus.Simulator({1: "gd350"}) as simulator:
        words = ["--port", simulator.port, "--json", "monitor", "--interval", "600", "output_current"]
        with subprocess.Popen(
            [sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as child:
            assert child.stdout is not None
            assert json.loads(child.stdout.readline())["output_current"] == 0.0
            child.send_signal(signal.SIGINT)
            rest, said = child.communicate(timeout=60)
    assert (child.returncode, rest, said) == (0, "", "")


@pytest.mark.skipif(os.name == "nt", reason="no pty")
class TestOnATerminal:
    """What a person sees, at the size of their window."""

    @staticmethod
    def watch(size: tuple[int, int], *words: str, until: str = "stopped", times: int = 1) -> list[str]:
        seen = on_a_terminal(words, size, until=lambda lines: "\n".join(lines).count(until) == times)
        assert seen.code == 0, seen.text
        assert all(len(line) <= size[0] for line in seen.shown)
        return seen.shown

    @pytest.mark.parametrize("size", SIZES)
    def test_every_register_is_there_and_nothing_is_cut(self, size: tuple[int, int]) -> None:
        shown = self.watch(size, "--port", "sim://gd350", "monitor", "--interval", "0.1")
        head, *rest = shown
        assert re.fullmatch(
            r"INVT Goodrive350 on sim://gd350, unit 1  stopped(  [\d.]+/s)?  0:00:0\d(  [\d.]+/s)?", head
        )
        text = "\n".join(rest)
        known = drivebus.Profile.builtin("gd350").monitor_names()
        assert {name for name in known if name not in text} == {"identification_code_compat"}
        assert ("least" in text) == (size[0] > 80), "there is room for more"
        assert "? unverified: `drivebus describe NAME` says why" in text

    def test_what_does_not_fit_is_counted(self) -> None:
        shown = self.watch((60, 10), "--port", "sim://gd350", "monitor", "--interval", "0.1")
        rows = [line for line in shown if re.match(r"[a-z]+(_[a-z0-9]+)+ ", line)]
        assert f"{22 - len(rows)} more do not fit: name those you want" in "\n".join(shown)

    def test_drives_stand_beside_each_other(self) -> None:
        units = ("--port", "sim://1=gd350,2=gd350", "-u", "1-2")
        words = ("monitor", "--interval", "0.1", "output_current", "running_frequency")
        # The last row of the screen, with both its values: what is above stands there by then.
        shown = self.watch((80, 24), *units, *words, until="0.00", times=2)
        assert any(re.fullmatch(r"register +unit 1 +unit 2 +unit", line) for line in shown)
        assert any(re.fullmatch(r"running_frequency +0\.00 +0\.00 +Hz", line) for line in shown)

    def test_what_is_missing_is_said_whole(self) -> None:
        with drivebus.Simulator({1: "gd350"}) as simulator:
            simulator.line.drop_answers(1000)
            words = ("--port", simulator.port, "--profile", "gd350", "monitor", "--interval", "1")
            shown = self.watch_missing(words)
        assert "missing: unit 1, read 3 words from 2100H" in shown
        assert "no answer within 500 ms" in shown

    @staticmethod
    def watch_missing(words: tuple[str, ...]) -> str:
        seen = on_a_terminal(words, (80, 24), until=lambda lines: any("missing" in line for line in lines))
        assert seen.code == 3, seen.text
        return " ".join(seen.shown)

    def test_what_was_there_last_stays_on_the_terminal(self) -> None:
        seen = on_a_terminal(["--port", "sim://gd350", "monitor", "--count", "2", "output_current"], (80, 24))
        assert seen.code == 0
        assert re.search(r"output_current +0\.0 +0\.0 +0\.0 +A", seen.raw.rpartition("\x1b[?1049l")[2])

    def test_a_family_that_proves_little_says_what_shows_more(self) -> None:
        words = ("--port", "sim://vfd500", "--profile", "vfd500", "monitor", "--interval", "0.1")
        shown = self.watch((80, 24), *words, until="more.")
        assert "No proved register of this family has the frequency; --unverified shows more." in " ".join(shown)


def test_several_drives_are_told_apart() -> None:
    words = ["--port", "sim://1=gd350,2=gd350?clock=virtual", "-u", "1-2"]
    told = samples(CliRunner().invoke(cli, [*words, "--json", "monitor", "--count", "2", "output_current"]))
    assert [each["drive"] for each in told] == ["unit 1", "unit 2"] * 2
    table = CliRunner().invoke(cli, [*words, "monitor", "--count", "1", "output_current"]).stdout
    assert [row["drive"] for row in csv.DictReader(io.StringIO(table))] == ["unit 1", "unit 2"]


def test_drives_of_several_lines_are_watched_together(tmp_path: Path) -> None:
    file = tmp_path / "drivebus.toml"
    file.write_text(
        '[lines]\na = { port = "sim://gd350" }\nb = { port = "sim://gd600" }\n'
        '[drives]\none = { line = "a", unit = 1 }\nother = { line = "b", unit = 1, profile = "gd600" }\n'
    )
    words = ["--config", str(file), "-d", "one", "-d", "other", "--json", "monitor", "--count", "3"]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 0, result.stderr
    assert {each["drive"] for each in samples(result)} == {"one", "other"}
    assert len(samples(result)) == 6
