"""Commands that keep what a drive is set to in a file, compare it, and give it back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

import drivebus
from drivebus.backup.unread import Unread, counts, in_words
from drivebus.cli.names import complete_group
from drivebus.cli.option_types import Place
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import counted, remark
from drivebus.cli.present.progress import progress_bar
from drivebus.cli.session import Session, pass_session, yes_option

__all__ = ["COMMANDS", "progress_bar"]

_FACTORY = "factory"
"""Stands for what the factory set, where a file could."""

_file = Place(dir_okay=False, path_type=Path)


@click.command()
@click.argument("file", type=_file)
@click.option("--fresh", is_flag=True, help="Start again instead of continuing an interrupted backup.")
@click.option("--force", is_flag=True, help="Replace FILE, whether it is an older backup or something else.")
@pass_session
def backup(session: Session, file: Path, fresh: bool, force: bool) -> None:
    """Read every parameter the profile knows into FILE, a text for people and version control.

    Writes nothing to the drive. After an interruption, the same command continues where it stopped. Passwords are not
    read. Exit code 1: some were lost, or refused for another reason than that they are not there, or closed; then what
    was read is in FILE.part, and the same command asks for the rest.
    """
    if not force:
        _keep_older(file)
    with session.drive() as drive, progress_bar(session.out, "reading") as progress:
        kept = drive.backup(file, not fresh, progress, force=force)
    place = file if kept.complete else file.with_name(f"{file.name}.part")
    if session.out.as_json:
        _show_as_json(session, place, kept)
    else:
        _show_backup(session, place, kept)
    if not kept.complete:
        lost = [why for why in kept.unread.values() if why.open]
        remark(f"The backup is not complete: {in_words(lost)}, see above. The same command asks for the rest.")
        raise click.exceptions.Exit(1)


def _show_as_json(session: Session, place: Path, kept: drivebus.Backup) -> None:
    origin = {name: value for name, value in vars(kept.origin).items() if name != "taken"}
    session.out.record(
        {
            "file": str(place),
            **origin,
            "taken": f"{kept.origin.taken:%Y-%m-%dT%H:%M:%SZ}",
            "parameters": len(kept),
            "complete": kept.complete,
            "counts": counts(kept.unread.values()),
            "unread": kept.unread,
        }
    )


def _show_backup(session: Session, place: Path, kept: drivebus.Backup) -> None:
    begun = f"{kept.origin.taken:%Y-%m-%d %H:%M} UTC"
    profile = kept.profile
    known = sum(profile.describe(name).kind == "parameter" for name in profile.names())
    session.out.say(
        f"{place}: {len(kept)} of the {known} parameters that the profile {profile.name} knows, of {session.called}, "
        f"{kept.origin.title}, begun {begun}."
    )
    if kept.unread:
        session.out.say(f"Not read: {in_words(kept.unread.values())}.")
        session.out.rows(["code", "reason", "why"], [[code, why, why.why] for code, why in kept.unread.items()])


def _keep_older(file: Path) -> None:
    """Refuses to replace a backup that is complete: it may be the one that is wanted some day."""
    try:
        older = drivebus.Backup.load(file)
    except drivebus.DrivebusError:
        return  # there is none; or whatever it is, taking the backup says so
    origin = older.origin
    # Where its replacement was begun, that goes on.
    if older.complete and not file.with_name(f"{file.name}.part").exists():
        raise drivebus.BadArgument(
            f"{file} has a backup already: {len(older)} parameters of unit {origin.unit}, {origin.title}, begun "
            f"{origin.taken:%Y-%m-%d %H:%M} UTC; give another name, or --force to replace it; nothing was read"
        )


@click.command()
@click.argument("file", type=_file)
@click.option(
    "--group",
    "groups",
    multiple=True,
    metavar="GROUP",
    shell_complete=complete_group,
    help="Only this group (P00) or code; may be repeated.",
)
@click.option(
    "--serial", is_flag=True, help="Also restore the serial settings. The drive may not be reachable afterwards."
)
@click.option("--motor", is_flag=True, help="Also restore the motor data.")
@click.option(
    "--raw",
    multiple=True,
    metavar="CODE",
    help="Also restore this parameter, of which only its word is known; may be repeated.",
)
@click.option("--force", is_flag=True, help="Also write to a drive of another family, identification or firmware.")
@click.option(
    "--twice", is_flag=True, help="Allow a second EEPROM write where a value can only be reached in two steps."
)
@click.option("--dry-run", is_flag=True, help="Show what would be written, and write nothing.")
@yes_option
@pass_session
def restore(
    session: Session,
    file: Path,
    groups: tuple[str, ...],
    serial: bool,
    motor: bool,
    raw: tuple[str, ...],
    force: bool,
    twice: bool,
    dry_run: bool,
    yes: bool,
) -> None:
    """Write the values in FILE back to the drive. Shows what it would write, and asks first.

    Writes only the values that differ, to EEPROM, and reads each back. After an interruption, the same command
    continues where it stopped. Exit code 1: something was not restored.
    """
    if not dry_run:
        session.will_write()
    kept = _load(session, file)
    options: dict[str, Any] = {
        "groups": groups or None,
        "serial": serial,
        "motor": motor,
        "raw": raw,
        "force": force,
        "twice": twice,
    }
    with session.drive() as drive:
        plan = drive.restore(kept, dry_run=True, **options)
        planned = plan.having("planned")
        if dry_run or not planned:
            _show_report(session, kept.profile, plan, "Nothing to write." if not planned else "Nothing was written.")
        else:
            if not session.out.as_json:
                _show_report(session, kept.profile, plan, "")
            session.ask(_question(drive, [item.code for item in planned]), yes)
            with progress_bar(session.out, "writing") as progress:
                plan = drive.restore(kept, progress=progress, **options)
            _show_report(session, kept.profile, plan, f"{len(plan.having('restored'))} of {len(planned)} restored.")
    if not plan.ok:
        failed = sum(item.failed for item in plan)
        were = "would not be" if dry_run else "was not" if failed == 1 else "were not"
        remark(f"{counted(failed, 'parameter')} {were} restored: see above.")
        raise click.exceptions.Exit(1)


def _complete_side(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Files, and what stands for none, for the shell."""
    known = [CompletionItem(_FACTORY)] if incomplete and _FACTORY.startswith(incomplete) else []
    return known or [CompletionItem(incomplete, type="file")]


