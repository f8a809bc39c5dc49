"""Trials on simulated drives: against the motor's own model, and what stops them early."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli
from drivebus.cli.present.csv_rows import CsvRows

HIGHEST, RISE, FALL = 0x0003, 0x000B, 0x000C
"""Where a GD350 has P00.03 in hundredths of Hz, and P00.11 and P00.12 in tenths of a second."""


def slope(machine: drivebus.sim.SimulatedDrive, ramp: int) -> float:
    """Hz/s that the machine is set to, from its own words."""
    return (machine.register(HIGHEST) / 100) / (machine.register(ramp) / 10)


def amperes(torque: float) -> float:
    """The current of the simulated motor: 9 A at rated torque, 3.6 A without any."""
    return math.hypot(3.6, math.sqrt(9.0**2 - 3.6**2) * torque)


@pytest.mark.parametrize("seconds", [2.0, 10.0])
@pytest.mark.parametrize(("start", "to"), [(10.0, 30.0), (30.0, 10.0), (0.0, 50.0)])
def test_a_step_is_what_the_model_does(
    virtual: drivebus.Simulator, virtual_drive: drivebus.Drive, seconds: float, start: float, to: float
) -> None:
    virtual_drive.write({"P00.11": seconds, "P00.12": seconds * 1.5})
    machine = virtual.drive(1)
    rate = slope(machine, RISE if to > start else FALL)
    true: list[float] = []
    trial = drivebus.trial.step(
        virtual_drive,
        start,
        to,
        duration=1.5 * abs(to - start) / rate,
        max_current=40,
        told=lambda *_: true.append(machine.frequency),
    )
    figures = trial.figures
    assert isinstance(figures, drivebus.trial.StepFigures)
    assert figures.rise_time == pytest.approx(0.8 * abs(to - start) / rate, rel=0.02)
    assert figures.settling_time == pytest.approx(0.98 * abs(to - start) / rate, rel=0.02, abs=0.02)
    assert (figures.overshoot, figures.steady_state_error) == (0.0, 0.0)
    # The answer is the machine's frequency of a moment before.
    measured = trial.samples[trial.roles.frequency]
    assert max(abs(told - now) for told, now in zip(measured, true, strict=True)) <= rate * 0.03 + 0.01
    assert trial.peak_current is not None
    if to > start:
        torque = machine.load + 2.0 * rate / 50.0
        assert trial.peak_current[0] == pytest.approx(amperes(torque), abs=0.06)
    virtual.advance(40)
    assert (machine.state, machine.frequency) == ("stopped", 0.0)


@pytest.mark.parametrize(("start", "to", "seconds"), [(5.0, 45.0, 4.0), (45.0, 5.0, 8.0)])
def test_a_ramp_is_held_against_what_the_drive_is_set_to(
    virtual_drive: drivebus.Drive, start: float, to: float, seconds: float
) -> None:
    virtual_drive.write({"P00.11": 4.0, "P00.12": 8.0})
    trial = drivebus.trial.ramp(virtual_drive, start, to, duration=9.0, max_current=40, also=["P00.11", "bus_voltage"])
    expected = math.copysign(50.0 / seconds, to - start)
    assert trial.ramp_setting == pytest.approx(expected)
    assert isinstance(trial.figures, drivebus.trial.RampFigures)
    assert trial.figures.rate == pytest.approx(expected, rel=0.005)
    assert set(trial.samples["P00.11"]) == {4.0}
    assert trial.samples.units["bus_voltage"] == "V"
    assert all(len(values) == len(trial.samples) for values in trial.samples.values.values())


def test_a_sine_below_the_ramp_is_followed_and_one_above_is_not(virtual_drive: drivebus.Drive) -> None:
    # 5 Hz around 15 Hz in 10 s are 3.1 Hz/s at most, in 4 s 7.9 Hz/s; the drive goes 5 Hz/s.
    slow = drivebus.trial.sine(virtual_drive, 10, 20, period=10, duration=30, max_current=40)
    fast = drivebus.trial.sine(virtual_drive, 10, 20, period=4, duration=16, max_current=40)
    assert isinstance(slow.figures, drivebus.trial.SineFigures)
    assert isinstance(fast.figures, drivebus.trial.SineFigures)
    assert slow.figures.gain == pytest.approx(1.0, abs=0.01)
    assert abs(slow.figures.phase_lag) < 1.0
    # A triangle of 5 Hz/s, whose first harmonic is 8/π² of its crest of 5 Hz, where the sine is steeper throughout.
    assert fast.figures.gain == pytest.approx(8 / math.pi**2, abs=0.02)
    assert fast.figures.phase_lag > 15
    setpoints = slow.samples["set_frequency_actual"]
    assert min(setpoints) >= 10.0
    assert max(setpoints) <= 20.0


Spoil = Callable[[drivebus.Simulator, drivebus.Bus], None]


def overload(simulator: drivebus.Simulator, _: drivebus.Bus) -> None:
    simulator.drive(1).load = 2.0


def trip(simulator: drivebus.Simulator, _: drivebus.Bus) -> None:
    simulator.drive(1).trip("OL1")


def other_setpoint(_: drivebus.Simulator, bus: drivebus.Bus) -> None:
    bus.write(1, 0x2001, 4500)


def other_stop(_: drivebus.Simulator, bus: drivebus.Bus) -> None:
    bus.write(1, 0x2000, 5)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (overload, "output_current was 1[0-9.]* A, above the 10 A"),
        (trip, "the drive tripped: .*OL1"),
        (other_setpoint, "set_frequency_actual was 45 Hz, outside 10 to 30 Hz: somebody else"),
        (
            other_stop,
            "the drive is stopped: somebody else told it to|running_frequency was [0-9.]+ Hz, outside 5 to 35 Hz",
        ),
    ],
)
@pytest.mark.parametrize("after", [0.0, 3.0, 6.0])
def test_what_goes_wrong_ends_it_with_a_stop(
    virtual: drivebus.Simulator,
    virtual_bus: drivebus.Bus,
    virtual_drive: drivebus.Drive,
    spoil: Spoil,
    reason: str,
    after: float,
) -> None:
    """While it comes up, while it rises, and when it has got there."""
    moments: list[float] = []

    def told(time: float, _: Mapping[str, float]) -> None:
        moments.append(time)
        if len(moments) == 1 + round(after / 0.0245):
            spoil(virtual, virtual_bus)

    trial = drivebus.trial.step(virtual_drive, 10, 30, duration=20, max_current=10, told=told)
    assert trial.aborted is not None
    assert re.search(reason, trial.aborted), trial.aborted
    assert trial.figures is None
    # Seen with the next sample, or with the next look at the state: a stop by somebody else, below 5 Hz.
    assert moments[-1] - moments[0] < after + (5 if spoil is other_stop else 0.5)
    virtual.advance(60)
    assert virtual.drive(1).state in ("stopped", "fault")
    assert virtual.drive(1).frequency == 0.0


def test_a_line_that_falls_silent_and_an_interruption_end_it_with_a_stop(
    virtual: drivebus.Simulator, virtual_drive: drivebus.Drive
) -> None:
    def told_silent(time: float, _: Mapping[str, float], seen: list[float] = []) -> None:  # noqa: B006
        seen.append(time)
        if time - seen[0] > 3:
            virtual.line.set_faults(silence=1.0)

    with pytest.raises(drivebus.NoAnswer):
        drivebus.trial.step(virtual_drive, 10, 30, duration=20, max_current=10, told=told_silent)
    virtual.line.set_faults(silence=0.0)
    virtual.advance(60)
    assert (virtual.drive(1).state, virtual.drive(1).frequency) == ("stopped", 0.0)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drivebus.trial.step(virtual_drive, 10, 30, duration=20, max_current=10, told=interrupted)
    virtual.advance(60)
    assert (virtual.drive(1).state, virtual.drive(1).frequency) == ("stopped", 0.0)


def test_a_motor_that_does_not_come_to_the_start_is_stopped(virtual_drive: drivebus.Drive) -> None:
    trial = drivebus.trial.step(virtual_drive, 40, 20, duration=5, max_current=None, settle=2)
    assert trial.aborted is not None
    assert trial.aborted.startswith("40 Hz was not reached in 2 s; the output was at 1")
    assert trial.samples.times[0] == 0.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda drive: drivebus.trial.step(drive, 10, 10, duration=5, max_current=5), "is no change"),
        (lambda drive: drivebus.trial.step(drive, 10, 60, duration=5, max_current=5), "above the drive's own maximum"),
        (lambda drive: drivebus.trial.step(drive, -1, 10, duration=5, max_current=5), "start -1 is out of range"),
        (lambda drive: drivebus.trial.step(drive, 1, 10, duration=0, max_current=5), "duration 0 is out of range"),
        (lambda drive: drivebus.trial.step(drive, 1, 10, duration=5, max_current=0), "max_current 0 is out of range"),
        (lambda drive: drivebus.trial.ramp(drive, 1, 10, duration=5, max_current=5, also=["output_curent"]), "closest"),
        (lambda drive: drivebus.trial.sine(drive, 9, 9, period=1, duration=5, max_current=5), "is not below"),
        (
            lambda drive: drivebus.trial.sine(drive, 1, 9, period=4, duration=8, max_current=5),
            "less than three periods",
        ),
    ],
)
def test_what_cannot_be_meant_moves_nothing(
    virtual: drivebus.Simulator, virtual_drive: drivebus.Drive, wrong: Callable[[drivebus.Drive], object], said: str
) -> None:
    before = virtual.drive(1).words_written
    with pytest.raises(drivebus.NotAllowed, match=said):
        wrong(virtual_drive)
    assert virtual.drive(1).words_written == before


def test_without_a_current_it_has_to_be_said() -> None:
    with drivebus.Bus("sim://gd600?clock=virtual") as bus:
        drive = bus.drive(1, "gd600", unverified=True)
        drive.prepare_control(store=True)
        with pytest.raises(drivebus.NotAllowed, match="max_current=None"):
            drivebus.trial.step(drive, 5, 10, duration=2, max_current=5)
        trial = drivebus.trial.step(drive, 5, 10, duration=2, max_current=None)
        assert (trial.roles.current, trial.peak_current, trial.ramp_setting) == (None, None, None)
        assert isinstance(trial.figures, drivebus.trial.StepFigures)


@pytest.mark.skipif(sys.platform == "win32", reason="no pty")
class TestCommand:
    @staticmethod
    def run(simulator: drivebus.Simulator, *words: str) -> Result:
        return CliRunner().invoke(cli, ["--port", simulator.port, *words], prog_name="drivebus")

    def test_a_file_that_is_removed_meanwhile_is_told(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        file = tmp_path / "step.csv"
        write = CsvRows.write

        def removing(rows: CsvRows, *what: Any) -> None:
            write(rows, *what)
            file.unlink(missing_ok=True)

        monkeypatch.setattr(CsvRows, "write", removing)
        words = ["try", "step", "--from", "10", "--to", "30", "--max-current", "40", "--for", "1", "--csv", str(file)]
        with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
            with drivebus.Bus(simulator) as bus:
                drive = bus.drive(1)
                drive.prepare_control()
                drive.write({"P00.11": 2.0, "P00.12": 2.0})
            done = self.run(simulator, "--json", *words, "--yes")
            assert json.loads(done.stdout)["aborted"] is None
            assert (done.exit_code, "was not there any more: it was removed" in done.stderr) == (1, True)

    def test_it_asks_tells_and_keeps_what_it_recorded(self, tmp_path: Path) -> None:
        file = str(tmp_path / "step.csv")
        words = ["try", "step", "--from", "10", "--to", "30", "--max-current", "40", "--for", "1", "--csv", file]
        with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
            with drivebus.Bus(simulator) as bus:
                drive = bus.drive(1)
                drive.prepare_control()
                drive.write({"P00.11": 2.0, "P00.12": 2.0})
            before = simulator.drive(1).words_written
            unasked = self.run(simulator, *words)
            assert unasked.exit_code == 2
            assert "as soon as the current exceeds 40 A or the frequency leaves 5 to 35 Hz" in unasked.stderr
            assert (simulator.drive(1).words_written, Path(file).exists()) == (before, False)
            done = self.run(simulator, "--json", *words, "--yes", "--with", "bus_voltage")
            assert done.exit_code == 0, done.stderr
            told = json.loads(done.stdout)
            assert (told["trial"], told["start"], told["to"], told["aborted"]) == ("step", 10.0, 30.0, None)
            titles, *rows = csv.reader(Path(file).read_text().splitlines())
            assert titles[:2] == ["time", "running_frequency [Hz]"]
            assert titles[-2:] == ["bus_voltage [V]", "missing"]
            assert len(rows) == told["samples"]
            again = self.run(simulator, *words, "--yes")
            assert again.exit_code == 2
            assert "is there already" in again.stderr
            aborted = self.run(
                simulator, "try", "ramp", "--from", "10", "--to", "30", "--max-current", "1", "--for", "1", "--yes"
            )
            assert aborted.exit_code == 1, aborted.stderr
            assert "above the 1 A that it was given" in aborted.stderr
            assert simulator.drive(1).state == "stopped"

    def test_it_says_that_the_motor_still_turns_and_titles_its_picture(self, tmp_path: Path) -> None:
        page = tmp_path / "step.html"
        with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
            with drivebus.Bus(simulator) as bus:
                drive = bus.drive(1)
                drive.prepare_control()
                drive.write({"P00.11": 1.0, "P00.12": 60.0})
            words = ["try", "step", "--from", "5", "--to", "8", "--max-current", "40", "--for", "0.3", "--yes"]
            done = self.run(simulator, *words, "--picture", str(page))
            assert done.exit_code == 0, done.stderr
            said = done.stdout.splitlines()[-1]
            turning = r"unit 1: the stop is confirmed; the motor is still slowing down, [1-9]\.\d\d Hz"
            assert re.fullmatch(turning, said), said
            assert simulator.drive(1).writes()[-1][1:] == (0x2000, 5)
        assert "unit 1, step 5 \\u2192 8 Hz" in page.read_text(encoding="utf-8")

    @pytest.mark.parametrize(
        ("words", "missing"),
        [
            (["step"], "--from, --to, --max-current and --for"),
            (["ramp", "--from", "10", "--to", "5"], "--max-current and --for"),
            (["sine", "--max-current", "5"], "--between, --period and --for"),
        ],
    )
    def test_all_that_is_missing_is_named_at_once(self, words: list[str], missing: str) -> None:
        done = CliRunner().invoke(cli, ["try", *words], prog_name="drivebus")
        told = " ".join(done.stderr.split())
        assert done.exit_code == 2
        assert f"Missing options {missing}. An example: `drivebus try {words[0]} --" in told
        example = told.partition("An example: `")[2].partition("`")[0]
        shown = CliRunner().invoke(cli, ["try", words[0], "--help"], prog_name="drivebus")
        assert f"Example: `{example}`" in " ".join(shown.stdout.split())

    def test_ctrl_c_stops_the_motor_and_says_what_it_does(self) -> None:
        from .conversation import Conversation

        with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
            with drivebus.Bus(simulator) as bus:
                drive = bus.drive(1)
                drive.prepare_control()
                drive.write({"P00.11": 2.0, "P00.12": 2.0})
            words = ["try", "step", "--from", "5", "--to", "10", "--max-current", "40", "--for", "600", "--yes"]
            with Conversation("--port", simulator.port, "-v", *words, terminal="xterm") as talk:
                talk.until("-> .*write set_frequency = 10.00 Hz")
                talk.until("set_frequency_actual 10.00 Hz")
                assert talk.end("\x03") == 130
                assert re.search(r"Interrupted\.\s+unit 1: (stopping|stopped)", talk.text), talk.text
            assert [word for _, address, word in simulator.drive(1).writes() if address == 0x2000][-1] == 5
