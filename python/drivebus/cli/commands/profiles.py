"""`drivebus profiles`: the families that are known, what is known of each, and help for who writes one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import click

import drivebus
from drivebus.cli import own_signature, profile_interview, profile_template
from drivebus.cli.drive_beside import WordReader
from drivebus.cli.halts_elsewhere import started_by
from drivebus.cli.manual_cells import COUNTS
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.names import complete_profile
from drivebus.cli.option_types import Place
from drivebus.cli.own_signature import OwnSignature
from drivebus.cli.present.families import KINDS, Families, FamilyRules, Mistakes
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import remark
from drivebus.cli.profile_answers import Answers
from drivebus.cli.row_reads import read_rows
from drivebus.cli.session import Declined, Session, pass_session
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]


@click.group(cls=Listing, invoke_without_command=True)
@pass_session
@click.pass_context
def profiles(context: click.Context, session: Session) -> None:
    """List the families of drives that are known. Subcommands show one, check one, or start one of your own."""
    if context.invoked_subcommand is not None:
        return
    session.out.render(Families([drivebus.Profile.builtin(name) for name in drivebus.profiles()]))


@profiles.command()
@click.argument("family", shell_complete=complete_profile)
@pass_session
def show(session: Session, family: str) -> None:
    """Show the rules of a family (or a folder) in words, and how well its rows are known."""
    session.out.render(FamilyRules(drivebus.Profile.find(family)))


@profiles.command()
@click.argument("folder", type=Place(path_type=Path))
@click.option("--read", is_flag=True, help="Also read each row once from the drive, to compare with its keypad.")
@pass_session
@click.pass_context
def check(context: click.Context, session: Session, folder: Path, read: bool) -> None:
    """Check the profile in FOLDER. Each mistake is named with its file, its line, and what would be right.

    Ends with exit code 2 if there are mistakes, with 4 if the drive refuses a row. A warning says which halts of it
    start a shipped family: that is no mistake, but a drive of that family at this address would run. A profile is
    read, never executed.
    """
    _check(context, session, folder, read=read)


def _check(context: click.Context, session: Session, folder: Path, *, read: bool, is_new: bool = False) -> None:
    problems = drivebus.Profile.check(folder)
    session.out.render(Mistakes(problems))
    if problems:
        some = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        remark(f"Error: {folder} has {some}; the profile is not used until all is right.")
        context.exit(2)
    profile = drivebus.Profile.load(folder)
    _warn(profile)
    counts = profile.counts()
    totals = {kind: counts[kind]["total"] for kind in KINDS}
    rows = ", ".join(f"{total} {kind if total != 1 else kind.removesuffix('s')}" for kind, total in totals.items())
    session.out.say(f"{folder} is sound: {rows}.")
    _say_what_is_missing(profile)
    if read and not _compare(session, folder, profile, is_new=is_new):
        context.exit(4)


def _compare(session: Session, folder: Path, profile: drivebus.Profile, *, is_new: bool) -> bool:
    """Shows what the drive has in each row, and by what it is told from others. Whether it refused none."""
    with session.bus() as bus:
        reads = list(read_rows(bus.drive(session.unit, profile=profile, unverified=True)))
        is_told = profile.signature() is not None or profile.role("identification") is not None
        signature = None if is_told else own_signature.find(bus, session.unit, profile)
    session.out.rows(["name", "place", "value", "unit", "label"], [each[:5] for each in reads], spare=["label"])
    refused = [each.name for each in reads if not each.is_there]
    if refused:
        remark(
            f"Error: {session.called} refuses {', '.join(refused)}: it has nothing there, or the address is one off. "
            "Some manuals count addresses from 1"
        )
    if signature is not None:
        _tell_apart(folder, signature, adds=is_new and not refused)
    return not refused


def _tell_apart(folder: Path, signature: OwnSignature, *, adds: bool) -> None:
    """Says by what the drive is told from others, or *adds* it to its profile."""
    rules = folder / "profile.toml"
    what = "what this drive answers and refuses, so that no other is taken for it"
    if adds:
        with rules.open("a", encoding="utf-8", newline="\n") as file:
            file.write(f"\n{signature.rules()}")
        remark(f"{rules} has {what}.")
    else:
        remark(f"Note: {rules} has nothing of {what}. Once its rows are right, this is it:\n{signature.rules()}")
    if signature.not_told:
        remark(f"By that it is not told from {', '.join(signature.not_told)}.")


def _say_what_is_missing(profile: drivebus.Profile) -> None:
    """What a drive that is controlled by name would have, too: no mistake in a profile that is only for watching."""
    if profile.kind != "inverter":
        return
    have = profile.commands()
    lacks = [
        ("[commands.codes] has no run_forward", "run_forward" in have, "it cannot be started by name"),
        ("[commands.codes] has neither stop nor coast", bool({"stop", "coast"} & set(have)), "nothing is started"),
        ("[state] is missing", profile.role("state") is not None, "a start and a stop are proved by nothing it shows"),
        ("[setpoints.frequency] is missing", profile.role("setpoints.frequency") is not None, "it gets no speed"),
        ("[[control]] is missing", bool(profile.control()), "whether it obeys the bus is not looked at"),
    ]
    for what, is_there, then in lacks:
        if not is_there:
            remark(f"Note: {what}: {then}.")


def _warn(profile: drivebus.Profile) -> None:
    """Says which halts of *profile* are a start to other families."""
    for each in started_by(profile):
        remark(f"Warning: {profile.name}: {each}; it starts such a drive, where one hangs at the address.")


@profiles.command()
@click.argument("folder", type=Place(path_type=Path))
@click.option(
    "--like", metavar="FAMILY", shell_complete=complete_profile, help="Start from this family, and change what differs."
)
@click.option(
    "--overlay", metavar="FAMILY", shell_complete=complete_profile, help="Add facts to this family's profile."
)
@click.option(
    "--table",
    type=Place(path_type=Path),
    help="The manual's table of registers or parameters, as a spreadsheet saves it, or pasted; - is the input.",
)
@click.option("--source", metavar="TEXT", help="Where the table is printed: manual, edition, page.")
@click.option("--addresses", type=click.Choice(COUNTS), help="How the table writes addresses, where they do not tell.")
@click.option(
    "--ask/--no-ask",
    default=None,
    help="Ask for all that the manual says. It does so on a terminal, without --like, --overlay and --table.",
)
@pass_session
@click.pass_context
def new(
    context: click.Context,
    session: Session,
    folder: Path,
    like: str | None,
    overlay: str | None,
    table: Path | None,
    source: str | None,
    addresses: str | None,
    ask: bool | None,
) -> None:
    """Start a profile: ask for what the manual says, or write files with comments. Nothing is overwritten.

    With --table its rows are those of a manual's table: with a code, parameters, else registers. Each row that could
    not be read is named, with the reason.

    Where it asks, the drive may be there: then it is asked which family it may be, each answer is held against what
    it shows, and each row is read once. Nothing is written to it.
    """
    if (like is not None) + (overlay is not None) + (table is not None) > 1:
        raise WrongUse("give one of --like, --overlay and --table: a profile is a copy, an overlay, or new")
    # A row names its source in one line.
    source = None if source is None else " ".join(source.split())
    is_plain = like is None and overlay is None and table is None
    asks = ask if ask is not None else is_plain and sys.stdin is not None and sys.stdin.isatty()
    if asks and (like or overlay):
        raise WrongUse("--ask begins with the manual alone: give it without --like and --overlay")
    if (table is None) != (not source) or (table is None and addresses is not None and not asks):
        raise WrongUse("give --table with --source, the manual and its page: each row names where it is printed")
    base = like or overlay
    if base is not None:
        drivebus.Profile.builtin(base)
    try:
        name = folder.resolve().name
        _check_free(folder)
        read = None
        if asks:
            _ask(context, session, folder, lambda reader: profile_interview.ask(table, source, addresses, reader))
            return
        if table is None or not source:
            written = profile_template.files(name, like=like, overlay=overlay)
        else:
            read = ManualTable()
            read.read(_read(table), source, count=addresses)
            written = profile_template.files_of_table(name, read)
        _write(folder, written)
    except OSError as error:
        raise WrongUse(f"{error.filename or folder}: {error.strerror or error}") from error
    told = {} if read is None else {"rows": len(read.rows), "left_out": [list(each) for each in sorted(read.left_out)]}
    session.out.record({"folder": str(folder), "files": list(written), **told})
    session.out.say(f"{folder}: {', '.join(written)}")
    if read is not None:
        _tell(session, read)
    session.out.say(f"Fill them in, then: drivebus profiles check {folder}")


def _check_free(folder: Path) -> None:
    there = [name for name in profile_template.NAMES if (folder / name).exists() or (folder / name).is_symlink()]
    if there:
        raise WrongUse(f"{folder} has {', '.join(there)} already; nothing was written")


def _write(folder: Path, written: dict[str, str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in written.items():
        with (folder / name).open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)


def _ask(context: click.Context, session: Session, folder: Path, ask: Callable[[WordReader | None], Answers]) -> None:
    """Makes a profile of what is answered, checks it, and compares it with the drive if that is there."""
    try:
        is_there = session.port is not None and click.confirm(
            f"Is the drive at {session.port}, {session.called}, now? It is only read", default=True, err=True
        )
        with ExitStack() as stack:
            bus = stack.enter_context(session.bus()) if is_there else None
            reader = None if bus is None else WordReader(bus, session.unit, session.called)
            if bus is not None and reader is not None and not _goes_on(session, bus, reader):
                raise Declined("Cancelled. Nothing was written.")
            answers = ask(reader)
        is_there = reader is not None and not reader.is_silent
    except click.Abort:
        remark()
        raise Declined("Cancelled. Nothing was written.") from None
    told = len(answers.table.left_out)
    written = profile_template.files_of_answers(folder.resolve().name, answers)
    for line, why in answers.table.left_out[told:]:
        remark(f"line {line} is left out: {why}")
    _write(folder, written)
    session.out.say(f"{folder}: {', '.join(written)}")
    _check(context, session, folder, read=is_there, is_new=True)
    unit = answers.serial[2] if answers.serial is not None else 1
    session.out.say(f"Try it on a simulated drive: drivebus sim --units {unit}={folder}")


def _goes_on(session: Session, bus: drivebus.Bus, reader: WordReader) -> bool:
    """Whether a new profile is wanted, although the drive may be of a family that is known."""
    try:
        found = bus.identify(session.unit)
    except (drivebus.NoAnswer, drivebus.BadAnswer) as error:
        reader.fall_silent(error)
        return True
    if not found.candidates:
        remark(f"{session.called} is of no family that is known: {found.reason}.")
        return True
    remark(f"{session.called} may be {found.title or ', '.join(found.candidates)} ({found.certainty}: {found.reason}).")
    remark(f"Then no profile is needed: --profile {found.candidates[0]}.")
    return click.confirm("Make a new one?", default=False, err=True)


def _read(table: Path) -> bytes:
    if str(table) != "-":
        return table.read_bytes()
    if sys.stdin.isatty():
        remark("Paste the table, its line of titles first; then Ctrl-D on a line of its own.")
    return sys.stdin.buffer.read()


def _tell(session: Session, table: ManualTable) -> None:
    """What of *table* was taken, and what was not."""
    taken = [("registers.csv", len(table.registers)), ("parameters.csv", len(table.parameters))]
    files = [f"{count} row{'s' * (count != 1)} in {name}" for name, count in taken if count or not table.rows]
    session.out.say(f"Of the table: {', '.join(files)}. Compare each with the manual: name, scale, range.")
    for row in table.rows:
        if row.notes:
            session.out.say(f"line {row.line}, {row.name}: {'; '.join(row.notes)}")
    for line, why in sorted(table.left_out):
        remark(f"line {line} is left out: {why}")


@profiles.command()
def schema() -> None:
    """Print the JSON schema of profile.toml. With it, an editor knows the keys and marks wrong ones while you type.

    `drivebus profiles new` puts it beside the files that it writes.
    """
    click.echo(drivebus.Profile.schema(), nl=False)


COMMANDS = [profiles]
