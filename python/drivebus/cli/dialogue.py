"""Questions on the terminal, one after the other, of which the last answer can be taken back."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NamedTuple, TypeVar, cast

import click

from drivebus.cli.present.output import remark
from drivebus.cli.wrong_use import WrongUse

__all__ = ["Dialogue"]

T = TypeVar("T")

_BACK = "back"


class _Seen(NamedTuple):
    """What was found between two answers."""

    what: object


class _TakenBack(Exception):  # it is no error
    """The last answer is not meant."""


class Dialogue:
    """What was asked and answered. To take an answer back, all before it is gone through again, in silence.

    A question may be part of reading another answer: that answer is then taken back with it.
    """

    def __init__(self) -> None:
        self._given: list[str | _Seen] = []
        self._place = 0

    def held(self, ask: Callable[[], T]) -> T:
        """What *ask* comes to, which asks by this dialogue, and begins anew each time that it is called."""
        while True:
            self._place = 0
            try:
                return ask()
            except _TakenBack:
                while isinstance(self._given.pop(), _Seen):
                    pass

    def needed(self, question: str, read: Callable[[str], T], default: str | None = None) -> T:
        """What *read* makes of an answer, asked for until it can; Enter is *default*, if there is one.

        Raises:
            click.Abort: The input ended, or Ctrl-C was pressed.
        """
        if self._place < len(self._given):
            before = self._place
            try:
                return self._taken(str(self._given[before]), read)
            except click.UsageError as error:
                # A part of reading it was taken back, and what was answered then speaks against it.
                del self._given[before:]
                self._place = before
                remark(f"Error: {error.message}")

        def heard(said: str) -> T:
            if default is None and not said.strip():
                raise WrongUse("this is needed")
            if said.strip().lower() == _BACK:
                if not self._given:
                    raise WrongUse("this is the first question")
                raise _TakenBack
            before = len(self._given)
            self._given.append(said)
            try:
                return self._taken(said, read)
            except click.UsageError:
                del self._given[before:]
                self._place = before
                raise

        answer: T = click.prompt(
            question, default=default or "", show_default=bool(default), value_proc=heard, err=True
        )
        return answer

    def optional(self, question: str, read: Callable[[str], T]) -> T | None:
        """As `needed`; None where Enter leaves it out."""
        return self.needed(question, lambda said: read(said.strip()) if said.strip() else None, "")

    def agreed(self, question: str, *, default: bool | None) -> bool:
        """Yes or no; with None for *default*, Enter is neither."""
        choices = {True: "Y/n", False: "y/N", None: "y/n"}[default]
        return self.needed(f"{question} [{choices}]", lambda said: _agreed(said, default), "")

    def insisted(self, question: str, else_said: str) -> None:
        """Asks whether what speaks against the tables is meant.

        Raises:
            WrongUse: It is not: *else_said* says what is wrong.
        """
        if not self.agreed(question, default=False):
            raise WrongUse(else_said)

    def meant(self, told: str, text: str) -> None:
        """Asks whether an answer is meant, where the table has what was *told*."""
        question = f"{told[:1].upper()}{told[1:]}. Is it {text} all the same?"
        self.insisted(question, f"{text} is not what the table says")

    def pasted(self) -> str:
        """Lines of the input, until a dot stands alone in one."""
        if self._place == len(self._given):
            remark("Paste it; then a dot on a line of its own.")
            lines: list[str] = []
            while (line := sys.stdin.readline()).strip() != "." and line:
                lines.append(line)
            self._given.append("".join(lines))
        return self._taken(str(self._given[self._place]), str)

    def seen(self, look: Callable[[], T]) -> T:
        """What *look* finds now; as it was found, where this is gone through again."""
        if self._place == len(self._given):
            self._given.append(_Seen(look()))
        found = self._given[self._place]
        self._place += 1
        return cast("T", found.what if isinstance(found, _Seen) else found)

    def say(self, text: str) -> None:
        """Says *text*, once."""
        if self._place == len(self._given):
            remark(text)

    def _taken(self, said: str, read: Callable[[str], T]) -> T:
        self._place += 1
        return read(said)


def _agreed(said: str, default: bool | None) -> bool:
    if not said.strip() and default is not None:
        return default
    answer = {"y": True, "yes": True, "n": False, "no": False}.get(said.strip().lower())
    if answer is None:
        raise WrongUse(f'"{said.strip()}" is neither y nor n')
    return answer
