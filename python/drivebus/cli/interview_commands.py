"""The questions about commands: which words run the motor, stop it and reset a fault, and where they go."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivebus import tables
from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.interview_registers import COMMAND, RegisterQuestions, allow, insist, widen
from drivebus.cli.interview_tables import Pages
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.printed_words import prints_words, words_of
from drivebus.cli.profile_answers import Commands

__all__ = ["CommandQuestions"]

_COMMANDS = {
    "run_forward": "Word that runs the motor forward (clockwise; look which way it turns)",
    "run_reverse": "Word that runs it in reverse",
    "stop": "Word that stops it along its ramp",
    "coast": "Word that lets it coast",
}
_RESET = "Word that resets a fault; ADDRESS=WORD if it goes elsewhere, such as 2002H=2"


class CommandQuestions:
    """What is asked about commands."""

    def __init__(self, dialogue: Dialogue, pages: Pages, registers: RegisterQuestions) -> None:
        self._dialogue = dialogue
        self._pages = pages
        self._registers = registers

    def commands(self) -> Commands | None:
        """How the motor is told what to do."""
        register = self._registers.named(COMMAND)
        if register is None:
            return None
        allow(register, "wo")
        words: dict[str, int] = {}
        elsewhere: dict[str, tuple[TableRow, int]] = {}
        for command, question in _COMMANDS.items():
            word = self._dialogue.optional(question, self._printed(register, words))
            if word is not None:
                words[command] = word
        reset = self._dialogue.optional(_RESET, lambda text: self._reset(text, register, words))
        if reset is not None:
            row, word = reset
            if row is register:
                words["reset_fault"] = word
            else:
                elsewhere["reset_fault"] = reset
        if not words:
            self._dialogue.say("Then it is not told anything by name.")
            return None
        if "run_forward" in words and not {"stop", "coast"} & set(words):
            self._dialogue.say("Without a stop and a coast it is not started by name.")
        widen(register, [*words.values()])
        said = (f"{command.replace('_', ' ')} {word:04X}H" for command, word in words.items())
        self._dialogue.say(f"{register.name} ({tables.shown(register.address)}) takes {', '.join(said)}.")
        told = prints_words(register, words.values())
        source = self._pages.source_of(register, is_printed=told)
        is_printed = self._dialogue.agreed("Are these words in the manual of this very drive?", default=True)
        return Commands(register, words, elsewhere, is_printed, source)

    def _printed(self, row: TableRow, words: Mapping[str, int]) -> Callable[[str], int]:
        """What reads a word of a command; it asks once more where the table has words, and not this one."""
        told = " ".join(row.notes)
        numbers = words_of(row) if told else set()
        new = values.new(words, values.command_word)

        def read(text: str) -> int:
            word = new(text)
            if numbers and word not in numbers:
                self._dialogue.meant(told, text)
            return word

        return read

    def _reset(self, text: str, register: TableRow, words: Mapping[str, int]) -> tuple[TableRow, int]:
        """A word that means one thing only to *register*, or another register and its word."""
        place, equals, said = (part.strip() for part in text.rpartition("="))
        named = self._registers.table.called(place) if equals else register
        address = named.address if named is not None else values.place(place)[1]
        if address == register.address:
            return register, self._printed(register, words)(said)
        word = values.command_word(said)
        known = self._registers.table.at(address)
        if known is not None:
            insist(self._dialogue, known, "Register that resets a fault", "command", ())
        row = known or self._registers.table.add(address, "Fault reset", self._pages.source())
        allow(row, "wo")
        widen(row, [word])
        return row, word
