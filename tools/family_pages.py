"""A page for each family of drives: what people wrote about it, and below that what its profile says.

`family_page("gd350")` gives the page as Markdown. Nothing of it is kept in the repository: what people wrote stands in
`about.md` of the profile's folder, and everything else is the profile's own.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from click.testing import CliRunner

import drivebus
from drivebus.cli import cli

__all__ = ["ABOUT", "family_page"]

ROOT = Path(__file__).resolve().parent.parent
ABOUT = ROOT / "crates/drives/profiles"
PROOF = {"verified": "", "unverified": "unverified", "assumed": "assumed"}
ACCESS = {
    "rw": "read, write",
    "ro": "read",
    "wo": "write",
    "run": "any time",
    "stop": "at standstill",
    "unknown": "not known",
}


def family_page(name: str) -> str:
    """The page of the family *name*, as Markdown."""
    profile = drivebus.Profile.builtin(name)
    rows = [profile.describe(each) for each in profile.names()]
    registers = [row for row in rows if row.kind == "register"]
    parameters = [row for row in rows if row.kind == "parameter"]
    title, _, written = (ABOUT / name / "about.md").read_text(encoding="utf-8").strip().partition("\n\n")
    parts = [
        title,
        _table(("in short", ""), _in_short(profile)),
        written,
        "## The profile\n",
        f"Name it `{name}`: `drivebus --profile {name} …`, or `bus.drive(1, {json.dumps(name)})`. "
        f"`drivebus profiles show {name}` prints these rules:",
        f"```text\n{_rules(name)}\n```",
        f"## Registers of {_plain(profile.title)}\n",
        _table(("address", "name", "what it is", "unit", "range", "access", "proof"), map(_register, registers)),
        f"## Parameters of {_plain(profile.title)}\n",
        _table(
            ("code", "name", "what it is", "unit", "range", "factory", "write", "proof"), map(_parameter, parameters)
        ),
        f"## Faults of {_plain(profile.title)}\n",
        _table(("number", "keypad", "fault", "cause", "remedy", "proof"), map(_fault, profile.faults())),
        f"Proof is empty where a document of the family prints the row. [The drives]({_from(name)}) explains the rest.",
    ]
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def _of_its_speed(profile: drivebus.Profile) -> str:
    """What a start over the bus lacks if a speed is to come with it."""
    setpoint = profile.role("setpoints.frequency")
    if setpoint is None:
        return "; no speed"
    known = profile.describe(setpoint)
    doubts = known.variant is not None and profile.variants()[known.variant].reason
    return "; a speed with --unverified" if doubts or known.evidence != "verified" else ""


def _from(name: str) -> str:
    """The way from what is written of a family to the page of all families."""
    return os.path.relpath(ROOT / "docs/families.md", ABOUT / name)


def _in_short(profile: drivebus.Profile) -> list[tuple[str, str]]:
    """What one wants to know before anything else."""
    serial, memory = profile.serial(), profile.memory()
    line = "not known"
    if serial is not None:
        line = f"{serial.baud_rate} bit/s, {serial.format}"
        line += "" if serial.unit is None else f", unit {serial.unit}"
        line += "" if serial.verified else " (unverified)"
    needs = [f"{each.code} = {each.value}" + ("" if each.verified else " (unverified)") for each in profile.control()]
    proved = {each for each in profile.commands() if profile.command_reason(each) is None}
    # Between the words of a start, the state has to be seen.
    is_seen = not profile.start_sequence() or profile.state_reason() is None
    run = "yes" if "run_forward" in proved and proved & {"stop", "coast"} and is_seen else "--unverified"
    if "run_forward" not in profile.commands():
        run = "no"
    elif run == "yes":
        run += _of_its_speed(profile)
    kept = "each write may wear EEPROM"
    if memory is not None:
        kept = "RAM, or EEPROM with --store" + (" (unverified)" if memory.reason else "")
    return [
        ("line from the factory", line),
        ("obeys the bus with", ", ".join(needs) or "not known"),
        ("run and stop", run),
        ("parameters are written to", kept),
    ]


def _rules(name: str) -> str:
    """What the command line says of the family, in lines of a page's width."""
    result = CliRunner().invoke(cli, ["profiles", "show", name], env={"COLUMNS": "100"}, catch_exceptions=False)
    return result.stdout.strip()


def _register(row: drivebus.Description) -> tuple[str, ...]:
    where = "not known" if row.address is None else f"{row.address:04X}H"
    if row.table != "holding":
        where = f"{row.table} {where}"
    return (
        where,
        f"`{row.name}`",
        _label(row),
        row.unit or "",
        _range(row),
        ACCESS[row.access],
        PROOF[row.evidence],
    )


def _parameter(row: drivebus.Description) -> tuple[str, ...]:
    factory = "" if row.default is None else row.choices.get(int(row.default), "") or f"{row.default:g}"
    return (
        f"`{row.code}`",
        f"`{row.name}`" if row.name != row.code else "",
        _label(row),
        row.unit or "",
        _range(row),
        factory,
        ACCESS[row.access],
        PROOF[row.evidence],
    )


def _fault(fault: drivebus.Fault) -> tuple[str, ...]:
    return (
        str(fault.code),
        f"`{fault.mnemonic}`" if fault.mnemonic else "",
        fault.label,
        fault.cause,
        fault.remedy,
        PROOF[fault.evidence],
    )


def _label(row: drivebus.Description) -> str:
    choices = ", ".join(f"{number} {text}" for number, text in row.choices.items())
    return f"{row.label}: {choices}" if choices else row.label


def _range(row: drivebus.Description) -> str:
    """`0 to P00.03`: a limit that another parameter sets has its name."""
    low = row.low_from or ("" if row.low is None else f"{row.low:g}")
    high = row.high_from or ("" if row.high is None else f"{row.high:g}")
    return f"{low} to {high}" if low and high else ""


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A table without the columns that nothing stands in, or a sentence where there are no rows."""
    found = list(rows)
    if not found:
        return "None is known."
    kept = [at for at, _ in enumerate(head) if any(row[at] for row in found)]
    lines = [[head[at] for at in kept], ["---" for _ in kept]]
    lines += [[_plain(row[at]) for at in kept] for row in found]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _plain(text: str) -> str:
    """*text* as it is, whatever Markdown would make of it; what is code stays code."""
    if text.startswith("`"):
        return text.replace("|", r"\|")
    for sign in "\\|*_<[":
        text = text.replace(sign, f"\\{sign}")
    return " ".join(text.split())
