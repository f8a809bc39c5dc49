"""What a motor does, in words: on its way to what it was told, and what obeying the bus means to it."""

from __future__ import annotations

import drivebus
from drivebus import State

__all__ = ["OBEYING", "going", "on_the_way"]

OBEYING = "this takes its commands and its setpoint from the bus"
"""What `prepare` does to a motor that turns."""


def on_the_way(status: drivebus.Status, towards: State | None) -> str | None:
    """What the motor does that turns, but not as it was told yet; None where it does."""
    doing = going(status.state, towards)
    return doing if doing is None or status.frequency is None else f"{doing}, {status.frequency:.2f} Hz"


def going(state: State, towards: State | None) -> str | None:
    """What a motor in *state* does that was told to go *towards* another; None where it does not turn, or is there."""
    if towards is None or not state.running or state is towards:
        return None
    return "stopping" if towards is State.STOPPED else "reversing"
