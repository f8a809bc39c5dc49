"""`drivebus scan --search`: what `drivebus.search` finds, how long it still takes, and what it left out."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

import drivebus
from drivebus.cli.present.output import counted, remark
from drivebus.cli.session import DEFAULT_BAUD, DEFAULT_FORMAT, Session

__all__ = ["search"]


def search(session: Session, timeout: float | None, full: bool) -> None:
    """Searches the line of *session*, and shows who was found."""
    out = session.out
    bits, parity, stop = session.line_format
    port = session.one_port()
    bar = _Countdown(out.console) if out.live else None
    found: list[drivebus.Located] = []
    with drivebus.search(
        port,
        baudrate=session.baud,
        bytesize=int(bits),
        parity=parity,
        stopbits=int(stop),
        full=full,
        timeout=timeout,
        rs485=session.direction,
        progress=None if bar is None else bar.show,
    ) as searching:
        try:
            with bar or nullcontext():
                for located in searching:
                    found.append(located)
                    if out.as_json:
                        out.record(_record(located))
                    elif bar is not None:
                        bar.found += 1
        finally:
            # Also what was found before Ctrl-C, or before the port was lost.
            if found and not out.as_json:
                out.rows(["unit", "settings", "family", "certainty", "problem"], [_row(each) for each in found])
                for line in _meanings(found):
                    out.say(line)
                known = [each for each in found if each.protocol == "modbus"]
                talk = f" Talk to the first: {_how(known[0], port)}" if known else ""
                out.say(f"{counted(len(found), 'unit')}.{talk}")
                for located in known[1:]:
                    if _named(located) is not None:
                        out.say(f"Unit {located.unit} has to be named: {_how(located, port)}")
        left_out = "; ".join(searching.untried)
    if found:
        remark(f"Not tried: {left_out}.")
        return
    remark(
        f"Error: nobody answered. Not tried: {left_out}. Check power, + to + and - to -, and the common wire; a port "
        f"on a board, wired to a bare transceiver, needs --rs485. `{session.doctor()}` looks at adapter and line."
    )
    raise click.exceptions.Exit(3)


_MEANINGS = {
    "shared": "several families report this code.",
    "by answers": "it has no code, but answers and refuses the same registers as this family. --profile names it.",
    "unverified": "no document prints this code for this family, or its state does not fit. --profile names it.",
}
"""What the column `certainty` says, but for `certain` and `unknown`, which say it themselves."""


class _Countdown(Bar):
    """The bar on a terminal, with the time that is left.

    Attributes:
        found: How many were found.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(TextColumn("{task.description}"), BarColumn(20), console=console, transient=True)
        self.found = 0
        self._spent = 0.0
        self._left: float | None = None
        self._task = self.add_task("opening", total=None)

    def show(self, at: drivebus.Progress) -> None:
        """Shows how far it has come."""
        # Who answers makes the plan longer.
        self._spent += max((at.left if self._left is None else self._left) - at.left, 0.0)
        self._left = at.left
        doing = "listening" if at.unit is None else f"unit {at.unit}"
        self.update(
            self._task,
            description=f"{at.settings} {doing}, {self.found} found, {at.left:.0f} s left",
            completed=self._spent,
            total=self._spent + at.left,
        )


def _row(located: drivebus.Located) -> list[Any]:
    """What is shown of *located*."""
    known = located.identification
    may_be = " or ".join(known.candidates) if known is not None else ""
    family = located.profile or may_be or ("unknown family" if located.protocol == "modbus" else "no Modbus")
    return [located.unit, str(located.settings), family, located.certainty, located.problem]


def _record(located: drivebus.Located) -> dict[str, Any]:
    """The same for a program."""
    known = located.identification
    return {
        "unit": located.unit,
        "baudrate": located.settings.baudrate,
        "format": located.settings.format,
        "profile": located.profile,
        "certainty": located.certainty,
        "candidates": () if known is None else known.candidates,
        "identification": None if known is None or known.code is None else f"{known.code:#06x}",
        "problem": located.problem,
        "protocol": located.protocol,
    }


def _meanings(found: Sequence[drivebus.Located]) -> Iterator[str]:
    """A line for each certainty that says less than it seems to."""
    for certainty, meaning in _MEANINGS.items():
        if any(located.certainty == certainty for located in found):
            yield f"{certainty}: {meaning}"


def _named(located: drivebus.Located) -> str | None:
    """The family that --profile has to name before the drive is used; None where it is known, or not to be told."""
    known = located.identification
    in_doubt = located.certainty in ("by answers", "unverified") and known is not None and len(known.candidates) == 1
    return located.profile if in_doubt else None


def _how(located: drivebus.Located, port: str) -> str:
    """What to type to talk to *located*."""
    words = ["--port", shlex.quote(port)]
    if located.settings.baudrate != DEFAULT_BAUD:
        words += ["--baud", str(located.settings.baudrate)]
    if located.settings.format != "".join(DEFAULT_FORMAT):
        words += ["--format", located.settings.format]
    if located.unit != 1:
        words += ["--unit", str(located.unit)]
    family = _named(located)
    if family is not None:
        words += ["--profile", family]
    return f"`drivebus {' '.join(words)} info`"
