"""Writes one parameter, once, and finds out what the drive made of it."""

from __future__ import annotations

from collections.abc import Iterable

from drivebus import _native
from drivebus.errors import LINE_ERRORS, Refused, Unverified
from drivebus.operations import kept, not_kept, raw_words
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.profile.refusals import means

__all__ = ["place", "store_all", "stores_all", "write"]

_ATTEMPTS = 3
"""How often a write is sent that the drive shows not to have heard."""


async def write(unit: DriveView, code: str, raw: int, before: int, *, store: bool) -> int:
    """Writes *raw* in place of *before*, for good if *store*, and returns what the drive then shows.

    What has two words can only be read, so one word it is.
    A confirmation that was lost is cleared up by reading. The write is repeated only where the drive shows what it had
    before: then it has not heard it, and has not worn its memory.

    Raises:
        Refused: The drive kept what it had.
        NotAllowed: Another drive answers at this address.
        NoAnswer, BadAnswer, PortError: It could not be sent, or what became of it could not be read.
    """
    address = place(unit, code, store=store)
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            await _put(unit, code, address, raw, store=store)
        except Refused as error:
            # The drive may be still at it: what it shows then is what counts.
            if means(unit.profile, error.code) != "taken":
                raise
        except LINE_ERRORS as error:
            # Where the value was in force already, out of RAM, reading does not tell whether it is kept now.
            if error.started is None or raw == before:
                raise
            shown = await _look(unit, code)
            if shown == before and attempt < _ATTEMPTS:
                continue
            return shown
        break
    return await _look(unit, code)


def place(unit: DriveView, code: str, *, store: bool) -> int:
    """Where *code* is written for good, or to RAM alone.

    Raises:
        NotAllowed: How the family does that is not known, or not verified.
    """
    address = unit.profile.address(code, store=store)
    reason = unit.evidence.unkept(code, store=store)
    if reason is None:
        return address
    raise Unverified(f"how {unit.profile.title} keeps a parameter is not verified: {reason}")


async def _look(unit: DriveView, code: str) -> int:
    [word] = await raw_words.read_words(unit, unit.profile.address(code))
    return word


async def _put(unit: DriveView, code: str, address: int, word: int, *, store: bool) -> None:
    """Writes the word of a parameter, and remembers to which memory."""
    known = unit.profile.describe(code)
    is_kept = store and not stores_all(unit)
    if not is_kept:
        kept.put_in_ram(unit, known)
    await raw_words.write(unit, address, word)
    if is_kept:
        kept.stored(unit, known)


def stores_all(unit: DriveView) -> bool:
    """Whether all stays in RAM until a word stores it."""
    return kept.store_register(unit.profile) is not None


async def store_all(unit: DriveView, codes: Iterable[str]) -> None:
    """Has the drive store all that it has in RAM, where it needs to be told, and where *codes* may be stored.

    What an earlier restore wrote that was cut off is told by nothing: so this is done also where nothing was written.

    Raises:
        Unconfirmed: It has all values, and is not known to have stored them.
    """
    if not stores_all(unit) or all(unit.evidence.unkept(code, store=True) is not None for code in codes):
        return
    kind, told = await call_core(unit, lambda core: _native.Values(core).store())
    if kind != "done":
        raise not_kept.not_stored(unit, *told)
