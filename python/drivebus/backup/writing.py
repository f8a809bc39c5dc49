"""Writes one parameter, once, and finds out what the drive made of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivebus.backup.reading import word_of
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, PortError

if TYPE_CHECKING:
    from drivebus.backup.keeping import Keeping

__all__ = ["LINE_ERRORS", "write"]

LINE_ERRORS = (NoAnswer, BadAnswer, PortError)

_ATTEMPTS = 3
"""How often a write is sent that the drive shows not to have heard."""


async def write(drive: Keeping, code: str, raw: int, before: int, *, store: bool) -> int:
    """Writes *raw* in place of *before*, for good if *store*, and returns what the drive then shows.

    A confirmation that was lost is cleared up by reading. The write is repeated only where the drive shows what it had
    before: then it has not heard it, and has not worn its memory.

    Raises:
        Refused: The drive kept what it had.
        NotAllowed: Another drive answers at this address.
        NoAnswer, BadAnswer, PortError: It could not be sent, or what became of it could not be read.
    """
    size = drive.profile.describe(code).words
    words = [raw >> 16 * index & 0xFFFF for index in range(size)]
    address = _address(drive, code, store)
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            await drive._put(code, address, words[0] if size == 1 else words, store=store)
        except LINE_ERRORS as error:
            # Where the value was in force already, out of RAM, reading does not tell whether it is kept now.
            if error.started is None or raw == before:
                raise
            shown = await _look(drive, code, size)
            if shown == before and attempt < _ATTEMPTS:
                continue
            return shown
        break
    return await _look(drive, code, size)


def _address(drive: Keeping, code: str, store: bool) -> int:
    try:
        return drive.profile.address(code, store=store)
    except NotAllowed:
        if store:
            raise
        # The family knows no write that is forgotten: a step on the way wears the memory too.
        return drive.profile.address(code, store=True)


async def _look(drive: Keeping, code: str, size: int) -> int:
    return word_of(await drive.read_words(drive.profile.address(code), size))
