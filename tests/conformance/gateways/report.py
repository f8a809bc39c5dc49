"""What was measured of gateways, as a section of the page, which can be put in the place of the one that is there."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence

from .. import faults, verdict
from ..report import machine, table
from .crowd import FAMILIES, LINES, Crowd, crowd
from .measure import Column
from .programs import TIMEOUT
from .rows import APART, PATIENCE, PAUSE, ROWS, ends
from .strict import Tally

HEADING = "## Gateways: Modbus TCP before a line"
NOT_HERE = "not to be had"


def section(columns: Sequence[Column]) -> str:
    """The whole section."""
    titles = [column.title for column in columns]
    rows = [[row.name, row.must, *(_cell(column, row.key) for column in columns)] for row in ROWS]
    spoilt = [[f"`{kind}`", *(_cell(column, kind) for column in columns)] for kind in faults.KINDS]
    told: dict[str, Callable[[Crowd], str]] = {
        **{f"{make}, {count}": _ends_of(make) for make, count in crowd().items()},
        "all": lambda found: ends(Tally(found.total)),
        "for": lambda found: f"{found.seconds:.0f} s",
    }
    crowds = [
        [line, name, *(_crowd(column, line, each) for column in columns)]
        for line in LINES
        for name, each in told.items()
    ]
    today = datetime.datetime.now(tz=datetime.timezone.utc).date()
    parts = [
        HEADING,
        INTRODUCTION.format(date=today, machine=machine(), timeout=TIMEOUT * 1e3),
        table(["gateway", "version", "how it is used"], [_about(column) for column in columns]),
        LATE.format(patience=PATIENCE * 1e3, apart=APART * 1e3, pause=PAUSE * 1e3),
        table(["what happens", "true end", *titles], rows),
        FAULTS.format(reads=faults.READS, all=faults.READS_OF_ALL, streak=faults.GIVEN_UP, patience=verdict.PATIENCE),
        table(["fault, 2 %", *titles], spoilt),
        CROWD.format(families=", ".join(FAMILIES.values())),
        table(["what disturbs the line", "clients", *titles], crowds),
    ]
    return "\n\n".join(parts) + "\n"


def replaced(page: str, section: str) -> str:
    """*page* with *section* in the place of the one that has its heading; at its end where there is none."""
    heading = section.partition("\n")[0]
    before, found, rest = page.partition(f"{heading}\n")
    if not found:
        return f"{page.rstrip()}\n\n{section}"
    _, next_heading, after = rest.partition("\n## ")
    return f"{before}{section}{next_heading}{after}"


def _about(column: Column) -> list[str]:
    return [column.title, column.version or NOT_HERE, column.missing or column.gateway.settings]


def _cell(column: Column, key: str) -> str:
    return NOT_HERE if column.missing else column.cells.get(key, "-")


def _crowd(column: Column, line: str, told: Callable[[Crowd], str]) -> str:
    if column.missing or line not in column.crowds:
        return NOT_HERE if column.missing else "-"
    return told(column.crowds[line])


def _ends_of(make: str) -> Callable[[Crowd], str]:
    return lambda found: ends(Tally(found.ends[make]))


INTRODUCTION = """\
Programs that let clients of Modbus TCP use a serial line, one after the other before the same line.
`make conformance SECTION=gateways` measures and writes this section alone, `make conformance ONLY=gateways` prints it,
`ONLY=gateways-stalled` one row of it.

Measured {date} on {machine}.

The unit is the slave of [One exchange, or a few](#one-exchange-or-a-few), 19200 bit/s, 8N1. Each gateway waits for
{timeout:.0f} ms for an answer of the line, as drivebus does; everything else is its default. drivebus answers as
docs/reference/service.md says. mbusd is not among them: Debian does not have it."""

LATE = """\
The clients are plain sockets that share no code with any gateway, and know what each register holds. They ask again and
again on one connection, each time another register. Where a client's time-out is over, it goes on with its next
transaction; it is {patience:.0f} ms with two clients, 10 s elsewhere.

- **right**: the answer names the transaction, the unit and the function, and has the values of that question.
- **wrong**: it names the transaction of another question, or has other values or another count; or it is a second
  answer to one transaction, whatever it says.
- **error**: an exception, or the gateway hung up.
- **none**: no answer in time. One that comes later counts as nothing, unless it is wrong.

Cells are right / wrong / error / none, or what became of the writes, by the unit's own log. A late answer comes
{apart:.0f} ms before the answer to what is asked then. In the rows about a silent unit {pause:.0f} ms pass between two
turns, so that each stands alone; in the first row two clients ask without a pause, and what is late for one gateway
once may shift all that follows."""

FAULTS = """\
The faults of [the simulator](#the-simulators-faults), through each gateway: {reads} reads of two registers by one
client in each row, {all} in the last, at 115200 bit/s. A `late` answer comes 625 to 1250 ms after it was due, an
`overtaken` one 550 to 2000 ms; modbus-relay waits for 1500 ms. Cells are right / wrong / error / hung, which is no
answer in 5 s. "Stopped": {streak} reads in a row and {patience:.0f} s long none was right, or one hung, and no more
were asked; where the last read failed, others follow that are not counted, until one is right."""

CROWD = """\
Twenty clients at once before four simulated drives ({families}) at 115200 bit/s, for as long as the rows "for" say:
clients as above, and others that people use, each with a time-out of 5 s. They read two registers at a time, from all
units in a random order; no two questions have the same answer. libmodbus and mbpoll come from one address, the others
from an address each. Cells are right / wrong / error / none."""
