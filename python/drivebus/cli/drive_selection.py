"""Which drives a command is for: one by its port and unit, several units of a line, or drives of `drivebus.toml`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

import drivebus
from drivebus.cli.names import completions, parse_units
from drivebus.cli.session import Session
from drivebus.cli.wrong_use import WrongUse
from drivebus.line.addresses import EVERYBODY

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from drivebus.site import Site, SiteDrive, SiteLine

__all__ = ["chosen", "complete_drive", "complete_port", "find_site", "of_drive"]

_NOT_WITH_NAMES = {
    "port": "--port",
    "baud": "--baud",
    "line_format": "--format",
    "rs485": "--rs485",
    "units": "--unit",
}
"""What `drivebus.toml` says of a drive."""


def chosen(context: click.Context, base: Session, names: Sequence[str], units: str, file: str | None) -> Session:
    """The session for what was named: *base* for one drive, with one of each in `several` where there are more.

    Raises:
        NotAllowed: `drivebus.toml` has a mistake, or no such drive.
        click.UsageError: A drive is named, and where it is as well; or a unit that the line has not.
    """
    if names:
        for parameter, option in _NOT_WITH_NAMES.items():
            if context.get_parameter_source(parameter) is ParameterSource.COMMANDLINE:
                raise WrongUse(f"--drive says where the drive is: leave {option} out", context)
        drives = find_site(file, needed=True).select(names)
        sessions = [of_drive(base, drive) for drive in drives]
    else:
        line = _line_called(base.port, file)
        if line is not None:
            base = _on(base, line, context)
        # Where no port is given, a command may have one of its own.
        addresses = EVERYBODY if base.port is None else base.addresses
        sessions = [replace(base, unit=unit) for unit in dict.fromkeys(parse_units(units, addresses))]
    if len(sessions) == 1:
        return sessions[0]
    looked_at = {one.port for one in sessions if one.may_only_look and not one.read_only}
    several = tuple(replace(one, beside_unit_0=one.port in looked_at) for one in sessions)
    return replace(base, several=several)


def find_site(file: str | None, needed: bool = False) -> Site:
    """What the `drivebus.toml` says that is named, or is in this folder, or among the user's settings.

    Raises:
        NotAllowed: It has a mistake.
        click.UsageError: There is none, and it is *needed*.
    """
    from pathlib import Path

    from drivebus.site import FILE, Site

    if file is not None:
        return Site.load(file)
    places = [Path(FILE), Path(click.get_app_dir("drivebus")) / FILE]
    place = next((place for place in places if place.exists()), None)
    if place is not None:
        return Site.load(place)
    if needed:
        raise WrongUse(f"there is neither {places[0]} in this folder nor {places[1]}: --drive takes names from there")
    return Site(places[0], {}, {}, {})


def _line_called(port: str | None, file: str | None) -> SiteLine | None:
    """The line that is called *port*, if it may be a name at all."""
    if port is None or not port.replace("_", "").replace("-", "").isalnum():
        return None
    there = os.path.exists(port)  # noqa: PTH110 - Path raises where a name is too long
    return None if there else find_site(file).lines.get(port)


def of_drive(base: Session, drive: SiteDrive) -> Session:
    """*base* for *drive*: what was typed of its family and variants goes before what the file says."""
    baud, line_format = _characters(base, drive.line)
    return replace(
        base,
        name=drive.name,
        port=drive.line.port,
        baud=baud,
        line_format=line_format,
        rs485=drive.line.rs485,
        unit=drive.unit,
        profile=base.profile or drive.profile,
        variants={**drive.variants, **base.variants},
        unverified=base.unverified or drive.unverified,
        read_only=base.read_only or drive.read_only,
        reserved=base.reserved or drive.line.reserved,
    )


def _on(base: Session, line: SiteLine, context: click.Context) -> Session:
    """*base* on *line*; settings that were typed stay."""

    def typed(parameter: str) -> bool:
        return context.get_parameter_source(parameter) is ParameterSource.COMMANDLINE

    baud, line_format = _characters(base, line)
    return replace(
        base,
        port=line.port,
        baud=base.baud if typed("baud") else baud,
        line_format=base.line_format if typed("line_format") else line_format,
        rs485=base.rs485 if typed("rs485") else line.rs485,
        reserved=base.reserved or line.reserved,
    )


def _characters(base: Session, line: SiteLine) -> tuple[int, tuple[str, str, str]]:
    bits = base.line_format if line.format is None else (line.format[0], line.format[1], line.format[2])
    return base.baud if line.baud is None else line.baud, bits


def complete_drive(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Names of drives and groups, for the shell."""
    return completions(name for name in _known(context, "drives", "groups") if name.startswith(incomplete))


def complete_port(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Names of lines, and files, for the shell."""
    lines = completions(name for name in _known(context, "lines") if incomplete and name.startswith(incomplete))
    return lines or completions([incomplete], "file")


def _known(context: click.Context, *sections: str) -> list[str]:
    try:
        site = find_site(context.find_root().params.get("config"))
    except drivebus.NotAllowed:
        return []
    return [name for section in sections for name in getattr(site, section)]
