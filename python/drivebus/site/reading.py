"""A file of TOML on its way to what it says: each value is checked, and each mistake is told with its line."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from itertools import takewhile
from pathlib import Path
from typing import Any, Literal, TypeAlias

from drivebus import checks
from drivebus.errors import BadArgument

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "Key",
    "Reading",
    "Wrong",
    "address",
    "dead_man_of",
    "flag",
    "listed",
    "number",
    "one_of",
    "quoted",
    "text",
    "texts",
    "whole",
]

Key: TypeAlias = "tuple[str | int, ...]"
"""Where a value stands: the names of its tables and its own, and numbers within lists."""


class Wrong(Exception):
    """One value that is not what it should be."""


class Reading:
    """One file being read.

    Args:
        path: The file.
        data: Its bytes.
        kind: What such a file is called.

    Raises:
        BadArgument: It is not text, or not TOML.
    """

    def __init__(self, path: Path, data: bytes, kind: str) -> None:
        self.path = path
        self._wrong: list[tuple[int, str]] = []
        try:
            self._text = data.decode("utf-8")
            self.data: dict[str, Any] = tomllib.loads(self._text)
        except UnicodeDecodeError:
            raise BadArgument(f"{path} is not a {kind}: it is not text in UTF-8") from None
        except tomllib.TOMLDecodeError as error:
            line = re.search(r"at line (\d+)", str(error))
            shown = re.sub(r" \(at .*\)$", "", str(error))
            where = f"{path}:{line[1]}" if line else f"{path}, at its end"
            raise BadArgument(f"{where}: not TOML: {shown[:1].lower()}{shown[1:]}") from None
        except RecursionError:
            raise BadArgument(f"{path} is not a {kind}: its values are nested too deeply") from None

    def finish(self) -> None:
        """Raises `BadArgument` with all that is wrong, if anything is."""
        if self._wrong:
            count = "one mistake" if len(self._wrong) == 1 else f"{len(self._wrong)} mistakes"
            told = [f"{self.path}:{line}: {reason}" for line, reason in sorted(self._wrong)]
            raise BadArgument("\n".join([f"{self.path} has {count}; nothing was opened:", *told]))

    def value(
        self,
        where: Key,
        table: Mapping[str, Any],
        key: str,
        read: Callable[[Any], Any],
        needed: bool = False,
        is_secret: bool = False,
    ) -> Any:
        """The value of *key*, or None where there is none or a wrong one, of which the message tells.

        What is secret stands in no message.
        """
        if key not in table:
            if needed:
                self.complain(where, f"{'.'.join(each for each in where if isinstance(each, str))} has no {key}")
            return None
        try:
            return read(table[key])
        except Wrong as error:
            shown = "…" if is_secret else _shown(table[key])
            self.complain((*where, key), f"{key} = {shown}: {error}")
            return None

    def check_keys(self, table: Mapping[str, Any], allowed: tuple[str, ...], where: Key) -> None:
        """Complains of what *table* has beside what is *allowed*."""
        for key in table:
            if key not in allowed:
                hint = checks.closest(key, allowed)
                self.complain((*where, key), f'"{key}" is not known here{hint}; allowed is {quoted(allowed)}')

    def section(self, name: str, allowed: tuple[str, ...]) -> dict[str, Any] | None:
        """The table *name* of the file, which may have the keys *allowed*; None where there is no such table."""
        table = self.data.get(name)
        if table is None:
            return None
        if not isinstance(table, dict):
            self.complain((name,), f"{name} is a table: [{name}]")
            return None
        self.check_keys(table, allowed, (name,))
        return table

    def tables(self, table: Mapping[str, Any], where: Key) -> list[tuple[Key, dict[str, Any]]]:
        """The tables of the list at *where*, which is in *table*, each with where it stands itself."""
        name = str(where[-1])
        found = table.get(name, [])
        if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
            dotted = ".".join(str(each) for each in where if isinstance(each, str))
            self.complain(where, f"{name} is a list of tables: [[{dotted}]]")
            return []
        return [((*where, place), each) for place, each in enumerate(found)]

    def complain(self, where: Key, reason: str) -> None:
        """What stands at *where* is wrong, for *reason*."""
        self._wrong.append((self.line_of(where), reason))

    def line_of(self, where: Key) -> int:
        """The line in which the key at *where* stands; the nearest one above it where it is written otherwise."""
        section: Key = ()
        counts: dict[Key, int] = {}
        best, depth = 1, 0
        for number, line in enumerate(self._text.splitlines(), 1):
            header = re.match(r"\s*(\[\[?)([^\[\]]+)\]", line)
            if header is not None:
                section = here = _section(_keys(header[2]), counts, is_list=header[1] == "[[")
            else:
                key = re.match(r"\s*([^=#]+?)\s*=", line)
                here = (*section, *_keys(key[1])) if key is not None else ()
            same = sum(1 for _ in takewhile(lambda both: both[0] == both[1], zip(here, where, strict=False)))
            if same > depth:
                best, depth = number, same
        return best


def _section(names: tuple[str, ...], counts: dict[Key, int], *, is_list: bool) -> Key:
    """Where the table of a header is: tables of a list are numbered, and those in one of them are in the latest."""
    here: Key = ()
    for place, name in enumerate(names, 1):
        here = (*here, name)
        if is_list and place == len(names):
            counts[here] = counts.get(here, -1) + 1
        if here in counts:
            here = (*here, counts[here])
    return here


def _keys(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def text(value: Any) -> str:
    """A text with something in it."""
    if not isinstance(value, str) or not value.strip():
        raise Wrong("not a text")
    return value


def flag(value: Any) -> bool:
    """A yes or a no."""
    if not isinstance(value, bool):
        raise Wrong("neither true nor false")
    return value


def whole(low: int, high: int) -> Callable[[Any], int]:
    """A whole number in this range."""

    def read(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise Wrong(f"not a whole number from {low} to {high}")
        return value

    return read


def number(low: float, high: float) -> Callable[[Any], float]:
    """A number in this range."""

    def read(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise Wrong(f"not a number from {low:g} to {high:g}")
        return float(value)

    return read


def one_of(*allowed: str) -> Callable[[Any], str]:
    """One of the texts *allowed*."""

    def read(value: Any) -> str:
        if value not in allowed:
            raise Wrong(f"allowed is {quoted(allowed)}")
        return str(value)

    return read


def address(value: Any) -> str:
    """`host:port`, or `[host]:port`."""
    if not isinstance(value, str) or not re.fullmatch(r".+:\d{1,5}", value) or int(value.rpartition(":")[2]) > 0xFFFF:
        raise Wrong('not an address and a port, such as "127.0.0.1:1502"')
    return value


def dead_man_of(low: float, high: float) -> Callable[[Any], float | Literal["off"]]:
    """Seconds in this range after which the motor of who is gone is halted, or `"off"`, which one has to type."""

    def read(value: Any) -> float | Literal["off"]:
        if value == "off":
            return "off"
        try:
            return number(low, high)(value)
        except Wrong:
            raise Wrong(f'neither "off" nor seconds from {low:g} to {high:g}') from None

    return read


def texts(value: Any) -> dict[str, str]:
    """A table of texts."""
    if not isinstance(value, dict) or not all(isinstance(each, str) for each in value.values()):
        raise Wrong('not a table of texts, such as { speed_unit = "Hz" }')
    return value


def listed(read: Callable[[Any], Any], example: str) -> Callable[[Any], list[Any]]:
    """A list, each of whose values *read* takes; such as the *example*."""

    def read_all(value: Any) -> list[Any]:
        if not isinstance(value, list):
            raise Wrong(f"not a list, such as {example}")
        return [read(each) for each in value]

    return read_all


def quoted(names: Iterable[str]) -> str:
    """*names* for people."""
    return ", ".join(f'"{name}"' for name in names) or "none"


def _shown(value: Any) -> str:
    shown = f'"{value}"' if isinstance(value, str) else str(value)
    return shown if len(shown) <= 60 else f"{shown[:60]}…"
