"""What came of a trial."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import drivebus
from drivebus.cli.present.output import Output
from drivebus.trial import RampFigures, SineFigures, StepFigures, Trial

__all__ = ["TrialResult"]


@dataclass(frozen=True)
class TrialResult:
    """The figures of a *trial* on *drive*; *now* tells people what the motor does."""

    trial: Trial
    drive: drivebus.Drive
    now: tuple[str, ...]

    def records(self) -> Iterator[dict[str, Any]]:
        """All of them in one object."""
        trial = self.trial
        current, at = trial.peak_current or (None, None)
        yield {
            "trial": trial.kind,
            "unit": self.drive.unit,
            **asdict(trial.course),
            **(asdict(trial.figures) if trial.figures else {}),
            **({"ramp_setting": trial.ramp_setting} if trial.kind == "ramp" else {}),
            "peak_current": current,
            "peak_current_at": at,
            "samples": len(trial.samples),
            "interval": trial.samples.interval,
            "aborted": trial.aborted,
        }

    def lay_out(self, out: Output) -> None:
        """The same in words, with units."""
        trial = self.trial
        told = dict(_figures(trial))
        current, at = trial.peak_current or (None, None)
        if current is not None and at is not None:
            shown = self.drive.describe(trial.roles.current or "").text(current)
            told["peak current"] = f"{shown} A, at {at:.2f} s"
        interval = trial.samples.interval
        told["samples"] = f"{len(trial.samples)}{'' if interval is None else f', one each {interval * 1000:.0f} ms'}"
        out.facts(told)
        for text in self.now:
            out.say(text)


def _figures(trial: Trial) -> Iterator[tuple[str, str]]:
    """The figures in words, with their units."""
    figures = trial.figures
    if isinstance(figures, StepFigures):
        yield "rise time, 10 to 90 %", _seconds(figures.rise_time)
        yield "overshoot", f"{figures.overshoot:.1f} %"
        yield "settling time, within 2 %", _seconds(figures.settling_time)
        yield "steady-state error", _hertz(figures.steady_state_error)
    elif isinstance(figures, RampFigures):
        yield "rate", "not reached" if figures.rate is None else f"{figures.rate:.3f} Hz/s"
        yield "the drive's ramp", "not known" if trial.ramp_setting is None else f"{trial.ramp_setting:.3f} Hz/s"
        yield "steady-state error", _hertz(figures.steady_state_error)
    elif isinstance(figures, SineFigures):
        yield "gain", f"{figures.gain:.3f}"
        yield "phase lag", f"{figures.phase_lag:.1f}°, {figures.lag:.3f} s"
        yield "offset", _hertz(figures.offset)
    elif trial.aborted is None:
        yield "figures", "too few samples"


def _seconds(seconds: float | None) -> str:
    return "not reached" if seconds is None else f"{seconds:.2f} s"


def _hertz(hz: float) -> str:
    # No -0.00.
    return f"{round(hz, 2) + 0.0:.2f} Hz"
