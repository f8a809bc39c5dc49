"""`drivebus record`: values of drives into a file, until Ctrl-C."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import click
from rich.live import Live
from rich.text import Text

import drivebus
from drivebus.cli import names
from drivebus.cli.open_lines import opened_lines
from drivebus.cli.option_types import Place, Seconds, Size, Whole
from drivebus.cli.present.output import counted, printable, remark
from drivebus.cli.present.recordings import Recorded
from drivebus.cli.session import Session, pass_session
from drivebus.cli.signals import heeded
from drivebus.cli.wrong_use import WrongUse
from drivebus.end_signals import END_SIGNALS
from drivebus.record.formats import format_of

__all__ = ["COMMANDS"]

_SHOWN = 3
"""So many of the newest messages about the files stay on the screen."""

_EACH = 0.25
"""Seconds between two looks at how far it has come."""


@click.command()
@click.argument("target", metavar="FILE", type=Place())
@click.argument("wanted", metavar="[NAME]...", nargs=-1, shell_complete=names.complete_name)
@click.option(
    "--interval",
    type=Seconds(0),
    default=0.0,
    show_default=True,
    help="Seconds from one sample to the next. 0: as fast as the line allows.",
)
@click.option("--for", "duration", type=Seconds(0), metavar="SECONDS", help="Stop after so long.")
@click.option("--count", "-n", type=Whole(1), help="Stop when there are so many rows of values.")
@click.option("--rotate-size", type=Size(), help="Begin the next file at this size, such as 10MB: FILE-2, FILE-3.")
@click.option("--rotate-every", type=Seconds(1), metavar="SECONDS", help="Begin the next file after so long.")
@click.option("--no-state", is_flag=True, help="Only the registers: no state, no faults, one read less in a cycle.")
@click.option("--force", is_flag=True, help="Replace the file if it is there.")
@pass_session
def record(
    session: Session,
    target: str,
    wanted: tuple[str, ...],
    interval: float,
    duration: float | None,
    count: int | None,
    rotate_size: int | None,
    rotate_every: float | None,
    no_state: bool,
    force: bool,
) -> None:
    """Record registers into a file until Ctrl-C: all monitor registers, or those named.

    FILE ends with .csv, .jsonl, .sqlite, .db or .parquet. `drivebus plot FILE` draws it. Gaps and faults get rows of
    their own. A kill or a full disk costs the last second at most. If FILE is removed or replaced meanwhile, that is
    told at once, and a new file goes on. Exit code 1: that happened, or rows were lost.
    """
    out = session.out
    format_of(target)
    if Path(target).exists() and not force:
        raise WrongUse(f"{target} is there already; give another name, or --force")
    with ExitStack() as opened:
        lines = opened_lines(session, opened)
        drives = {drive: one for _, several in lines for one, drive in several}
        # A disk that is full is told below, and not as a warning from a thread.
        opened.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", drivebus.DrivebusWarning)
        recorder = drivebus.Recorder(
            target,
            {drive: _named(drive, wanted) for drive in drives},
            interval=interval or None,
            labels={drive: one.called for drive, one in drives.items()},
            state=not no_state,
            rotate_bytes=rotate_size,
            rotate_seconds=rotate_every,
            replace=force,
        )
        now = lines[0][0].now
        began = now()
        shown = _Shown(recorder, now)
        if not out.live:
            out.remark(f"Recording {counted(len(drives), 'drive')} into {target}. Ctrl-C ends it.")
        try:
            with heeded(END_SIGNALS, _end), ExitStack() as live:
                if out.live:
                    live.enter_context(Live(shown, console=out.console, refresh_per_second=1 / _EACH, transient=True))
                while not recorder.wait(_EACH):
                    shown.say_problem(session)
                    shown.say_what_befell(session)
                    if duration is not None and now() - began >= duration:
                        break
                    if count is not None and recorder.rows >= count:
                        break
        except KeyboardInterrupt:
            pass
        finally:
            problem = _close(recorder)
            shown.say_what_befell(session)
    _tell(session, recorder, problem)


class _Shown:
    """One line on the terminal: how far it has come."""

    def __init__(self, recorder: drivebus.Recorder, now: Callable[[], float]) -> None:
        self._recorder = recorder
        self._now = now
        self._began = now()
        self._problem = ""
        self._said = 0

    def __rich__(self) -> Text:
        recorder, took = self._recorder, self._now() - self._began
        rate = recorder.rows / took if took else 0.0
        late = f"{recorder.late} too late  " if recorder.late else ""
        text = Text(
            f"{printable(recorder.files[-1].name)}  {took:.0f} s  {recorder.rows} rows  {rate:.1f}/s  "
            f"{_bytes(recorder.size)}  {counted(recorder.gaps, 'gap')}  {late}Ctrl-C ends it"
        )
        for told in recorder.told[-_SHOWN:]:
            text.append(f"\n{printable(told)}", "yellow")
        return text if not recorder.problem else text.append(f"\nnot written now: {recorder.problem}", "yellow")

    def say_what_befell(self, session: Session) -> None:
        """Says what befell the files since it was said last; where somebody watches, only in the end."""
        if session.out.live and not self._recorder.closed:
            return
        for told in self._recorder.told[self._said :]:
            remark(f"Warning: {told}.")
            self._said += 1

    def say_problem(self, session: Session) -> None:
        """Says that the file cannot be written, once, where nobody watches."""
        problem = self._recorder.problem
        if problem and not self._problem and not session.out.live:
            remark(f"Warning: {self._recorder.files[-1]} cannot be written now: {problem}. It is tried again.")
        self._problem = problem


def _end(_number: int, _frame: object) -> None:
    """A signal that ends programs ends the recording as Ctrl-C does, so that the file gets its end."""
    raise KeyboardInterrupt


def _named(drive: drivebus.Drive, wanted: tuple[str, ...]) -> list[str] | None:
    return [names.named(drive.profile, text) for text in wanted] or None


def _close(recorder: drivebus.Recorder) -> str:
    """Ends the file; why it could not be."""
    with suppress(KeyboardInterrupt):
        try:
            recorder.close()
        except OSError as error:
            return str(error)
    return ""


def _bytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


def _tell(session: Session, recorder: drivebus.Recorder, problem: str) -> None:
    """Says what was recorded."""
    session.out.render(Recorded(recorder))
    if problem:
        remark(f"Error: {problem}")
    elif recorder.lost:
        remark(f"Error: {counted(recorder.lost, 'row')} could not be kept.")
    elif recorder.told:
        remark("Error: it was not written as it was to be: see above.")
    if problem or recorder.lost or recorder.told:
        raise click.exceptions.Exit(1)
    if not recorder.rows and recorder.missing:
        remark(f"Error: no drive answered. `{session.doctor()}` looks at adapter and line.")
        raise click.exceptions.Exit(3)


COMMANDS = [record]
