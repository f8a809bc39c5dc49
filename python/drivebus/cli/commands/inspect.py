"""Commands that read, such as `status`, `read` and `scan`: nothing here writes to a drive."""

from __future__ import annotations

from typing import Any

import click
from click.core import ParameterSource
from rich.progress import Progress

import drivebus
from drivebus.cli import names
from drivebus.cli.commands import scan_search
from drivebus.cli.option_types import Seconds
from drivebus.cli.parallel import each_drive
from drivebus.cli.present import profile_rules
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.errors import exit_code, tell
from drivebus.cli.present.output import Output, counted, remark
from drivebus.cli.session import Session, pass_session
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


@click.command()
@click.option("--units", default="1-247", show_default=True, metavar="LIST", help="Addresses to ask, such as 1-31,40.")
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
    if search:
        if context.get_parameter_source("units") is not ParameterSource.DEFAULT:
            raise click.UsageError("--search decides itself which addresses it asks: leave --units out, or --search")
        if context.get_parameter_source("protocol") is not ParameterSource.DEFAULT:
            raise click.UsageError("--search decides itself how it asks: leave --protocol out, or --search")
        scan_search.search(session, timeout, full)
        return
    if full:
        raise click.UsageError("--full is for --search: give that too")
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
                _show_found(session, found)
            progress.advance(task)
        took = bus.now() - began
    if answered:
        count = len(answered)
        units_found = counted(count, "unit")
        session.out.say(f"{units_found}, {len(wanted) - count} silent, {took:.0f} s")
    else:
        remark(
            "Error: no unit answered. Check wiring (A/B), baud rate and format (factory setting of a Goodrive: "
            f"19200 8E1, unit 1). Or let `{session.doctor()}` look."
        )
        raise click.exceptions.Exit(3)


def _show_found(session: Session, found: drivebus.Found) -> None:
    if session.out.as_json:
        code = None if found.identification is None else f"{found.identification:#06x}"
        session.out.record({**vars(found), "identification": code})
        return
    if found.protocol != "modbus" and found.problem is not None:
        said = found.problem.removeprefix("it ")
        session.out.say(f"unit {found.unit}: {said}, {found.round_trip * 1000:.1f} ms")
        return
    family = found.profile or " or ".join(found.candidates) or "unknown family"
    if found.certainty == "shared" and found.profile is not None:
        others = (name for name in found.candidates if name != found.profile)
        family += f" (or {' or '.join(others)})"
    code = "" if found.identification is None else f", identification {found.identification:#06x}"
    sure = "" if found.certainty in ("certain", "unknown") else f", {found.certainty}"
    problem = f" ({found.problem})" if found.problem else ""
    session.out.say(f"unit {found.unit}: {family}{code}{sure}, {found.round_trip * 1000:.1f} ms{problem}")


@click.command()
@each_drive
def info(session: Session) -> None:
    """Show which drive it is and how sure that is, what is known about its family, and whether it obeys the bus."""
    out = session.out
    with session.bus() as bus:
        found = bus.identify(session.unit)
        facts: dict[str, Any] = {
            "unit": found.unit,
            "identification": None if found.code is None else f"{found.code:#06x}",
            "certainty": found.certainty,
            "reason": found.reason,
            "may_be": found.candidates if out.as_json else " or ".join(found.candidates),
            "port": bus.port,
            "line": f"{session.baud} {''.join(session.line_format)}",
        }
        try:
            drive = session.drive_on(bus)
        except drivebus.NotAllowed:
            out.facts(facts)
            raise
        control = drive.check_control()
        profile = drive.profile
        contradiction = drive.contradiction()
        against = None if contradiction is None else in_commands(contradiction)
        out.facts(
            {
                "unit": drive.unit,
                "profile": profile.name,
                "family": profile.family,
                "title": profile.title,
                "kind": profile.kind,
                **facts,
                "contradiction": against,
                "memory": "; ".join(profile_rules.memory(profile)),
                **_round_trip(bus, drive.unit, out.as_json),
                "status": _facts_of(drive.status()) if out.as_json else str(drive.status()),
                "obeys_bus": bool(control) if len(control) else None,
            }
        )
        if against is not None:
            remark(f"{against[0].upper()}{against[1:]}. Until then nothing is written to it.")
        elif found.candidates and profile.family not in found.candidates:
            remark(f"It is treated as {profile.family}, and does not say that it is one.")
        if not len(control):
            out.say("What makes it obey the bus is not known.")
            return
        if out.as_json:
            out.rows(
                ["code", "is", "needed", "ok", "verified", "label", "note"],
                [
                    [item.code, item.actual, item.wanted, item.ok, item.verified, item.label, item.note]
                    for item in control
                ],
            )
            return
        out.rows(
            ["code", "is", "needed", "ok", "label"],
            [[item.code, item.actual, item.wanted, item.ok, item.label] for item in control],
        )
        for item in control:
            if item.note:
                out.say(f"{item.code}{'' if item.verified else ' is not verified'}: {item.note}")


