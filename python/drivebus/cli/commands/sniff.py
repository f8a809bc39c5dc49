"""`drivebus sniff`: what others say on a line, without a word of ours."""

from __future__ import annotations

import signal
import threading
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import replace

import click
from click.core import ParameterSource
from rich.live import Live

import drivebus
from drivebus.capture import Captured
from drivebus.cli.capture_file import CaptureFile
from drivebus.cli.names import parse_families
from drivebus.cli.option_types import Place, Seconds, Whole
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.exchanges import Filter, Lines
from drivebus.cli.present.output import counted, remark
from drivebus.cli.present.sniff_table import SniffTable
from drivebus.cli.session import EXAMPLE_PORT, Session, pass_session
from drivebus.cli.signals import heeded
from drivebus.cli.wrong_use import WrongUse
from drivebus.end_signals import END_SIGNALS
from drivebus.sniffer import Exchange, Families, Figures

__all__ = ["COMMANDS"]

_EACH = 0.2
"""Seconds between two looks of the live table."""


@click.command()
@click.argument("port", required=False)
@click.option("--for", "duration", type=Seconds(0), metavar="SECONDS", help="Stop after so long.")
@click.option("--count", "-n", type=Whole(1), help="Stop after so many exchanges.")
@click.option("--write", "-w", "target", type=Place(), metavar="FILE", help="Also keep it for Wireshark; - is a pipe.")
@click.option(
    "--link",
    type=click.Choice(["upper", "rtac"]),
    default="upper",
    show_default=True,
    help="Link type of that file. upper: Wireshark needs no setting. rtac: line events, with `decode as`.",
)
@click.option("--force", is_flag=True, help="Replace the file if it is there.")
@click.option(
    "--function", "functions", multiple=True, metavar="HEX", help="Only this function, such as 06. Repeatable."
)
@click.option("--errors", is_flag=True, help="Only what went wrong: refusals, silence, damage, late answers.")
@click.option("--table", is_flag=True, help="Show a live table of units and registers instead of lines.")
@pass_session
@click.pass_context
def sniff(
    context: click.Context,
    session: Session,
    port: str | None,
    duration: float | None,
    count: int | None,
    target: str | None,
    link: str,
    force: bool,
    functions: tuple[str, ...],
    errors: bool,
    table: bool,
) -> None:
    """Listen to other masters on a line and show who asks whom for what. Nothing is sent.

    --unit shows these units only. --profile names the family of all units, or of each: 3=gd350,5=vfd500. Without it,
    families are taken from what units say of themselves, or guessed.
    """
    port = port or session.port
    if port is None:
        raise WrongUse(f"no port: give it, as in `drivebus sniff {EXAMPLE_PORT}`; `drivebus ports` lists them")
    families = Families(parse_families(session.profile))
    units = _units(context, session)
    shown = Filter(units, frozenset(_function(text) for text in functions), errors)
    bits, parity, stop = session.line_format
    out = session.out
    line = drivebus.SerialFormat(session.baud, parity, int(stop), int(bits))
    figures = Figures(line.t35)
    screen = SniffTable(port, families, figures) if table and out.live else None
    lines = Lines(out, families)
    ended = threading.Event()
    seen, settings = 0, f"{session.baud} {bits}{parity}{stop}"
    with ExitStack() as opened:
        kept = None
        if target is not None:
            kept = opened.enter_context(CaptureFile(target, force, port, settings, link))
        heard = drivebus.sniff(
            port,
            baudrate=session.baud,
            parity=parity,
            stopbits=int(stop),
            bytesize=int(bits),
            profiles=families,
            duration=duration,
            stop=ended,
        )
        opened.enter_context(closing(heard))
        opened.enter_context(_ended_by_signals(ended))
        live = opened.enter_context(
            Live(screen, console=out.console, refresh_per_second=1 / _EACH, screen=True) if screen else nullcontext()
        )
        quiet = target == "-" or (table and live is not None)
        if live is None:
            out.remark(f"Listening on {port}, {settings}. Ctrl-C ends it.")
        try:
            for exchange in heard:
                figures.take(exchange)
                if kept is not None:
                    _keep(kept, exchange, line.char_time)
                if not shown.lets_pass(exchange):
                    continue
                seen += 1
                if screen is not None:
                    screen.take(exchange)
                elif not quiet:
                    lines.show(exchange)
                if count is not None and seen >= count:
                    break
        except KeyboardInterrupt:
            pass
    _told(replace(session, port=port), figures, target, kept)


def _ended_by_signals(stop: threading.Event) -> AbstractContextManager[None]:
    """What ends programs sets *stop*, so that all that was heard is shown and kept; the second time it ends at once."""

    def end(number: int, _frame: object) -> None:
        signal.signal(number, signal.default_int_handler)
        stop.set()

    # What is ignored, as under nohup, stays so.
    heard = [each for each in (signal.SIGINT, *END_SIGNALS) if signal.getsignal(each) not in (signal.SIG_IGN, None)]
    return heeded(heard, end)


def _units(context: click.Context, session: Session) -> frozenset[int]:
    """The units that were named; none where the option is left to its default."""
    if context.find_root().get_parameter_source("units") is ParameterSource.DEFAULT:
        return frozenset()
    return frozenset(each.unit for each in session.several or (session,))


def _function(text: str) -> int:
    try:
        function = int(text.upper().removesuffix("H"), 16)
    except ValueError:
        function = 0
    if not 1 <= function <= 0x7F:
        raise WrongUse(f'"{text}" is not a function; give one in hexadecimal, 01 to 7F')
    return function


def _keep(kept: CaptureFile, exchange: Exchange, char_time: float) -> None:
    """Writes what was heard of *exchange*, each frame with the moment of its end."""
    if exchange.request is not None:
        kept.write(Captured(exchange.time + char_time * len(exchange.request), exchange.request, True))
    if exchange.answer is not None:
        kept.write(Captured(exchange.answered or exchange.time, exchange.answer, False))
    elif exchange.error is not None and exchange.error.raw:
        raw = exchange.error.raw
        kept.write(Captured(exchange.answered or exchange.time + char_time * len(raw), raw, None))


def _told(session: Session, figures: Figures, target: str | None, kept: CaptureFile | None) -> None:
    """Says what was heard, and what it means."""
    asked = sum(unit.requests for unit in figures.units.values())
    answered = sum(unit.answers for unit in figures.units.values())
    hints = [in_commands(hint) for hint in figures.hints()]
    session.out.record({"exchanges": asked, "answered": answered, "noise": figures.noise, "hints": hints})
    session.out.remark(f"{counted(asked, 'request')} to {counted(len(figures.units), 'unit')}, {answered} answered.")
    for hint in hints:
        session.out.remark(f"- {hint}")
    if not figures.exchanges:
        remark(
            "Nothing was heard: nobody speaks there, the wires are off or crossed, or the adapter only hears itself. "
            f"`{session.doctor()}` looks at the line."
        )
    if kept is not None and kept.gone:
        raise click.exceptions.Exit(1)
    if kept is not None and kept.is_empty:
        remark(f"{target} was not written: there was nothing to write.")
    elif target not in (None, "-"):
        remark(f"Wireshark opens {target}; with `-o mbrtu.tcp.port:502` it tells a write from its answer.")


COMMANDS = [sniff]
