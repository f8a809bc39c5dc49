"""The command that asks a drive which parameters it has."""

from __future__ import annotations

from pathlib import Path

import click

from drivebus.backup.unread import in_words
from drivebus.cli.option_types import Place
from drivebus.cli.present.discoveries import Discovered
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
    session.out.render(Discovered(found, folder, session.called))
    if found.doubtful:
        session.out.remark(
            f"{', '.join(found.doubtful)}: the drive answers alike to whatever is asked there, also to numbers that no "
            "parameter has. Nothing of it was taken."
        )
    if not found.complete:
        remark(
            f"Of {counted(len(found.unsettled), 'number')} it is not settled whether the drive has them: "
            f"{in_words(found.unsettled.values())}. The same command asks for them again."
        )
        raise click.exceptions.Exit(1)


COMMANDS = [discover]
