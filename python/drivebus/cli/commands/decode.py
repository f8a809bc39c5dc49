"""`drivebus decode`: a frame, or all frames of a capture or a log, taken apart."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

import drivebus
from drivebus.cli import names
from drivebus.cli.present.frames import show_frame
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, pass_session
from drivebus.line import huanyang

if TYPE_CHECKING:
    from drivebus.capture import Captured

__all__ = ["COMMANDS"]


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
    from drivebus.cli.present.exchanges import Lines
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


COMMANDS = [decode]
