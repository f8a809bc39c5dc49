"""`drivebus serve`: the lines of `drivebus.toml` as a service, for programs and for clients over the network."""

from __future__ import annotations

import signal
from contextlib import suppress
from datetime import datetime, timezone
from types import FrameType
from typing import Any

import click

from drivebus.cli.drive_selection import find_site
from drivebus.cli.option_types import Seconds
from drivebus.cli.present.output import counted, remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse
from drivebus.end_signals import END_SIGNALS

__all__ = ["COMMANDS"]


@click.command()
@click.argument("file", required=False)
@click.option("--check", "checks", is_flag=True, help="Say what is wrong in the file, and end. Nothing is opened.")
@click.option("--status", "shows", is_flag=True, help="Say how the service does that runs, and end.")
@click.option(
    "--password", "asks", is_flag=True, help="Ask for a password, print what stands for it in the file, and end."
)
@click.option("--for", "duration", type=Seconds(0), metavar="SECONDS", help="Stop after so long.")
@click.pass_context
@pass_session
def serve(
    session: Session,
    context: click.Context,
    file: str | None,
    checks: bool,
    shows: bool,
    asks: bool,
    duration: float | None,
) -> None:
    """Serve the lines of drivebus.toml, or of FILE, until Ctrl-C or SIGTERM: for a service.

    Other programs use the lines through it, and clients of Modbus TCP as [[share.tcp]] says. What happens is told on
    standard error. A motor that a client set in motion is halted when the service ends.
    """
    from drivebus import service

    if checks + shows + asks > 1:
        raise WrongUse(
            "--check looks at the file, --status at the service, and --password at neither: give one of them"
        )
    if asks:
        _ask(session)
        return
    config = context.find_root().params.get("config")
    if file is not None and config is not None:
        raise WrongUse(f"{file} and --config {config} are two files: give one of them")
    site = find_site(file or config, needed=True)
    if shows:
        _show(session, service.read_status(site))
        return
    if not site.lines:
        raise WrongUse(f"{site.path} has no lines to serve: name them as [lines.NAME]")
    if checks:
        service.check(site)
        lines, gateways, hours = len(site.lines), len(site.share.gateways), service.hours_of(site)
        session.out.record({"file": str(site.path), "lines": lines, "gateways": gateways, "spool_hours": hours})
        session.out.say(f"{site.path}: {counted(lines, 'line')}, {counted(gateways, 'gateway')}: no mistake")
        if hours is not None:
            session.out.say(f"the spool holds {hours:,.0f} hours of samples, or more where values stay the same")
        return
    served = service.Service(site, remark)

    def end(_number: int, _frame: FrameType | None) -> None:
        served.end()

    for number in [*END_SIGNALS, signal.SIGINT]:
        signal.signal(number, end)
    with suppress(KeyboardInterrupt):
        served.run(duration)


def _ask(session: Session) -> None:
    """Asks twice for a password, without showing it, and prints the line for the file."""
    from drivebus.web import LEAST, hashed

    password = click.prompt("Password of who may log in", hide_input=True, confirmation_prompt="Once more", err=True)
    if len(password) < LEAST:
        raise WrongUse(f"that is too short: a password has {LEAST} characters or more")
    told = hashed(password)
    session.out.record({"password": told})
    session.out.say(f'password = "{told}"')


def _show(session: Session, status: dict[str, Any]) -> None:
    session.out.record(status)
    session.out.say(f"process {status['process']}, at {status['time']}")
    moment = datetime.now(timezone.utc).timestamp()
    for name, line in status["lines"].items():
        if not line["open"]:
            session.out.say(f"{name}: {line['port']} is away: {line['why']}")
            continue
        session.out.say(
            f"{name}: {line['port']}, {line['occupied']:.0%} occupied, {counted(line['requests'], 'request')}, "
            f"{line['timeouts']} without an answer"
        )
        for program in line["programs"]:
            session.out.say(
                f"{name}: {program['name']}, {counted(program['calls'], 'request')}, {program['answered']} answered"
            )
        for address, of in line["gateways"].items():
            session.out.say(
                f"{name}: {address}, {counted(of['clients'], 'client')}, {counted(of['requests'], 'request')}: "
                f"{of['answered']} answered, {of['failed']} failed, {of['late']} late, {of['refused']} refused, "
                f"{of['written']} written, {of['halted']} halted"
            )
        for drive, asked in line["drives"].items():
            age = max(moment - asked["time"], 0.0)
            session.out.say(
                f"{name}: {drive}, asked {age:.1f} s ago{': ' + asked['missing'] if asked['missing'] else ''}"
            )
        for hint in line["hints"]:
            session.out.say(f"{name}: {hint}")
    for name, outlet in status["outlets"].items():
        session.out.say(f"{name}: {_outlet_in_words(outlet)}")
    if status["spool"] is not None:
        session.out.say(f"spool: {status['spool']['last']} samples, {status['spool']['lost']} lost")


def _outlet_in_words(outlet: dict[str, Any]) -> str:
    """How something does that is told how the plant is."""
    is_well = outlet.get("connected", outlet.get("open", False))
    how = "connected" if "connected" in outlet else "open"
    told = how if is_well else f"not {how}: {outlet['why']}"
    if "delivered" in outlet:
        told += f"; {outlet['delivered']} samples delivered, {outlet['behind']} behind"
    return told


COMMANDS = [serve]
