"""The questions about the state: what a register shows while the motor runs, stands still or has a fault."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.interview_registers import STATE, RegisterQuestions
from drivebus.cli.interview_tables import Pages, one_of
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.printed_words import prints_bits, prints_words
from drivebus.cli.profile_answers import Bits, State
from drivebus.cli.wrong_use import WrongUse

__all__ = ["StateQuestions"]

T = TypeVar("T")

_STATES = {
    "forward": "while it runs forward",
    "reverse": "while it runs in reverse",
    "running": "while it runs, whichever way",
    "stopped": "while it stands still",
    "fault": "while it has a fault",
}
_BY_BITS = ("fault", "forward", "reverse", "running", "stopped")
"""Of those that fit, the first counts, where none is a running motor."""
_AGAIN = "Then it is told otherwise, or by another register: back leads to that"


class StateQuestions:
    """What is asked about the state."""

    def __init__(self, dialogue: Dialogue, pages: Pages, registers: RegisterQuestions) -> None:
        self._dialogue = dialogue
        self._pages = pages
        self._registers = registers

    def state(self) -> State | None:
        """Where the drive tells what the motor does."""
        register = self._registers.named(STATE)
        if register is None:
            return None
        register.scale = 1
        question = "It tells by one number for each state, or by bits (number, bits)"
        state = self._dialogue.needed(question, lambda text: self._described(register, text))
        if state is None:
            return None
        if state.numbers:
            told = prints_words(register, state.numbers.values())
        else:
            told = prints_bits(register, [field for each in state.bits.values() for field in each])
        state.source = self._pages.source_of(register, is_printed=told)
        return state

    def _described(self, register: TableRow, text: str) -> State | None:
        """What *register* shows in each state, by numbers or by bits as *text* says, if the drive shows one of them."""
        if one_of(("number", "bits"))(text) == "number":
            state = State(register, self._each_state(_STATES, "Number", values.word), {}, "")
        else:
            bits = self._each_state(_BY_BITS, "Bits, such as 0=1, 4-3=2,", values.bits, _is_shown)
            state = State(register, {}, bits, "")
        if not (state.numbers or state.bits):
            return None
        self._compare(state)
        return state

    def _compare(self, state: State) -> None:
        """Asks whether the motor does what the drive shows now.

        Raises:
            WrongUse: It does not.
        """
        beside = self._registers.beside
        word = beside.word(state.register.place)
        if word is None:
            return
        now = f"{state.register.name} shows {word:04X}H now"
        shown = state.shown_by(word)
        if shown is None:
            self._dialogue.insisted(f"{now}, which is none of these. Are they right all the same?", f"{now}. {_AGAIN}")
            return
        does = _STATES[shown].removeprefix("while ")
        if not self._dialogue.agreed(f"{now}: {does}. Is that so?", default=None):
            raise WrongUse(f"{now}: not that {does}. {_AGAIN}")
        beside.state = shown

    def _each_state(
        self,
        states: Iterable[str],
        question: str,
        read: Callable[[str], T],
        check: Callable[[str, T, Mapping[str, T]], None] = lambda _state, _told, _known: None,
    ) -> dict[str, T]:
        """What tells each of *states*, where *check* agrees.

        Who has named a direction is not asked for a state without one.
        """
        known: dict[str, T] = {}
        new = values.new(known, read)
        for state in states:
            if state == "running" and {"forward", "reverse"} & set(known):
                continue

            def checked(text: str, state: str = state) -> T:
                told = new(text)
                check(state, told, known)
                return told

            told = self._dialogue.optional(f"{question} {_STATES[state]}", checked)
            if told is not None:
                known[state] = told
        return known


def _is_shown(state: str, told: Bits, known: Mapping[str, Bits]) -> None:
    """That *told* leaves each state to be told: the first of *known* that fits is the one that counts."""
    for other, bits in known.items():
        shown = ", ".join(
            f"{high}={value}" if high == low else f"{high}-{low}={value}" for (high, low), value in bits.items()
        )
        if bits.items() <= told.items():
            raise WrongUse(f"{other} is told by {shown}, and so {state} would never be. Which bit is another one then?")
        if state == "stopped" and told.items() <= bits.items():
            raise WrongUse(f"a motor that runs {other} shows that too ({shown})")
