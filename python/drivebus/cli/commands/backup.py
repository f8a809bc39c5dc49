"""Commands that keep what a drive is set to in a file, compare it, and give it back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

import drivebus
from drivebus.backup.unread import in_words
from drivebus.cli.each_drive import each_drive
from drivebus.cli.names import complete_group
from drivebus.cli.option_types import Place
from drivebus.cli.present.backups import BackupTaken, Differences, RestoreReport
from drivebus.cli.present.output import counted, remark
from drivebus.cli.present.progress import progress_bar
from drivebus.cli.session import Session, pass_session, yes_option
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS", "progress_bar"]

_FACTORY = "factory"
"""Stands for what the factory set, where a file could."""

_file = Place(dir_okay=False, path_type=Path)
_file_or_folder = Place(path_type=Path)


@click.command()
@click.argument("file", type=_file_or_folder)
@click.option("--fresh", is_flag=True, help="Start again instead of continuing an interrupted backup.")
@click.option("--force", is_flag=True, help="Replace FILE, whether it is an older backup or something else.")
@each_drive
def backup(session: Session, file: Path, fresh: bool, force: bool) -> None:
    """Read every parameter the profile knows into FILE, a text for people and version control.

    Writes nothing to the drive. After an interruption, the same command continues where it stopped. Passwords are not
    read. Exit code 1: some were lost, or refused for another reason than that they are not there, or closed; then what
    was read is in FILE.part, and the same command asks for the rest. Of several drives, FILE is a folder, which gets a
    file for each: FILE/pump1.toml.
    """
    if session.crew is not None:
        file = _in_folder(file, session.called)
    if not force:
        _keep_older(file)
    with session.drive() as drive, progress_bar(session.out, "reading") as progress:
        kept = drive.backup(file, not fresh, progress, force=force)
    place = file if kept.complete else file.with_name(f"{file.name}.part")
    session.out.render(BackupTaken(kept, place, session.called))
    if not kept.complete:
        lost = [why for why in kept.unread.values() if why.open]
        remark(f"The backup is not complete: {in_words(lost)}, see above. The same command asks for the rest.")
        raise click.exceptions.Exit(1)


def _in_folder(folder: Path, drive: str) -> Path:
    """The file of *drive* in *folder*, which is made where it is not there."""
    if folder.suffix:
        raise WrongUse(f"several drives have a file each: give a folder for them, such as {folder.stem}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise drivebus.BadArgument(
            f"{folder} cannot be a folder for several backups: {error.strerror or error}; nothing was read"
        ) from None
    return folder / f"{drive.replace(' ', '-')}.toml"


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
            end = "Nothing was written." if planned else "Nothing to write."
        else:
            session.out.preview(RestoreReport(plan, kept.profile, ""))
            session.ask(_question(drive, [item.code for item in planned]), yes)
            with progress_bar(session.out, "writing") as progress:
                plan = drive.restore(kept, progress=progress, **options)
            end = f"{len(plan.having('restored'))} of {len(planned)} restored."
        session.out.render(RestoreReport(plan, kept.profile, end))
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
    sides = (found.left if a == _FACTORY else a, found.right if b is None else b)
    session.out.render(Differences(found, profile, sides, everything))
    if unsettled:
        remark(f"{counted(len(unsettled), 'parameter')} could not be compared: {in_words(unsettled.values())}.")
    if found:
        raise click.exceptions.Exit(1)


def _diff(
    session: Session, a: str, b: str | None, everything: bool, force: bool
) -> tuple[drivebus.Diff, drivebus.Profile]:
    """What differs, and the profile that says how its values are shown."""
    if a == b == _FACTORY:
        raise WrongUse(f"{_FACTORY} does not differ from itself: give a FILE, or nothing for the drive, as B")
    if b == _FACTORY:
        raise WrongUse(f"{_FACTORY} comes first: drivebus diff {_FACTORY} {a}")
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


COMMANDS = [backup, restore, diff]
