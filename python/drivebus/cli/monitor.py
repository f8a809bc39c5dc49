"""`drivebus monitor`: registers as they change, asked by `Bus.poll` at a rate that does not drift."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from datetime import datetime, timezone
from typing import Any

import click
from rich.console import Group
from rich.live import Live
from rich.text import Text

import drivebus
from drivebus.cli import names
from drivebus.cli.output import Output, printable, remark
from drivebus.cli.session import Session, exit_code, pass_session
from drivebus.cli.types import Seconds, Whole

__all__ = ["COMMANDS"]

_KEPT = 10_000
"""Samples that wait where they are taken more slowly than they come. A person who watches wants the newest only."""


@click.command()
@click.argument("wanted", metavar="[NAME]...", nargs=-1, shell_complete=names.complete_name)
@click.option(
    "--interval",
    type=Seconds(0),
    default=0.5,
    show_default=True,
    help="Seconds from one sample to the next; 0: as fast as the line.",
)
@click.option("--count", type=Whole(1), help="Samples to take; without it, until Ctrl-C.")
@pass_session
def monitor(session: Session, wanted: tuple[str, ...], interval: float, count: int | None) -> None:
    """Watch registers as they change: all monitor registers, or those named.

    A sample that does not come is shown as missing, and the next one is asked for. Where none comes at all, the exit
    code says why.
    """
    out = session.out
    interrupted = False
    with session.bus() as bus:
        drive = session.drive_on(bus)
        known = [names.named(drive.profile, text) for text in wanted] or drive.readable()
        if not known:
            raise drivebus.NotAllowed(
                f"nothing that is known of {drive.profile.title} may be watched without --unverified; name what you "
                "want to see"
            )
        seen = _Seen(out, {name: drive.describe(name) for name in known})
        with bus.poll({drive: known}, interval or None, size=1 if out.live else _KEPT) as poll:
            try:
                with seen.live or nullcontext():
                    for sample in poll:
                        seen.show(sample)
                        if seen.count == count:
                            break
            except KeyboardInterrupt:
                interrupted = True
    for text in seen.told(poll, interval):
        remark(text)
    if seen.last is not None and seen.missing == seen.count:
        session.advise(seen.last)
        raise click.exceptions.Exit(exit_code(seen.last))
    # Without --count it is how this ends.
    if interrupted and count is not None:
        raise click.exceptions.Exit(130)


class _Seen:
    """What was shown so far.

    Attributes:
        live: The table on a terminal; None where nobody watches.
        count: Samples, those that are missing included.
        missing: How many of them are.
        last: Why the last of these is.
    """

    def __init__(self, out: Output, known: dict[str, drivebus.Description]) -> None:
        self._out = out
        self._known = known
        self._doubtful = {name: row.evidence for name, row in known.items() if row.evidence != "verified"}
        self.live = Live(console=out.console, auto_refresh=False) if out.live else None
        self.count = 0
        self.missing = 0
        self.last: drivebus.DrivebusError | None = None

    def show(self, sample: drivebus.Sample) -> None:
        """One sample; what is not verified is marked."""
        self.count += 1
        if sample.missing is not None:
            self.missing += 1
            self.last = sample.missing
        if self.live is not None:
            self.live.update(self._table(sample), refresh=True)
        elif self._out.as_json:
            self._out.record(self._record(sample))
        else:
            moment = datetime.fromtimestamp(sample.time, timezone.utc).isoformat(timespec="milliseconds")
            self._out.say(f"{moment} {self._line(sample)}")

    def told(self, poll: drivebus.Poll, interval: float) -> Iterator[str]:
        """What is to be said of *poll* when it is over."""
        if self.missing:
            yield f"{self.missing} of {self.count} samples {'is' if self.missing == 1 else 'are'} missing."
        # What waits for an answer that does not come is late too, and no interval helps against that.
        if poll.late and not self.missing:
            yield f"{poll.late} times the line was not free in time for the next sample: {interval:g} s is too short."
        if poll.dropped and self.live is None:
            yield f"{poll.dropped} samples came faster than they were taken, and are left out."

    def _table(self, sample: drivebus.Sample) -> Group:
        came = {name: None if sample.missing else row.text(sample[name]) for name, row in self._known.items()}
        rows = [[name, came[name], row.unit, self._doubtful.get(name)] for name, row in self._known.items()]
        table = self._out.table(["register", "value", "unit", ""], rows)
        return Group(table, Text("" if sample.missing is None else printable(f"missing: {sample.missing}")))

    def _record(self, sample: drivebus.Sample) -> dict[str, Any]:
        if sample.missing is not None:
            return {"time": sample.time, "missing": str(sample.missing), "exit_code": exit_code(sample.missing)}
        values = {str(name): value for name, value in sample.items()}
        return {"time": sample.time, **values, **({"evidence": self._doubtful} if self._doubtful else {})}

    def _line(self, sample: drivebus.Sample) -> str:
        if sample.missing is not None:
            return f"missing: {sample.missing}"
        return " ".join(
            f"{name}={row.text(sample[name])}{row.unit}{f' [{self._doubtful[name]}]' if name in self._doubtful else ''}"
            for name, row in self._known.items()
        )


COMMANDS = [monitor]
