"""What an error advises: texts that name calls and arguments, so that each face can call them by its own names.

A `Text` is a str in Python's words. A program that has others, such as a command line, takes its parts instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

__all__ = ["Advice", "Text", "argument", "call", "joined"]


class Advice(NamedTuple):
    """A call or an argument that helps.

    Attributes:
        name: What it is called, such as `"force"` or `"reset_fault"`.
        value: The value of the argument, or what the call is given; None where any or none is meant.
        written: How it is written in Python: `"force=True"`, `"reset_fault()"`.
    """

    name: str
    value: object
    written: str

    def __str__(self) -> str:
        return self.written


def argument(name: str, value: object = None, written: str = "") -> Advice:
    """The argument *name*. Without *value* any is meant; *written* is how that stands there, if not as itself."""
    return Advice(name, value, f"{name}={written or ('…' if value is None else _quoted(value))}")


def call(name: str) -> Advice:
    """A call of *name*, as a method of what is talked about."""
    return Advice(name, None, f"{name}()")


class Text(str):
    """A text that names calls and arguments.

    Attributes:
        parts: What it is made of, in order: plain texts, and what is named.
    """

    __slots__ = ("parts",)

    parts: tuple[str | Advice, ...]

    def __new__(cls, *parts: object) -> Text:
        """Of *parts*, which are texts with or without names, and names."""
        flat = tuple(_flat(parts))
        made = super().__new__(cls, "".join(map(str, flat)))
        made.parts = flat
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return Text, self.parts

    def rstrip(self, chars: Any = None, /) -> Text:
        """The same, without such characters at the end of its last plain part."""
        *parts, last = self.parts or ("",)
        return Text(*parts, last.rstrip(chars) if isinstance(last, str) else last)


def joined(parts: Iterable[object], between: str, last: str) -> Text:
    """*parts* with *between* them, and *last* before the last of them."""
    *others, end = parts
    woven = [each for other in others for each in (other, between)]
    return Text(*woven[:-1], last, end) if others else Text(end)


def _flat(parts: Iterable[object]) -> Iterator[str | Advice]:
    for part in parts:
        if isinstance(part, Text):
            yield from part.parts
        elif isinstance(part, Advice):
            yield part
        elif part != "":
            yield str(part)


def _quoted(value: object) -> str:
    """*value* as it is typed, texts in the quotes that people type."""
    return f'"{value}"' if isinstance(value, str) else repr(value)
