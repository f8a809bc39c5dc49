"""What a drive says, as values a program can use: choices, states, faults, snapshots.

Plain data: nothing here reads from a drive or knows how its words are laid out. Each kind is loaded when it is asked
for: a stop needs the states alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.values.choices import Choice, Value, counted, digits_of
    from drivebus.values.control import Control, ControlItem
    from drivebus.values.descriptions import Description, group_of
    from drivebus.values.faults import Fault
    from drivebus.values.snapshots import Snapshot
    from drivebus.values.states import ControlSource, State
    from drivebus.values.status import Status
    from drivebus.values.watchdogs import WatchdogSettings

__all__ = [
    "Choice",
    "Control",
    "ControlItem",
    "ControlSource",
    "Description",
    "Fault",
    "Snapshot",
    "State",
    "Status",
    "Value",
    "WatchdogSettings",
    "counted",
    "digits_of",
    "group_of",
]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "choices": (
                "Choice",
                "Value",
                "counted",
                "digits_of",
            ),
            "control": (
                "Control",
                "ControlItem",
            ),
            "descriptions": (
                "Description",
                "group_of",
            ),
            "faults": ("Fault",),
            "snapshots": ("Snapshot",),
            "states": (
                "ControlSource",
                "State",
            ),
            "status": ("Status",),
            "watchdogs": ("WatchdogSettings",),
        },
    )
