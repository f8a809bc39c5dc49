"""What was measured, as a page of Markdown."""

from __future__ import annotations

import datetime
import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from . import faults
from .faults import Pace, Tally
from .play import Result
from .rows import ROWS, Row
from .verdict import ERROR, HUNG, PATIENCE, RIGHT, WRONG, Recovery, Verdict


@dataclass
class Column:
    """One library, or drivebus against a unit of the other kind."""

    title: str
    library: str
    mute: bool = False
    about: Mapping[str, str] = field(default_factory=dict)
    missing: str = ""
    results: dict[str, Result] = field(default_factory=dict)  # by the row's key
    tallies: dict[str, Tally] = field(default_factory=dict)  # by the kind of fault
    paces: dict[int, Pace] = field(default_factory=dict)  # by baud


def milliseconds(seconds: float) -> str:
    value = seconds * 1e3
    return f"{value:.1f} ms" if value < 10 else f"{value:.0f} ms" if value < 10_000 else f"{seconds:.0f} s"


def cell(verdict: Verdict) -> str:
    if verdict.kind == HUNG:
        return f"{HUNG}: no return in {verdict.seconds:.0f} s"
    detail = f": {verdict.detail}" if verdict.detail else ""
    return f"{verdict.kind}{detail}, {milliseconds(verdict.seconds)}"


def recovered(recovery: Recovery) -> str:
    before = [f"{count} {kind}" for count, kind in ((recovery.wrong, WRONG), (recovery.errors, ERROR)) if count]
    if recovery.seconds is None:
        return f"not within {PATIENCE:.0f} s" + (f" ({', '.join(before)})" if before else "")
    return milliseconds(recovery.seconds) + (f", after {', '.join(before)}" if before else "")


def counts(tally: Tally) -> str:
    text = " / ".join(str(tally.ends[kind]) for kind in (RIGHT, WRONG, ERROR, HUNG))
    return text if tally.recovered else f"{text}, stopped"


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rule = ["---"] * len(head)
    return "\n".join("| " + " | ".join(each) + " |" for each in (head, rule, *lines))


def machine() -> str:
    """What it ran on, in one line."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if "model name" in line]
    name = models[0] if models else platform.machine()
    system = f"{platform.system()} {platform.release()}, CPython {platform.python_version()}"
    return f"{name}, {os.cpu_count()} cores, {system}, load average {os.getloadavg()[2]:.1f} (15 minutes)"


def versions(columns: Sequence[Column]) -> str:
    lines = []
    for column in columns:
        if not column.mute:
            about = column.about
            lines.append(
                [about["distribution"], about["version"], about["settings"]]
                if about
                else [column.library, "not run", f"could not be imported: {column.missing}"]
            )
    return table(["library", "version", "how it is used"], lines)


def page(columns: Sequence[Column]) -> str:
    """The whole page."""
    here = [column for column in columns if column.about]
    titles = [column.title for column in here]
    single = [[row.name, true_end(row), *(cell(column.results[row.key].verdict) for column in here)] for row in ROWS]
    back = [[row.name, *(recovered(column.results[row.key].recovery) for column in here)] for row in ROWS]
    on_line = [column for column in here if not column.mute]
    kinds = [kind for kind in faults.KINDS if all(kind in column.tallies for column in on_line)]
    spoilt = [[f"`{kind}`", *(counts(column.tallies[kind]) for column in on_line)] for kind in kinds]
    slow = [
        [
            f"`{kind}`",
            *(
                ("never" if not tally.recovered else milliseconds(tally.slowest) if tally.slowest else "-")
                for tally in (column.tallies[kind] for column in on_line)
            ),
        ]
        for kind in kinds
    ]
    paces = [[f"{baud} bit/s", *(pace(column.paces[baud]) for column in on_line)] for baud in faults.SPEEDS]
    names = [column.title for column in on_line]
    return (
        "\n\n".join(
            [
                INTRODUCTION.format(date=datetime.datetime.now(tz=datetime.timezone.utc).date(), machine=machine()),
                versions(columns),
                SINGLE,
                table(["what happens", "true end", *titles], single),
                table(["rows that ended", *titles], totals(here)),
                OPTIONS,
                "## Time to recover",
                BACK,
                table(["after", *titles], back),
                FAULTS.format(
                    reads=faults.READS,
                    all=faults.READS_OF_ALL,
                    seed=faults.SEED,
                    streak=faults.GIVEN_UP,
                    patience=PATIENCE,
                ),
                table(["fault, 2 %", *names], spoilt),
                SLOWEST,
                table(["fault, 2 %", *names], slow),
                errors_seen(on_line, kinds),
                PACE.format(words=faults.WORDS, times=faults.TIMES),
                table(["speed", *names], paces),
            ]
        )
        + "\n"
    )


def true_end(row: Row) -> str:
    """Whether there is a right answer, or only an error tells the truth."""
    return RIGHT if row.must == RIGHT else ERROR


def totals(columns: Sequence[Column]) -> list[list[str]]:
    """How many rows ended how."""
    ends = [Counter(result.verdict.kind for result in column.results.values()) for column in columns]
    return [[kind, *(str(end[kind]) for end in ends)] for kind in (RIGHT, ERROR, WRONG, HUNG)]


def pace(pace: Pace) -> str:
    if pace.idle is None:
        return f"error: {pace.error}"
    early = f", {pace.too_early} too early" if pace.too_early else ""
    return f"{milliseconds(pace.idle)}{early}"


def errors_seen(columns: Sequence[Column], kinds: Sequence[str]) -> str:
    """Which errors the libraries raised in the rows about faults."""
    lines = []
    for column in columns:
        names = sorted({name for kind in kinds for name in column.tallies[kind].errors})
        lines.append(f"- {column.title}: {', '.join(names) if names else 'none'}")
    return "Errors that came up in these rows:\n\n" + "\n".join(lines)


INTRODUCTION = """\
# Conformance on a hostile line

