"""Who may use the lines of a site: the users of a group, and clients over the network, as `drivebus serve` lets them.

    [share]
    group = "plant"

    [[share.tcp]]
    line = "hall"
    address = "192.168.7.10:1502"
    dead_man = 2.0

    [[share.tcp.allow]]
    networks = ["192.168.7.0/24"]
    drives = ["pumps"]
    commands = ["run", "setpoint"]

Here it is read. What the names of registers and commands mean, and whether they may be allowed, the families know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from drivebus import checks
from drivebus.site.entries import SiteDrive, SiteLine, drives_named
from drivebus.site.reading import (
    Key,
    Reading,
    Wrong,
    address,
    dead_man_of,
    flag,
    listed,
    number,
    one_of,
    quoted,
    text,
    whole,
)

__all__ = ["SiteAllow", "SiteGateway", "SiteShare", "share_of"]

_WITHIN, _DEAD_MAN = (0.05, 60.0), (0.1, 3600.0)
"""Seconds, as `drivebus.Gateway` takes them."""

_OF_BOTH = ("line", "answer_within", "dead_man", "allow")
_RULE = ("networks", "drives", "units", "functions", "write", "commands")
"""The keys of a table for clients over the network or at a pseudo-terminal, and of its rules."""


@dataclass(frozen=True)
class SiteAllow:
    """What clients of some networks may do, as `drivebus.Allow` has it.

    Attributes:
        networks: Whose clients; none: everybody's.
        drives: The drives.
        units: Units that are no drives.
        functions: Function codes; None: the usual ones.
        write: Registers and parameters that may be written.
        commands: Commands that may be given.
        lines: In which line of the file each key stands, and the table itself by an empty name.
    """

    networks: tuple[str, ...] = ()
    drives: tuple[SiteDrive, ...] = ()
    units: tuple[int, ...] = ()
    functions: tuple[int, ...] | None = None
    write: tuple[str | int, ...] = ()
    commands: tuple[str, ...] = ()
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SiteGateway:
    """Where clients of Modbus find a line, as `drivebus.Gateway` has it.

    Attributes:
        line: The line.
        address: `host:port`, or the path of a pseudo-terminal.
        framing: `"tcp"`, or `"rtu"` for RTU over TCP.
        answer_within: Seconds until an answer goes out at the latest.
        dead_man: Seconds of silence after which a motor is halted, `"off"`, or None where it is not said.
        allow: What clients may do; none: all may read.
        at: In which line of the file its table begins.
    """

    line: SiteLine
    address: str
    framing: Literal["tcp", "rtu"] = "tcp"
    answer_within: float = 1.0
    dead_man: float | Literal["off"] | None = None
    allow: tuple[SiteAllow, ...] = ()
    at: int = 1


@dataclass(frozen=True)
class SiteShare:
    """Who may use the lines.

    Attributes:
        group: The group of the system whose users may use them through the service; None: its own user alone.
        audit: The file that each write over the network is appended to; None: none.
        realtime: Whether the threads of the lines go before all others of the computer.
        gateways: Where clients find them: over the network, or as a serial port.
    """

    group: str | None = None
    audit: Path | None = None
    realtime: bool = False
    gateways: tuple[SiteGateway, ...] = ()


def share_of(
    file: Reading,
    lines: Mapping[str, SiteLine],
    drives: Mapping[str, SiteDrive],
    groups: Mapping[str, tuple[SiteDrive, ...]],
) -> SiteShare:
    """What *file* says of sharing; what is wrong in it is complained of."""
    table = file.section("share", ("group", "audit", "realtime", "tcp", "pty"))
    if table is None:
        return SiteShare()
    group = file.value(("share",), table, "group", text)
    audit = file.value(("share",), table, "audit", text)
    realtime = file.value(("share",), table, "realtime", flag) or False
    reader = _Gateways(file, lines, drives, groups)
    tcp = [reader.tcp(each, where) for where, each in file.tables(table, ("share", "tcp"))]
    pty = [reader.pty(each, where) for where, each in file.tables(table, ("share", "pty"))]
    gateways = tuple(each for each in [*tcp, *pty] if each is not None)
    return SiteShare(group, None if audit is None else file.path.parent / audit, realtime, gateways)


@dataclass(frozen=True)
class _Gateways:
    """Reads the tables of addresses and of pseudo-terminals."""

    file: Reading
    lines: Mapping[str, SiteLine]
    drives: Mapping[str, SiteDrive]
    groups: Mapping[str, tuple[SiteDrive, ...]]

    def tcp(self, table: dict[str, Any], where: Key) -> SiteGateway | None:
        file = self.file
        file.check_keys(table, ("address", "framing", *_OF_BOTH), where)
        at = file.value(where, table, "address", address, needed=True)
        framing: Literal["tcp", "rtu"] = file.value(where, table, "framing", one_of("tcp", "rtu")) or "tcp"
        return self._read(table, where, at, framing, _RULE)

    def pty(self, table: dict[str, Any], where: Key) -> SiteGateway | None:
        self.file.check_keys(table, ("path", *_OF_BOTH), where)
        path = self.file.value(where, table, "path", _absolute, needed=True)
        return self._read(table, where, path, "rtu", tuple(key for key in _RULE if key != "networks"))

    def _read(
        self,
        table: dict[str, Any],
        where: Key,
        found_at: str | None,
        framing: Literal["tcp", "rtu"],
        rule: tuple[str, ...],
    ) -> SiteGateway | None:
        file = self.file
        name = file.value(where, table, "line", text, needed=len(self.lines) != 1)
        within = file.value(where, table, "answer_within", number(*_WITHIN))
        dead_man = file.value(where, table, "dead_man", dead_man_of(*_DEAD_MAN))
        line = self.lines.get(name) if name else next(iter(self.lines.values()), None)
        if name is not None and line is None:
            hint = checks.closest(name, self.lines)
            file.complain((*where, "line"), f'there is no line "{name}"{hint}; there are {quoted(self.lines)}')
        allow = [self._allow(each, there, line, rule) for there, each in file.tables(table, (*where, "allow"))]
        if line is None or found_at is None:
            return None
        return SiteGateway(line, found_at, framing, within or 1.0, dead_man, tuple(allow), file.line_of(where))

    def _allow(self, table: dict[str, Any], where: Key, line: SiteLine | None, keys: tuple[str, ...]) -> SiteAllow:
        file = self.file
        file.check_keys(table, keys, where)
        networks = file.value(where, table, "networks", listed(_network, '["192.168.7.0/24"]'))
        names = file.value(where, table, "drives", listed(text, '["pump1"]')) or []
        units = file.value(where, table, "units", listed(whole(0, 255), "[7]"))
        functions = file.value(where, table, "functions", listed(_function, "[3, 6]"))
        write = file.value(where, table, "write", listed(_register, '["P00.11"]'))
        commands = file.value(where, table, "commands", listed(text, '["run", "setpoint"]'))
        drives = drives_named(names, self.drives, self.groups, file, (*where, "drives"))
        for drive in drives:
            if line is not None and drive.line != line:
                file.complain((*where, "drives"), f'"{drive.name}" is on the line "{drive.line.name}"')
        at = {key: file.line_of((*where, key)) for key in keys if key in table} | {"": file.line_of(where)}
        some = None if functions is None else tuple(functions)
        return SiteAllow(
            tuple(networks or ()),
            drives,
            tuple(units or ()),
            some,
            tuple(write or ()),
            tuple(commands or ()),
            at,
        )


def _absolute(value: Any) -> str:
    if not text(value).startswith("/"):
        raise Wrong('not a path that begins with "/", such as "/run/drivebus/plc"')
    return text(value)


def _network(value: Any) -> str:
    # Not for who has no such table: a stop waits for all that is loaded.
    import ipaddress

    try:
        return str(ipaddress.ip_network(text(value)))
    except ValueError as error:
        raise Wrong(f"no address and no network: {error}") from None


def _function(value: Any) -> int:
    if isinstance(value, bool) or value not in (1, 2, 3, 4, 5, 6, 15, 16):
        raise Wrong("functions that can be allowed are 1 to 6, 15 and 16")
    return int(value)


def _register(value: Any) -> str | int:
    if isinstance(value, str):
        return text(value)
    return whole(0, 0xFFFF)(value)
