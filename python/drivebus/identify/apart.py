"""Which family a unit that is to be halted may be, from the few words it was asked for, and what is asked next.

A value: answers go in, and the next question or a verdict comes out. It neither asks nor waits. Three things are held
against each family: what its units answer, what they refuse, and whose code a word is. A family that contradicts an
answer is out. One whose code came, or whose whole signature, or whose state is one of its states, is *shown*. Where the
named family is shown and nothing is left that its command would do harm to, it is taken; where another is shown and the
named one is not, that one is. Where several are left that want different words, nobody is.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import NamedTuple

from drivebus.identify import codes
from drivebus.identify.harm import HALTS, families, halt_of, harms
from drivebus.identify.refusals import LOCKED, NO_FUNCTION, Answer, no_such_address, passes
from drivebus.identify.signatures import shows, signature_of
from drivebus.profile import Profile

__all__ = ["Apart", "Verdict"]

_SPECIFIED = frozenset((0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x0A, 0x0B))
"""The exceptions of the Modbus specification, section 7, which a family may answer without its manual listing them."""


class Verdict(NamedTuple):
    """What is to be done.

    Attributes:
        ask: The place to ask the unit for; None where nothing more is asked.
        take: The family to halt it as; None where none is taken.
        others: The families that it may be as well where none is taken.
    """

    ask: int | None = None
    take: Profile | None = None
    others: tuple[Profile, ...] = ()


class Apart:
    """The families that one unit may be, told apart by its answers.

    Args:
        named: What it was named as.
        trusted: Whether that is meant, whatever the unit says: then it is taken where nothing else is shown.
    """

    def __init__(self, named: Profile, *, trusted: bool = False) -> None:
        self._named = named
        self._trusted = trusted
        self._families = families(named)
        self._answers: dict[int, Answer] = {}

    @property
    def is_asked(self) -> bool:
        """Whether the unit told anything yet."""
        return bool(self._answers)

    @property
    def shows_named(self) -> bool:
        """Whether the answers show a unit of what it was named as, and nothing speaks against that."""
        return self._is_live(self._named) and self._is_shown(self._named)

    def heard(self, answer: Answer) -> bool:
        """Takes *answer* into account. Whether it tells anything: a unit that is busy says nothing of what it is."""
        # That a password locks it is said in the words of one maker.
        if answer.exception != LOCKED and passes(answer):
            return False
        self._answers[answer.address] = answer
        return True

    def verdict(self, what: str | int) -> Verdict:
        """What to ask, or as what to take the unit.

        Args:
            what: The command that it is to be halted by, or the place that a word is to be written to. As what a unit
                is taken that is written to, matters only for whether that one keeps the word, or starts by it.
        """
        named = self._named
        live = [profile for profile in self._families if self._is_live(profile)]
        if self.shows_named:
            return self._between(named, self._rivals(named, live, what))
        if isinstance(what, str) and named in live and (verdict := self._by_harm(live, what)) is not None:
            return verdict
        if named in live and (place := self._next_of(named)) is not None:
            return Verdict(ask=place)
        shown = [profile for profile in live if profile is not named and self._is_shown(profile)]
        if shown:
            return self._one_of(shown, live, what)
        for profile in live:
            # Of a family that an answer does not fit, no more is asked.
            if profile is not named and self._explains(profile, by_rule=True):
                place = self._next_of(profile)
                if place is not None:
                    return Verdict(ask=place)
        if self._trusted or (named in live and (isinstance(what, str) or self._has_words)):
            return Verdict(take=named)
        return Verdict(others=tuple(profile for profile in live if profile.commands()))

    def _by_harm(self, live: list[Profile], command: str) -> Verdict | None:
        """The verdict where it takes fewer questions to rule out whom *command* would harm than to see what it is.

        Nothing has to show the named family then: a halt that harms nobody is no risk, and what the unit is is asked
        behind it.
        """
        named = self._named
        in_danger = [
            each for each in live if each is not named and _telling_places(each) and harms(each, named, command)
        ]
        places = dict.fromkeys(place for each in (named, *in_danger) for place in _telling_places(each))
        ask: list[int] = []
        while in_danger:
            # Of two that rule out as many the one that tells more of the named family, which stands first.
            left = {
                place: [each for each in in_danger if not _rules_out(named, each, place)]
                for place in places
                if place not in self._answers
            }
            best = min(left, key=lambda place: len(left[place]), default=None)
            if best is None or len(left[best]) == len(in_danger):
                return None
            ask.append(best)
            in_danger = left[best]
        if len(ask) + 2 > sum(place not in self._answers for place in _telling_places(named)):
            return None
        return Verdict(ask=ask[0]) if ask else Verdict(take=named) if self._answers else None

    def _between(self, taken: Profile, rivals: list[Profile]) -> Verdict:
        """The verdict on a unit that shows *taken*, where *rivals* could say the same and would take harm."""
        for rival in rivals:
            place = self._telling(taken, rival)
            if place is None and not self._is_told(taken):
                # Nothing but a state speaks for it: then the other one may show itself.
                place = self._next_of(rival)
            if place is not None:
                return Verdict(ask=place)
        rivals = [rival for rival in rivals if self._is_shown(rival)]
        return Verdict(others=(taken, *rivals)) if rivals else Verdict(take=taken)

    def _one_of(self, shown: list[Profile], live: list[Profile], what: str | int) -> Verdict:
        """The verdict on a unit that does not show what it was named as, and shows the families *shown*."""
        if len(shown) > 1 and (place := self._telling(*shown[:2])) is not None:
            return Verdict(ask=place)
        if isinstance(what, int):
            others = tuple(each for each in shown if harms(each, self._named, what))
            return Verdict(others=others) if others else Verdict(take=shown[0])
        for taken in shown:
            halt = halt_of(taken, what)
            if halt is None:
                continue
            verdict = self._between(taken, self._rivals(taken, live, halt))
            if not verdict.others:
                return verdict
        return Verdict(others=tuple(shown))

    def _rivals(self, taken: Profile, live: list[Profile], what: str | int) -> list[Profile]:
        """The families that could have answered the same as *taken*, and that *what* is sent to it is not for.

        A code and a signature say which family it is, so that only those count which would take harm. A state alone
        says little: whoever halts by other words counts.
        """
        others = [each for each in live if each is not taken and self._explains(each)]
        if isinstance(what, int) or self._is_told(taken):
            return [each for each in others if harms(each, taken, what)]
        return [each for each in others if not _halts_alike(each, taken)]

    @property
    def _has_words(self) -> bool:
        """Whether the unit answered any question, and did not refuse them all."""
        return any(answer.word is not None for answer in self._answers.values())

    def _is_live(self, profile: Profile) -> bool:
        """Whether nothing that was heard speaks against *profile*."""
        return not any(self._speaks_against(profile, answer) for answer in self._answers.values())

    def _speaks_against(self, profile: Profile, answer: Answer) -> bool:
        against = _speaks_against(profile, answer)
        return not self._reports(profile) if against is None else against

    def _is_shown(self, profile: Profile) -> bool:
        """Whether its code came, or its whole signature, or where it has neither, one of its states."""
        if codes.is_listed(profile) or signature_of(profile) is not None:
            return self._is_told(profile)
        place = _state_place(profile)
        state = None if place is None else self._answers.get(place)
        # A state alone may be any word: what else was answered must fit, too.
        is_state = state is not None and state.word is not None and profile.state(state.word) != "unknown"
        return is_state and self._explains(profile)

    def _is_told(self, profile: Profile) -> bool:
        """Whether its code came, or its whole signature."""
        if codes.address_of(profile) is not None and codes.is_listed(profile):
            return self._reports(profile)
        return shows(signature_of(profile), self._answers.values())

    def _reports(self, profile: Profile) -> bool:
        """Whether the unit gave a code that is listed for *profile*."""
        place = codes.address_of(profile)
        answer = None if place is None else self._answers.get(place)
        if place is None or answer is None or answer.word is None:
            return False
        return codes.are_own(profile, codes.listed_for(profile, place, answer.word))

    def _explains(self, profile: Profile, *, by_rule: bool = False) -> bool:
        """Whether a unit of *profile* would have answered what was answered: it has something at each such place.

        With *by_rule* also where its addresses may hold a parameter that has no row.
        """
        groups = profile.parameter_groups() if by_rule else ()
        answered = [place for place, answer in self._answers.items() if answer.word is not None]
        return all(profile.name_at(place) is not None or place >> 8 in groups for place in answered)

    def _next_of(self, profile: Profile) -> int | None:
        """What to ask to see whether the unit shows *profile*."""
        return next((place for place in _telling_places(profile) if place not in self._answers), None)

    def _telling(self, one: Profile, other: Profile) -> int | None:
        """What to ask to tell *one* from *other*: best what one has and the other is printed to refuse."""
        places = dict.fromkeys((*_telling_places(other), *_telling_places(one)))
        rated = [(_apart(one, other, place), place) for place in places if place not in self._answers]
        best, place = max(rated, key=lambda each: each[0], default=(0, None))
        return place if best > 0 else None


@functools.lru_cache(maxsize=4096)
def _speaks_against(profile: Profile, answer: Answer) -> bool | None:
    """Whether *answer* alone speaks against *profile*; None where it does unless the unit gave a code of its family."""
    place, word = answer.address, answer.word
    if word is None:
        exception = answer.exception or 0
        known = profile.exceptions()
        if known and exception not in known and exception not in _SPECIFIED:
            # In the words of another maker.
            return True
        lacks = no_such_address(profile, exception) or (place >> 16 and exception == NO_FUNCTION)
        return bool(lacks) and place in _answered(profile)
    if place in _refused(profile):
        return True
    if place == _state_place(profile) and profile.state(word) == "unknown":
        return True if profile.state_reason() is None else None
    rows = codes.listed_for(profile, place, word)
    if not rows or codes.are_own(profile, rows):
        return False
    return place == codes.address_of(profile) or profile.name_at(place) is None


def _apart(one: Profile, other: Profile, place: int) -> int:
    """How well the word at *place* tells two families apart; 0 not at all."""
    best = 0
    for has, lacks in ((one, other), (other, one)):
        if place in _answered(has):
            best = max(best, 4 if place in _refused(lacks) else 2 if lacks.name_at(place) is None else 0)
        elif has.name_at(place) is not None:
            best = max(best, 3 if place in _refused(lacks) else 1 if lacks.name_at(place) is None else 0)
    return best


def _rules_out(named: Profile, other: Profile, place: int) -> bool:
    """Whether what a unit of *named* most likely says to the question for *place* speaks against *other*."""
    if place in _answered(named):
        return place in _refused(other)
    return place in _answered(other) and (place in _refused(named) or named.name_at(place) is None)


def _halts_alike(one: Profile, other: Profile) -> bool:
    """Whether the same words at the same places halt both."""
    return _halts(one) == _halts(other)


@functools.lru_cache(maxsize=256)
def _halts(profile: Profile) -> frozenset[tuple[int, int]]:
    return frozenset(profile.command(name) for name in HALTS if name in profile.commands())


@functools.lru_cache(maxsize=256)
def _state_place(profile: Profile) -> int | None:
    register = profile.role("state")
    return None if register is None else profile.describe(register).place


@functools.lru_cache(maxsize=256)
def _refused(profile: Profile) -> frozenset[int]:
    """The places that no unit of *profile* answers."""
    signature = signature_of(profile)
    return frozenset(() if signature is None else signature["refuses"])


@functools.lru_cache(maxsize=256)
def _answered(profile: Profile) -> frozenset[int]:
    """The places that each unit of *profile* answers, as its own documents print."""
    signature = signature_of(profile)
    printed = frozenset(
        known.place
        for known in map(profile.describe, profile.names())
        if known.place is not None and known.evidence == "verified" and known.access != "wo"
    )
    code = codes.address_of(profile) if codes.is_listed(profile) else None
    answers = () if signature is None else signature["answers"]
    return printed | frozenset(answers) | (frozenset() if code is None else {code})


@functools.lru_cache(maxsize=256)
def _telling_places(profile: Profile) -> tuple[int, ...]:
    """The places that show a unit of *profile*, in the order in which they are asked for."""

    def each() -> Iterator[int | None]:
        if codes.is_listed(profile):
            yield codes.address_of(profile)
        signature = signature_of(profile)
        if signature is not None:
            yield from signature["answers"]
            yield from signature["refuses"]
        yield _state_place(profile)

    return tuple(dict.fromkeys(place for place in each() if place is not None))
