"""Commands that explain: what a name means, what a fault means, and whether the answer can be trusted."""

from __future__ import annotations

import re

import click

import drivebus
from drivebus.cli import names
from drivebus.cli.each_drive import each_drive
from drivebus.cli.present.descriptions import Description, Group, Groups, Matches
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.fault_lists import FaultHistory, FaultsByFamily, KnownFaults
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]


@click.command()
@click.argument("text", metavar="TEXT...", nargs=-1, required=True, shell_complete=names.complete_name)
@click.option("--all", "everything", is_flag=True, help="Also what programmers need: table, words, scale, sign.")
@pass_session
def describe(session: Session, text: tuple[str, ...], everything: bool) -> None:
    """Show what is known about a register or parameter, or search for one.

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
        session.out.render(Matches(profile, wanted, [profile.describe(name) for name in found]))
        return
    session.out.render(Description(known, everything))


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
        session.out.render(_all_groups(profile, rows))
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
    session.out.render(Group(f"{profile.title}, {group}", chosen, unlisted))


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


def _all_groups(profile: drivebus.Profile, rows: list[drivebus.Description]) -> Groups:
    registers = [row for row in rows if row.kind == "register"]
    listed = [("registers", len(registers), "registers that only the bus has")]
    listed.append(("monitor", len(profile.monitor_names()), "what `drivebus monitor` shows by default"))
    for name in _groups(rows):
        members = [row for row in rows if row.group == name]
        such_as = ", ".join(row.label for row in members[:3]) + (", …" if members[3:] else "")
        listed.append((name, len(members), such_as))
    return Groups(profile.title, len(rows), listed)


def _groups(rows: list[drivebus.Description]) -> list[str]:
    return list(dict.fromkeys(row.group for row in rows if row.group))


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
        raise WrongUse("--all lists every fault: leave it out to have one explained")
    if everything or text:
        _show_known(session, " ".join(text))
        return
    with session.drive() as drive:
        past = drive.fault_history()
        try:
            present, unknown = drive.fault(), None
        except drivebus.NotAllowed as error:
            present, unknown = None, in_commands(error)
    kept = past[0].values if past else ()
    described = {name: drive.describe(name) for name in kept}
    session.out.render(FaultHistory(present, unknown, past, bool(drive.profile.fault_history), described))


def _show_known(session: Session, text: str) -> None:
    """The faults of the family that *text* means; all for none. One alone is told with all that is known of it."""
    if text and session.profile is None and session.port is None:
        _show_of_all(session, text)
        return
    profile = session.known_profile()
    known = _meant(profile.faults(), text) if text else profile.faults()
    if text and not known:
        raise drivebus.BadArgument(f'{profile.name} names no fault "{text}"; {_instead(profile.faults())}')
    session.out.render(KnownFaults(known, bool(text)))


def _instead(known: list[drivebus.Fault]) -> str:
    """What to do where nothing is named so."""
    if sum(bool(fault.mnemonic) for fault in known) * 2 < len(known):
        return (
            "no known manual prints what its keypad shows. `drivebus faults` asks the drive for the number, and words "
            "find a fault too: `drivebus faults overcurrent`"
        )
    return "`drivebus faults --all` lists those it names"


def _show_of_all(session: Session, text: str) -> None:
    """The faults that *text* means in each family: what the keypad shows is enough to look it up."""
    found = [
        (name, fault) for name in drivebus.profiles() for fault in _meant(drivebus.Profile.builtin(name).faults(), text)
    ]
    if not found:
        raise drivebus.BadArgument(f'no family that is known names a fault "{text}"; `drivebus profiles` lists them')
    session.out.render(FaultsByFamily(found))


def _meant(known: list[drivebus.Fault], text: str) -> list[drivebus.Fault]:
    """Those that *text* means: by number, by what the keypad shows, or by words in what is said of them.

    `STo` and `STO` are two faults. Who types neither (`sto`) is shown both. A few letters are a whole word or nothing:
    `oC` is no part of "block".
    """
    words = [re.compile(rf"\b{re.escape(word)}" + (r"\b" if len(word) < 4 else "")) for word in text.lower().split()]
    for means in (
        lambda fault: str(fault.code) == (text.lstrip("0") or "0"),
        lambda fault: fault.mnemonic == text,
        lambda fault: fault.mnemonic.lower() == text.lower(),
        lambda fault: all(word.search(f"{fault.mnemonic} {fault.label} {fault.cause}".lower()) for word in words),
    ):
        found = [fault for fault in known if means(fault)]
        if found or text.isdecimal():
            return found
    return []


COMMANDS = [faults, describe, list_]
