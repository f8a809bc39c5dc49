"""docs/developers/halts.md has what the profiles say: which halts and resets do harm to which other families.

`python -m tests.python.test_halts_page` writes the table anew. Whether it is true, the simulated drives say
(`test_halts_of_other_families`); here it is only kept.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from drivebus import Profile, profiles, tables
from drivebus.profile.family import family_of

PAGE = Path(__file__).resolve().parents[2] / "docs/developers/halts.md"
BEGIN, END = "<!-- table: kept by tests/python/test_halts_page.py -->\n", "<!-- end of the table -->"
COMMANDS = {"stop": "stop", "coast": "coast", "jog_stop": "end of a jog", "reset_fault": "reset"}


def table() -> str:
    """A line for each word at each address: who means it as what, and whom it does harm to."""
    rows: dict[tuple[int, int], tuple[dict[str, list[str]], set[str]]] = defaultdict(lambda: (defaultdict(list), set()))
    for name in profiles():
        profile = Profile.builtin(name)
        for command, called in COMMANDS.items():
            if command in profile.commands():
                means, harms = rows[profile.command(command)]
                means[called].append(name)
                harms.update(family_of(profile).harmed(command))
    lines = ["| word | is | starts, reverses or sets something in |", "| --- | --- | --- |"]
    for (place, word), (means, harms) in sorted(rows.items()):
        kind, address = tables.split(place)
        where = f"{address:04X}H = {word:04X}H" if kind == "holding" else f"{kind} {address:04X}H = {word}"
        meant = "; ".join(f"{called}: {', '.join(sorted(names))}" for called, names in means.items())
        lines.append(f"| {where} | {meant} | {', '.join(sorted(harms)) or 'none'} |")
    return "\n".join(lines) + "\n"


def test_the_page_has_what_the_profiles_say() -> None:
    kept = PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0]
    assert kept == table(), "python -m tests.python.test_halts_page"


def test_the_table_knows_what_manuals_print() -> None:
    """5 runs an EDS300 (its manual, p. 46); 6 is no halt of an MS300, whose stop is 1 (CP2000 manual, p. 514)."""
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ") for line in table().splitlines()}
    assert "eds300" in rows["2000H = 0005H"][2]
    assert "ms300" in rows["2000H = 0006H"][2]
    assert "gd350" in rows["2000H = 0001H"][2]
    assert "eds300" not in rows["2000H = 0006H"][2]


if __name__ == "__main__":
    head, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(head + BEGIN + table() + END + rest.split(END)[1], encoding="utf-8")
