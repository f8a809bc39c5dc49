"""LinuxCNC's HAL and a drive as its spindle: one component for every family of drives.

`pins` names what HAL sees, `core` decides from it what the drive is told, without a clock and without a line, `motor`
tells the drive, `loop` brings the three together, and `linuxcnc` is what is asked of LinuxCNC itself.
"""

from drivebus.hal.core import Scale, Spindle
from drivebus.hal.linuxcnc import Alive, HalGone, component, module
from drivebus.hal.loop import Loop
from drivebus.hal.motor import SpindleMotor
from drivebus.hal.pins import PINS, Container, Pins

__all__ = [
    "PINS",
    "Alive",
    "Container",
    "HalGone",
    "Loop",
    "Pins",
    "Scale",
    "Spindle",
    "SpindleMotor",
    "component",
    "module",
]