@click.command()
@click.argument("a", metavar="A", shell_complete=_complete_side)
@click.argument("b", metavar="[B]", required=False, shell_complete=_complete_side)
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="Also what changes by itself, such as the fault history; list what is not compared.",
)
@click.option("--force", is_flag=True, help="Also compare with a drive of another identification or firmware.")
@pass_session
def diff(session: Session, a: str, b: str | None, everything: bool, force: bool) -> None:
    """Show how B, or the drive, differs from A.

    A and B are files. "factory" stands for the factory settings, as far as they are known. Only the parameters in A are
    compared with the drive. Exit code 0: nothing differs. 1: something differs, or could not be compared because it was
    lost or refused. Other exit codes are as usual.
    """
    found, profile = _diff(session, a, b, everything, force)
    unsettled = found.unsettled()
    if session.out.as_json:
        for each in found:
            session.out.record(vars(each))
        for code, why in unsettled.items():
            session.out.record({"code": code, "not_compared": why.why, "reason": why})
    else:
        sides = (found.left if a == _FACTORY else a, found.right if b is None else b)
        told = in_words(why for why in found.uncompared.values() if isinstance(why, Unread))
        kinds = f" ({told})" if told else ""
        rest = f" {len(found.uncompared)} were not compared{kinds}." if found.uncompared else ""
        hint = " --all lists them." if rest and not everything else ""
        session.out.say(f"{' -> '.join(sides)}: {len(found)} of {found.compared} parameters differ.{rest}{hint}")
        if len(found):
            rows = [
                [
                    each.code,
                    *_texts(profile, each.code, each.left, each.right),
                    each.unit,
                    each.label,
                    in_commands(each.reason),
                ]
                for each in found
            ]
            session.out.rows(["code", "was", "is", "unit", "label", "reason"], rows)
        listed = found.uncompared if everything else unsettled
        if listed:
            session.out.say("Not compared:")
            session.out.rows(["code", "reason"], listed.items())
    if unsettled:
        remark(f"{counted(len(unsettled), 'parameter')} could not be compared: {in_words(unsettled.values())}.")
    if found:
        raise click.exceptions.Exit(1)


