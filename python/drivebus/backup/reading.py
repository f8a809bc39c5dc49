"""Reads many parameters as words, in the fewest requests that the drive allows, and says why it lacks the others."""

from __future__ import annotations

from collections.abc import Sequence

from drivebus.backup.unread import Unread, lost, refused
from drivebus.errors import BadAnswer, NoAnswer, Refused
from drivebus.operations import raw_words as bus_words
from drivebus.operations.drive_view import DriveView

__all__ = ["Reader", "Words"]

_LOCKED = "password_protected"
"""By this name every profile calls a refusal that meets whatever is asked."""

_DEAD = 8
"""Reads in a row without an answer after which the line counts as failed: cutting out one silent parameter takes
fewer."""


class Words:
    """What one request brought.

    Attributes:
        raw: The word of each parameter in it; one of two words is one number.
        unread: Or why it was not read.
    """

    __slots__ = ("raw", "unread")

    def __init__(self, raw: dict[str, int], unread: dict[str, Unread]) -> None:
        self.raw = raw
        self.unread = unread


class Reader:
    """Reads *codes*, request by request. One that is refused is cut in two, down to the parameter that is meant.

    What was lost is asked for once more, after all others, and cut in two only then.
    """

    def __init__(self, unit: DriveView, codes: Sequence[str]) -> None:
        self._unit = unit
        self._waiting = [list(codes)] if codes else []
        self._planned: list[tuple[int, int, list[str]]] = []
        self._lost: list[str] = []
        self._is_second_round = False
        self._silent = 0
        self._answers = 0

    async def next(self) -> Words | None:
        """What the next request brought; None when all was asked.

        Raises:
            Refused: The drive is locked by a password: it would refuse each.
            NotAllowed: Another drive answers at this address since the port was opened again.
            NoAnswer, BadAnswer: Nothing was answered at all, or nothing any more.
            PortError: See there.
        """
        if not self._planned:
            if not self._waiting and self._lost:
                self._waiting, self._lost, self._is_second_round = [self._lost], [], True
            if not self._waiting:
                return None
            self._plan(self._waiting.pop())
        address, count, inside = self._planned.pop(0)
        unit = self._unit
        # Known before the first answer, so that a port that is opened again meanwhile brings no words of another drive.
        await unit.identity.check(unit.bus, judged=False)
        try:
            words = await bus_words.read_words(unit, address, count)
            await unit.identity.check(unit.bus, judged=False)
        except Refused as error:
            if error.name == _LOCKED:
                raise
            self._heard()
            return self._lacks(inside, refused(unit.profile, error))
        except (NoAnswer, BadAnswer) as error:
            self._silent += 1
            if self._silent == _DEAD or (self._is_second_round and not self._answers):
                raise
            return self._lacks(inside, lost(error))
        self._heard()
        return Words({code: self._word(code, words, address) for code in inside}, {})

    async def rest(self) -> Words:
        """What all requests that are left bring."""
        raw: dict[str, int] = {}
        unread: dict[str, Unread] = {}
        while (words := await self.next()) is not None:
            raw.update(words.raw)
            unread.update(words.unread)
        return Words(raw, unread)

    def _heard(self) -> None:
        self._silent, self._answers = 0, self._answers + 1

    def _lacks(self, inside: list[str], why: Unread) -> Words:
        """What a read of *inside* brought that failed for *why*; who is asked again, and how, is noted."""
        if why.why == "lost" and not self._is_second_round:
            self._lost += inside
            return Words({}, {})
        if len(inside) == 1:
            return Words({}, {inside[0]: why})
        half = len(inside) // 2
        self._waiting += [inside[half:], inside[:half]]
        return Words({}, {})

    def _plan(self, codes: Sequence[str]) -> None:
        profile = self._unit.profile
        places = {code: profile.address(code) for code in codes}
        self._planned = [
            (address, count, [code for code, place in places.items() if address <= place < address + count])
            for address, count in profile.compile(codes).reads
        ]

    def _word(self, code: str, words: Sequence[int], address: int) -> int:
        place = self._unit.profile.address(code) - address
        known = self._unit.profile.describe(code)
        return known.number(words[place : place + known.words])
