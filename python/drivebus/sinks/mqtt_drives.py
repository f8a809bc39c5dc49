"""What is known of a drive before it was ever asked: what it will tell, what it may be told, and what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["MqttDrive", "MqttValue"]


@dataclass(frozen=True)
class MqttValue:
    """A value that a drive is asked for.

    Attributes:
        name: Its name, as in a `DrivePicture`.
        label: What it is, in words.
        unit: Its unit; empty where it has none.
        digits: How many it has behind the point.
    """

    name: str
    label: str
    unit: str
    digits: int


@dataclass(frozen=True)
class MqttDrive:
    """A drive of a plant.

    Attributes:
        name: Its name in the file.
        maker: Who makes it.
        model: What the maker calls it.
        fresh: Of each poll that asks it for how many seconds its answer is worth something; empty: it is not polled.
        values: What it is asked for.
        tells_state: Whether it tells what it is doing.
        tells_fault: Whether it tells that it is in a fault.
        may: What it may be told; empty: nothing.
        highest: The highest setpoint in Hz; 0.0: no setpoint in Hz is known.
        step: In Hz, from one setpoint to the next.
        in_force: The value that is the setpoint in force; empty: none of them is.
    """

    name: str
    maker: str
    model: str
    fresh: Mapping[int, float] = field(default_factory=dict)
    values: tuple[MqttValue, ...] = ()
    tells_state: bool = False
    tells_fault: bool = False
    may: frozenset[str] = frozenset()
    highest: float = 0.0
    step: float = 0.01
    in_force: str = ""
