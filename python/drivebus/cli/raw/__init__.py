"""`drivebus raw`: requests by hand, as with the serial assistants of the manuals.

`request` is one request and what it may do, `script` the lines that people type, `families` what the units are,
`sending` puts them on the line and shows what comes, `prompt` asks for one line after the other, with `editing` for the
history and the completion of what is typed, and `command` is the command.
"""

from __future__ import annotations

from drivebus.cli.raw.command import raw

__all__ = ["COMMANDS"]

COMMANDS = [raw]
