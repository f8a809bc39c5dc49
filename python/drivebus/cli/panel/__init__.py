"""`drivebus panel`: several drives on one screen, watched and commanded.

This file holds the command: what it needs of a terminal, and how it ends. The screen is loaded when all that is there.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace

import click

import drivebus
from drivebus.cli.names import parse_families
from drivebus.cli.option_types import Seconds
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse

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

    What moves a motor asks first. What the panel started it stops when it ends. --profile names the family of all
    units, or of each: 3=gd350,5=vfd500. It needs `pip install 'drivebus[panel]'` and a terminal of 80 by 24; `drivebus
    monitor` needs neither.
    """
    session = _each_its_family(session)
    _check_terminal(session, bool(context.find_root().params.get("trace")))
    try:
        import textual  # noqa: F401 - whether it is there
    except ImportError:
        raise WrongUse(
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
    if ended.mistake is not None:
        what = f"{type(ended.mistake).__name__}: {ended.mistake}".rstrip(": ").replace("\n", " ")
        remark(
            f"Error: the panel ended by a mistake of its own: {what}. What it had started it has stopped first"
            f"{', but for what is named above' if ended.failures else ''}. `{session.command('status')}` shows the "
            "drive; the logger drivebus.panel has the rest at level DEBUG."
        )
    if ended.failures:
        raise click.exceptions.Exit(exit_code(ended.failures[0][1]))
    if ended.mistake is not None:
        raise click.exceptions.Exit(1)


def _each_its_family(session: Session) -> Session:
    """*session*, with a family for each unit that --profile names by its address.

    Raises:
        NotAllowed: There is no such family.
    """
    families = parse_families(session.profile)
    if not isinstance(families, dict):
        return session
    members = session.several or (session,)
    if any(one.name for one in members):
        raise WrongUse("drivebus.toml has the family of each drive: `profile` there, or one --profile for all")
    others = families.keys() - {one.unit for one in members}
    if others:
        raise WrongUse(f"--profile names unit {min(others)}, and --unit does not")
    for name in families.values():
        drivebus.Profile.find(name)
    each = tuple(
        replace(one, profile=families.get(one.unit), trust_profile=one.trust_profile and one.unit in families)
        for one in members
    )
    return each[0] if len(each) == 1 else replace(session, profile=None, several=each)


def _check_terminal(session: Session, traces: bool) -> None:
    """Refuses a terminal that cannot show it, before anything is opened."""
    plain = f"`{session.command('monitor')}` is the plain table"
    if session.out.as_json or traces:
        raise WrongUse(
            f"the panel has the whole screen, so --{'json' if session.out.as_json else 'trace'} is for others; {plain}"
        )
    if not all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        raise drivebus.NotAllowed(f"the panel needs a terminal, and this is none; {plain}")
    if not _is_in_front():
        raise drivebus.NotAllowed(
            "the panel needs to be in the foreground of its terminal, and another program is; bring it there with "
            f"`fg`, or by `timeout --foreground` where timeout starts it; {plain}"
        )
    kind = os.environ.get("TERM", "")
    if kind in ("", "dumb", "unknown") and sys.platform != "win32":
        raise drivebus.NotAllowed(f'the panel needs a terminal with a cursor, and TERM is "{kind}"; {plain}')
    columns, lines = os.get_terminal_size(sys.stdout.fileno())
    if columns < _LEAST[0] or lines < _LEAST[1]:
        raise drivebus.NotAllowed(
            f"the panel needs a window of {_LEAST[0]} by {_LEAST[1]}, and this one has {columns} by {lines}; make it "
            f"larger, or: {plain}"
        )


def _is_in_front() -> bool:
    """Whether the terminal is this program's now: one in the background is held as soon as it reads a key."""
    if sys.platform == "win32":
        return True
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # a terminal that controls no programs
        return True


COMMANDS = [panel]