drivebus and other Modbus RTU masters for Python on the same lines. `make conformance` runs everything and writes this
page; `make conformance CONFORMANCE_PYTHON=python3.13` names an interpreter (tmodbus needs Python 3.12 or newer).

Measured {date} on {machine}.

A Linux pseudo-terminal at 19200 bit/s, 8N1; no real RS-485, so only what the libraries do is measured. Time-out 200 ms
for all; retries off, except in the rows that say otherwise; everything else is the library's default."""

SINGLE = """\
## One exchange, or a few

The unit is a small slave in plain Python (`tests/conformance`) that shares no code with any of the libraries. Its
register *a* holds *a*, and it keeps a log of every write. Each library runs in a process of its own. A late reply is
one that the slave holds back until the next request is in, or, where others pass it, until register 200 is read. Before
each row one register is read, except at first contact.

- **right**: the values asked for came back; a write was carried out once, and the call said so.
- **wrong**: the call returned something else without an error: values of another question, fewer values than asked
  for, a write confirmed that was not carried out or was carried out twice, an address or value that was not written.
- **error**: the call raised what is named, or returned an object that says it is an error.
- **hung**: the call did not return in 5 s.

"True end" is the result that a caller should get. In some rows there is no right answer, and an error is the true end.
The times are those of the judged call. Two columns are drivebus: with a unit that answers the loop-back 08H, and with
one that is silent on it."""

OPTIONS = """\
pymodbus, minimalmodbus and modbus-tk have an option for adapters that echo what they send (`handle_local_echo`); that
is off by default. pymodbus needs to be told that a broadcast has no answer. tmodbus is measured from a thread beside
its event loop; uModbus leaves locking to its caller."""

BACK = """\
From the end of the judged call (or from the return of the port) until the first right read of a register that was not
asked for before: at least ten reads over at least 3 s, the first ten without a pause."""

FAULTS = """\
## The simulator's faults

A simulated GD350 at 115200 bit/s, 8N1; 2 % of answers are hit by the fault named, in the row `all` by each of them
but `unplug`. Seed {seed}. {reads} reads of two registers in each row, {all} in the last; defaults of each library,
retries included. docs/reference/simulator.md says what each fault does; a `late` answer comes 250 to
500 ms after it was due, an `overtaken` one 220 to 800 ms, the port is unplugged before every 50th read, for 250 ms.

Cells are right / wrong / error / hung. While the port is away errors come as fast as a library raises them.
"Stopped": {streak} reads in a row and {patience:.0f} s long none was right, or one hung, and no more were asked; where
the last read failed, others follow that are not counted, until one is right."""

SLOWEST = "The longest time from the end of a read that was not right to the end of the next right one (a dash: none):"

PACE = """\
## Time between frames

The idle time a library leaves between the last bit of an answer and the first bit of its next request, median of
{times} reads of {words} registers in a loop, on the simulated line. The protocol asks for 3.5 characters: 3.6 ms at
9600 bit/s, 1.8 ms at 19200 (10 bits a character), 1.75 ms above. "Too early" counts requests that came before that
was over."""
