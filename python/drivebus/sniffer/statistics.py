"""What is counted of a line that others use, by unit and by register, and what the figures most likely mean."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import median

from drivebus.advice import Advice, Text
from drivebus.checks import counted
from drivebus.errors import BadAnswer, NoAnswer, Refused
from drivebus.line import huanyang
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.frames import written_by
from drivebus.values import Value

__all__ = ["Figures", "RegisterFigures", "UnitFigures"]

_KEPT = 1_000
"""Turnarounds of a unit that are kept for its median."""

_SOME = 20
"""Requests before a share says anything."""

_IDLE = frozenset({0x00, 0xFF})


@dataclass(slots=True)
class RegisterFigures:
    """What was heard of one register of one unit.

    Attributes:
        reads, writes: How often.
        value: The last value; None before the first.
        changes: How often it differed from the one before.
        first, last: Unix times of the first and the last exchange that carried it.
    """

    reads: int = 0
    writes: int = 0
    value: Value | None = None
    changes: int = 0
    first: float = 0.0
    last: float = 0.0

    @property
    def period(self) -> float | None:
        """Seconds between two exchanges that carry it, on average; None of one."""
        count = self.reads + self.writes
        return (self.last - self.first) / (count - 1) if count > 1 else None


@dataclass(slots=True)
class UnitFigures:
    """What was heard of one unit.

    Attributes:
        requests: How often it was asked.
        answers: How often it surely answered, refusals included.
        refusals: How often it refused, by exception code.
        silent: Requests without an answer.
        damaged: Requests whose answer was damaged, or may be another's.
        repeated: Requests that had been sent before without an answer.
        strays: Answers that answer nothing, late ones among them.
        registers: By the name or the address of the register.
        turnarounds: The last of them, in seconds.
        protocol: What it speaks: `"modbus"` or `"huanyang"`.
    """

    requests: int = 0
    answers: int = 0
    refusals: Counter[int] = field(default_factory=Counter)
    silent: int = 0
    damaged: int = 0
    repeated: int = 0
    strays: int = 0
    registers: dict[str | int, RegisterFigures] = field(default_factory=dict)
    turnarounds: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    protocol: str = "modbus"

    @property
    def turnaround(self) -> float | None:
        """The median of its turnarounds in seconds; None where there is none."""
        return median(self.turnarounds) if self.turnarounds else None


class Figures:
    """Counts exchanges.

    Args:
        t35: Seconds of silence that must stand between two frames.

    Attributes:
        units: By address; broadcasts are those of unit 0.
        exchanges: How many exchanges and other things were counted.
        noise: Bytes that belong to no frame, and how many of them are 00 or FF.
        short_gaps: Frames before which the silence was shorter than it must be; only told where the adapter hands bytes
            over as they come.
        first, last: Unix times of the first and the last that was heard.
    """

    def __init__(self, t35: float) -> None:
        self.units: dict[int, UnitFigures] = {}
        self.exchanges = 0
        self.noise = 0
        self.short_gaps = 0
        self.first = self.last = 0.0
        self._idle = 0
        self._t35 = t35
        self._lump = 0.0

    @property
    def lump(self) -> float:
        """Seconds that the adapter kept bytes back, as far as that has shown."""
        return self._lump

    def take(self, exchange: Exchange) -> None:
        """Counts *exchange*."""
        self.exchanges += 1
        self.first = self.first or exchange.time
        self.last = exchange.time
        self._lump = max(self._lump, exchange.lump)
        times = (exchange.gap, exchange.turnaround)
        if self._lump < self._t35:
            self.short_gaps += sum(time is not None and time < 0.95 * self._t35 for time in times)
        if exchange.unit is None:
            raw = exchange.error.raw if exchange.error is not None else b""
            self.noise += len(raw)
            self._idle += sum(byte in _IDLE for byte in raw)
            return
        unit = self.units.setdefault(exchange.unit, UnitFigures())
        if exchange.request is None:
            unit.strays += 1
            return
        self._count(unit, exchange, exchange.request)

    def _count(self, unit: UnitFigures, exchange: Exchange, request: bytes) -> None:
        unit.protocol = exchange.protocol
        unit.requests += 1
        unit.repeated += exchange.repeated > 0
        unit.answers += exchange.answer is not None
        unit.silent += isinstance(exchange.error, NoAnswer)
        unit.damaged += isinstance(exchange.error, BadAnswer)
        if isinstance(exchange.error, Refused):
            unit.refusals[exchange.error.code] += 1
        if exchange.turnaround is not None:
            unit.turnarounds.append(exchange.turnaround)
        if exchange.answer is None and exchange.unit != 0:
            return
        writes = written_by(request) is not None
        for name, value in exchange.values.items() if not isinstance(exchange.error, Refused) else ():
            register = unit.registers.setdefault(name, RegisterFigures(first=exchange.time))
            register.reads += not writes
            register.writes += writes
            register.changes += register.value is not None and value != register.value
            register.value, register.last = value, exchange.time

    def hints(self) -> Iterator[str]:
        """What the figures most likely mean, and what to do; nothing of a sound line."""
        asked = sum(unit.requests for unit in self.units.values())
        damaged = sum(unit.damaged for unit in self.units.values())
        for address, unit in sorted(self.units.items()):
            if unit.protocol == "huanyang":
                yield (
                    f"unit {address} speaks {huanyang.NAME}, which has the CRC of Modbus and nothing else of it: no "
                    "program for Modbus can command it, and it may take what is meant for others here for its own"
                )
                continue
            if address and unit.requests >= _SOME and not unit.answers and not unit.damaged:
                yield (
                    f"unit {address} was asked {unit.requests} times and never answered: it is off, has another "
                    "address or other settings; each time costs the line a time-out"
                )
            elif address and unit.requests >= _SOME and unit.silent * 20 > unit.requests:
                yield (
                    f"unit {address} left {unit.silent} of {unit.requests} requests without an answer: look at its "
                    "wires, or give it a longer time-out in the master"
                )
            if unit.requests >= _SOME and sum(unit.refusals.values()) * 5 > unit.requests:
                codes = ", ".join(f"{code:02X}H" for code in sorted(unit.refusals))
                yield (
                    f"unit {address} refuses {sum(unit.refusals.values())} of {unit.requests} requests ({codes}): the "
                    "master asks for what it does not have"
                )
            if unit.strays:
                yield (
                    f"unit {address} answered {counted(unit.strays, 'time')} what was not asked then: its answers come "
                    "after the master's time-out, or two units have this address"
                )
        if asked >= _SOME and damaged * 50 > asked:
            yield (
                f"{damaged} of {asked} answers came damaged: keep the cable away from motor cables, earth its shield, "
                "and look for 120 ohm at both ends and nowhere else"
            )
        if self.noise and not asked:
            yield Text(
                f"{counted(self.noise, 'byte')} came and no frame: another baud rate or parity is used there (",
                Advice("search", None, "drivebus.search()"),
                " finds it where you may ask)",
            )
        elif self.noise > 20 and self._idle * 2 >= self.noise:
            yield (
                f"{self.noise} bytes came between frames, most of them 00 or FF: nothing holds the line at rest; add "
                "bias at one place, best at the master"
            )
        if self.short_gaps > 5:
            yield (
                f"{self.short_gaps} frames began before the silence of {self._t35 * 1e3:.2f} ms was over: the master "
                "or a unit does not keep it, and strict units lose such frames"
            )
