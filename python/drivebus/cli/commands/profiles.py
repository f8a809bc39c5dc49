"""`drivebus profiles`: the families that are known, what is known of each, and help for who writes one."""

from __future__ import annotations

from pathlib import Path

import click

import drivebus
from drivebus.cli import profile_template
from drivebus.cli.halts_elsewhere import started_by
from drivebus.cli.names import complete_profile
from drivebus.cli.option_types import Place
from drivebus.cli.present.families import KINDS, Families, FamilyRules, Mistakes
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, pass_session
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
@pass_session
@click.pass_context
def check(context: click.Context, session: Session, folder: Path) -> None:
    """Check the profile in FOLDER. Each mistake is named with its file, its line, and what would be right.

    Ends with exit code 2 if there are mistakes. A warning says which halts of it start a shipped family: that is no
    mistake, but a drive of that family at this address would run. A profile is read, never executed.
    """
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
@pass_session
def new(session: Session, folder: Path, like: str | None, overlay: str | None) -> None:
    """Start a profile: write its files, with comments that explain them. Nothing is overwritten."""
    if like is not None and overlay is not None:
        raise WrongUse("give --like or --overlay, not both: a profile is either a copy or an overlay")
    base = like or overlay
    if base is not None:
        drivebus.Profile.builtin(base)
    try:
        written = profile_template.files(folder.resolve().name, like=like, overlay=overlay)
        there = [name for name in written if (folder / name).exists() or (folder / name).is_symlink()]
        if there:
            raise WrongUse(f"{folder} has {', '.join(there)} already; nothing was written")
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in written.items():
            with (folder / name).open("x", encoding="utf-8", newline="\n") as file:
                file.write(text)
    except OSError as error:
        raise WrongUse(f"{error.filename or folder}: {error.strerror or error}") from error
    session.out.record({"folder": str(folder), "files": list(written)})
    session.out.say(f"{folder}: {', '.join(written)}")
    session.out.say(f"Fill them in, then: drivebus profiles check {folder}")


@profiles.command()
def schema() -> None:
    """Print the JSON schema of profile.toml. With it, an editor knows the keys and marks wrong ones while you type.

    `drivebus profiles new` puts it beside the files that it writes.
    """
    click.echo(drivebus.Profile.schema(), nl=False)


COMMANDS = [profiles]
