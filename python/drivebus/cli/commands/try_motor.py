"""`drivebus try`: how a motor follows a step, a ramp or a sine of its setpoint, in figures."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from typing import Any, TextIO

import click
from rich.live import Live
from rich.text import Text

import drivebus
from drivebus.capture.standing import Standing
from drivebus.cli import names
from drivebus.cli.option_types import Amperes, Hertz, Place, Seconds
from drivebus.cli.present.csv_rows import CsvRows
from drivebus.cli.present.output import Output, remark
from drivebus.cli.present.trials import TrialResult
from drivebus.cli.required_options import NamesAllMissing
from drivebus.cli.session import Session, force_option, pass_session, yes_option
from drivebus.cli.wrong_use import WrongUse
from drivebus.trial import Trial
from drivebus.trial.abort_rules import Bounds
from drivebus.trial.setpoint_courses import Change, Wave

__all__ = ["COMMANDS"]


@click.group("try")
def trying() -> None:
    """Try how the motor follows its setpoint: a step, a ramp, a sine. Records it, and stops the motor in the end."""


def _trial(command: Callable[..., None]) -> Callable[..., None]:
    """The options of every trial."""
    options: list[Callable[..., Any]] = [
        click.option(
            "--max-current", type=Amperes(0), required=True, metavar="A", help="Stop above this current; off: never."
        ),
        click.option(
            "--for",
            "duration",
            type=Seconds(0.1, 3600),
            required=True,
            metavar="SECONDS",
            help="Stop so long after the first change.",
        ),
        click.option(
            "--margin",
            type=Hertz(0),
            metavar="HZ",
            help="Stop if the frequency leaves the bounds by more. Default: a quarter of their width, at least 1 Hz.",
        ),
        click.option(
            "--settle",
            type=Seconds(0, 3600),
            default=60.0,
            show_default=True,
            metavar="SECONDS",
            help="Time to settle at the beginning.",
        ),
        click.option(
            "--with",
            "also",
            multiple=True,
            metavar="REGISTER",
            shell_complete=names.complete_name,
            help="Record this too. May be repeated.",
        ),
        click.option(
            "--csv", "file", type=Place(dir_okay=False), metavar="FILE", help="Keep all samples in this file."
        ),
        click.option(
            "--picture", type=Place(dir_okay=False), metavar="FILE", help="Draw all samples: .png, .svg or .html."
        ),
        click.option("--reverse", is_flag=True, help="Turn the other way."),
        force_option,
        yes_option,
        pass_session,
    ]
    for option in reversed(options):
        command = option(command)
    return command


_FROM = click.option("--from", "start", type=Hertz(0), required=True, metavar="HZ", help="Settle here first.")
_TO = click.option("--to", type=Hertz(0), required=True, metavar="HZ", help="Then set this.")


@trying.command(cls=NamesAllMissing)
@_FROM
@_TO
@_trial
def step(session: Session, start: float, to: float, **how: Any) -> None:
    """Set another speed at once: rise time, overshoot, settling time, steady-state error, peak current.

    Example: `drivebus try step --from 10 --to 30 --max-current 8 --for 10`.
    """
    carry_out = functools.partial(drivebus.trial.step, start=start, to=to)
    _do(session, Change(start, to), _change(start, to), carry_out, **how)


@trying.command(cls=NamesAllMissing)
@_FROM
@_TO
@_trial
def ramp(session: Session, start: float, to: float, **how: Any) -> None:
    """Set another speed at once, and compare how fast the motor gets there with the ramp that the drive is set to.

    Example: `drivebus try ramp --from 30 --to 10 --max-current 8 --for 10 --csv ramp.csv`.
    """
    carry_out = functools.partial(drivebus.trial.ramp, start=start, to=to)
    _do(session, Change(start, to), _change(start, to), carry_out, **how)


@trying.command(cls=NamesAllMissing)
@click.option("--between", type=(Hertz(0), Hertz(0)), required=True, metavar="LOW HIGH", help="The bounds, in Hz.")
@click.option("--period", type=Seconds(0.1, 3600), required=True, metavar="SECONDS", help="Once up and down.")
@_trial
def sine(session: Session, between: tuple[float, float], period: float, **how: Any) -> None:
    """Move the speed up and down as a sine: gain and phase lag. The first period counts for nothing.

    Example: `drivebus try sine --between 10 20 --period 4 --max-current 8 --for 20`.
    """
    low, high = between
    what = f"moves it between {low:g} and {high:g} Hz, once up and down in {period:g} s"
    carry_out = functools.partial(drivebus.trial.sine, low=low, high=high, period=period)
    _do(session, Wave(low, high, period), what, carry_out, **how)


def _change(start: float, to: float) -> str:
    return f"lets it settle at {start:g} Hz, then sets {to:g} Hz"


def _path(course: Change | Wave) -> str:
    """The course in the title of a picture."""
    if isinstance(course, Wave):
        return f"{course.low:g} ↔ {course.high:g} Hz in {course.period:g} s"
    return f"{course.start:g} → {course.to:g} Hz"


def _do(
    session: Session,
    course: Change | Wave,
    what: str,
    carry_out: Callable[..., Trial],
    *,
    max_current: float,
    duration: float,
    margin: float | None,
    also: tuple[str, ...],
    file: str | None,
    picture: str | None,
    reverse: bool,
    yes: bool,
    **how: Any,
) -> None:
    """Asks, carries out what moves along *course* as *what* says, and shows what came of it."""
    session.will_write()
    if picture is not None:
        _check(picture)
    limit = None if math.isinf(max_current) else max_current
    margin = Bounds.usual_margin(course) if margin is None else margin
    with session.drive() as drive, ExitStack() as opened:
        recorded = drive.readable(*(names.named(drive.profile, text) for text in also)) if also else []
        leaves = f"the frequency leaves {max(course.low - margin, 0):g} to {course.high + margin:g} Hz"
        sooner = leaves if limit is None else f"the current exceeds {limit:g} A or {leaves}"
        way = "in reverse" if reverse else "forward"
        session.ask(
            f"This starts the motor {way}, {what}, and stops it {duration:g} s later, or as soon as {sooner}", yes
        )
        kept = None if file is None else _Kept(opened, file, drive)
        shown = _Shown(session.out, drive) if session.out.live else None
        told = [each for each in (kept, shown) if each is not None]
        try:
            with shown.live if shown else nullcontext():
                trial = carry_out(
                    drive,
                    duration=duration,
                    max_current=limit,
                    margin=margin,
                    also=recorded,
                    reverse=reverse,
                    told=lambda time, values: [each(time, values) for each in told],
                    **how,
                )
        except KeyboardInterrupt as error:
            if hasattr(error, "add_note"):
                for text in _now(session, drive, "stopping"):
                    error.add_note(text)
            raise
        turning = "the stop is confirmed; the motor is still slowing down"
        session.out.render(TrialResult(trial, drive, tuple(_now(session, drive, turning))))
        is_kept = kept is None or kept.is_there()
    if picture is not None:
        from drivebus.plot import draw, of_samples

        draw(of_samples(trial.samples, f"{session.called}, {trial.kind} {_path(course)}"), picture)
    if trial.aborted is not None:
        remark(f"Error: the trial was aborted: {trial.aborted}")
    if trial.aborted is not None or not is_kept:
        raise click.exceptions.Exit(1)


def _check(picture: str) -> None:
    """Whether *picture* can be drawn, before the motor moves."""
    from drivebus.plot.draw import check

    check(picture)
    if Path(picture).exists():
        raise WrongUse(f"{picture} is there already; give another name. The motor was not started")


class _Kept:
    """Writes each sample into a new file, which is there before the motor moves."""

    def __init__(self, opened: ExitStack, file: str, drive: drivebus.Drive) -> None:
        self._file = opened.enter_context(_new(file))
        self._name = file
        self._standing = Standing(Path(file), os.fstat(self._file.fileno()))
        self._drive = drive
        self._rows: CsvRows | None = None

    def __call__(self, time: float, values: Mapping[str, float]) -> None:
        if self._rows is None:
            profile = self._drive.profile
            rows = {name: self._drive.describe(name) for name in values}
            doubtful = {
                name: doubt for name, row in rows.items() if (doubt := names.evidence(profile, row)) != "verified"
            }
            self._rows = CsvRows(self._file, rows, doubtful)
        self._rows.write(time, values)

    def is_there(self) -> bool:
        """Whether the file stands where it was made; says so if it does not."""
        why = self._standing.gone()
        if why:
            remark(f"Error: {self._name} was not there any more: {why}; the samples are not kept.")
        return not why


class _Shown:
    """Shows the latest sample as a line that goes away in the end.

    Attributes:
        live: The line.
    """

    def __init__(self, out: Output, drive: drivebus.Drive) -> None:
        self.live = Live(Text(), console=out.console, refresh_per_second=5, transient=True)
        self._drive = drive
        self._begun: float | None = None

    def __call__(self, time: float, values: Mapping[str, float]) -> None:
        self._begun = time if self._begun is None else self._begun
        rows = {name: self._drive.describe(name) for name in values}
        shown = (f"{name} {row.text(values[name])} {row.unit}".rstrip() for name, row in rows.items())
        line = f"{time - self._begun:6.1f} s  {'  '.join(shown)}"
        self.live.update(Text(line, no_wrap=True, overflow="crop"))


def _new(file: str) -> TextIO:
    """*file*, which must not be there yet, opened."""
    try:
        return Path(file).open("x", encoding="utf-8", newline="")
    except FileExistsError:
        raise WrongUse(f"{file} is there already; give another name. The motor was not started") from None
    except OSError as error:
        reason = error.strerror or error
        raise WrongUse(f"{file} cannot be written: {reason}. The motor was not started") from None


def _now(session: Session, drive: drivebus.Drive, turning: str) -> Iterator[str]:
    """What the motor does now, if the drive tells; in the words *turning*, if it still turns."""
    with suppress(drivebus.DrivebusError):
        status = drive.status()
        where = "" if status.frequency is None else f", {status.frequency:.2f} Hz"
        yield f"{session.called}: {f'{turning}{where}' if status.state.running else status}"


COMMANDS = [trying]
