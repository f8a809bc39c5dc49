"""What is seen of a motor after it was told to stop, and whether that proves that it obeys.

A drive that ramps down says "running" until it stands, so its frequency is looked at: a fall along the ramp that is set
in the drive, and that began with the stop, proves it as well as standstill does. It is decided in the core
(`crates/drive`).
"""

from __future__ import annotations

from drivebus._native import Fall

__all__ = ["PATIENCE", "Fall"]

PATIENCE = Fall.PATIENCE
"""Seconds of the line's clock in which the frequency of a motor that stops must fall."""
