"""`drivebus share`: lets programs that speak Modbus TCP, or know serial ports alone, read a line beside others."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Literal

import click

import drivebus
from drivebus.cli.option_types import Seconds
from drivebus.cli.present.output import counted, remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]

_LOOKS = 0.2
"""Seconds between two looks at what was refused."""

_AT_ONCE = 5
"""So much of it is told each time; whoever floods a gateway shall not flood a log."""


@click.command()
@click.argument("port", required=False)
@click.option("--tcp", "address", metavar="HOST:PORT", help="Where to listen, such as 127.0.0.1:1502.")
@click.option("--pty", metavar="PATH", help="Instead, make a serial port there for a program that knows no other.")
@click.option("--rtu", is_flag=True, help="Clients speak RTU over TCP, instead of Modbus TCP.")
@click.option(
    "--answer-within",
    type=Seconds(0.05, 60),
    default=1.0,
    show_default=True,
    metavar="SECONDS",
    help="When an answer goes out at the latest: 0BH where the unit gave none.",
)
@click.option("--for", "duration", type=Seconds(0), metavar="SECONDS", help="Stop after so long.")
@pass_session
def share(
    session: Session,
    port: str | None,
    address: str | None,
    pty: str | None,
    rtu: bool,
    answer_within: float,
    duration: float | None,
) -> None:
    """Let programs that speak Modbus TCP read the line, until Ctrl-C.

    They read, and nothing else: whatever may write is refused. Other drivebus commands use the port meanwhile, and a
    `drivebus stop` goes before all of them. Everybody who can reach HOST:PORT can read.
    """
    if (address is None) == (pty is None):
        raise WrongUse("give --tcp HOST:PORT, or --pty PATH")
    session = session if port is None else replace(session, port=port)
    framing: Literal["tcp", "rtu"] = "rtu" if rtu else "tcp"
    with (
        # So that a read is asked again within the time that its client waits.
        session.bus(learn_timeout=True) as bus,
        drivebus.Gateway(
            bus, address or Path.cwd() / (pty or ""), framing=framing, answer_within=answer_within
        ) as gateway,
    ):
        with suppress(KeyboardInterrupt):
            session.out.record({"address": gateway.address, "port": bus.port})
            session.out.say(gateway.address)
            session.out.remark(f"units 1 to 247 on {bus.port} can be read at {gateway.address}. Ctrl-C ends it.")
            _tell_until(gateway, duration)
        stats = gateway.stats
    told = ("let_in", "requests", "answered", "failed", "late", "refused", "busy", "cut_off", "gave_way")
    session.out.record({name: getattr(stats, name) for name in told})
    session.out.remark(
        f"{counted(stats.requests, 'request')} of {counted(stats.let_in, 'connection')}: {stats.answered} answered, "
        f"{stats.failed + stats.late} failed, {stats.refused} refused"
    )


def _tell_until(gateway: drivebus.Gateway, duration: float | None) -> None:
    end = None if duration is None else monotonic() + duration
    while end is None or monotonic() < end:
        gateway.wait(_LOOKS if end is None else min(_LOOKS, max(end - monotonic(), 0.0)))
        told = gateway.told()
        for text in told[:_AT_ONCE]:
            remark(text)
        if len(told) > _AT_ONCE:
            remark(f"and {len(told) - _AT_ONCE} more like these")


COMMANDS = [share]
