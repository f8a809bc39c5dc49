"""Frames as they are shown: those that are taken apart, and those that commands send and hear."""

from __future__ import annotations

import logging
from contextlib import suppress

import click

import drivebus
from drivebus.cli.present.moments import time_of_day
from drivebus.cli.present.output import Output, remark
from drivebus.line.meaning import meaning
from drivebus.line.trace import LOGGER as TRACE_LOGGER

__all__ = ["show_frame", "show_frames"]


class _Shown(logging.Handler):
    """Shows each frame as a line on standard error, with the time of day."""

    def emit(self, record: logging.LogRecord) -> None:
        """Shows the frame of *record*."""
        # Whoever has gone and reads it no more must not keep a stop from being sent.
        with suppress(OSError):
            remark(f"{time_of_day(record.created)} {record.getMessage()}")


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
