"""Commands that only look: nothing here writes to a drive."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import click
from rich.live import Live
from rich.progress import Progress

import drivebus
from drivebus.cli import names
from drivebus.cli.output import Output
from drivebus.cli.session import Session, pass_session

__all__ = ["COMMANDS"]


@click.command()
@pass_session
def ports(session: Session) -> None:
    """List serial ports, with what is plugged in."""
    from serial.tools import list_ports

    found = sorted(list_ports.comports())
    if not found:
        session.out.say("No serial port found. Is the adapter plugged in? Try `drivebus demo` without one.")
    session.out.rows(
        ["port", "description", "serial_number", "hardware"],
        [[port.device, port.description, port.serial_number, port.hwid] for port in found],
    )


@click.command()
@click.option("--units", default="1-247", show_default=True, metavar="LIST", help="Which to ask, such as 1-31,40.")
@click.option("--timeout", type=float, help="Seconds each is given.  [default: 0.1]")
@pass_session
def scan(session: Session, units: str, timeout: float | None) -> None:
    """Find the drives on the line, by one read each."""
    wanted = names.parse_units(units)
    count = 0
    with session.bus() as bus, Progress(transient=True, disable=not session.out.live) as progress:
        task = progress.add_task("asking", total=len(wanted))
        for unit in wanted:
            for found in bus.scan([unit], timeout):
                count += 1
                _show_found(session, found)
            progress.advance(task)
    if not count:
        click.echo(
            "Error: no unit answered. Check wiring (A/B), baud rate and format (factory setting of a Goodrive: "
            "19200 8E1, unit 1).",
            err=True,
        )
        raise click.exceptions.Exit(3)


def _show_found(session: Session, found: drivebus.Found) -> None:
    if session.out.as_json:
        session.out.record(vars(found))
        return
    code = "" if found.identification is None else f", identification {found.identification:#06x}"
    problem = f" ({found.problem})" if found.problem else ""
    session.out.say(
        f"unit {found.unit}: {found.profile or 'unknown family'}{code}, {found.round_trip * 1000:.1f} ms{problem}"
    )


@click.command()
@pass_session
def info(session: Session) -> None:
    """Say what the drive is, and whether it is set to obey the bus."""
    with session.bus() as bus:
        drive = session.drive_on(bus)
        control = drive.check_control()
        session.out.facts(
            {
                "unit": drive.unit,
                "profile": drive.profile.name,
                "title": drive.profile.title,
                "identification": f"{int(drive.read('identification_code')):#06x}",
                "port": bus.port,
                "line": f"{session.baud} {''.join(session.line_format)}",
                "round_trip_ms": round(bus.echo(drive.unit) * 1000, 3),
                "status": str(drive.status()),
                "obeys_bus": bool(control),
            }
        )
        session.out.rows(
            ["code", "is", "needed", "ok", "verified", "label"],
            [[item.code, item.actual, item.wanted, item.ok, item.verified, item.label] for item in control],
        )


@click.command()
@pass_session
def status(session: Session) -> None:
    """Say what the drive is doing."""
    with session.drive() as drive:
        now = drive.status()
        session.out.facts(
            {
                "state": now.state if session.out.as_json else str(now.state),
                "ready": now.ready,
                "frequency": now.frequency if session.out.as_json else f"{now.frequency:.2f} Hz",
                "setpoint": now.setpoint if session.out.as_json else f"{now.setpoint:.2f} Hz",
                "commands_from": now.source,
                "motor": now.motor,
                "overload_alarm": now.overload_alarm,
                "fault": now.fault,
            }
        )


@click.command()
@click.argument("wanted", metavar="[NAME]...", nargs=-1, shell_complete=names.complete_name)
@click.option("--interval", type=names.Seconds(0), default=0.5, show_default=True, help="Seconds between samples.")
@click.option("--count", type=click.IntRange(1), help="Samples to take; without it, until Ctrl-C.")
@pass_session
def monitor(session: Session, wanted: tuple[str, ...], interval: float, count: int | None) -> None:
    """Watch registers as they change: all monitor registers, or those named."""
    out = session.out
    with session.drive() as drive:
        profile = drive.profile
        known = [names.named(profile, text) for text in wanted]
        taken = 0
        with Live(console=out.console, auto_refresh=False) if out.live else nullcontext() as live:
            try:
                while True:
                    _show_sample(out, live, drive.monitor(*known))
                    taken += 1
                    if taken == count:
                        return
                    drive.bus.sleep(interval)
            except KeyboardInterrupt:
                return


def _show_sample(out: Output, live: Live | None, snapshot: drivebus.Snapshot) -> None:
    if live is not None:
        rows = [[name, value, snapshot.units[name]] for name, value in snapshot.items()]
        live.update(out.table(["register", "value", "unit"], rows), refresh=True)
    elif out.as_json:
        out.record({"time": snapshot.time, **snapshot})
    else:
        pairs = (f"{name}={value}{snapshot.units[name]}" for name, value in snapshot.items())
        out.say(f"{snapshot.time:.3f} {' '.join(pairs)}")


@click.command()
@click.argument("wanted", metavar="NAME...", nargs=-1, required=True, shell_complete=names.complete_name)
@click.option("--verify", is_flag=True, help="Ask twice; both answers must agree.")
@pass_session
def read(session: Session, wanted: tuple[str, ...], verify: bool) -> None:
    """Read registers or parameters: by name, code (P00.11) or address (3004H, 0x3004)."""
    with session.drive() as drive:
        profile = drive.profile
        rows: list[list[Any]] = []
        for text in wanted:
            place = names.resolve(profile, text)
            if isinstance(place, int):
                [word] = drive.read_words(place, verify=verify)
                rows.append([f"{place:04X}H", word, "", f"unknown register, raw {word:#06x}"])
            else:
                known = drive.describe(place)
                value = drive.read(place, verify=verify)
                rows.append([known.code or known.name, value, known.unit, known.label])
        session.out.rows(["name", "value", "unit", "label"], rows)


COMMANDS = [ports, scan, info, status, monitor, read]
