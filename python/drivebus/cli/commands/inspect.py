"""Commands that read, such as `status`, `read` and `scan`: nothing here writes to a drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import click
from click.core import ParameterSource
from rich.progress import Progress

import drivebus
from drivebus.cli import names
from drivebus.cli.commands import scan_search
from drivebus.cli.each_drive import each_drive
from drivebus.cli.option_types import Seconds
from drivebus.cli.present.drive_facts import DriveStatus, Identity, KnownDrive, Reading, Readings
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.errors import exit_code, tell
from drivebus.cli.present.found_units import FoundUnit
from drivebus.cli.present.output import counted, remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse
from drivebus.line import huanyang
from drivebus.line.scan_order import PROTOCOLS, asked

__all__ = ["COMMANDS"]


@click.command()
@pass_session
def ports(session: Session) -> None:
    """List the serial ports, and the adapters that are plugged in."""
    found = drivebus.ports()
    if not found:
        session.out.say("No serial port found. Is the adapter plugged in? Try `drivebus demo` without one.")
    session.out.rows(
        ["port", "description", "serial_number", "hardware"],
        [[port.path, port.description, port.serial_number, port.hardware] for port in found],
    )


_EVERYBODY = "1-247"
"""The addresses that a scan asks, if nobody says which."""


@click.command()
@click.option(
    "--units",
    default=_EVERYBODY,
    show_default=True,
    metavar="LIST",
    help="Addresses to ask, such as 1-31,40; --unit and -u mean the same here.",
)
@click.option("--timeout", type=Seconds(0.001, 3600), help="Seconds to wait for each answer.  [default: 0.1]")
@click.option(
    "--search",
    is_flag=True,
    help="Also find out the baud rate and the format, the likeliest first. Takes about a minute.",
)
@click.option("--full", is_flag=True, help="With --search: try every address at every setting. Takes 20 minutes.")
@click.option(
    "--protocol",
    type=click.Choice(PROTOCOLS),
    default="auto",
    show_default=True,
    help="Ask in Modbus, in Huanyang's own protocol, or in both where nobody answers.",
)
@pass_session
@click.pass_context
def scan(
    context: click.Context,
    session: Session,
    units: str,
    timeout: float | None,
    search: bool,
    full: bool,
    protocol: str,
) -> None:
    """Find the drives on the line. Each address is asked once.

    With --search, nothing needs to be known of the line: baud rate, format and address are found. Only reads are sent.
    The port must be free, because its settings change.
    """
    session, units = _units_to_ask(context, session, units)
    if search:
        if units != _EVERYBODY:
            raise WrongUse("--search decides itself which addresses it asks: leave --units out, or --search")
        if context.get_parameter_source("protocol") is not ParameterSource.DEFAULT:
            raise WrongUse("--search decides itself how it asks: leave --protocol out, or --search")
        scan_search.search(session, timeout, full)
        return
    if full:
        raise WrongUse("--full is for --search: give that too")
    session.one_port()
    wanted = names.parse_units(units, session.addresses)
    # On the console that the lines go to, so that they stand above the bar.
    bar = Progress(console=session.out.console, transient=True, disable=not session.out.live)
    with session.bus() as bus, bar as progress:
        began = bus.now()
        task = progress.add_task("asking", total=len(wanted))
        answered: list[drivebus.Found] = []
        for unit, foreign in asked(wanted, protocol, answered):
            if foreign:
                progress.update(task, description="asking in Huanyang's own protocol")
            for found in bus.scan([unit], timeout, protocol="huanyang" if foreign else "modbus"):
                answered.append(found)
                session.keep_found(found)
                session.out.render(FoundUnit(found))
            progress.advance(task)
        took = bus.now() - began
    if answered:
        count = len(answered)
        units_found = counted(count, "unit")
        session.out.say(f"{units_found}, {len(wanted) - count} silent, {took:.0f} s")
    else:
        remark(
            "Error: no unit answered. Check power and wiring (swap A and B), or find baud rate, format and address: "
            f"`{session.for_line('scan --search')}`. `{session.doctor()}` looks at adapter and line."
        )
        raise click.exceptions.Exit(3)


def _units_to_ask(context: click.Context, session: Session, units: str) -> tuple[Session, str]:
    """The session for the line alone, and which units are asked: those of `-u`, where that was typed, too."""
    root = context.find_root()
    if root.params.get("drives") or root.get_parameter_source("units") is not ParameterSource.COMMANDLINE:
        return session, units
    if context.get_parameter_source("units") is not ParameterSource.DEFAULT:
        raise WrongUse("--unit and --units both say which addresses are asked: leave one of them out")
    return replace(session, several=()), str(root.params["units"])


@click.command()
@each_drive
def info(session: Session) -> None:
    """Show which drive it is and how sure that is, what is known about its family, and whether it obeys the bus."""
    with session.bus() as bus:
        found = _identified(session, bus)
        identity = Identity(found, bus.port, f"{session.baud} {''.join(session.line_format)}")
        try:
            drive = session.drive_on(bus)
        except drivebus.NotAllowed:
            session.out.render(replace(identity, device=_device(bus, found)))
            raise
        control = drive.check_control()
        contradiction = drive.contradiction()
        against = None if contradiction is None else in_commands(contradiction)
        known = KnownDrive(identity, drive.profile, against, _round_trip(bus, drive.unit), drive.status(), control)
    session.out.render(known)
    if against is not None:
        remark(f"{against[0].upper()}{against[1:]}. Until then nothing is written to it.")
    elif found.candidates and known.profile.family not in found.candidates and known.profile.identifications():
        remark(f"Using profile {known.profile.name}; the drive does not report its family.")


def _identified(session: Session, bus: drivebus.Bus) -> drivebus.Identification:
    """What the unit says that it is; one that is named as a drive of another protocol is asked nothing of Modbus."""
    named = None if session.profile is None else drivebus.Profile.find(session.profile)
    if named is None or named.requests().protocol == "modbus":
        return bus.identify(session.unit)
    reason = f"it is named as a drive that speaks {huanyang.NAME}, in which none says what it is"
    return drivebus.Identification(session.unit, (named.name,), named.name, None, named.title, "unknown", reason)


def _device(bus: drivebus.Bus, found: drivebus.Identification) -> drivebus.DeviceIdentification | None:
    """Who made a unit of which nothing else is known, if it says so; no other is asked."""
    if found.candidates:
        return None
    try:
        return bus.device_identification(found.unit)
    except (drivebus.Refused, drivebus.NoAnswer, drivebus.BadAnswer):
        return None


def _round_trip(bus: drivebus.Bus, unit: int) -> float | None:
    """Seconds that an echo takes there and back; None if the unit takes no echo."""
    try:
        return bus.echo(unit)
    except (drivebus.Refused, drivebus.NotAllowed):
        return None


@click.command()
@each_drive
def status(session: Session) -> None:
    """Show what the drive is doing: state, frequency, current, voltage, speed, fault.

    Missing values are named, with the reason.
    """
    with session.drive() as drive:
        now = drive.status()
        measured = _measured(drive)
        assumed, besides = _assumed(drive, now, measured)
    described = {name: drive.describe(name) for name in (*measured, *besides)}
    session.out.render(DriveStatus(now, measured, described, assumed, besides))


_MEASURED = ("output_current", "output_voltage", "bus_voltage", "rotation_speed")
"""What one wants to see of a motor besides, where the family has it."""


def _measured(drive: drivebus.Drive) -> dict[str, Any]:
    """What the drive measures at its motor, in one more read at most."""
    known = [name for name in _MEASURED if name in drive.profile.names() and _may_be_read(drive, name)]
    return {str(name): value for name, value in drive.snapshot(*known).items()} if known else {}


def _assumed(
    drive: drivebus.Drive, now: drivebus.Status, measured: Mapping[str, Any]
) -> tuple[drivebus.Status | None, dict[str, Any]]:
    """What registers tell besides that are only assumed: to read them harms nobody, and they are shown as such.

    Nothing of that where it tells no more, or the drive does not answer it.
    """
    roles = [role for role in ("state", "fault", "frequency", "setpoint") if role in now.missing]
    if drive.unverified or not any(drive.profile.role(role) for role in roles):
        return None, {}
    names = [name for name in _MEASURED if name in drive.profile.names() and name not in measured]
    try:
        status = drive.status(unverified=True)
        besides = drive.snapshot(*names, unverified=True) if names else {}
    except drivebus.DrivebusError:
        return None, {}
    return (status if len(status.missing) < len(now.missing) else None), dict(besides)


def _may_be_read(drive: drivebus.Drive, name: str) -> bool:
    try:
        return bool(drive.readable(name))
    except drivebus.NotAllowed:
        return False


@click.command()
@click.argument("wanted", metavar="NAME...", nargs=-1, required=True, shell_complete=names.complete_name)
@click.option("--verify", is_flag=True, help="Ask twice; both answers must agree.")
@each_drive
def read(session: Session, wanted: tuple[str, ...], verify: bool) -> None:
    """Read registers or parameters: by name, code (P00.11) or address (3004H, 0x3004).

    Values that could be read are shown even if others fail. Failures are reported on standard error and set the exit
    code.
    """
    rows: list[Reading] = []
    with session.drive() as drive:
        places = [names.resolve(drive.profile, text) for text in wanted]
        # Nothing is asked where one of them is wrong; what a parameter of the drive decides has to be asked.
        drive.readable(*(name for name in places if isinstance(name, str) and drive.describe(name).variant is None))
        for place in places:
            rows.append(_described(drive, place))
            try:
                _read(drive, place, rows[-1], verify)
            except drivebus.DrivebusError as error:
                rows[-1].error = error
    session.out.render(Readings(rows))
    failed = [(row.name, row.error) for row in rows if row.error is not None]
    for name, reason in failed:
        tell(reason, name)
    session.advise(*(reason for _, reason in failed))
    if failed:
        raise click.exceptions.Exit(exit_code(failed[0][1]))


def _described(drive: drivebus.Drive, place: str | int) -> Reading:
    """What is known of a name, or of an address without one, before it is asked."""
    if isinstance(place, int):
        return Reading(f"{place:04X}H", "", "unknown register", None)
    known = drive.describe(place)
    return Reading(known.code or known.name, known.unit, known.label, names.evidence(drive.profile, known))


def _read(drive: drivebus.Drive, place: str | int, row: Reading, verify: bool) -> None:
    """Asks for what *row* is to have."""
    if isinstance(place, int):
        [word] = drive.read_words(place, verify=verify)
        row.label += f", raw {word:#06x}"
        row.value, row.text = word, str(word)
        return
    came = drive.snapshot(place, verify=verify)
    row.value = value = came[place]
    row.unit = came.units[place]
    known = drive.describe(place)
    # What one count is, the profile says alone of what no parameter of the drive decides.
    row.text = known.text(value) if known.variant is None else f"{value:.6g}"
    # What is below zero is no word of bits.
    row.bits = drive.profile.fields(place, int(value)) if value >= 0 else None


COMMANDS = [ports, scan, info, status, read]
