"""The live table of `drivebus sniff --table`: units, their registers, and what was heard last."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

import drivebus
from drivebus import tables
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import printable
from drivebus.line import huanyang
from drivebus.sniffer import Exchange, Families, Figures
from drivebus.sniffer.statistics import RegisterFigures, UnitFigures

__all__ = ["SniffTable"]

_WIDEST = 30
"""Letters of what the bits of a word mean."""
_LAST = 5
"""What went wrong last is shown for so many exchanges."""


class SniffTable:
    """Renders itself to whatever size the terminal has; what does not fit is counted.

    Args:
        port: The name of the line.
        families: Which family each unit is of.
        figures: What was counted.
    """

    def __init__(self, port: str, families: Families, figures: Figures) -> None:
        self._port = port
        self._families = families
        self._figures = figures
        self._wrong: deque[str] = deque(maxlen=_LAST)

    def take(self, exchange: Exchange) -> None:
        """Shows what is wrong with *exchange*."""
        if exchange.error is not None:
            self._wrong.append(str(exchange.error))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        room = (options.height or console.height) - 1
        span = self._figures.last - self._figures.first
        rate = f"{self._figures.exchanges / span:.1f}/s" if span > 0 else ""
        yield Text.assemble(
            (f"{printable(self._port)}", "bold"), f"  {self._figures.exchanges} heard  {rate}", end="\n"
        )
        units = self._units()
        yield units
        notes = [Text(printable(text), "yellow", overflow="ellipsis", no_wrap=True) for text in self._notes()]
        room -= len(self._figures.units) + 2 + len(notes)
        rows = list(self._registers())
        fitting = rows if len(rows) <= room - 1 else rows[: max(room - 2, 0)]
        if fitting:
            yield self._table(fitting)
        if len(fitting) < len(rows):
            yield Text(f"{len(rows) - len(fitting)} more registers do not fit: name units with --unit", "dim")
        yield from notes

    def _notes(self) -> list[str]:
        return [*map(in_commands, self._figures.hints()), *self._wrong][-_LAST:]

    def _units(self) -> Table:
        table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
        for title in ("unit", "family", "asked", "answered", "refused", "silent", "damaged", "turnaround"):
            table.add_column(title, justify="left" if title == "family" else "right", no_wrap=True)
        for address, unit in sorted(self._figures.units.items()):
            table.add_row(*self._unit(address, unit))
        return table

    def _unit(self, address: int, unit: UnitFigures) -> list[str | Text]:
        profile = self._families.of(address) if address else None
        family = "all" if not address else "" if profile is None else profile.name
        if profile is not None and self._families.is_guess(address):
            family += "?"
        if unit.protocol != "modbus":
            family = huanyang.NAME
        turnaround = unit.turnaround
        bad = [
            Text(str(count), "red" if count else "")
            for count in (sum(unit.refusals.values()), unit.silent, unit.damaged)
        ]
        after = "" if turnaround is None else f"{turnaround * 1e3:.1f} ms"
        return [str(address), printable(family), str(unit.requests), str(unit.answers), *bad, after]

    def _registers(self) -> Iterator[list[str]]:
        for address, unit in sorted(self._figures.units.items()):
            profile = self._families.of(address) if address else None
            mark = "?" if profile is not None and self._families.is_guess(address) else ""
            for name, register in _by_name(unit, profile).items():
                shown, *rest = _register(name, register, profile)
                yield [str(address), f"{shown}{mark}" if isinstance(name, str) else shown, *rest]

    def _table(self, rows: list[list[str]]) -> Table:
        table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
        for title in ("unit", "register", "value", "", "read", "written", "every"):
            table.add_column(title, justify="left" if title in ("register", "") else "right", no_wrap=True)
        for row in rows:
            table.add_row(*map(Text, row))
        return table


def _by_name(unit: UnitFigures, profile: drivebus.Profile | None) -> dict[str | int, RegisterFigures]:
    """The registers of *unit*, those heard before its family was known under the names that they have now."""
    if profile is None:
        return unit.registers
    found: dict[str | int, RegisterFigures] = {}
    for heard, register in unit.registers.items():
        name, known = heard, register
        if isinstance(heard, int) and register.value is not None:
            place = profile.plain_address(heard) if heard <= 0xFFFF else heard
            named = profile.name_at(place, written=bool(register.writes))
            if named is not None and profile.describe(named).words == 1:
                name, known = named, replace(register, value=profile.decode(named, int(register.value)))
        other = found.get(name)
        found[name] = known if other is None else _joined(other, known)
    return found


def _joined(one: RegisterFigures, other: RegisterFigures) -> RegisterFigures:
    """What was heard of a register under two names."""
    return replace(
        max(one, other, key=lambda each: each.last),
        reads=one.reads + other.reads,
        writes=one.writes + other.writes,
        changes=one.changes + other.changes,
        first=min(one.first, other.first),
    )


def _register(name: str | int, register: RegisterFigures, profile: drivebus.Profile | None) -> list[str]:
    """A register as one row: what it is called, its value, its unit, how often it was read and written."""
    value, unit = str(register.value), ""
    shown = name if isinstance(name, str) else tables.shown(name)
    if profile is not None and isinstance(name, str) and register.value is not None:
        row = profile.describe(name)
        value, unit = row.text(register.value), row.unit
        if row.bits:
            meant = ", ".join(profile.fields(name, int(register.value)).values())
            unit = meant if len(meant) <= _WIDEST else f"{meant[: _WIDEST - 1]}…"
        shown = f"{row.code} {row.name}" if row.code not in (None, row.name) else row.name
    period = register.period
    every = "" if period is None else f"{period:.2f} s" if period >= 1 else f"{period * 1e3:.0f} ms"
    counts = [str(count or "") for count in (register.reads, register.writes)]
    return [*map(printable, (shown, value, unit)), *counts, every]
