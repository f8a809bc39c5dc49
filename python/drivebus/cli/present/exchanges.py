"""Exchanges as people read them, line by line, or as JSON; and what may be left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus import tables
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.moments import moment, time_of_day
from drivebus.cli.present.output import Output, remark
from drivebus.line import huanyang
from drivebus.line.meaning import meaning
from drivebus.sniffer import Exchange, Families

__all__ = ["Filter", "Lines", "taken_back"]


@dataclass(frozen=True)
class Filter:
    """Which exchanges are shown.

    Attributes:
        units: Those of these units; empty: of all.
        functions: Those that ask for these functions; empty: any.
        errors: Only what went wrong.
    """

    units: frozenset[int] = frozenset()
    functions: frozenset[int] = frozenset()
    errors: bool = False

    def lets_pass(self, exchange: Exchange) -> bool:
        """Whether *exchange* is shown."""
        return (
            (not self.units or exchange.unit in self.units)
            and (not self.functions or exchange.function in self.functions)
            and (not self.errors or exchange.error is not None)
        )


class Lines:
    """Shows exchanges one after the other.

    Args:
        out: Where they go.
        families: What their words mean.
        has_times: Whether their times are those of the clock.
        line: The name of the line, where there are several; it is shown above them.
    """

    def __init__(self, out: Output, families: Families, has_times: bool = True, line: str = "") -> None:
        self._out = out
        self._families = families
        self._has_times = has_times
        self._line = line
        if line and not out.as_json:
            out.say(f"{line}:")

    def show(self, exchange: Exchange) -> None:
        """One exchange."""
        for text in taken_back(self._families):
            remark(text)
        if self._out.as_json:
            self._out.record(self._record(exchange))
            return
        when = ""
        if self._has_times:
            when = f"{time_of_day(exchange.time)} "
        gap = "" if exchange.gap is None or not self._has_times else f"+{exchange.gap * 1e3:.2f} ms"
        head = f"{when}{gap:>12}  "
        error = exchange.error
        self._out.say(f"{head}{self._words(exchange)}", "red" if error is not None else "", hanging=len(head))

    def _words(self, exchange: Exchange) -> str:
        error = exchange.error
        if exchange.request is None:
            return str(error)
        if exchange.protocol != "modbus":
            return self._foreign(exchange)
        profile = None if exchange.unit is None else self._families.of(exchange.unit, exchange.request)
        asked = meaning(exchange.request, True, None, profile)
        if profile is not None and exchange.unit is not None and self._guessed(exchange.unit):
            asked = asked.replace(f"unit {exchange.unit}", f"unit {exchange.unit} ({profile.name}, guessed)", 1)
        again = f" (again, {exchange.repeated})" if exchange.repeated else ""
        if isinstance(error, drivebus.Refused):
            name = f" {error.name}" if error.name else ""
            return f"{asked}{again} -> refused: exception {error.code:02X}H{name}{self._after(exchange)}"
        if error is not None:
            told = str(error).removeprefix(f"unit {exchange.unit} ")
            raw = f" [{error.raw.hex(' ').upper()}]" if error.raw else ""
            return f"{asked}{again} -> {told}{raw}"
        if exchange.answer is None:
            return f"{asked}{again}"
        told = meaning(exchange.answer, False, exchange.request, profile).removeprefix(f"unit {exchange.unit} ")
        return f"{asked}{again} -> {told.removeprefix('answers ')}{self._after(exchange)}"

    def _record(self, exchange: Exchange) -> dict[str, Any]:
        error = exchange.error
        told: dict[str, Any] = {
            "time": moment(exchange.time),
            "unit": exchange.unit,
            "profile": exchange.profile,
            "guessed": exchange.unit is not None and exchange.profile is not None and self._guessed(exchange.unit),
            "protocol": exchange.protocol,
            "request": exchange.request,
            "answer": exchange.answer,
            "gap": exchange.gap,
            "turnaround": exchange.turnaround,
            "repeated": exchange.repeated,
            "values": {
                name if isinstance(name, str) else f"{name:#06x}": value for name, value in exchange.values.items()
            },
        }
        if not self._has_times:
            for name in ("time", "gap", "turnaround"):
                del told[name]
        if self._line:
            told["line"] = self._line
        if error is not None:
            told |= {"error": str(error), "raw": error.raw, "exit_code": exit_code(error)}
        return told

    def _after(self, exchange: Exchange) -> str:
        turnaround = exchange.turnaround if self._has_times else None
        return "" if not turnaround else f", after {turnaround * 1e3:.2f} ms"

    def _foreign(self, exchange: Exchange) -> str:
        """An exchange in Huanyang's own protocol."""
        asked = huanyang.words(exchange.request or b"", True)
        if exchange.answer is None:
            return asked if exchange.error is None else f"{asked} -> did not answer"
        told = huanyang.words(exchange.answer, False).removeprefix(f"unit {exchange.unit} ")
        return f"{asked} -> {told.removesuffix(huanyang.REMARK)}{self._after(exchange)}"

    def _guessed(self, unit: int) -> bool:
        return self._families.is_guess(unit)


def taken_back(families: Families) -> Iterator[str]:
    """What is to be said of guesses that did not hold."""
    for unit, name, address in families.withdrawn():
        yield (
            f"unit {unit} was taken for {name} by what it was asked and answered. What came of {tables.shown(address)} "
            f"now does not fit, so its registers are shown by addresses; `--profile {unit}=FAMILY` names them."
        )
