"""`drivebus.toml`: the lines one owns with their settings, the drives on them by name, and groups of drives.

    [lines.hall]
    port = "/dev/ttyUSB0"
    baud = 19200

    [drives.pump1]
    line = "hall"
    unit = 1
    profile = "gd350"

    [groups]
    pumps = ["pump1", "pump2"]

Every mistake is told with its line. Nothing is opened here, and nothing is asked.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from drivebus import checks
from drivebus.advice import Text
from drivebus.errors import BadArgument
from drivebus.line.addresses import Addresses

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["FILE", "Site", "SiteDrive", "SiteLine"]

FILE = "drivebus.toml"
"""What the file is called."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_LARGEST = 1_000_000
"""Bytes that such a file may have."""


@dataclass(frozen=True)
class SiteLine:
    """A line with its settings; what is None is as usual.

    Attributes:
        name: What it is called.
        port: What to open.
        baud: Bits per second.
        format: Data bits, parity and stop bits, such as `"8E1"`.
        rs485: Who switches the direction: `"kernel"`, `"rts"` or `"auto"`.
        reserved: Whether it has units that the specification reserves, as `drivebus.Bus` takes it.
    """

    name: str
    port: str
    baud: int | None = None
    format: str | None = None
    rs485: str | None = None
    reserved: bool = False

    @property
    def addresses(self) -> Addresses:
        """Which units it may have."""
        return Addresses.of(self.port, reserved=self.reserved)


@dataclass(frozen=True)
class SiteDrive:
    """A drive on one of the lines.

    Attributes:
        name: What it is called.
        line: The line it hangs on.
        unit: Its address, 1..247, or another that its line has.
        profile: Its family, or the folder of a profile; None asks the drive.
        variants: What parameters of the drive decide, by name.
        unverified: Whether what no document of its family proves may be used.
        read_only: Whether nothing may be written to it.
    """

    name: str
    line: SiteLine
    unit: int
    profile: str | None = None
    variants: Mapping[str, str] = field(default_factory=dict)
    unverified: bool = False
    read_only: bool = False


