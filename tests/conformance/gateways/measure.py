"""Runs every row with every gateway. Rows are named `gateways-KEY`, where a KEY is a row's, a fault's, or `crowd`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from .. import faults
from ..child import BOUND
from ..report import counts
from ..verdict import HUNG, WRONG
from . import crowd
from .programs import GATEWAYS, OURS, TIMEOUT, DidNotStart, Gateway, NotToBeHad
from .rows import ROWS, Cell, ends, played
from .strict import Client, Tally, as_library

NAME = "gateways"
CROWD = "crowd"


@dataclass
class Column:
    """One gateway: its version, or why it is not here, and what came of each row."""

    gateway: Gateway
    version: str = ""
    missing: str = ""
    cells: dict[str, str] = field(default_factory=dict)  # by the row's key, or the kind of fault
    crowds: dict[str, crowd.Crowd] = field(default_factory=dict)  # by what disturbs the line

    @property
    def title(self) -> str:
        return self.gateway.title


Say = Callable[[Column, str, str, bool], None]
"""Told of each result: whose, of which row, what it is, and whether it must not be so."""


def columns() -> list[Column]:
    made = []
    for gateway in GATEWAYS:
        column = Column(gateway)
        try:
            column.version = gateway.version()
        except NotToBeHad as reason:
            column.missing = str(reason)
        made.append(column)
    return made


def names() -> list[str]:
    """What can be asked for."""
    return [f"{NAME}-{key}" for key in (*(row.key for row in ROWS), *faults.KINDS, CROWD)]


def run(say: Say, beginnings: Sequence[str] = ("",), seconds: float = crowd.SECONDS) -> list[Column]:
    """The rows whose names begin so, with every gateway that is here. *seconds* is how long a crowd asks drivebus."""
    made = columns()
    here = [column for column in made if not column.missing]
    chosen = [name for name in names() if name.startswith(tuple(beginnings))]
    for row in ROWS:
        if f"{NAME}-{row.key}" in chosen:
            for column in here:
                _cell(column, row.key, say, partial(played, row))
    for kind in faults.KINDS:
        if f"{NAME}-{kind}" in chosen:
            for column in here:
                _cell(column, kind, say, partial(spoilt, kind))
    if f"{NAME}-{CROWD}" in chosen:
        for line in crowd.LINES:
            for column in here:
                _crowd(column, line, say, seconds)
    return made


def _crowd(column: Column, line: str, say: Say, seconds: float) -> None:
    what = f"{NAME}-{CROWD}: {line}"
    try:
        found = crowd.run(column.gateway, line, seconds if is_ours(column) else min(seconds, crowd.SECONDS))
    except (DidNotStart, OSError) as reason:
        say(column, what, f"did not serve: {reason}", True)
        return
    column.crowds[line] = found
    say(column, what, f"{ends(Tally(found.total))}, {found.seconds:.0f} s", found.total[WRONG] > 0)


def _cell(column: Column, key: str, say: Say, play: Callable[[Gateway], Cell]) -> None:
    try:
        cell = play(column.gateway)
    except (DidNotStart, OSError) as reason:
        cell = Cell(f"did not serve: {reason}", wrong=1)
    column.cells[key] = cell.text
    told = f"; {dict(cell.tally.details)}" if cell.tally and cell.tally.details else ""
    say(column, f"{NAME}-{key}", cell.text + told, cell.wrong > 0)


def spoilt(kind: str, gateway: Gateway, reads: int | None = None) -> Cell:
    """Reads through a gateway from a line with one kind of the simulator's faults, or all of them."""
    with (
        faults.line(faults.BAUD) as (simulator, port),
        gateway.before(port, faults.BAUD) as address,
        Client(address, BOUND) as client,
    ):
        tally = faults.spoilt_reads(simulator, as_library(client), kind, reads, TIMEOUT)
    return Cell(counts(tally), tally.ends[WRONG] + tally.ends[HUNG])


def is_ours(column: Column) -> bool:
    return column.gateway is OURS
