"""Frames as they are shown: those that are taken apart, and those that other commands send and hear."""

from __future__ import annotations

import logging
import os
from contextlib import suppress
from datetime import datetime
from typing import TYPE_CHECKING

import click

import drivebus
from drivebus.cli import names
from drivebus.cli.output import Output, remark
from drivebus.cli.session import Session, pass_session
from drivebus.line import huanyang
from drivebus.line.trace import LOGGER as TRACE_LOGGER
from drivebus.line.trace import meaning

if TYPE_CHECKING:
    from drivebus.capture import Captured

__all__ = ["COMMANDS", "show_frame", "show_frames"]


class _Shown(logging.Handler):
    """Shows each frame as a line on standard error, with the time of day."""

    def emit(self, record: logging.LogRecord) -> None:
        """Shows the frame of *record*."""
        time = datetime.fromtimestamp(record.created).astimezone().isoformat(sep=" ", timespec="microseconds")
        # Whoever has gone and reads it no more must not keep a stop from being sent.
        with suppress(OSError):
            remark(f"{time[11:26]} {record.getMessage()}")


def show_frames(context: click.Context) -> None:
    """Shows each frame that the command in *context* sends and hears."""
    logger, shown = logging.getLogger(TRACE_LOGGER), _Shown()
    before = logger.level, logger.propagate
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    logger.addHandler(shown)

    def end() -> None:
        logger.removeHandler(shown)
        logger.setLevel(before[0])
        logger.propagate = before[1]

    context.call_on_close(end)


@click.command()
@click.argument("data", metavar="FILE|HEX...", nargs=-1, required=True)
@pass_session
def decode(session: Session, data: tuple[str, ...]) -> None:
    """Take a whole frame apart, CRC included, or all frames of a capture or a log.

    A capture is a pcapng or pcap file, of `sniff -w` or any other tool; a log the text of any tool, in whatever form it
    has the bytes; both also packed by gzip. With --profile, registers are shown by name; 3=gd350,5=vfd500 names the
    family of each unit.
    """
    if len(data) == 1 and _is_file(data[0]):
        _decode_file(session, data[0])
        return
    from drivebus.capture.text import heard

    found, remarks = heard("\n".join(data) if any(" " in part for part in data) else " ".join(data))
    whole = [captured for captured in found if _is_whole(captured.data)]
    if len(found) > 1 and whole:
        _show_remarks(remarks)
        _show_exchanges(session, found, session.serial_format)
        return
    frame = whole[0].data if whole else _typed(data, [captured.data for captured in found])
    _show_remarks(remarks)
    kind = drivebus.rtu.decode(frame).kind
    if huanyang.is_sure(frame):
        show_frame(session.out, "frame", frame, True)
        session.out.say(f"{'':<7}or the answer to such a request, which has the same form")
        return
    profile = None if session.profile is None else drivebus.Profile.find(session.profile)
    show_frame(session.out, "frame", frame, kind in _REQUESTS, profile=profile)
    if kind in _ALIKE:
        session.out.say(f"{'':<7}or the answer to it, which is the same")


def _typed(data: tuple[str, ...], found: list[bytes]) -> bytes:
    """The bytes that were typed, which are no frame: it is for the core to say why."""
    try:
        return names.parse_hex(data)
    except click.UsageError:
        if not found:
            raise
        return found[0]


def _is_whole(data: bytes) -> bool:
    try:
        drivebus.rtu.decode(data)
    except drivebus.BadAnswer:
        return False
    return True


def _show_remarks(remarks: list[str]) -> None:
    for text in remarks:
        remark(text)


def _is_file(text: str) -> bool:
    """Whether *text* is the name of a file: one that is there, or what no hex looks like."""
    there = os.path.isfile(text)  # noqa: PTH113 - Path raises where a name is too long
    named = os.path.splitext(text)[1].lower()  # noqa: PTH122
    return there or named in (".pcapng", ".pcap", ".cap", ".gz", ".txt", ".log", ".csv")


def _decode_file(session: Session, file: str) -> None:
    from drivebus.capture import line_of, read

    # Times of frames are those of their last characters: when they began follows from the speed.
    format_ = line_of(file) or session.serial_format
    whole: list[Captured] = []
    broken = None
    try:
        whole.extend(read(file, remark))
    except drivebus.NotAllowed as error:
        # What came before it breaks off is shown.
        if not whole:
            raise
        broken = error
    _show_exchanges(session, whole, format_)
    if broken is not None:
        raise broken


def _show_exchanges(session: Session, whole: list[Captured], format_: drivebus.SerialFormat) -> None:
    from drivebus.cli.exchanges import Lines
    from drivebus.sniffer import Families, exchanges_in

    lines: dict[str, list[Captured]] = {}
    for frame in whole:
        lines.setdefault(frame.line, []).append(frame)
    for line, frames in lines.items():
        # A unit is not the one of the same address on another line.
        families = Families(names.parse_families(session.profile))
        shown = Lines(session.out, families, any(frame.time is not None for frame in frames), line)
        for exchange in exchanges_in(frames, format_, families):
            shown.show(exchange)


_ALIKE = ("write", "echo")
"""Requests that a unit answers with the same bytes."""

_REQUESTS = ("read", "write_many", *_ALIKE)


def show_frame(
    out: Output,
    what: str,
    frame: bytes,
    sent: bool,
    asked: bytes | None = None,
    profile: drivebus.Profile | None = None,
) -> None:
    """Shows *frame* and what it means.

    Args:
        out: Where it is shown.
        what: What it is, in a word of up to six letters.
        frame: All of it, the CRC included.
        sent: Whether a master sent it.
        asked: The request that it answers, if a unit sent it.
        profile: The family of the unit, for names.
    """
    if out.as_json:
        decoded = drivebus.rtu.decode(frame)
        fields = {name: value for name, value in vars(decoded).items() if value is not None}
        out.record({"what": what, "hex": frame, **fields})
    else:
        out.say(f"{what:<7}{frame.hex(' ').upper()}")
        out.say(f"{'':<7}{meaning(frame, sent, asked, profile)}", hanging=7)


COMMANDS = [decode]
