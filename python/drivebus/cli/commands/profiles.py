"""`drivebus profiles`: the families that are known, what is known of each, and help for who writes one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import drivebus
from drivebus.cli import profile_template
from drivebus.cli.halts_elsewhere import started_by
from drivebus.cli.names import complete_profile
from drivebus.cli.option_types import Place
from drivebus.cli.present import profile_rules
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]

KINDS = ("registers", "parameters", "faults")


@click.group(cls=Listing, invoke_without_command=True)
@pass_session
@click.pass_context
def profiles(context: click.Context, session: Session) -> None:
    """List the families of drives that are known. Subcommands show one, check one, or start one of your own."""
    if context.invoked_subcommand is not None:
        return
    rows: list[list[Any]] = []
    for name in drivebus.profiles():
        profile = drivebus.Profile.builtin(name)
        counts = profile.counts()
        totals = [counts[kind]["total"] for kind in KINDS]
        share = _printed(counts)
        if session.out.as_json:
            doubtful = [sum(counts[kind][how] for kind in KINDS) for how in ("unverified", "assumed")]
            rows.append([name, profile.title, profile.kind, *totals, share, *doubtful])
        else:
            rows.append([name, profile.title, sum(totals), "" if share is None else f"{int(share * 100)} %"])
    if session.out.as_json:
        session.out.rows(["name", "title", "kind", *KINDS, "verified", "unverified", "assumed"], rows)
        return
    session.out.rows(["name", "title", "rows", "verified"], rows)
    session.out.say(
        "rows: registers, parameters and faults that are known. verified: those that a document of this very family "
        "prints. `drivebus profiles show NAME` counts those that are unverified and assumed, and has more."
    )


def _printed(counts: dict[str, dict[str, int]]) -> float | None:
    """The share of rows that a document of the family itself prints, 0.0 to 1.0; None where there are no rows."""
    total = sum(counts[kind]["total"] for kind in KINDS)
    doubtful = sum(counts[kind]["unverified"] + counts[kind]["assumed"] for kind in KINDS)
    return round((total - doubtful) / total, 3) if total else None


@profiles.command()
@click.argument("family", shell_complete=complete_profile)
@pass_session
def show(session: Session, family: str) -> None:
    """Show the rules of a family (or a folder) in words, and how well its rows are known."""
    profile = drivebus.Profile.find(family)
    counts = profile.counts()
    if session.out.as_json:
        session.out.record({**profile_rules.known(profile), "counts": counts})
        return
    for title, lines in profile_rules.in_words(profile):
        session.out.heading(title)
        for line in lines:
            session.out.say(f"  {line}")
    session.out.heading("Rows, and how well they are known")
    session.out.rows(profile_rules.COUNTED, [profile_rules.counted(kind, counts[kind]) for kind in KINDS])


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
    for problem in problems:
        if session.out.as_json:
            session.out.record(problem)
        else:
            session.out.say(_placed(problem))
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


def _placed(problem: dict[str, Any]) -> str:
    where = problem["file"] if problem["line"] is None else f"{problem['file']}, line {problem['line']}"
    return f"{where}: {problem['reason']}"


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
        raise click.UsageError("give --like or --overlay, not both: a profile is either a copy or an overlay")
    base = like or overlay
    if base is not None:
        drivebus.Profile.builtin(base)
    try:
        written = profile_template.files(folder.resolve().name, like=like, overlay=overlay)
        there = [name for name in written if (folder / name).exists() or (folder / name).is_symlink()]
        if there:
            raise click.UsageError(f"{folder} has {', '.join(there)} already; nothing was written")
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in written.items():
            with (folder / name).open("x", encoding="utf-8", newline="\n") as file:
                file.write(text)
    except OSError as error:
        raise click.UsageError(f"{error.filename or folder}: {error.strerror or error}") from error
    if session.out.as_json:
        session.out.record({"folder": str(folder), "files": list(written)})
    else:
        session.out.say(f"{folder}: {', '.join(written)}")
        session.out.say(f"Fill them in, then: drivebus profiles check {folder}")


@profiles.command()
def schema() -> None:
    """Print the JSON schema of profile.toml. With it, an editor knows the keys and marks wrong ones while you type.

    `drivebus profiles new` puts it beside the files that it writes.
    """
    click.echo(drivebus.Profile.schema(), nl=False)


COMMANDS = [profiles]
