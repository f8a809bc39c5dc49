"""The command that asks a drive which parameters it has."""

from __future__ import annotations

from pathlib import Path

import click

import drivebus
from drivebus.backup.unread import in_words
from drivebus.cli.option_types import Place
from drivebus.cli.present.output import counted, remark
from drivebus.cli.present.progress import progress_bar
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]


@click.command()
@click.argument("folder", type=Place(file_okay=False, path_type=Path))
@click.option("--group", "groups", multiple=True, metavar="GROUP", help="Only this group (P05); may be repeated.")
@click.option("--fresh", is_flag=True, help="Start again instead of continuing an interrupted discovery.")
@click.option("--base", metavar="PROFILE", help="Your own profile, as seen from FOLDER, if the drive has one.")
@pass_session
def discover(session: Session, folder: Path, groups: tuple[str, ...], fresh: bool, base: str | None) -> None:
    """Ask the drive which parameters it has, and put those without a row into FOLDER, as a profile to go on with.

    Sends reads only, ten thousand or so: three minutes at 19200 baud. After an interruption, the same command continues
    where it stopped. Exit code 1: of some it is not settled whether the drive has them; the same command asks for them
    again.
    """
    with session.drive() as drive, progress_bar(session.out, "asking") as progress:
        found = drive.discover(folder, groups=groups or None, resume=not fresh, progress=progress, base=base)
    if session.out.as_json:
        session.out.record(
            {
                "folder": str(folder),
                "profile": found.profile.name,
                "unit": found.unit,
                "taken": f"{found.taken:%Y-%m-%dT%H:%M:%SZ}",
                "parameters": len(found.words),
                "unlisted": found.unlisted,
                "missing": found.missing,
                "refused": dict(found.refused),
                "complete": found.complete,
                "unsettled": {code: {"why": why.why, "reason": why} for code, why in found.unsettled.items()},
                "doubtful": list(found.doubtful),
                "requests": found.requests,
            }
        )
    else:
        _show(session, folder, found)
    if not found.complete:
        remark(
            f"Of {counted(len(found.unsettled), 'number')} it is not settled whether the drive has them: "
            f"{in_words(found.unsettled.values())}. The same command asks for them again."
        )
        raise click.exceptions.Exit(1)


def _show(session: Session, folder: Path, found: drivebus.Discovery) -> None:
    new = found.unlisted
    session.out.say(
        f"{folder}: {session.called} has {counted(len(found.words), 'parameter')}. {len(found.words) - len(new)} of "
        f"them have a row in the profile {found.profile.name}; {len(new)} more are in {folder}."
    )
    if found.missing:
        session.out.say(f"The profile lists, and the drive has not: {', '.join(found.missing)}.")
    if found.refused:
        session.out.say("There, but not told:")
        session.out.rows(["code", "reason"], found.refused.items())
    if found.unsettled:
        session.out.say("Not settled:")
        session.out.rows(["code", "why", "reason"], [[code, why.why, why] for code, why in found.unsettled.items()])
    if found.doubtful:
        remark(
            f"{', '.join(found.doubtful)}: the drive answers alike to whatever is asked there, also to numbers that no "
            "parameter has. Nothing of it was taken."
        )
    session.out.say(f"Use it: drivebus --profile {_as_given(folder)} read {next(iter(new), 'P00.00')}")


def _as_given(folder: Path) -> str:
    """*folder* so that it is not taken for the name of a shipped profile."""
    text = str(folder)
    return text if folder.is_absolute() or len(folder.parts) > 1 else f"./{text}"


COMMANDS = [discover]
