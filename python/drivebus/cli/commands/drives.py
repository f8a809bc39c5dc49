"""`drivebus drives`: the drives one owns, by the names that `drivebus.toml` gives them."""

from __future__ import annotations

import click

import drivebus
from drivebus.cli.drive_selection import find_site
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]


@click.command()
@pass_session
@click.pass_context
def drives(context: click.Context, session: Session) -> None:
    """List the drives of drivebus.toml with their lines and groups. No drive is asked."""
    out = session.out
    site = find_site(context.find_root().params.get("config"), needed=True)
    rows = [
        [
            drive.name,
            drive.line.name,
            drive.line.port,
            drive.unit,
            drive.profile,
            ", ".join(name for name, members in site.groups.items() if drive in members),
        ]
        for drive in site.drives.values()
    ]
    if not rows:
        raise drivebus.BadArgument(f"{site.path} names no drive; give it a table such as [drives.pump1]")
    out.rows(["drive", "line", "port", "unit", "profile", "groups"], rows)


COMMANDS = [drives]