@dataclass(frozen=True)
class Site:
    """What a `drivebus.toml` says.

    Attributes:
        path: The file.
        lines: Lines by name.
        drives: Drives by name.
        groups: Drives of each group, by its name.
    """

    path: Path
    lines: Mapping[str, SiteLine]
    drives: Mapping[str, SiteDrive]
    groups: Mapping[str, tuple[SiteDrive, ...]]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Site:
        """The site in the file at *path*.

        Raises:
            NotAllowed: It cannot be read, or something in it is wrong; each mistake is named with its line.
        """
        place = Path(path)
        try:
            with place.open("rb") as file:
                data = file.read(_LARGEST + 1)
        except (OSError, ValueError) as error:
            raise BadArgument(f"{place} cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if len(data) > _LARGEST:
            raise BadArgument(f"{place} is not a {FILE}: it has more than {_LARGEST} bytes")
        return _Reader(place, data).site()

    def select(self, names: Iterable[str]) -> list[SiteDrive]:
        """The drives that *names* of drives and groups mean, each once, in their order.

        Raises:
            NotAllowed: One is neither; the message has the closest.
        """
        chosen: dict[str, SiteDrive] = {}
        for name in names:
            if name in self.drives:
                chosen.setdefault(name, self.drives[name])
            elif name in self.groups:
                chosen |= {drive.name: drive for drive in self.groups[name] if drive.name not in chosen}
            else:
                known = [*self.drives, *self.groups]
                hint = checks.closest(name, known)
                raise BadArgument(f'{self.path} has no drive or group "{name}"{hint}; it has {_list(known)}')
        return list(chosen.values())


class _Wrong(Exception):
    """One value that is not what it should be."""


class _Reader:
    """One file on its way to a `Site`."""

    def __init__(self, path: Path, data: bytes) -> None:
        self._path = path
        self._wrong: list[tuple[int, str]] = []
        try:
            self._text = data.decode("utf-8")
            self._data = tomllib.loads(self._text)
        except UnicodeDecodeError:
            raise BadArgument(f"{path} is not a {FILE}: it is not text in UTF-8") from None
        except tomllib.TOMLDecodeError as error:
            line = re.search(r"at line (\d+)", str(error))
            shown = re.sub(r" \(at .*\)$", "", str(error))
            where = f"{path}:{line[1]}" if line else f"{path}, at its end"
            raise BadArgument(f"{where}: not TOML: {shown[:1].lower()}{shown[1:]}") from None
        except RecursionError:
            raise BadArgument(f"{path} is not a {FILE}: its values are nested too deeply") from None

    def site(self) -> Site:
        """What the file says, or all that is wrong in it."""
        self._check_keys(self._data, ("lines", "drives", "groups"), ())
        lines = {name: line for name, line in self._tables("lines", self._line) if line is not None}
        drives = {
            name: drive
            for name, drive in self._tables("drives", lambda name, table: self._drive(name, table, lines))
            if drive is not None
        }
        groups = self._groups(drives)
        if self._wrong:
            count = "one mistake" if len(self._wrong) == 1 else f"{len(self._wrong)} mistakes"
            told = [f"{self._path}:{line}: {reason}" for line, reason in sorted(self._wrong)]
            raise BadArgument("\n".join([f"{self._path} has {count}; nothing was opened:", *told]))
        return Site(self._path, lines, drives, groups)

    def _tables(self, section: str, read: Callable[[str, dict[str, Any]], Any]) -> Iterator[tuple[str, Any]]:
        """Each table in *section*, as *read* makes it."""
        tables = self._data.get(section, {})
        if not isinstance(tables, dict):
            self._complain((section,), f"{section} is a table of tables, such as [{section}.NAME]")
            return
        for name, table in tables.items():
            if not isinstance(table, dict):
                self._complain((section, name), f"{section}.{name} is a table: [{section}.{name}]")
            elif self._is_name((section, name)):
                yield name, read(name, table)

    def _line(self, name: str, table: dict[str, Any]) -> SiteLine | None:
        where = ("lines", name)
        self._check_keys(table, ("port", "baud", "format", "rs485", "reserved"), where)
        port = self._value(where, table, "port", _text, needed=True)
        baud = self._value(where, table, "baud", _whole(1, 100_000_000))
        characters = self._value(where, table, "format", _format)
        rs485 = self._value(where, table, "rs485", _one_of("kernel", "rts", "auto"))
        reserved = self._value(where, table, "reserved", _flag) or False
        return None if port is None else SiteLine(name, port, baud, characters, rs485, reserved)

    def _drive(self, name: str, table: dict[str, Any], lines: Mapping[str, SiteLine]) -> SiteDrive | None:
        where = ("drives", name)
        self._check_keys(table, ("line", "unit", "profile", "variants", "unverified", "read_only"), where)
        line = self._value(where, table, "line", _text, needed=True)
        unit = self._value(
            where, table, "unit", _unit_of(lines.get(line) if isinstance(line, str) else None), needed=True
        )
        profile = self._value(where, table, "profile", _text)
        variants = self._value(where, table, "variants", _texts) or {}
        unverified = self._value(where, table, "unverified", _flag) or False
        read_only = self._value(where, table, "read_only", _flag) or False
        if line is not None and line not in lines:
            if line not in self._data.get("lines", {}):
                self._complain((*where, "line"), f'there is no line "{line}"; there {_there(list(lines))}')
            return None
        if line is None or unit is None:
            return None
        if profile is not None and ("/" in profile or os.sep in profile):
            profile = str(self._path.parent / profile)
        return SiteDrive(name, lines[line], unit, profile, variants, unverified, read_only)

    def _groups(self, drives: Mapping[str, SiteDrive]) -> dict[str, tuple[SiteDrive, ...]]:
        groups = self._data.get("groups", {})
        if not isinstance(groups, dict):
            self._complain(("groups",), 'groups is a table of lists, such as pumps = ["pump1", "pump2"]')
            return {}
        found: dict[str, tuple[SiteDrive, ...]] = {}
        for name, members in groups.items():
            where = ("groups", name)
            if not self._is_name(where):
                continue
            if name in drives:
                self._complain(where, f'"{name}" is a drive already; give the group another name')
            if not isinstance(members, list) or not all(isinstance(member, str) for member in members):
                self._complain(where, f"{name} is a list of drives, such as [{_list(list(drives)[:2] or ['pump1'])}]")
                continue
            unknown = [member for member in members if member not in self._data.get("drives", {})]
            for member in unknown:
                self._complain(where, f'there is no drive "{member}"{checks.closest(member, list(drives))}')
            found[name] = tuple(drives[member] for member in dict.fromkeys(members) if member in drives)
        return found

    def _value(
        self, where: tuple[str, ...], table: dict[str, Any], key: str, read: Callable[[Any], Any], needed: bool = False
    ) -> Any:
        """The value of *key*, or None where there is none or a wrong one, of which the message tells."""
        if key not in table:
            if needed:
                self._complain(where, f"{'.'.join(where)} has no {key}")
            return None
        try:
            return read(table[key])
        except _Wrong as error:
            self._complain((*where, key), f"{key} = {_shown(table[key])}: {error}")
            return None

    def _check_keys(self, table: Mapping[str, Any], allowed: tuple[str, ...], where: tuple[str, ...]) -> None:
        for key in table:
            if key not in allowed:
                hint = checks.closest(key, allowed)
                self._complain((*where, key), f'"{key}" is not known here{hint}; allowed is {_list(allowed)}')

    def _is_name(self, where: tuple[str, ...]) -> bool:
        if _NAME.fullmatch(where[-1]):
            return True
        self._complain(where, f'"{where[-1]}" is not a name: a letter, then letters, digits, "_" and "-"')
        return False

    def _complain(self, where: tuple[str, ...], reason: str) -> None:
        self._wrong.append((_line_of(self._text, where), reason))


def _line_of(text: str, where: tuple[str, ...]) -> int:
    """The line of *text* in which the key at *where* stands; the nearest one above it where it is written otherwise."""
    section: tuple[str, ...] = ()
    best, depth = 1, 0
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[([^\[\]]+)\]", line)
        if header is not None:
            section = here = _keys(header[1])
        else:
            key = re.match(r"\s*([^=#]+?)\s*=", line)
            here = (*section, *_keys(key[1])) if key is not None else ()
        same = sum(1 for _ in takewhile(lambda both: both[0] == both[1], zip(here, where, strict=False)))
        if same > depth:
            best, depth = number, same
    return best


def _keys(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise _Wrong("not a text")
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _Wrong("neither true nor false")
    return value


def _whole(low: int, high: int) -> Callable[[Any], int]:
    def read(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise _Wrong(f"not a whole number from {low} to {high}")
        return value

    return read


def _unit_of(line: SiteLine | None) -> Callable[[Any], int]:
    """The address of a unit on *line*; None is one that is not there, or is wrong itself."""
    addresses = Addresses() if line is None else line.addresses

    def read(value: Any) -> int:
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        why = addresses.why_not(value) if is_whole else ""
        if is_whole and not why:
            return int(value)
        told = f"not a whole number from {checks.UNITS[0]} to {checks.UNITS[-1]}"
        if line is not None and why:
            here = f"say reserved = true in [lines.{line.name}]"
            told += "; " + "".join(part if isinstance(part, str) else here for part in Text(why).parts)
        raise _Wrong(told)

    return read


def _one_of(*allowed: str) -> Callable[[Any], str]:
    def read(value: Any) -> str:
        if value not in allowed:
            raise _Wrong(f"allowed is {_list(allowed)}")
        return str(value)

    return read


def _format(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[78][NEO][12]", value.upper()):
        raise _Wrong('give data bits (7, 8), parity (N, E, O) and stop bits (1, 2), such as "8E1"')
    return value.upper()


def _texts(value: Any) -> dict[str, str]:
    if not isinstance(value, dict) or not all(isinstance(text, str) for text in value.values()):
        raise _Wrong('not a table of texts, such as { speed_unit = "Hz" }')
    return value


def _shown(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


def _list(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"


def _there(names: list[str]) -> str:
    return f"{'is' if len(names) == 1 else 'are'} {_list(names)}"
