"""Writes one parameter, once, and finds out what the drive made of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivebus.errors import LINE_ERRORS, NotAllowed

if TYPE_CHECKING:
    from drivebus.backup.keeping import Keeping

__all__ = ["place", "write"]

_ATTEMPTS = 3
"""How often a write is sent that the drive shows not to have heard."""


async def write(drive: Keeping, code: str, raw: int, before: int, *, store: bool) -> int:
    """Writes *raw* in place of *before*, for good if *store*, and returns what the drive then shows.

    What has two words can only be read, so one word it is.
    A confirmation that was lost is cleared up by reading. The write is repeated only where the drive shows what it had
    before: then it has not heard it, and has not worn its memory.

    Raises:
        Refused: The drive kept what it had.
        NotAllowed: Another drive answers at this address.
        NoAnswer, BadAnswer, PortError: It could not be sent, or what became of it could not be read.
    """
    address = place(drive, code, store=store)
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            await drive._put(code, address, raw, store=store)
        except LINE_ERRORS as error:
            # Where the value was in force already, out of RAM, reading does not tell whether it is kept now.
            if error.started is None or raw == before:
                raise
            shown = await _look(drive, code)
            if shown == before and attempt < _ATTEMPTS:
                continue
            return shown
        break
    return await _look(drive, code)


def place(drive: Keeping, code: str, *, store: bool) -> int:
    """Where *code* is written for good, or to RAM alone.

    Raises:
        NotAllowed: How the family does that is not known, or not verified.
    """
    profile = drive.profile
    memory = profile.memory()
    address = profile.address(code, store=store)
    plain = store and address == profile.describe(code).address
    if memory is None or memory["reason"] is None or drive.unverified or plain:
        return address
    raise NotAllowed(f"how {profile.title} keeps a parameter is not verified: {memory['reason']}")


async def _look(drive: Keeping, code: str) -> int:
    [word] = await drive.read_words(drive.profile.address(code))
    return word
