"""The command `raw`: requests on the command line, in a script, or at a prompt."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import click
from click.core import ParameterSource

import drivebus
from drivebus.cli.option_types import Place, Seconds, Whole
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.output import remark
from drivebus.cli.raw.families import UnitFamilies
from drivebus.cli.raw.request import request_of
from drivebus.cli.raw.script import Send, Step, Typed, requests_of, typed_in
from drivebus.cli.raw.sending import Sender
from drivebus.cli.session import Session, pass_session, yes_option
from drivebus.cli.wrong_use import WrongUse

__all__ = ["raw"]


@click.command()
@click.argument("data", metavar="[HEX]...", nargs=-1)
@click.option(
    "--script",
    type=Place(exists=True, dir_okay=False, allow_dash=True),
    metavar="FILE",
    help="Send the requests of this file, one a line; - is standard input.",
)
@click.option("--count", type=Whole(1, 1_000_000), help="Send it all so often.")
@click.option("--interval", type=Seconds(0), metavar="SECONDS", help="Seconds from one time to the next.")
@click.option("--keep-going", is_flag=True, help="Go on after a request that is refused or not answered.")
@click.option("--force", is_flag=True, help="Also send a command that the family does not define.")
@yes_option
@pass_session
def raw(
    session: Session,
    data: tuple[str, ...],
    script: str | None,
    count: int | None,
    interval: float | None,
    keep_going: bool,
    force: bool,
    yes: bool,
) -> None:
    """Send any request and show the answer. Give unit and PDU in hexadecimal, without the CRC.

    Example: `drivebus raw 01 03 21 00 00 01`. All numbers are hex, as in a frame, the unit too: unit 11 is 0B, and 11
    is unit 17. Without HEX, a prompt asks for one request after the other; `help` there
    says what it takes. A script, or what is piped in, has the same lines. What writes asks first, in a script once for
    all of it.

    A word for a command register must be a command of the family (--profile; without it, of any family that has its
    commands there). --force sends any other.
    """
    if data and script is not None:
        raise WrongUse("give HEX or --script, not both")
    if interval is not None and count is None:
        raise WrongUse("--interval is the time from one of --count times to the next; give --count too")
    if data:
        request = request_of(data, force, session.addresses)
        _check_unit(session, request.unit)
        if not request.only_looks:
            replace(session, unit=request.unit).will_write()
        with session.bus(read_only=session.read_only) as bus:
            _send(session, bus, lambda _: [Send("", (request,))], count or 1, interval, keep_going, force, yes)
        return
    if script is None and sys.stdin is not None and sys.stdin.isatty():
        if count is not None or keep_going:
            raise WrongUse("--count and --keep-going are for HEX and scripts; the prompt takes x10 behind a line")
        from drivebus.cli.raw.prompt import prompt

        with session.bus(read_only=session.read_only) as bus:
            prompt(session, bus, force, yes)
        return
    name = "standard input" if script in (None, "-") else str(script)
    typed = list(typed_in(_lines(script), name, session.unit, force, session.addresses))
    if not any(line.verb in ("hex", "read", "write") for line in typed):
        raise WrongUse(f"{name} has no request; nothing was sent")
    with session.bus(read_only=session.read_only) as bus:
        _send(
            session,
            bus,
            lambda families: _steps(session, typed, families),
            count or 1,
            interval,
            keep_going,
            force,
            yes,
        )


def _check_unit(session: Session, asked: int) -> None:
    """That a request goes to the unit that was named, if one was."""
    given = click.get_current_context().find_root().get_parameter_source("units")
    if given is ParameterSource.COMMANDLINE and asked != session.unit:
        raise WrongUse(
            f"the request is for unit {asked}, its first byte, and --unit says {session.unit}; nothing was sent"
        )


def _lines(script: str | None) -> list[str]:
    """The text of *script*; None is standard input.

    Raises:
        click.UsageError: It cannot be read, or is no text.
    """
    if script in (None, "-") and sys.stdin is None:
        raise WrongUse("there is no standard input; give HEX, or a file with --script")
    try:
        with click.open_file("-" if script is None else script, encoding="utf-8-sig") as file:
            text: str = file.read()
            return text.splitlines()
    except UnicodeDecodeError:
        raise WrongUse(f"{script or 'standard input'} is not text; nothing was sent") from None
    except OSError as error:
        raise WrongUse(f"{script} cannot be read: {error.strerror or error}") from None


def _steps(session: Session, typed: Sequence[Typed], families: UnitFamilies) -> list[Step]:
    """What all lines ask for."""
    found = (requests_of(line, families.find, session.unverified) for line in typed)
    return [step for step in found if step is not None]


def _send(
    session: Session,
    bus: drivebus.Bus,
    steps_of: Callable[[UnitFamilies], list[Step]],
    count: int,
    interval: float | None,
    keep_going: bool,
    force: bool,
    yes: bool,
) -> None:
    """Sends all of it, and ends with the exit code of what failed first."""
    families = UnitFamilies(session, bus)
    sender = Sender(session, bus, families, force, yes)
    steps = steps_of(families)
    sender.prepare(steps, count)
    total = count * sum(step.times * len(step.requests) for step in steps if isinstance(step, Send))
    try:
        failure = sender.run(steps, count, interval, keep_going)
    except KeyboardInterrupt:
        remark(f"Interrupted. {sender.told(total)}")
        raise click.exceptions.Exit(130) from None
    if total > 1:
        remark(sender.told(total))
    if failure is not None:
        session.advise(failure)
        raise click.exceptions.Exit(exit_code(failure))
