"""What is told of the families: the counts are those of the CSV files, and the pages have what the profiles say.

The oracle reads the files plainly, and applies what docs/profiles.md says of what a sister family takes over. It shares
no code with the package. `python -m tests.python.test_families_page` writes the table of docs/families.md anew.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from tools.family_pages import family_page

import drivebus
from drivebus.cli import cli

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent.parent
PROFILES = ROOT / "crates/drives/profiles"
FAMILIES = sorted(path.name for path in PROFILES.iterdir() if path.is_dir())
KINDS = ("registers", "parameters", "faults")
PAGE = ROOT / "docs/families.md"
BEGIN, END = "<!-- table: kept by tests/python/test_families_page.py -->\n", "<!-- end of the table -->"

Row = dict[str, str]


def names_of(row: Row) -> set[str]:
    return {row[column] for column in ("name", "code") if row.get(column)}


def rows_of(family: str) -> dict[str, list[Row]]:
    """The rows of each table as a family has them, its sister's among them."""
    manifest: dict[str, Any] = tomllib.loads((PROFILES / family / "profile.toml").read_text(encoding="utf-8"))
    own: dict[str, list[Row]] = {}
    for kind in KINDS:
        path = PROFILES / family / f"{kind}.csv"
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        own[kind] = list(csv.DictReader(io.StringIO(text)))
    extends = manifest.get("extends")
    if extends is None:
        return own
    gone, confirmed = set(manifest.get("drop", [])), set(extends.get("confirmed", []))
    addresses = {address_of(row) for kind in KINDS[:2] for row in own[kind]} - {None}
    stated = set().union(*(names_of(row) for kind in KINDS[:2] for row in own[kind]))
    numbers = {row["code"] for row in own["faults"]}
    for kind, rows in rows_of(extends["profile"]).items():
        for row in rows:
            sure = "faults" in confirmed if kind == "faults" else bool(names_of(row) & confirmed)
            if kind == "faults":
                replaced = row["code"] in numbers or "faults" in gone
            else:
                replaced = bool(names_of(row) & (gone | stated)) or address_of(row) in addresses
            if not replaced:
                doubtful = row["verified"] == "yes" and not sure
                own[kind].append({**row, "verified": "no" if doubtful else row["verified"]})
    return own


def address_of(row: Row) -> int | None:
    code = re.fullmatch(r"[Pr](\d+)\.(\d+)", row.get("code", ""))
    if code:
        return int(code[1]) << 8 | int(code[2])
    return int(row["address"].rstrip("Hh"), 16) if row.get("address") else None


def counted(rows: list[Row]) -> dict[str, int]:
    sourced = sum(bool(row["source"].strip()) for row in rows)
    return {
        "total": len(rows),
        "sourced": sourced,
        "unsourced": len(rows) - sourced,
        "unverified": sum(row["verified"] == "no" for row in rows),
        "assumed": sum(row["verified"] == "assumed" for row in rows),
    }


def shown(family: str) -> dict[str, dict[str, int]]:
    result = CliRunner().invoke(cli, ["--json", "profiles", "show", family])
    assert result.exit_code == 0, result.output
    counts: dict[str, dict[str, int]] = json.loads(result.stdout)["counts"]
    return counts


def test_every_folder_is_shipped() -> None:
    assert sorted(drivebus.profiles()) == FAMILIES


@pytest.mark.parametrize("family", FAMILIES)
def test_counts_are_those_of_the_files(family: str) -> None:
    oracle = {kind: counted(rows) for kind, rows in rows_of(family).items()}
    assert shown(family) == oracle
    # For people, the same numbers.
    text = CliRunner().invoke(cli, ["profiles", "show", family]).stdout
    for kind in KINDS:
        numbers = re.search(rf"^{kind} +(\d+) +(\d+) +(\d+) +(\d+) +(\d+)$", text, re.MULTILINE)
        assert numbers is not None, text
        assert [int(number) for number in numbers.groups()] == list(oracle[kind].values())


