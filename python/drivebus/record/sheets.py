"""Tables as a spreadsheet saves them, read by the core: as it reads those of a profile."""

from __future__ import annotations

from drivebus._native import read_sheet

__all__ = ["read_sheet"]
