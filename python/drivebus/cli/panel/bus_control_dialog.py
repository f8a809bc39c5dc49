"""Whether a drive obeys the bus, and what is asked before it is set so: what would be written, and where."""

from __future__ import annotations

import drivebus
from drivebus.cli.panel.members import Member
from drivebus.cli.present.motors import OBEYING
from drivebus.cli.session import may_turn

__all__ = ["lacking", "question"]


def lacking(member: Member, drive: drivebus.Drive, only_sure: bool) -> drivebus.Control:
    """What is not set as it must be. *only_sure*: what surely keeps it from starting, as `Drive.run` judges that.

    Raises:
        NoAnswer, BadAnswer, Refused: See each.
    """
    known = member.session.unverified
    return drivebus.Control(
        item
        for item in drive.check_control()
        if not item.ok and not (only_sure and (item.actual is None or not (item.verified or known)))
    )


def question(member: Member, drive: drivebus.Drive, items: drivebus.Control) -> str:
    """Names *items* and what becomes of them. Asks the drive whether it turns.

    Raises:
        NoAnswer, BadAnswer, Refused: See each.
    """
    turning = may_turn(drive)
    takes = f"{turning}; {OBEYING}" if turning else OBEYING[0].upper() + OBEYING[1:]
    written = "\n".join(f"  {_written(item)}" for item in items)
    return (
        f"{member.what}: prepare it? To RAM, until the drive is switched off, this writes\n{written}\n"
        f"{takes}. Is the machine clear?"
    )


def _written(item: drivebus.ControlItem) -> str:
    now = "not read" if item.actual is None else int(item.actual)
    unsure = "" if item.verified else " [value unverified]"
    return f"{item.code}: {now} -> {int(item.wanted)}, {item.label}{unsure}"
