"""What a drive is doing, and where it takes its commands from."""

from __future__ import annotations

from enum import Enum

__all__ = ["ControlSource", "State"]


class State(str, Enum):
    """What the drive is doing, from its first status word. It equals its name: `State.STOPPED == "stopped"`."""

    FORWARD = "forward"
    REVERSE = "reverse"
    RUNNING = "running"
    """It turns; the drive does not tell which way."""
    STOPPED = "stopped"
    FAULT = "fault"
    POWER_OFF = "power_off"
    PRE_EXCITING = "pre_exciting"
    UNKNOWN = "unknown"

    @property
    def running(self) -> bool:
        """Whether the drive feeds the motor in order to turn it."""
        return self in (State.FORWARD, State.REVERSE, State.RUNNING)

    @property
    def at_rest(self) -> bool:
        """Whether the output to the motor is off. A drive that magnetises the motor before a start is not at rest."""
        return self in (State.STOPPED, State.FAULT, State.POWER_OFF)

    def __str__(self) -> str:
        return self.value.replace("_", " ")

    def __format__(self, form: str) -> str:
        return format(str(self), form)


class ControlSource(str, Enum):
    """Where the drive takes its run command from. It equals its name: `ControlSource.KEYPAD == "keypad"`."""

    KEYPAD = "keypad"
    TERMINAL = "terminal"
    COMMUNICATION = "communication"

    def __str__(self) -> str:
        return self.value

    def __format__(self, form: str) -> str:
        return format(str(self), form)
