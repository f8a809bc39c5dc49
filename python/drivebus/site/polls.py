"""What a site asks its drives again and again, and where samples wait for others, as `drivebus serve` does it.

    [[poll]]
    drives = ["pumps"]
    registers = ["running_frequency", "output_current"]
    interval = 1.0
    heartbeat = 60.0

    [poll.band]
    output_current = 0.2

    [spool]
    path = "/var/lib/drivebus/spool"
    size_mb = 1000

Here it is read. What the names of registers mean, the families know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drivebus.site.entries import SiteDrive, drives_named
from drivebus.site.reading import Key, Reading, Wrong, listed, number, text, whole

__all__ = ["SitePoll", "SiteSpool", "polls_of", "spool_of"]

INTERVAL, HEARTBEAT = (0.01, 86_400.0), (1.0, 86_400.0)
"""Seconds."""
_MEGABYTES = (10, 1_000_000)


@dataclass(frozen=True)
class SitePoll:
    """What is asked of some drives again and again.

    Attributes:
        drives: The drives.
        registers: Registers and parameters by name; none: the monitor registers of each.
        interval: Seconds from one sample to the next.
        band: How far a value may go from the one that was kept last before it is kept, by name, in its own unit.
            Without one, each change counts.
        heartbeat: Seconds after which a sample is kept though nothing changed.
        lines: In which line of the file each key stands, and the table itself by an empty name.
    """

    drives: tuple[SiteDrive, ...]
    registers: tuple[str, ...] = ()
    interval: float = 1.0
    band: Mapping[str, float] = field(default_factory=dict)
    heartbeat: float = 60.0
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SiteSpool:
    """Where samples wait.

    Attributes:
        path: The file; `drivebus-spool` beside that of the site, unless it says otherwise.
        size: Bytes that it may have.
    """

    path: Path
    size: int


def polls_of(
    file: Reading, drives: Mapping[str, SiteDrive], groups: Mapping[str, tuple[SiteDrive, ...]]
) -> tuple[SitePoll, ...]:
    """What *file* says of polls; what is wrong in it is complained of."""
    tables = file.tables(file.data, ("poll",))
    return tuple(_poll(file, table, where, drives, groups) for where, table in tables)


def spool_of(file: Reading) -> SiteSpool | None:
    """Where *file* says that samples wait; None: nowhere, so that no disk wears for nothing."""
    table = file.section("spool", ("path", "size_mb"))
    if table is None:
        return None
    path = file.value(("spool",), table, "path", text) or "drivebus-spool"
    megabytes = file.value(("spool",), table, "size_mb", whole(*_MEGABYTES)) or 1_000
    return SiteSpool(file.path.parent / path, megabytes * 1_000_000)


def _poll(
    file: Reading,
    table: dict[str, Any],
    where: Key,
    drives: Mapping[str, SiteDrive],
    groups: Mapping[str, tuple[SiteDrive, ...]],
) -> SitePoll:
    keys = ("drives", "registers", "interval", "band", "heartbeat")
    file.check_keys(table, keys, where)
    names = file.value(where, table, "drives", listed(text, '["pump1"]'))
    registers = file.value(where, table, "registers", listed(text, '["output_current"]')) or []
    interval = file.value(where, table, "interval", number(*INTERVAL)) or 1.0
    heartbeat = file.value(where, table, "heartbeat", number(*HEARTBEAT)) or 60.0
    band = file.value(where, table, "band", _band) or {}
    chosen = drives_named(drives if names is None else names, drives, groups, file, (*where, "drives"))
    at = {key: file.line_of((*where, key)) for key in keys if key in table} | {"": file.line_of(where)}
    return SitePoll(chosen, tuple(registers), interval, band, heartbeat, at)


def _band(value: Any) -> dict[str, float]:
    if not isinstance(value, dict):
        raise Wrong("not a table of numbers, such as { output_current = 0.2 }")
    return {name: number(0.0, 1e9)(width) for name, width in value.items()}
