"""`drivebus stop --all`: every drive that is known on a line, or on all lines of `drivebus.toml`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import click
from click.core import ParameterSource

import drivebus
from drivebus.cli.drive_selection import find_site, of_drive
from drivebus.cli.parallel import Crew
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, is_another
from drivebus.cli.wrong_use import WrongUse
from drivebus.site import families_on, forget

__all__ = ["stop_all"]

_Done = Callable[[Session, drivebus.Drive], None]


def stop_all(context: click.Context, session: Session, within: float, done: _Done) -> None:
    """Stops all drives of the line that the options name, or of all lines of `drivebus.toml` where they name none.

    Args:
        context: Of the command.
        session: The options before it.
        within: Seconds for which a drive is told until it takes it.
        done: Says what a drive does that was told to stop.

    Raises:
        click.UsageError: Drives are named as well, or there is no line.
        NotAllowed: No drive is known there.
        NotStopped: Some were not proved to stop.
    """
    root = context.find_root()
    for parameter, option in (("units", "--unit"), ("drives", "--drive")):
        if root.get_parameter_source(parameter) is ParameterSource.COMMANDLINE:
            raise WrongUse(f"--all stops every drive that is known: leave {option} out, or --all", context)
    session = replace(session, several=()) if session.several else session
    lines = _lines(context, session)
    if len(lines) == 1:
        _stop_line(*lines[0], within, done)
        return
    by_session = {line.called: drives for line, drives in lines}
    crew = Crew([line for line, _ in lines])
    crew.run(lambda line: _stop_line(line, by_session[line.called], within, done))


def _lines(context: click.Context, session: Session) -> list[tuple[Session, dict[int, Session]]]:
    """Each line, with a session for each drive that is known on it."""
    file = context.find_root().params.get("config")
    site = find_site(file)
    lines: dict[str, tuple[Session, dict[int, Session]]] = {}
    if session.port is not None:
        lines[session.port] = session, {}
    for drive in site.drives.values():
        if session.port not in (None, drive.line.port):
            continue
        one = of_drive(session, drive)
        line, drives = lines.setdefault(
            drive.line.port,
            (replace(one, name=drive.line.name, profile=session.profile, read_only=session.read_only), {}),
        )
        drives.setdefault(drive.unit, one)
    for port, (line, drives) in lines.items():
        for unit in families_on(port):
            # A reserved one was asked for by name when it was kept.
            reserved = line.reserved or bool(line.addresses.why_not(unit))
            drives.setdefault(unit, replace(line, name="", unit=unit, reserved=reserved))
    if not lines:
        session.one_port()
    return list(lines.values())


def _stop_line(line: Session, drives: dict[int, Session], within: float, done: _Done) -> None:
    """Stops the *drives* of one line: those whose family is known at once, the others when they have told it."""
    if not drives:
        raise drivebus.BadArgument(
            f"no drive is known on {line.port}, so nobody was told to stop. Name them: `{line.command('stop --unit')} "
            "1-4`; `drivebus scan` finds them. If a motor must stop now, use the emergency stop"
        )
    drives = {unit: replace(one, crew=line.crew, out=line.out) for unit, one in drives.items()}
    failures: dict[int, drivebus.DrivebusError] = {}
    for unit, one in drives.items():
        try:
            one.will_write()
        except drivebus.NotAllowed as error:
            failures[unit] = error
    allowed = {unit: one for unit, one in drives.items() if unit not in failures}
    has_reserved = any(one.reserved for one in allowed.values())
    with line.bus(read_only=line.read_only, reserved=has_reserved) as bus:
        families = families_on(str(line.port))
        known = {
            unit: bus.drive(
                unit, one.profile or families[unit], unverified=one.unverified, variants=one.variants or None
            )
            for unit, one in allowed.items()
            if one.profile is not None or families.get(unit) in drivebus.profiles()
        }
        if known:
            try:
                bus.stop_all(within=within)
            except drivebus.NotStopped as error:
                failures |= error.failures
        for unit, one in allowed.items():
            drive = known.get(unit)
            try:
                if drive is not None and one.profile is None and is_another(drive):
                    forget(str(one.port), unit)
                    # What it shows was halted, if it was; else it is asked what it is.
                    drive = one.as_it_shows(bus, drive) if unit not in failures else None
                if drive is None:
                    drive = one.drive_on(bus, urgent=True)
                    drive.stop(within=within)
                    failures.pop(unit, None)
                if unit not in failures:
                    done(one, drive)
            except drivebus.DrivebusError as error:
                failures[unit] = error
    if failures:
        names = ", ".join(drives[unit].called for unit in failures)
        for unit, failure in failures.items():
            remark(f"{drives[unit].called}: {failure}")
        raise drivebus.NotStopped(
            f"{len(drives) - len(failures)} of {len(drives)} drives were proved to stop; not proved: {names}",
            failures=failures,
        )
