"""Runs every row against every library and every gateway, and writes the page.

python -m tests.conformance.run --out docs/developers/conformance.md
python -m tests.conformance.run --out docs/developers/conformance.md --section gateways
python -m tests.conformance.run --only overtaken
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

from . import faults, libraries
from .child import Child, Missing
from .gateways import measure as gateways
from .gateways.crowd import SECONDS
from .gateways.report import replaced, section
from .play import play
from .report import Column, cell, counts, page, recovered
from .rows import ROWS


def columns() -> list[Column]:
    """Makes drivebus twice, then the others, each with its version or the reason why it is not here."""
    made = []
    for library in libraries.NAMES:
        if library == "drivebus":
            made += [Column("drivebus", library), Column("drivebus, 08H silent", library, mute=True)]
        else:
            made.append(Column(library, library))
    for column in made:
        try:
            with Child(column.library) as child:
                column.about = child.about
        except Missing as reason:
            column.missing = str(reason)
        else:
            if not column.mute:
                column.title = column.about["distribution"]
    return made


class Told:
    """What is printed of each result, and which of drivebus's own must be looked at."""

    def __init__(self) -> None:
        self.wrong: list[str] = []

    def say(self, title: str, what: str, text: str, looked_at: bool) -> None:
        mark = "  <-- must end otherwise" if looked_at else ""
        print(f"{time.strftime('%H:%M:%S')} {what:30} {title:22} {text}{mark}", flush=True)
        if looked_at:
            self.wrong.append(f"{what}, {title}")

    def library(self, column: Column, what: str, text: str, bad: bool) -> None:
        self.say(column.title, what, text, bad and column.library == "drivebus")

    def gateway(self, column: gateways.Column, what: str, text: str, bad: bool) -> None:
        self.say(column.title, what, text, bad and gateways.is_ours(column))


def of_libraries(beginnings: tuple[str, ...], say: Callable[[Column, str, str, bool], None]) -> list[Column]:
    """Every row, fault and speed whose name begins so, with every library."""
    rows = [row for row in ROWS if row.key.startswith(beginnings)]
    kinds = [kind for kind in faults.KINDS if kind.startswith(beginnings)]
    speeds = [baud for baud in faults.SPEEDS if str(baud).startswith(beginnings)]
    if not (rows or kinds or speeds):
        return []
    all_columns = columns()
    here = [column for column in all_columns if column.about]
    for row in rows:
        for column in here:
            result = column.results[row.key] = play(row, column.library, mute=column.mute)
            text = f"{cell(result.verdict)}; recovered: {recovered(result.recovery)}"
            say(column, row.key, text, not result.verdict.keeps(row.must) or result.recovery.wrong > 0)
    for kind in kinds:
        for column in (each for each in here if not each.mute):
            tally = column.tallies[kind] = faults.spoilt(column.library, kind)
            say(column, kind, f"{counts(tally)}; {tally.hits} hits", tally.ends["wrong"] + tally.ends["hung"] > 0)
    for baud in speeds:
        for column in (each for each in here if not each.mute):
            pace = column.paces[baud] = faults.idle(column.library, baud)
            say(column, str(baud), str(pace), pace.idle is None or pace.too_early > 0)
    return all_columns


def main() -> int:
    """0 when drivebus ended every row as it must."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, help="the page to write")
    what.add_argument("--only", nargs="+", help="rows and faults whose name begins so; they are printed, not written")
    parser.add_argument("--section", choices=[gateways.NAME], help="of the page, measure and write this section alone")
    crowd = parser.add_mutually_exclusive_group()
    crowd.add_argument("--seconds", type=float, default=SECONDS, help="how long a crowd asks drivebus")
    crowd.add_argument("--hour", action="store_const", const=3600.0, dest="seconds")
    given = parser.parse_args()
    beginnings = tuple(given.only or [""])
    told = Told()
    libraries_ = [] if given.section else of_libraries(beginnings, told.library)
    gateways_ = gateways.run(told.gateway, beginnings, given.seconds)
    if given.out:
        before = given.out.read_text(encoding="utf-8") if given.section else page(libraries_)
        given.out.write_text(replaced(before, section(gateways_)), encoding="utf-8")
        print(f"wrote {given.out}")
    print(f"drivebus, to be looked at: {', '.join(told.wrong) or 'nothing'}")
    return 1 if told.wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