def _diff(
    session: Session, a: str, b: str | None, everything: bool, force: bool
) -> tuple[drivebus.Diff, drivebus.Profile]:
    """What differs, and the profile that says how its values are shown."""
    if a == b == _FACTORY:
        raise click.UsageError(f"{_FACTORY} does not differ from itself: give a FILE, or nothing for the drive, as B")
    if b == _FACTORY:
        raise click.UsageError(f"{_FACTORY} comes first: drivebus diff {_FACTORY} {a}")
    first = None if a == _FACTORY else _load(session, Path(a))
    if b is None:
        with session.drive() as drive:
            found = drive.diff(first, everything=everything, force=force)
            return found, drive.profile if first is None else first.profile
    second = _load(session, Path(b))
    if first is None:
        return second.diff(None, everything=everything), second.profile
    return first.diff(second, everything=everything), first.profile


def _load(session: Session, file: Path) -> drivebus.Backup:
    """The backup in *file*; a wrong one is told before any port is opened."""
    profile = None if session.profile is None else drivebus.Profile.find(session.profile)
    kept = drivebus.Backup.load(file, profile)
    version, now = kept.origin.profile_version, kept.profile.version
    if kept.origin.profile == kept.profile.name and version not in (0, now):
        remark(
            f"{file} was read with version {version} of the profile {kept.profile.name}, and this is version {now}: "
            "its values are taken as this one means them."
        )
    return kept


def _question(drive: drivebus.Drive, codes: list[str]) -> str:
    text = f"This writes {counted(len(codes), 'parameter')} to the drive's memory"
    sources = [item.code for item in drive.profile.control() if item.code in codes]
    if sources:
        text += (
            f", and with {', '.join(sources)} where it takes commands from: a drive that is told to run there may start"
        )
    try:
        drive.state()
    except drivebus.NotAllowed:
        text += ". Whether the motor turns cannot be asked of this family: look"
    return text


def _show_report(session: Session, profile: drivebus.Profile, report: drivebus.Restoration, end: str) -> None:
    """Every parameter as JSON; for people, those of which there is something to say."""
    if session.out.as_json:
        for item in report:
            session.out.record(vars(item))
        return
    told = [item for item in report if _is_told(item)]
    if told:
        rows = [
            [
                item.code,
                *_texts(profile, item.code, item.before, item.wanted),
                item.unit,
                item.result,
                item.label,
                in_commands(item.reason),
            ]
            for item in told
        ]
        session.out.rows(["code", "drive", "backup", "unit", "result", "label", "reason"], rows)
    counts = {result: len(report.having(result)) for result in ("same", "skipped")}
    session.out.say(
        f"{end} The same: {counts['same']}. Left alone: {counts['skipped']} (fault history, read-only, and what has to "
        "be asked for: serial settings, motor data).".strip()
    )


def _texts(profile: drivebus.Profile, code: str, *values: Any) -> list[str]:
    """*values* of *code* with as many digits as the drive counts; empty for None."""
    known = profile.describe(code)
    return ["" if value is None else known.text(value) for value in values]


def _is_told(item: drivebus.Restored) -> bool:
    """Whether there is something to say of *item*: what failed always, what was left alone where it differs."""
    if item.failed:
        return True
    differs = item.result != "same" and item.before != item.wanted
    return differs and (item.result != "skipped" or item.before is not None)


COMMANDS = [backup, restore, diff]
