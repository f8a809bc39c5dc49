"""What a drive can be told through an outlet, in one word each."""

from __future__ import annotations

__all__ = ["HALTS", "MOVES", "ORDERS"]

MOVES = ("run", "setpoint", "reset")
"""Those that may set a motor in motion, or let it be."""
HALTS = ("stop", "coast")
"""Those that halt: whoever may tell a drive anything may tell it this, and it goes before all else."""
ORDERS = MOVES + HALTS
