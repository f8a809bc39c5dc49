"""The lines of all drives that were chosen, each opened once, for commands that look at several drives at a time."""

from __future__ import annotations

from contextlib import ExitStack

import drivebus
from drivebus.cli.session import Session

__all__ = ["opened_lines"]


def opened_lines(
    session: Session, opened: ExitStack
) -> list[tuple[drivebus.Bus, list[tuple[Session, drivebus.Drive]]]]:
    """Each line with its drives, and what was said of each. *opened* closes the lines."""
    lines: dict[str, tuple[drivebus.Bus, list[tuple[Session, drivebus.Drive]]]] = {}
    for one in session.several or (session,):
        key = one.line_key
        if key not in lines:
            lines[key] = opened.enter_context(one.bus()), []
        bus, drives = lines[key]
        drives.append((one, one.drive_on(bus)))
    return list(lines.values())