def test_the_list_says_how_much_of_each_is_printed() -> None:
    """Verified is what is neither unverified nor assumed, of all rows."""
    said = CliRunner().invoke(cli, ["--json", "profiles"])
    listed = {row["name"]: row for row in map(json.loads, said.stdout.splitlines())}
    text = CliRunner().invoke(cli, ["profiles"]).stdout
    assert sorted(listed) == FAMILIES
    for family in FAMILIES:
        oracle = {kind: counted(rows) for kind, rows in rows_of(family).items()}
        assert {kind: listed[family][kind] for kind in KINDS} == {kind: oracle[kind]["total"] for kind in KINDS}
        total = sum(counts["total"] for counts in oracle.values())
        doubtful = {how: sum(counts[how] for counts in oracle.values()) for how in ("unverified", "assumed")}
        assert {how: listed[family][how] for how in doubtful} == doubtful
        proved = total - sum(doubtful.values())
        share = listed[family]["verified"]
        assert share == (pytest.approx(proved / total, abs=0.0005) if total else None), family
        line = re.search(rf"^{family} .*?(\d+)(?: +(\d+) %)?$", text, re.MULTILINE)
        assert line is not None, text
        percents = {100 * proved // total, -(-100 * proved // total)} if total else {None}
        assert int(line[1]) == total
        assert (None if line[2] is None else int(line[2])) in percents


DOCUMENTS = re.compile(
    r"(?:manualshive|manualslib|manualsdir|manualsdump|azmanual|manualarchiveguide|INVT ebook|issue) (\d+)"
    r"|easymanua\.ls (?:(?:abb|danfoss|siemens) )?([a-z0-9-]+)"
    r"|((?:AAV|BBV|EAV|NVE)\d+)"
)


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_written_names_the_documents_of_each_family(family: str) -> None:
    """Each document that the head of a profile names stands in its about.md, by what it is found by."""
    manifest = tomllib.loads((PROFILES / family / "profile.toml").read_text(encoding="utf-8"))
    written = (PROFILES / family / "about.md").read_text(encoding="utf-8")
    documents = {number or name or order for number, name, order in DOCUMENTS.findall(manifest["source"])}
    assert documents
    # One that the GD350 manual lends is named there.
    missing = {document for document in documents if document not in written} - {"2645"}
    assert missing == set()


def says_what_it_is(family: str) -> str:
    """What a simulated drive of the family is taken for by what it answers."""
    if drivebus.Profile.builtin(family).requests().protocol != "modbus":
        return "no, but it speaks another protocol"
    with drivebus.Bus(f"sim://{family}?clock=virtual") as bus:
        certainty = bus.identify(1).certainty
    return {"certain": "yes", "shared": "yes, a shared code", "by answers": "by its answers", "unknown": "no"}[
        certainty
    ]


def may_run(family: str) -> str:
    """Whether a motor is started: a start, and a stop or a coast, must be proved. Then, whether a speed is."""
    profile = drivebus.Profile.builtin(family)
    commands = profile.commands()
    if "run_forward" not in commands:
        return "no"
    proved = {each for each in commands if profile.command_reason(each) is None}
    starts = "run_forward" in proved and (not profile.start_sequence() or profile.state_reason() is None)
    if not starts or not proved & {"stop", "coast"}:
        return "`--unverified`"
    setpoint = profile.role("setpoints.frequency")
    if setpoint is None:
        return "yes; no speed"
    known = profile.describe(setpoint)
    is_proved = known.evidence == "verified" and (known.variant is None or not profile.variants()[known.variant].reason)
    return "yes" if is_proved else "yes; a speed with `--unverified`"


def table() -> str:
    lines = [
        "| drive | profile | says what it is | run and stop | rows | proved |",
        "| --- | --- | --- | --- | ---: | ---: |",
    ]
    for family in drivebus.profiles():
        counts = [counted(rows) for rows in rows_of(family).values()]
        total = sum(each["total"] for each in counts)
        proved = total - sum(each["unverified"] + each["assumed"] for each in counts)
        share = f"{100 * proved // total} %" if total else ""
        about = os.path.relpath(PROFILES / family / "about.md", PAGE.parent)
        title = f"[{drivebus.Profile.builtin(family).title}]({about})"
        lines.append(f"| {title} | `{family}` | {says_what_it_is(family)} | {may_run(family)} | {total} | {share} |")
    return "\n".join(lines) + "\n"


def test_the_page_has_what_the_profiles_say() -> None:
    kept = PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0]
    assert kept == table(), "python -m tests.python.test_families_page"


def answered(call: Callable[[], object]) -> str:
    """Whether it is done, wants `unverified=True`, or is not known at all."""
    try:
        call()
    except drivebus.Unverified:
        return "unverified"
    except drivebus.BadArgument:
        return "not known"
    except (drivebus.NotReady, drivebus.Unconfirmed):
        # It obeys its keypad, or has to be set first: the question of proof comes before that.
        pass
    return "done"


@pytest.mark.parametrize("family", [family for family in FAMILIES if may_run(family) != "no"])
def test_a_motor_runs_where_the_page_says_so(family: str) -> None:
    """What the table says of "run and stop", asked of a simulated drive."""
    said = {
        ("done", "done"): "yes",
        ("done", "unverified"): "yes; a speed with `--unverified`",
        ("done", "not known"): "yes; no speed",
        ("unverified", "unverified"): "`--unverified`",
    }
    with drivebus.Bus(f"sim://{family}?clock=virtual") as bus:
        drive = bus.drive(1, family)
        started = answered(drive.run)
        drive.prepare_control(store=drive.profile.memory() is None, unverified=True)
        assert said[started, answered(lambda: drive.run(10.0))] == may_run(family)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_page_is_made_of_each_profile(family: str) -> None:
    """The page of the site has what is written, each row, and the counts that `profiles show` prints."""
    page = family_page(family)
    title, _, written = (PROFILES / family / "about.md").read_text(encoding="utf-8").rstrip().partition("\n\n")
    assert page.startswith(title)
    assert f"\n\n{written}\n\n" in page
    assert f"| run and stop | {may_run(family).replace('`', '')} |" in page
    for kind, rows in rows_of(family).items():
        body = page.partition(f"## {kind.capitalize()} of ")[2].partition("\n## ")[0]
        made = [line for line in body.splitlines() if line.startswith("| ")][2:]
        assert len(made) == len(rows), kind
        for row in rows:
            said = row.get("code") if kind != "registers" else row["name"]
            assert any(re.search(rf"\| `?{re.escape(said or '')}`? \|", line) for line in made), said
        numbers = " +".join(str(number) for number in shown(family)[kind].values())
        assert re.search(rf"^{kind} +{numbers}$", page, re.MULTILINE)


if __name__ == "__main__":
    head, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(head + BEGIN + table() + END + rest.split(END)[1], encoding="utf-8")
