"""`drivebus replay`: answers as the units of a capture did, so that what was seen can be run again."""

from __future__ import annotations

from contextlib import suppress

import click

import drivebus
from drivebus.capture import read
from drivebus.cli.output import remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.types import Place, Seconds
from drivebus.sniffer import exchanges_in
from drivebus.sniffer.replay import Replay

__all__ = ["COMMANDS"]


@click.command()
@click.argument("file", type=Place())
@click.option(
    "--transport",
    type=click.Choice(["auto", "pty", "tcp"]),
    default="auto",
    show_default=True,
    help="A pseudo-terminal, or RTU over TCP. auto: the first of them that this system has.",
)
@click.option("--for", "duration", type=Seconds(0), metavar="SECONDS", help="Stop after so long.")
@pass_session
def replay(session: Session, file: str, transport: str, duration: float | None) -> None:
    """Answer as the units in a capture did, until Ctrl-C.

    FILE is a pcapng file or hex text. Each request gets the answers that it got there, in their order; the last of them
    is given from then on. What nobody answered there stays without an answer.
    """
    bits, parity, stop = session.line_format
    line = drivebus.SerialFormat(session.baud, parity, int(stop), int(bits))
    exchanges = list(exchanges_in(read(file), line))
    with Replay(exchanges, line, transport) as units:
        answered = sum(exchange.answer is not None for exchange in exchanges if exchange.request is not None)
        if session.out.as_json:
            session.out.record({"port": units.port, "exchanges": answered})
        else:
            session.out.say(units.port)
            remark(f"{answered} answers of {file} at {units.port}. Ctrl-C ends it.")
        with suppress(KeyboardInterrupt):
            units.wait(duration)
    unknown = sorted(units.unknown)
    if unknown:
        shown = "; ".join(request.hex(" ").upper() for request in unknown[:3]) + ("; …" if len(unknown) > 3 else "")
        remark(f"{len(unknown)} requests are not in {file} and got no answer: {shown}")


COMMANDS = [replay]
