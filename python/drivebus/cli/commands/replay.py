"""`drivebus replay`: answers as the units of a capture did, so that what was seen can be run again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from time import monotonic

import click

from drivebus import tables
from drivebus.capture import line_of, read
from drivebus.cli.option_types import Place, Seconds
from drivebus.cli.present.output import counted, remark
from drivebus.cli.session import Session, pass_session
from drivebus.sniffer import exchanges_in
from drivebus.sniffer.frames import place_of, written_by
from drivebus.sniffer.replay import Replay

__all__ = ["COMMANDS", "Missing"]

_AGAIN = 10.0
"""Seconds after which the same request is told again."""

_AT_ONCE = 5
"""So many are told in a second; a scan asks for hundreds."""


class Missing:
    """Tells of requests that cannot be answered, not more often than somebody can read.

    Args:
        say: Is given each line.
        clock: Tells the time in seconds.
    """

    def __init__(self, say: Callable[[str], object], clock: Callable[[], float] = monotonic) -> None:
        self._say = say
        self._clock = clock
        self._told: dict[bytes, float] = {}
        self._last: deque[float] = deque(maxlen=_AT_ONCE)

    def take(self, request: bytes) -> None:
        """*request* came."""
        now = self._clock()
        crowded = len(self._last) == _AT_ONCE and now - self._last[0] < 1.0
        if crowded or now - self._told.get(request, -_AGAIN) < _AGAIN:
            return
        self._told[request] = now
        self._last.append(now)
        self._say(f"not in the capture: unit {request[0]}, {_asked(request)}")


def _asked(request: bytes) -> str:
    place = place_of(request)
    if place is None:
        return f"function {request[1]:02X}H"
    does = "read" if written_by(request) is None else "write"
    return f"{does} {counted(place[1], 'word')} at {tables.shown(place[0])}"


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

    FILE is a pcapng or pcap file, or hex text. Each request gets the answers that it got in the capture, in their
    order, and then the last one again. A new read is answered if the capture has all its registers, a new write never.
    Requests without an answer in the capture stay unanswered and are reported.
    """
    line = line_of(file) or session.serial_format
    exchanges = list(exchanges_in(read(file, remark), line))
    with Replay(exchanges, line, transport, Missing(remark).take) as units:
        answered = sum(exchange.answer is not None for exchange in exchanges if exchange.request is not None)
        with suppress(KeyboardInterrupt):
            session.out.record({"port": units.port, "exchanges": answered})
            session.out.say(units.port)
            session.out.remark(f"{answered} answers of {file} at {units.port}. Ctrl-C ends it.")
            units.wait(duration)
    unknown = sorted(units.unknown)
    if unknown:
        shown = "; ".join(request.hex(" ").upper() for request in unknown[:3]) + ("; …" if len(unknown) > 3 else "")
        are = "is" if len(unknown) == 1 else "are"
        remark(f"{counted(len(unknown), 'request')} {are} not in {file} and got no answer: {shown}")


COMMANDS = [replay]
