"""`drivebus monitor`: at its rate, with what is missing, until it is interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli
from drivebus.cli.output import Output

SIM = "sim://gd350?clock=virtual"


def monitor(*words: str, before: tuple[str, ...] = ("--json",)) -> Result:
    arguments = ["--port", SIM, "--profile", "gd350", *before, "monitor", *words]
    return CliRunner().invoke(cli, arguments, prog_name="drivebus")


def samples(result: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def lose(monkeypatch: pytest.MonkeyPatch, *lost: int) -> None:
    """Has the samples of these numbers end as if nobody had answered."""
    made = drivebus.Sample.__init__
    numbers = iter(range(1000))

    def make(sample: Any, target: Any, time: float, answered: float, values: Any, missing: Any) -> None:
        if next(numbers) in lost:
            values, missing = None, drivebus.NoAnswer("unit 1, read 3004H: no answer within 500 ms")
        made(sample, target, time, answered, values, missing)

    monkeypatch.setattr(drivebus.Sample, "__init__", make)


def test_as_many_samples_as_asked() -> None:
    result = monitor("--count", "3", "output_current")
    assert (result.exit_code, result.stderr) == (0, "")
    assert [sample.keys() for sample in samples(result)] == [{"time", "output_current"}] * 3
    lines = monitor("--count", "2", before=()).stdout.splitlines()
    assert len(lines) == 2
    assert all("output_current=0.0A" in line and "bus_voltage=" in line for line in lines)


def test_the_rate_does_not_drift() -> None:
    """An exchange and the showing take their time; the beats are where they would be without."""
    times = [sample["time"] for sample in samples(monitor("--interval", "0.25", "--count", "41"))]
    # The first may have to wait for the silence after what was asked before.
    assert [time - times[1] for time in times[1:]] == pytest.approx([0.25 * beat for beat in range(40)], abs=1e-5)


def test_as_fast_as_the_line() -> None:
    """19200 8E1: 8 characters there, 7 back, two silences of 3.5; the drive's own delay is P14.03, 5 ms."""
    times = [sample["time"] for sample in samples(monitor("--interval", "0", "--count", "5", "output_current"))]
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
    assert "missing: unit 1, read 3004H: no answer" in monitor("--count", "2", before=()).stdout.splitlines()[0]


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


def test_a_table_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is missing leaves its values empty, and says so below."""
    lose(monkeypatch, 1)
    monkeypatch.setattr("rich.console.Console.is_terminal", property(lambda _: True))
    result = monitor("--count", "2", "output_current", before=())
    first, second = result.stdout.split("missing:")[0], result.stdout.split("missing:")[1]
    assert "0.0  A" in first
    assert "no answer within 500 ms" in second
    assert result.exit_code == 0
