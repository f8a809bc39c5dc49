"""The prompt of `drivebus raw`: one line after the other, each sent when it is complete."""

from __future__ import annotations

import click

import drivebus
from drivebus.cli.present.errors import tell
from drivebus.cli.present.output import remark
from drivebus.cli.raw.editing import Editing
from drivebus.cli.raw.families import UnitFamilies
from drivebus.cli.raw.script import Send, requests_of, typed_in
from drivebus.cli.raw.sending import Sender
from drivebus.cli.session import Declined, Session

__all__ = ["prompt"]

_HELP = """\
01 03 2100 0001         unit and PDU in hex; blanks are optional, the CRC is added; unit 11 is 0B
read output_current     the same by name, code or address; several names are asked in the fewest requests
write P00.11=2.5        a parameter goes to RAM; what writes asks first
… x10                   ten times, as fast as the line allows
… x10 every 0.5         ten times, one each half second; Ctrl-C ends it
unit 2                  sets the unit whose names are used; this number is decimal
wait 0.5                waits half a second
# …                     a comment
help, ?                 this
quit, Ctrl-D            ends"""


def prompt(session: Session, bus: drivebus.Bus, force: bool, yes: bool) -> None:
    """Asks for lines and sends what they say, until the last one."""
    families = UnitFamilies(session, bus)
    sender = Sender(session, bus, families, force, yes)
    unit = session.unit
    session.out.remark(
        f"Requests to {session.port}: unit and PDU in hex, without CRC. `help` shows the rest, Ctrl-D ends."
    )
    with Editing(families) as editing:
        while True:
            editing.unit = unit
            try:
                line = editing.line("" if session.out.as_json else "raw> ")
            except KeyboardInterrupt:
                remark()
                continue
            if line is None or line.strip().lower() in ("quit", "exit"):
                break
            if line.strip().lower() in ("help", "?"):
                remark(_HELP)
                continue
            unit = _done(line, unit, sender, families, session, force)
    sender.remind()


def _done(line: str, unit: int, sender: Sender, families: UnitFamilies, session: Session, force: bool) -> int:
    """Does what *line* says, and returns the unit whose names are meant from then on. No error ends the prompt."""
    total = 0
    try:
        for typed in typed_in([line], "", unit, force, session.addresses):
            unit = typed.unit
            step = requests_of(typed, families.find, session.unverified)
            if step is None:
                continue
            sender.prepare([step])
            total = step.times * len(step.requests) if isinstance(step, Send) else 0
            sender.run([step])
            if total > 1:
                remark(sender.told(total))
    except KeyboardInterrupt:
        remark(f"Interrupted. {sender.told(total)}" if total else "Interrupted.")
    except Declined as declined:
        declined.show()
    except click.UsageError as error:
        remark(f"Error: {error.message}")
    except drivebus.DrivebusError as error:
        tell(error)
    return unit
