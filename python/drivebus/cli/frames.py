"""Frames: by hand, as with the serial assistants of the manuals, and those that other commands send and hear."""

from __future__ import annotations

import logging
import os
from contextlib import suppress
from datetime import datetime

import click

import drivebus
from drivebus.cli import names
from drivebus.cli.output import remark
from drivebus.cli.session import Session, pass_session, yes_option
from drivebus.line.trace import LOGGER as TRACE_LOGGER
from drivebus.line.trace import meaning

__all__ = ["COMMANDS", "show_frames"]

_READS = frozenset({0x01, 0x02, 0x03, 0x04, 0x07, 0x08, 0x0B, 0x0C, 0x11, 0x14, 0x18})
"""Function codes that change nothing in a unit, as the core has them; of 08H, most of its sub-functions."""

_DIAGNOSTICS = frozenset({0x00, 0x02, *range(0x0B, 0x13)})
"""Sub-functions of 08H that only tell something."""


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
@click.argument("data", metavar="HEX...", nargs=-1, required=True)
@click.option("--force", is_flag=True, help="Also send a command that the family does not define.")
@yes_option
@pass_session
def raw(session: Session, data: tuple[str, ...], force: bool, yes: bool) -> None:
    """Send any request and show the answer. Give unit and PDU in hexadecimal, without the CRC.

    Example: `drivebus raw 01 03 21 00 00 01`. A word for a command register must be a command of the family (--profile;
    without it, of any family that has its commands there). --force sends any other.
    """
    body = names.parse_hex(data)
    if not 2 <= len(body) <= 254:
        raise click.UsageError(
            f"{len(body)} bytes are not a request; give the unit, then 1 to 253 bytes of PDU, and no CRC"
        )
    unit, pdu = body[0], body[1:]
    if not 1 <= unit <= 247:
        raise click.UsageError(f"no unit {unit:02X} answers; the first byte is the unit, 01 to F7")
    if not force and len(body) > 4 and _framed(body[:-2]) == body:
        asked = body[:-2].hex(" ").upper()
        raise click.UsageError(f"the last two bytes are the CRC of the others, and it is added: drivebus raw {asked}")
    diagnoses = pdu[0] != 0x08 or int.from_bytes(pdu[1:3], "big") in _DIAGNOSTICS
    if pdu[0] not in _READS or not diagnoses:
        session.will_write()
    with session.bus() as bus:
        if session.profile is not None:
            # From now on the bus knows what the unit is, and refuses what would be no command of its family.
            bus.drive(unit, session.profile)
        elif not force:
            _check_commands(unit, body)
        if pdu[0] not in _READS:
            session.ask(f"Function {pdu[0]:02X}H writes, which can move the motor", yes, unit)
        try:
            answer = bus.transact(unit, pdu, force=force)
        except drivebus.NotAllowed:
            raise
        except drivebus.DrivebusError as error:
            _show_frame(session, "sent", _framed(body), True)
            if not isinstance(error, drivebus.Refused):
                raise
            _show_frame(session, "answer", error.raw, False, _framed(body))
            if session.profile is not None:
                name, told = drivebus.Profile.find(session.profile).exception(error.code)
                session.out.say(f"{'':<7}{session.profile} means by it: {name}, {told}")
            raise
        sent = _framed(body)
        _show_frame(session, "sent", sent, True)
        _show_frame(session, "answer", _framed(bytes([unit]) + answer), False, sent)


@click.command()
@click.argument("data", metavar="FILE|HEX...", nargs=-1, required=True)
@pass_session
def decode(session: Session, data: tuple[str, ...]) -> None:
    """Take a whole frame apart, CRC included, or all frames of a capture.

    A capture is a pcapng file of Wireshark's or `sniff -w`, or hex text of any tool. With --profile, registers are
    shown by name; 3=gd350,5=vfd500 names the family of each unit.
    """
    if len(data) == 1 and _is_file(data[0]):
        _decode_file(session, data[0])
        return
    frame = names.parse_hex(data)
    kind = drivebus.rtu.decode(frame).kind
    _show_frame(session, "frame", frame, kind in _REQUESTS)
    if kind in _ALIKE:
        session.out.say(f"{'':<7}or the answer to it, which is the same")


def _is_file(text: str) -> bool:
    """Whether *text* is the name of a file: one that is there, or what no hex looks like."""
    there = os.path.isfile(text)  # noqa: PTH113 - Path raises where a name is too long
    return there or os.path.splitext(text)[1].lower() in (".pcapng", ".pcap", ".txt", ".log")  # noqa: PTH122


def _decode_file(session: Session, file: str) -> None:
    from drivebus.capture import Captured, read
    from drivebus.cli.exchanges import Lines
    from drivebus.sniffer import Families, exchanges_in

    bits, parity, stop = session.line_format
    line = drivebus.SerialFormat(session.baud, parity, int(stop), int(bits))
    families = Families(names.parse_families(session.profile))
    whole: list[Captured] = []
    broken = None
    try:
        whole.extend(read(file))
    except drivebus.NotAllowed as error:
        # What came before it breaks off is shown.
        if not whole:
            raise
        broken = error
    shown = Lines(session.out, families, any(frame.time is not None for frame in whole))
    for exchange in exchanges_in(whole, line, families):
        shown.show(exchange)
    if broken is not None:
        raise broken


def _check_commands(unit: int, body: bytes) -> None:
    """Raises `NotAllowed` where *body* writes to a command register a code that no family with that register defines.

    What the unit is, nobody has said; what it cannot mean is known all the same.
    """
    write = drivebus.rtu.written(body[1:])
    if write is None:
        return
    first, words = write
    families = [drivebus.Profile.builtin(name) for name in drivebus.profiles()]
    for address, word in enumerate(words, first):
        there = [family for family in families if family.command_address == address]
        if there and not any(word in family.command_codes() for family in there):
            raise drivebus.NotAllowed(
                f"{word} at {address:04X}H is not a command of any family that has its command register there "
                f"({', '.join(family.name for family in there)}); nothing was sent to unit {unit}. With --profile the "
                "family is known; with --force it is sent all the same"
            )


def _framed(body: bytes) -> bytes:
    return body + drivebus.crc16(body).to_bytes(2, "little")


_ALIKE = ("write", "echo")
"""Requests that a unit answers with the same bytes."""

_REQUESTS = ("read", "write_many", *_ALIKE)


def _show_frame(session: Session, what: str, frame: bytes, sent: bool, asked: bytes | None = None) -> None:
    """*frame* and what it means; *asked* is the request that it answers, if it was *sent* by a unit."""
    if session.out.as_json:
        decoded = drivebus.rtu.decode(frame)
        fields = {name: value for name, value in vars(decoded).items() if value is not None}
        session.out.record({"what": what, "hex": frame, **fields})
    else:
        session.out.say(f"{what:<7}{frame.hex(' ').upper()}")
        profile = None if session.profile is None else drivebus.Profile.find(session.profile)
        session.out.say(f"{'':<7}{meaning(frame, sent, asked, profile)}", hanging=7)


COMMANDS = [raw, decode]
