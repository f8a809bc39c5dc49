"""`drivebus panel`: several drives on one screen, watched and commanded.

This file holds the command: what it needs of a terminal, and how it ends. The screen is loaded when all that is there.
"""

from __future__ import annotations

import os
import sys

import click

import drivebus
from drivebus.cli.output import remark
from drivebus.cli.session import Session, exit_code, pass_session
from drivebus.cli.types import Seconds

__all__ = ["COMMANDS"]

_LEAST = (80, 24)
"""Columns and lines that the panel needs."""


@click.command()
@click.option(
    "--watchdog",
    type=Seconds(0.1),
    metavar="SECONDS",
    help="While the panel runs a motor, have the drive coast after so long a silence: for kill -9 and cut cables.",
)
@pass_session
@click.pass_context
def panel(context: click.Context, session: Session, watchdog: float | None) -> None:
    """Watch and command drives on a full screen. Space stops, always. `?` there shows the keys.

    What moves a motor asks first. What the panel started it stops when it ends. It needs
    `pip install 'drivebus[panel]'` and a terminal of 80 by 24; `drivebus monitor` needs neither.
    """
    _check_terminal(session, bool(context.find_root().params.get("trace")))
    try:
        import textual  # noqa: F401 - whether it is there
    except ImportError:
        raise click.UsageError(
            "the panel needs textual: pip install 'drivebus[panel]'; `drivebus monitor` is the plain table"
        ) from None
    for one in session.several or (session,):
        one.one_port()
    from drivebus.cli.panel.program import run

    ended = run(session, watchdog)
    if ended.signal:
        raise click.exceptions.Exit(128 + ended.signal)
    for called, failure in ended.failures:
        remark(f"Error: {called}: stop: {failure}")
    if ended.failures:
        raise click.exceptions.Exit(exit_code(ended.failures[0][1]))


def _check_terminal(session: Session, traces: bool) -> None:
    """Refuses a terminal that cannot show it, before anything is opened."""
    plain = f"`{session.command('monitor')}` is the plain table"
    if session.out.as_json or traces:
        raise click.UsageError(
            f"the panel has the whole screen, so --{'json' if session.out.as_json else 'trace'} is for others; {plain}"
        )
    if not all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        raise drivebus.NotAllowed(f"the panel needs a terminal, and this is none; {plain}")
    kind = os.environ.get("TERM", "")
    if kind in ("", "dumb", "unknown") and os.name != "nt":
        raise drivebus.NotAllowed(f'the panel needs a terminal with a cursor, and TERM is "{kind}"; {plain}')
    columns, lines = os.get_terminal_size(sys.stdout.fileno())
    if columns < _LEAST[0] or lines < _LEAST[1]:
        raise drivebus.NotAllowed(
            f"the panel needs a window of {_LEAST[0]} by {_LEAST[1]}, and this one has {columns} by {lines}; make it "
            f"larger, or: {plain}"
        )


COMMANDS = [panel]
