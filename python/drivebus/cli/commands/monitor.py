"""`drivebus monitor`: registers as they change, asked by `Bus.poll` at a rate that does not drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from queue import SimpleQueue
from threading import Thread
from typing import Any

import click

import drivebus
from drivebus.cli import names, watch_list
from drivebus.cli.open_lines import opened_lines
from drivebus.cli.option_types import Seconds, Whole
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.output import remark
from drivebus.cli.present.samples import view_for
from drivebus.cli.present.screen import Watched
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]

_KEPT = 10_000
"""Samples that wait where they are taken more slowly than they come."""


@click.command()
@click.argument("wanted", metavar="[NAME]...", nargs=-1, shell_complete=names.complete_name)
@click.option(
    "--interval",
    type=Seconds(0),
    default=0.5,
    show_default=True,
    help="Seconds from one sample to the next. 0: as fast as the line allows.",
)
@click.option("--count", type=Whole(1), help="Samples to take of each drive. Default: until Ctrl-C.")
@pass_session
def monitor(session: Session, wanted: tuple[str, ...], interval: float, count: int | None) -> None:
    """Watch registers as they change: all monitor registers, or those named.

    A terminal shows the latest values, and the least and greatest so far. A file or a pipe gets CSV, and --json an
    object for each sample. A missing sample is shown as missing, and the next one is asked for. If none
    comes at all, the exit code says why.
    """
    interrupted = False
    with ExitStack() as open_lines:
        lines: list[tuple[drivebus.Bus, _Drives]] = [
            (bus, [(_watched(one, drive, wanted), drive) for one, drive in drives])
            for bus, drives in opened_lines(session, open_lines)
        ]
        drives = [drive for _, line in lines for drive in line]
        view = view_for(session.out, [watched for watched, _ in drives])
        seen = _Seen()
        polls = [
            open_lines.enter_context(
                bus.poll({drive: watch_list.asked(watched) for watched, drive in line}, interval or None, size=_KEPT)
            )
            for bus, line in lines
        ]
        by_drive = {id(drive): watched for watched, drive in drives}
        try:
            with view.shown():
                for sample in _samples(polls):
                    watched = by_drive[id(sample.drive)]
                    watched.take(sample)
                    seen.take(sample)
                    view.show(watched, sample)
                    if count is not None and seen.count == count * len(drives):
                        break
        except KeyboardInterrupt:
            interrupted = True
        told = list(seen.told(polls, interval, view.is_lossless))
    view.end()
    for text in told:
        remark(text)
    if seen.last is not None and seen.missing == seen.count:
        session.advise(seen.last)
        raise click.exceptions.Exit(exit_code(seen.last))
    # Without --count it is how this ends.
    if interrupted and count is not None:
        raise click.exceptions.Exit(130)


_Drives = list[tuple[Watched, drivebus.Drive]]


def _watched(session: Session, drive: drivebus.Drive, wanted: Sequence[str]) -> Watched:
    """What is shown of *drive*."""
    watched = watch_list.watched(session, drive, wanted, session.out.live)
    if watched.hint and not session.out.live:
        remark(watched.hint)
    return watched


def _samples(polls: Sequence[drivebus.Poll[Any]]) -> Iterator[drivebus.Sample]:
    """What comes of each of *polls*, as it comes."""
    if len(polls) == 1:
        yield from polls[0]
        return
    came: SimpleQueue[drivebus.Sample | None] = SimpleQueue()

    def forward(poll: drivebus.Poll[Any]) -> None:
        for sample in poll:
            came.put(sample)
        came.put(None)

    for poll in polls:
        Thread(target=forward, args=(poll,), name="drivebus monitor", daemon=True).start()
    going = len(polls)
    while going:
        sample = came.get()
        going -= sample is None
        if sample is not None:
            yield sample


class _Seen:
    """What came so far.

    Attributes:
        count: Samples, those that are missing included.
        missing: How many of them are.
        last: Why the last of these is.
    """

    def __init__(self) -> None:
        self.count = 0
        self.missing = 0
        self.last: drivebus.DrivebusError | None = None

    def take(self, sample: drivebus.Sample) -> None:
        """One sample."""
        self.count += 1
        if sample.missing is not None:
            self.missing += 1
            self.last = sample.missing

    def told(self, polls: Sequence[drivebus.Poll[Any]], interval: float, lossless: bool) -> Iterator[str]:
        """What is to be said of *polls* when they are over; if *lossless*, also what was left out."""
        if self.missing:
            yield f"{self.missing} of {self.count} samples {'is' if self.missing == 1 else 'are'} missing."
        late, dropped = sum(poll.late for poll in polls), sum(poll.dropped for poll in polls)
        # What waits for an answer that does not come is late too, and no interval helps against that.
        if late and not self.missing:
            yield f"{late} times the line was not free in time for the next sample: {interval:g} s is too short."
        if dropped and lossless:
            yield f"{dropped} samples came faster than they were taken, and are left out."


COMMANDS = [monitor]
