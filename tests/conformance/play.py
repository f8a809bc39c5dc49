"""One row against one library: a port, a slave and a process of its own."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from .child import BOUND, Child
from .rows import Row
from .slave import Slave
from .verdict import ERROR, Recovery, Verdict, recovery


@dataclass(frozen=True)
class Result:
    """How the row ended, and what it took to come back."""

    verdict: Verdict
    recovery: Recovery


def play(row: Row, library: str, *, mute: bool = False, timeout: float = 0.2, bound: float = BOUND) -> Result:
    """Runs one row. `mute`: the unit does not answer 08H. `bound`: what a call may take."""
    with (
        tempfile.TemporaryDirectory() as folder,
        Slave(Path(folder), row.behaviour, mute=mute, echo=row.echo) as slave,
        Child(library, bound) as child,
    ):
        opened = child.open(slave.port, timeout=timeout, retries=row.retries)
        if not opened.returned:
            return Result(Verdict(ERROR, f"open: {opened.error}", opened.seconds), Recovery(None))
        if row.fresh:
            slave.hold_stale(100)
        else:
            child.read(1)
        verdict = row.play(slave, child)
        return Result(verdict, recovery(child))