def _round_trip(bus: drivebus.Bus, unit: int, as_json: bool) -> dict[str, Any]:
    """How long an echo takes there and back: seconds in JSON, as everywhere. Nothing if the unit takes no echo."""
    try:
        seconds = bus.echo(unit)
    except drivebus.Refused:
        return {"round_trip": None}
    return {"round_trip": round(seconds, 6) if as_json else f"{seconds * 1e3:.1f} ms"}


def _facts_of(status: drivebus.Status) -> dict[str, Any]:
    """What *status* tells, by name, and what it does not, and why."""
    return {
        "state": status.state,
        "ready": status.ready,
        "frequency": status.frequency,
        "setpoint": status.setpoint,
        "commands_from": status.source,
        "motor": status.motor,
        "overload_alarm": status.overload_alarm,
        "fault": status.fault,
        "missing": dict(status.missing),
    }


@click.command()
@each_drive
def status(session: Session) -> None:
    """Show what the drive is doing: state, frequency, current, voltage, speed, fault.

    Missing values are named, with the reason.
    """
    out = session.out
    with session.drive() as drive:
        now = drive.status()
        measured = _measured(drive)
    values = _facts_of(now)
    if out.as_json:
        out.record({**values, **measured})
        return
    del values["missing"]
    if "state" in now.missing:
        values["state"] = None
    for name in ("frequency", "setpoint"):
        if values[name] is not None:
            values[name] = f"{values[name]:.2f} Hz"
    shown = {
        name: f"{drive.describe(name).text(value)} {drive.describe(name).unit}" for name, value in measured.items()
    }
    out.facts({**values, **shown})
    if now.missing:
        out.say("Missing:")
        out.facts(now.missing)
        if "state" in now.missing and drive.profile.state_reason() is not None and not drive.unverified:
            out.say("`--unverified` also shows what no document of this family proves.")


_MEASURED = ("output_current", "output_voltage", "bus_voltage", "rotation_speed")
"""What one wants to see of a motor besides, where the family has it."""


def _measured(drive: drivebus.Drive) -> dict[str, Any]:
    """What the drive measures at its motor, in one more read at most."""
    known = [name for name in _MEASURED if name in drive.profile.names() and _may_be_read(drive, name)]
    return {str(name): value for name, value in drive.snapshot(*known).items()} if known else {}


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
    rows: list[dict[str, Any]] = []
    failed: list[tuple[str, drivebus.DrivebusError]] = []
    with session.drive() as drive:
        places = [names.resolve(drive.profile, text) for text in wanted]
        # Nothing is asked where one of them is wrong; what a parameter of the drive decides has to be asked.
        drive.readable(*(name for name in places if isinstance(name, str) and drive.describe(name).variant is None))
        for place in places:
            row = _described(drive, place)
            try:
                row["value"] = value = _value(drive, place, row, verify)
                row["text"] = str(value) if isinstance(place, int) else drive.describe(place).text(value)
                bits = drive.profile.fields(place, int(value)) if isinstance(place, str) else {}
                if bits:
                    row["bits"] = bits
            except drivebus.DrivebusError as error:
                failed.append((row["name"], error))
                row |= {"error": in_commands(error), "exit_code": exit_code(error)}
            rows.append(row)
    _show_read(session.out, rows)
    for name, reason in failed:
        tell(reason, name)
    session.advise(*(reason for _, reason in failed))
    if failed:
        raise click.exceptions.Exit(exit_code(failed[0][1]))


def _described(drive: drivebus.Drive, place: str | int) -> dict[str, Any]:
    """What is known of a name, or of an address without one, before it is asked."""
    if isinstance(place, int):
        return {"name": f"{place:04X}H", "value": None, "unit": "", "label": "unknown register", "evidence": None}
    known = drive.describe(place)
    return {
        "name": known.code or known.name,
        "value": None,
        "unit": known.unit,
        "label": known.label,
        "evidence": names.evidence(drive.profile, known),
    }


def _value(drive: drivebus.Drive, place: str | int, row: dict[str, Any], verify: bool) -> Any:
    if isinstance(place, str):
        return drive.read(place, verify=verify)
    [word] = drive.read_words(place, verify=verify)
    row["label"] += f", raw {word:#06x}"
    return word


def _show_read(out: Output, rows: list[dict[str, Any]]) -> None:
    """Every row as JSON; for people, those that came."""
    if out.as_json:
        for row in rows:
            row.pop("text", None)
            out.record(row)
        return
    came = [row for row in rows if "error" not in row]
    columns = ["name", "value", "unit", "label", "evidence"]
    if all(row["evidence"] in ("verified", None) for row in came):
        columns.remove("evidence")
    if came:
        out.rows(columns, [[row["text" if column == "value" else column] for column in columns] for row in came])
    for row in came:
        if "bits" in row:
            out.say(f"{row['name']}: {', '.join(f'{name} = {meaning}' for name, meaning in row['bits'].items())}")


COMMANDS = [ports, scan, info, status, read]
