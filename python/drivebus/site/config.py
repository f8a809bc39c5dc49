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
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drivebus import checks
from drivebus.advice import Text
from drivebus.errors import BadArgument
from drivebus.line.addresses import Addresses
from drivebus.site.entries import SiteDrive, SiteLine
from drivebus.site.mqtt import SiteMqtt, mqtt_of
from drivebus.site.polls import SitePoll, SiteSpool, polls_of, spool_of
from drivebus.site.reading import Reading, Wrong, flag, one_of, quoted, text, texts, whole
from drivebus.site.share import SiteShare, share_of
from drivebus.site.sinks import SitePostgres, SitePrometheus, postgres_of, prometheus_of
from drivebus.site.sparkplug import SiteSparkplug, sparkplug_of
from drivebus.site.web import SitePerson, SiteWeb, people_of, web_of

__all__ = ["FILE", "Site"]

FILE = "drivebus.toml"
"""What the file is called."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_SINKS = ("prometheus", "postgres", "mqtt", "sparkplug")
_SECTIONS = ("lines", "drives", "groups", "share", "poll", "spool", *_SINKS, "web", "people")
_LARGEST = 1_000_000
"""Bytes that such a file may have."""


@dataclass(frozen=True)
class Site:
    """What a `drivebus.toml` says.

    Attributes:
        path: The file.
        lines: Lines by name.
        drives: Drives by name.
        groups: Drives of each group, by its name.
        share: Who may use the lines, beside the programs of one user.
        polls: What a service asks the drives again and again.
        spool: Where it keeps what they say until others have it.
        prometheus: Where Prometheus finds how they are.
        postgres: Where their samples go.
        mqtt: The broker that is told of them, and by which they may be told something.
        sparkplug: The edge node of Sparkplug that they are.
        web: Where people find the page.
        people: Who may log in there.
    """

    path: Path
    lines: Mapping[str, SiteLine]
    drives: Mapping[str, SiteDrive]
    groups: Mapping[str, tuple[SiteDrive, ...]]
    share: SiteShare = field(default_factory=SiteShare)
    polls: tuple[SitePoll, ...] = ()
    spool: SiteSpool | None = None
    prometheus: SitePrometheus | None = None
    postgres: SitePostgres | None = None
    mqtt: SiteMqtt | None = None
    sparkplug: SiteSparkplug | None = None
    web: SiteWeb | None = None
    people: tuple[SitePerson, ...] = ()

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
                raise BadArgument(f'{self.path} has no drive or group "{name}"{hint}; it has {quoted(known)}')
        return list(chosen.values())


class _Reader:
    """One file on its way to a `Site`."""

    def __init__(self, path: Path, data: bytes) -> None:
        self._file = Reading(path, data, FILE)

    def site(self) -> Site:
        """What the file says, or all that is wrong in it."""
        self._file.check_keys(self._file.data, _SECTIONS, ())
        lines = {name: line for name, line in self._tables("lines", self._line) if line is not None}
        drives = {
            name: drive
            for name, drive in self._tables("drives", lambda name, table: self._drive(name, table, lines))
            if drive is not None
        }
        groups = self._groups(drives)
        share = share_of(self._file, lines, drives, groups)
        polls, spool = polls_of(self._file, drives, groups), spool_of(self._file)
        prometheus, postgres = prometheus_of(self._file), postgres_of(self._file)
        mqtt, sparkplug = mqtt_of(self._file, drives, groups), sparkplug_of(self._file)
        web, people = web_of(self._file), people_of(self._file)
        self._file.finish()
        sinks = (prometheus, postgres, mqtt, sparkplug)
        return Site(self._file.path, lines, drives, groups, share, polls, spool, *sinks, web, people)

    def _tables(self, section: str, read: Callable[[str, dict[str, Any]], Any]) -> Iterator[tuple[str, Any]]:
        """Each table in *section*, as *read* makes it."""
        tables = self._file.data.get(section, {})
        if not isinstance(tables, dict):
            self._file.complain((section,), f"{section} is a table of tables, such as [{section}.NAME]")
            return
        for name, table in tables.items():
            if not isinstance(table, dict):
                self._file.complain((section, name), f"{section}.{name} is a table: [{section}.{name}]")
            elif self._is_name((section, name)):
                yield name, read(name, table)

    def _line(self, name: str, table: dict[str, Any]) -> SiteLine | None:
        where = ("lines", name)
        self._file.check_keys(table, ("port", "baud", "format", "rs485", "reserved"), where)
        port = self._file.value(where, table, "port", text, needed=True)
        baud = self._file.value(where, table, "baud", whole(1, 100_000_000))
        characters = self._file.value(where, table, "format", _format)
        rs485 = self._file.value(where, table, "rs485", one_of("kernel", "rts", "auto"))
        reserved = self._file.value(where, table, "reserved", flag) or False
        return None if port is None else SiteLine(name, port, baud, characters, rs485, reserved)

    def _drive(self, name: str, table: dict[str, Any], lines: Mapping[str, SiteLine]) -> SiteDrive | None:
        where = ("drives", name)
        self._file.check_keys(table, ("line", "unit", "profile", "variants", "unverified", "read_only"), where)
        line = self._file.value(where, table, "line", text, needed=True)
        unit = self._file.value(
            where, table, "unit", _unit_of(lines.get(line) if isinstance(line, str) else None), needed=True
        )
        profile = self._file.value(where, table, "profile", text)
        variants = self._file.value(where, table, "variants", texts) or {}
        unverified = self._file.value(where, table, "unverified", flag) or False
        read_only = self._file.value(where, table, "read_only", flag) or False
        if line is not None and line not in lines:
            if line not in self._file.data.get("lines", {}):
                self._file.complain((*where, "line"), f'there is no line "{line}"; there {_there(list(lines))}')
            return None
        if line is None or unit is None:
            return None
        if profile is not None and ("/" in profile or os.sep in profile):
            profile = str(self._file.path.parent / profile)
        return SiteDrive(name, lines[line], unit, profile, variants, unverified, read_only)

    def _groups(self, drives: Mapping[str, SiteDrive]) -> dict[str, tuple[SiteDrive, ...]]:
        groups = self._file.data.get("groups", {})
        if not isinstance(groups, dict):
            self._file.complain(("groups",), 'groups is a table of lists, such as pumps = ["pump1", "pump2"]')
            return {}
        found: dict[str, tuple[SiteDrive, ...]] = {}
        for name, members in groups.items():
            where = ("groups", name)
            if not self._is_name(where):
                continue
            if name in drives:
                self._file.complain(where, f'"{name}" is a drive already; give the group another name')
            if not isinstance(members, list) or not all(isinstance(member, str) for member in members):
                self._file.complain(
                    where, f"{name} is a list of drives, such as [{quoted(list(drives)[:2] or ['pump1'])}]"
                )
                continue
            unknown = [member for member in members if member not in self._file.data.get("drives", {})]
            for member in unknown:
                self._file.complain(where, f'there is no drive "{member}"{checks.closest(member, list(drives))}')
            found[name] = tuple(drives[member] for member in dict.fromkeys(members) if member in drives)
        return found

    def _is_name(self, where: tuple[str, ...]) -> bool:
        if _NAME.fullmatch(where[-1]):
            return True
        self._file.complain(where, f'"{where[-1]}" is not a name: a letter, then letters, digits, "_" and "-"')
        return False


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
        raise Wrong(told)

    return read


def _format(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[78][NEO][12]", value.upper()):
        raise Wrong('give data bits (7, 8), parity (N, E, O) and stop bits (1, 2), such as "8E1"')
    return value.upper()


def _there(names: list[str]) -> str:
    return f"{'is' if len(names) == 1 else 'are'} {quoted(names)}"
