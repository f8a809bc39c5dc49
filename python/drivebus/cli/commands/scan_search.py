"""`drivebus scan --search`: what `drivebus.search` finds, how long it still takes, and what it left out."""

from __future__ import annotations

import functools
from contextlib import nullcontext
from dataclasses import replace

import click
from rich.console import Console
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

import drivebus
from drivebus.cli.present.found_units import LocatedUnits
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session

__all__ = ["search"]


def search(session: Session, timeout: float | None, full: bool) -> None:
    """Searches the line of *session*, and shows who was found."""
    out = session.out
    bits, parity, stop = session.line_format
    port = session.one_port()
    bar = _Countdown(out.console) if out.live else None
    found = LocatedUnits(out, functools.partial(_how, session))
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
                    found.take(located)
                    if bar is not None:
                        bar.found += 1
                        # On the console of the bar, so that it stands above it.
                        out.say(found.in_a_line(located))
        finally:
            # Also what was found before Ctrl-C, or before the port was lost.
            found.end()
        left_out = "; ".join(searching.untried)
    if found:
        remark(f"Not tried: {left_out}.")
        return
    remark(
        f"Error: nobody answered. Not tried: {left_out}. Check power, + to + and - to -, and the common wire; a port "
        f"on a board, wired to a bare transceiver, needs --rs485. `{session.doctor()}` looks at adapter and line."
    )
    raise click.exceptions.Exit(3)


def _how(session: Session, located: drivebus.Located, family: str | None) -> str:
    """What to type to talk to *located*, as *family* if it has to be named."""
    settings = located.settings
    one = replace(
        session,
        name="",
        baud=settings.baudrate,
        line_format=(str(settings.bytesize), settings.parity, str(settings.stopbits)),
        unit=located.unit,
        profile=family,
        reserved=False,
    )
    return one.command("info")


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
