"""Commands that explain: what a name means, what a fault means, and whether the answer can be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

import drivebus
from drivebus import tables
from drivebus.cli import names
from drivebus.cli.parallel import each_drive
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import counted
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]

_MATCHES = 20
"""Most rows that a search shows: who has more of them asks for something narrower."""


@click.command()
@click.argument("text", metavar="TEXT...", nargs=-1, required=True, shell_complete=names.complete_name)
@pass_session
def describe(session: Session, text: tuple[str, ...]) -> None:
    """Show all that is known about a register or parameter, or search for one.

    TEXT is a name, a code or an address. Anything else is searched for in names, labels, choices and notes:
    `drivebus describe torque`. Other words of the field are found too, such as "ramp" or "dc link". With --profile, no
    drive is asked.
    """
    profile = session.known_profile()
    wanted = " ".join(text)
    try:
        known = profile.describe(names.named(profile, wanted))
    except drivebus.NotAllowed:
        shown = next((fault.mnemonic for fault in profile.faults() if fault.mnemonic.lower() == wanted.lower()), "")
        if shown:
            raise drivebus.BadArgument(
                f'"{wanted}" is not a register or parameter of {profile.name}, but a fault: `drivebus faults {shown}`'
            ) from None
        found = profile.search(wanted, limit=10_000)
        if not found:
            raise
        _show_matches(session, profile, wanted, found)
        return
    values = dict(vars(known))
    values["address"] = None if known.place is None else tables.shown(known.place)
    if not session.out.as_json:
        values["choices"] = ", ".join(f"{number} = {label}" for number, label in known.choices.items())
        values["bits"] = ", ".join(known.bits or {})
        values["unverified_bits"] = ", ".join(known.unverified_bits)
        del values["verified"]  # `evidence` says more
        if known.writable and known.verified and not known.bounded:
            printed = " but for its choices" if known.choices else ""
            values["write"] = f"unverified{printed}: its range is not printed"
    session.out.facts(values)


def _show_matches(session: Session, profile: drivebus.Profile, wanted: str, found: list[str]) -> None:
    has_them = all(word in _all_of(profile.describe(found[0])) for word in wanted.lower().split())
    matches = "match" if len(found) == 1 else "matches"
    count = f"{len(found)} {matches}" if has_them else f"nothing that is called so, and {len(found)} near {matches}"
    narrower = f", the best {_MATCHES} of them; more words narrow it" if len(found) > _MATCHES else ""
    session.out.say(f'{profile.name} has {count} for "{wanted}"{narrower}:')
    session.out.rows(_NAMED, [_match(profile, name) for name in found[:_MATCHES]])


def _all_of(row: drivebus.Description) -> str:
    """What is known of *row*, to look for a word in."""
    return str(vars(row)).lower()


_NAMED = ["name", "code", "address", "unit", "label", "evidence"]


def _match(profile: drivebus.Profile, name: str) -> list[Any]:
    known = profile.describe(name)
    return [known.name, known.code, _address(known), known.unit, known.label, known.evidence]


@click.command(name="list")
@click.argument("group", metavar="[GROUP]", required=False, shell_complete=names.complete_group)
@pass_session
def list_(session: Session, group: str | None) -> None:
    """List the registers and parameter groups of the drive's family, or the rows of GROUP.

    GROUP is a group of parameters (P00), "registers", "monitor", "parameters" or "all". With --profile, no drive is
    asked.
    """
    profile = session.known_profile()
    rows = [profile.describe(name) for name in profile.names()]
    if group is None:
        _show_groups(session, profile, rows)
        return
    wanted = group.lower()
    chosen = {
        "all": rows,
        "registers": [row for row in rows if row.kind == "register"],
        "parameters": [row for row in rows if row.kind == "parameter"],
        "monitor": [profile.describe(name) for name in profile.monitor_names()],
    }.get(wanted)
    if chosen is None:
        chosen = [row for row in rows if row.group.lower() == wanted]
    unlisted = _unlisted(profile, wanted)
    if not chosen and not unlisted and wanted not in _ALWAYS:
        known = ", ".join([*_ALWAYS, *_groups(rows)])
        raise drivebus.BadArgument(f'{profile.name} has no group "{group}"; it has {known}')
    session.out.say(f"{profile.title}, {group}: {counted(len(chosen), 'row')}")
    session.out.rows(
        ["name", "code", "address", "unit", "range", "access", "label"],
        [
            [row.name, row.code, _address(row), row.unit, _range(row), row.access, row.label]
            for row in sorted(chosen, key=lambda row: (row.kind == "parameter", row.address is None, row.address))
        ],
    )
    if unlisted and not session.out.as_json:
        session.out.say(unlisted)


def _unlisted(profile: drivebus.Profile, group: str) -> str:
    """What is said of the codes in *group* that have no row; nothing where it has none that could be read."""
    known = {f"p{number:02}" for number in profile.parameter_groups()}
    if group not in known and not (group == "parameters" and known):
        return ""
    code = f"{group.upper()}.00" if group in known else "P05.00"
    return (
        f"The drive may have more. A code without a row, such as {code}, is read as a raw word, and written with "
        "--unverified. `drivebus discover` asks the drive which there are."
    )


_ALWAYS = ("registers", "monitor", "parameters", "all")
"""Groups that every family has."""


def _show_groups(session: Session, profile: drivebus.Profile, rows: list[drivebus.Description]) -> None:
    registers = [row for row in rows if row.kind == "register"]
    listed = [["registers", len(registers), "registers that only the bus has"]]
    listed.append(["monitor", len(profile.monitor_names()), "what `drivebus monitor` shows by default"])
    for name in _groups(rows):
        members = [row for row in rows if row.group == name]
        listed.append(
            [name, len(members), ", ".join(row.label for row in members[:3]) + (", …" if members[3:] else "")]
        )
    session.out.say(f"{profile.title}: {counted(len(rows), 'name')}; `drivebus list GROUP` shows those of a group")
    session.out.rows(["group", "names", "such as"], listed)


def _groups(rows: list[drivebus.Description]) -> list[str]:
    return list(dict.fromkeys(row.group for row in rows if row.group))


def _address(row: drivebus.Description) -> str | None:
    return None if row.place is None else tables.shown(row.place)


def _range(row: drivebus.Description) -> str:
    if row.choices:
        return f"{len(row.choices)} choices"
    if row.low is None or row.high is None:
        return ""
    return f"{row.text(row.low)} to {row.text(row.high)}"


@click.command()
@click.argument("text", metavar="[FAULT]...", nargs=-1)
@click.option("--all", "everything", is_flag=True, help="List every fault of the family. No drive is asked for faults.")
@each_drive
def faults(session: Session, text: tuple[str, ...], everything: bool) -> None:
    """Explain the present fault, and list the last ones, with the values that the drive kept if they are known.

    FAULT is a number, the letters on the keypad (`drivebus faults OL1`), or words (`drivebus faults earth short`). No
    drive is asked for faults then.
    """
    if everything and text:
        raise click.UsageError("--all lists every fault: leave it out to have one explained")
    if everything or text:
        _show_known(session, " ".join(text))
        return
    out = session.out
    with session.drive() as drive:
        history = drive.fault_history()
        kept = bool(drive.profile.fault_history)
        try:
            present, reason = drive.fault(), None
        except drivebus.NotAllowed as error:
            present, reason = None, in_commands(error)
    if out.as_json:
        if reason is not None:
            out.record({"when": "now", "missing": reason})
        listed = [("now", present)] if present is not None else []
        if present is None and reason is None:
            out.record({"when": "now", "code": None, "label": "no fault"})
        for when, fault in [*listed, *_numbered(history)]:
            out.record({"when": when, **dict(zip(_COLUMNS, _row(fault), strict=True)), "values": dict(fault.values)})
        return
    if reason is not None:
        out.say(f"The present fault is not known: {reason}")
    else:
        out.say("No fault now." if present is None else f"Now: {present}")
    if present is not None:
        out.facts({"cause": present.cause, "remedy": present.remedy, "note": present.note})
    if not kept:
        out.say("Where this family keeps its last faults is not known.")
    elif not history:
        out.say("The history is empty, or may not be read.")
    else:
        out.say("History, the latest first:")
        out.rows(["when", *_COLUMNS], [[when, *_row(fault)] for when, fault in _numbered(history)])
        if history[0].values:
            out.say("What the drive saw at the last one:")
            out.rows(["parameter", "value", "unit", "label"], _values(drive, history[0].values))


_COLUMNS = ["code", "mnemonic", "label", "cause", "remedy", "verified"]


def _row(fault: drivebus.Fault) -> list[Any]:
    return [fault.code, fault.mnemonic, fault.label, fault.cause, fault.remedy, fault.verified]


def _numbered(history: list[drivebus.Fault]) -> list[tuple[str, drivebus.Fault]]:
    return [("last" if number == 0 else f"{number} before", fault) for number, fault in enumerate(history)]


def _show_known(session: Session, text: str) -> None:
    """The faults of the family that *text* means; all for none. One alone is told with all that is known of it."""
    if text and session.profile is None and session.port is None:
        _show_of_all(session, text)
        return
    profile = session.known_profile()
    known = _meant(profile.faults(), text) if text else profile.faults()
    if text and not known:
        raise drivebus.BadArgument(
            f'{profile.name} names no fault "{text}"; `drivebus faults --all` lists those it names'
        )
    if text and len(known) == 1 and not session.out.as_json:
        [fault] = known
        session.out.say(str(fault))
        session.out.facts({"cause": fault.cause, "remedy": fault.remedy, "note": fault.note})
        return
    if not known and not session.out.as_json:
        session.out.say("No fault of this family is known by number; the drive's manual has them.")
    session.out.rows(_COLUMNS, [_row(fault) for fault in known])


def _show_of_all(session: Session, text: str) -> None:
    """The faults that *text* means in each family: what the keypad shows is enough to look it up."""
    found = [
        (name, fault) for name in drivebus.profiles() for fault in _meant(drivebus.Profile.builtin(name).faults(), text)
    ]
    if not found:
        raise drivebus.BadArgument(f'no family that is known names a fault "{text}"; `drivebus profiles` lists them')
    # Families of one maker have most of their faults in common.
    families: dict[tuple[Any, ...], list[str]] = {}
    for name, fault in found:
        families.setdefault(tuple(_row(fault)[:-1]), []).append(name)
    if session.out.as_json:
        for row, names_of in families.items():
            session.out.record({"families": names_of, **dict(zip(_COLUMNS, row, strict=False))})
        return
    for row, names_of in families.items():
        code, mnemonic, label, cause, remedy = row
        session.out.say(f"{code} {mnemonic}: {label} ({', '.join(names_of)})".replace(" :", ":"), "bold")
        session.out.facts({"cause": cause, "remedy": remedy})


def _meant(known: list[drivebus.Fault], text: str) -> list[drivebus.Fault]:
    """Those that *text* means: by number, by what the keypad shows, or by words in what is said of them.

    `STo` and `STO` are two faults. Who types neither (`sto`) is shown both.
    """
    words = text.lower().split()
    for means in (
        lambda fault: str(fault.code) == (text.lstrip("0") or "0"),
        lambda fault: fault.mnemonic == text,
        lambda fault: fault.mnemonic.lower() == text.lower(),
        lambda fault: all(word in f"{fault.mnemonic} {fault.label} {fault.cause}".lower() for word in words),
    ):
        found = [fault for fault in known if means(fault)]
        if found or text.isdecimal():
            return found
    return []


def _values(drive: drivebus.Drive, values: Mapping[str, Any]) -> list[list[Any]]:
    known = [(value, drive.describe(name)) for name, value in values.items()]
    return [[row.code or row.name, value, row.unit, row.label] for value, row in known]


COMMANDS = [faults, describe, list_]
