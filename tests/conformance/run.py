"""Runs every row against every library and writes the page.

python -m tests.conformance.run --out docs/developers/conformance.md
python -m tests.conformance.run --only overtaken
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from . import faults, libraries
from .child import Child, Missing
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


def main() -> int:
    """0 when drivebus ended every row as it must."""
    parser = argparse.ArgumentParser(description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, help="the page to write")
    what.add_argument("--only", nargs="+", help="rows and faults whose name begins so; they are printed, not written")
    given = parser.parse_args()
    beginnings = tuple(given.only or [""])
    all_columns = columns()
    here = [column for column in all_columns if column.about]
    wrong = []

    def say(column: Column, what: str, text: str, bad: bool) -> None:
        mark = "  <-- must end otherwise" if bad and column.library == "drivebus" else ""
        print(f"{time.strftime('%H:%M:%S')} {what:30} {column.title:22} {text}{mark}", flush=True)
        if mark:
            wrong.append(f"{what}, {column.title}")

    for row in (each for each in ROWS if each.key.startswith(beginnings)):
        for column in here:
            result = column.results[row.key] = play(row, column.library, mute=column.mute)
            text = f"{cell(result.verdict)}; recovered: {recovered(result.recovery)}"
            say(column, row.key, text, not result.verdict.keeps(row.must) or result.recovery.wrong > 0)
    for kind in (each for each in faults.KINDS if each.startswith(beginnings)):
        for column in (each for each in here if not each.mute):
            tally = column.tallies[kind] = faults.spoilt(column.library, kind)
            say(column, kind, f"{counts(tally)}; {tally.hits} hits", tally.ends["wrong"] + tally.ends["hung"] > 0)
    for baud in (each for each in faults.SPEEDS if str(each).startswith(beginnings)):
        for column in (each for each in here if not each.mute):
            pace = column.paces[baud] = faults.idle(column.library, baud)
            say(column, str(baud), str(pace), pace.idle is None or pace.too_early > 0)
    if given.out:
        given.out.write_text(page(all_columns), encoding="utf-8")
        print(f"wrote {given.out}")
    print(f"drivebus, to be looked at: {', '.join(wrong) or 'nothing'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
