"""Signatures: how units of a family without a code are told, by which words they answer and which they refuse."""

from __future__ import annotations

import functools
from collections.abc import Sequence

from drivebus.errors import BadAnswer, NoAnswer
from drivebus.identify.refusals import Answer, answer_at, passes
from drivebus.line.asking import Ask
from drivebus.profile import Profile, profiles
from drivebus.profile.family import family_of

__all__ = ["Signature", "listed", "shown_by", "shows", "signature_of"]

Signature = dict[str, list[int]]
"""The addresses that a unit `answers`, and those that it `refuses`: see `Profile.signature`."""


@functools.cache
def listed() -> dict[str, Signature]:
    """The signature of each shipped family that has one."""
    found = {name: Profile.builtin(name).signature() for name in profiles()}
    return {name: signature for name, signature in found.items() if signature is not None}


def signature_of(profile: Profile) -> Signature | None:
    """The signature of *profile*; an overlay has that of the family below it."""
    own = profile.signature()
    if own is not None:
        # That is read without a look at all other families.
        return own
    below = family_of(profile).signature
    return None if below is None else {"answers": below[0], "refuses": below[1]}


def shows(profile: Profile, answers: Sequence[Answer]) -> bool:
    """Whether *answers* have all that such a unit is told by: each word that it answers, a refusal of each other."""
    return family_of(profile).is_signed_by(answers)


async def shown_by(ask: Ask, unit: int, answered: dict[int, bool]) -> tuple[str, ...]:
    """The families whose signature *unit* shows. What was asked stands in *answered*, and what is asked goes there.

    Of a signature no more is asked once the unit does not show it, so that a unit of none of them is asked little.
    """
    shown = []
    for name, signature in listed().items():
        wanted = [(place, True) for place in signature["answers"]]
        wanted += [(place, False) for place in signature["refuses"]]
        for place, yes in wanted:
            if place not in answered:
                try:
                    answer = await answer_at(ask, unit, place)
                except (NoAnswer, BadAnswer):
                    # Neither, then: no signature has it.
                    break
                if passes(answer):
                    break
                answered[place] = answer.word is not None
            if answered[place] is not yes:
                break
        else:
            shown.append(name)
    return tuple(shown)
