"""Tries how a drive and its motor follow a setpoint: a step, a ramp, a sine; always stopped in the end.

    with drivebus.Bus("/dev/ttyUSB0") as bus:
        trial = drivebus.trial.step(bus.drive(1), 10, 30, duration=10, max_current=8)
        print(trial.figures.rise_time, trial.figures.overshoot)

`setpoint_courses` says what the setpoint does, `abort_rules` what ends a trial early, `recording` moves the motor and
records, `samples` is what came of that, `metrics` is the arithmetic over it, and `trials` are the functions that one
calls.
"""

from drivebus.trial.metrics import RampFigures, SineFigures, StepFigures, peak, ramp_figures, sine_figures, step_figures
from drivebus.trial.samples import Samples
from drivebus.trial.trials import Trial, ramp, sine, step

__all__ = [
    "RampFigures",
    "Samples",
    "SineFigures",
    "StepFigures",
    "Trial",
    "peak",
    "ramp",
    "ramp_figures",
    "sine",
    "sine_figures",
    "step",
    "step_figures",
]
