"""What a unit is, as far as it tells: by its identification code, or by which words it answers and which it refuses.

It is found out in the core (`crates/drive`), by reads alone; here are the words for it. Whether what was found is
enough to command a motor by it, `profile_choice` asks there.
"""

from __future__ import annotations

from typing import Any

from drivebus import _native, tables
from drivebus.errors import NoAnswer
from drivebus.identify.families import all_of, one_of
from drivebus.identify.refusals import LOCKED, Answer, busy
from drivebus.identify.results import Certainty, Identification
from drivebus.line.asking import Ask
from drivebus.line.tasks import carried_out_by

__all__ = ["identify"]

_PASSWORD = ", as INVT drives do that a user password locks: type it in at the keypad"


async def identify(ask: Ask, unit: int) -> Identification:
    """Finds out what *unit* is. *ask* asks for one word.

    Raises:
        NoAnswer, BadAnswer, PortError: From its first answer.
    """
    kind, told = await carried_out_by(_native.identify(unit), ask)
    if kind == "unreached":
        raise NoAnswer(f"no answer, says a gateway (exception {told:02X}H)", unit=unit)
    if kind == "busy":
        raise busy(unit, *told) from told[-1]
    return _worded(unit, **told)


def _worded(
    unit: int,
    *,
    candidates: list[str],
    family: str | None,
    code: int | None,
    titles: list[str],
    certainty: Certainty,
    reason: tuple[str, Any],
) -> Identification:
    """What was found out of *unit*, in words."""
    title = one_of(titles) if titles else ""
    kind, told = reason
    if kind == "code":
        words = _by_code(f"it reports {code:04X}H", title, candidates, *told)
    elif kind == "answers":
        seen = ", ".join(f"{tables.shown(place)} {'answered' if yes else 'refused'}" for place, yes in told)
        words = f"it has no known code, and answers like such a unit: {seen}"
    else:
        words = f"{'; '.join(_said(Answer(*each)) for each in told)}, and its answers fit no known family"
    return Identification(unit, tuple(candidates), family, code, title, certainty, words)


def _by_code(
    says: str,
    title: str,
    candidates: list[str],
    place: int,
    alone: Certainty,
    source: str,
    against: tuple[int, int | None, int | None] | None,
) -> str:
    """Why a unit is what its code, which it *says*, is listed for; and what it said *against* that."""
    if alone == "unverified":
        words = f"{says}, which no document prints for {title}, only {source}"
    elif alone == "shared":
        words = f"{says}, which {all_of(candidates)} share"
    else:
        words = f"{says}, printed for {title} in {source}"
    if against is None:
        return words
    state, word, _ = against
    says = f"{'refuses' if word is None else f'says {word} at'} {tables.shown(state)}"
    return f"{words}; but it {says}, where such a drive has its state: {place:04X}H may have another meaning"


def _said(answer: Answer) -> str:
    """What a unit said where others have their codes."""
    if answer.word is not None:
        return f"it reports {answer.word:04X}H, which is not a known code"
    why = _PASSWORD if answer.exception == LOCKED else ""
    return f"it refuses {answer.address:04X}H (exception {answer.exception:02X}H{why})"
