"""Echoes of one unit: how many came back whole, what became of the others, and how long the unit takes to begin."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from drivebus.bus import Bus
from drivebus.doctor.characters import of_unit
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import BadAnswer, CrcError, DrivebusError, NoAnswer, Refused
from drivebus.line.frames import frames_in, may_be_of
from drivebus.line.seven_bits import agreed, seen_in
from drivebus.line_search.settings import Settings
from drivebus.rtu import is_frame

__all__ = ["Echoes"]

_CHARS = 8
"""Characters of an echo's request, and of its answer: unit, function, sub-function, word, CRC."""

_UNEVEN = 0.02
"""Seconds between the usual and the longest turnaround that a sound line with a sound unit does not show."""

_ENOUGH = 20
"""Echoes that came back in time, beside which a single slow one says nothing yet."""


@dataclass
class Echoes:
    """What became of the echoes that one unit was asked for.

    Attributes:
        unit: Its address, 1..247.
        asked: How many it was asked for.
        silent: How many did not come back in time.
        damaged: How many came back as no frame.
        bad: How many brought a whole frame that is not their answer.
        late: How many answers came after their time.
        refused: How the unit refused one; it is asked for no more then.
        last: What the last bad one was, in words.
        turnarounds: Seconds from the end of each request to the first bit of its answer, where it came back whole.
        came: What came instead of the others.
        settings: At which it was asked.
    """

    unit: int
    settings: Settings
    asked: int = 0
    silent: int = 0
    damaged: int = 0
    bad: int = 0
    late: int = 0
    refused: Refused | None = None
    last: str = ""
    turnarounds: list[float] = field(default_factory=list)
    came: list[bytes] = field(default_factory=list)

    @classmethod
    def of(cls, bus: Bus, unit: int, count: int, tell: Callable[[str], None]) -> Echoes:
        """Asks *unit* for *count* echoes, and tells which one it is at."""
        echoes = cls(unit, Settings.of(bus))
        while echoes.asked < count and echoes.refused is None:
            tell(f"echo {echoes.asked + 1} of {count} from unit {unit}")
            echoes._ask(bus)
        echoes.late = int(bus.stats()["units"].get(unit, {}).get("late_replies", 0))
        return echoes

    def _ask(self, bus: Bus) -> None:
        """Asks for one more."""
        self.asked += 1
        on_the_wire = 2 * _CHARS * bus.format.char_time
        try:
            self.turnarounds.append(max(bus.echo(self.unit) - on_the_wire, 0.0))
        except Refused as error:
            # By 06H a unit says that the request came damaged, or that it is busy, and not that it knows no echo.
            if error.means == "ask_again":
                self.damaged += 1
            else:
                self.refused = error
        except NoAnswer:
            self.silent += 1
        except CrcError as error:
            self.damaged += 1
            self.came.append(error.raw)
        except BadAnswer as error:
            self.came.append(error.raw)
            # What holds no whole frame was one before something happened to it.
            if frames_in(error.raw) or is_frame(error.raw):
                self.bad += 1
                self.last = str(error)
            elif may_be_of(self.unit, error.raw):
                self.damaged += 1
            else:
                self.silent += 1

    @property
    def answered(self) -> int:
        """How many came back whole."""
        return len(self.turnarounds)

    def findings(self, family: str | None) -> Iterator[Finding]:
        """What is found by the echoes of a unit of *family*; None if that is not known."""
        if self.refused is not None:
            yield self._no_echo(self.refused)
        elif not (self.damaged or self.bad or self.silent):
            yield self._all_whole(family)
        elif not self.answered and (sent := agreed(seen_in(self.unit, came) for came in self.came)) is not None:
            yield of_unit(self.unit, sent, self.settings)
        else:
            if self.damaged:
                yield self._damaged() if self.answered else self._two_units()
            if self.bad:
                yield self._bad_answers()
            if self.silent:
                yield self._late_answers() if self.late else self._lost_answers()
        if self.turnarounds:
            yield self._turnaround()

    def _no_echo(self, refused: Refused) -> Finding:
        return self._finding(
            "no_echo",
            Severity.NOTE,
            f"unit {self.unit} answers, and refuses echoes (08H): {refused}",
            "a master must make sure of it by reads after a time-out, which takes longer",
        )

    def _all_whole(self, family: str | None) -> Finding:
        return self._finding(
            "answers",
            Severity.OK,
            f"unit {self.unit}{f', a {family},' if family else ''} returned {self.answered} of {self.asked} "
            "echoes whole",
        )

    def _two_units(self) -> Finding:
        return self._finding(
            "two_units",
            Severity.FAULT,
            f"not one of {self.asked} echoes of unit {self.unit} came back whole, and {self.damaged} came damaged, at "
            "whatever baud rate and parity",
            "most likely two units have this address and talk at once: switch one off after the other, and give "
            "each its own (INVT: P14.00). If it is alone: terminators, + and -, the common wire",
            error=CrcError,
        )

    def _damaged(self) -> Finding:
        return self._finding(
            "damaged",
            self._severity,
            f"{self.damaged} of {self.asked} echoes of unit {self.unit} came back damaged",
            "reflections or interference: 120 ohm at both ends of the line and nowhere else, short stubs, the shield "
            "earthed, motor cables far; if only this unit has it: its connector, or a second unit with its address",
            error=CrcError,
        )

    def _bad_answers(self) -> Finding:
        return self._finding(
            "bad_answers",
            self._severity,
            f"{self.bad} of {self.asked} echoes of unit {self.unit} had a wrong answer; the last: {self.last}",
            "another master on the line, a gateway that mixes answers up, or two units with one address",
            error=BadAnswer,
        )

    def _late_answers(self) -> Finding:
        text = (
            f"{self.silent} of {self.asked} echoes of unit {self.unit} did not come back in time, and {self.late} "
            f"{'answer' if self.late == 1 else 'answers'} came after it"
        )
        if self.silent == 1 and self.answered >= _ENOUGH:
            advice = "a busy computer may do that once; if it is so the next time too, look for the cause"
            return self._finding("late_answers", Severity.NOTE, text, advice, late=self.late)
        return self._finding(
            "late_answers",
            self._severity,
            text,
            "lower its response delay (INVT: P14.03), or give a longer time-out; behind a gateway or a radio link both "
            "are usual",
            error=NoAnswer,
            late=self.late,
        )

    def _lost_answers(self) -> Finding:
        return self._finding(
            "lost_answers",
            self._severity,
            f"{self.silent} of {self.asked} echoes of unit {self.unit} did not come back in time",
            "a loose wire, an adapter that switches its direction too late, or a unit that takes longer than the time-"
            "out (INVT: P14.03)",
            error=NoAnswer,
        )

    @property
    def _severity(self) -> Severity:
        """How bad it is that some did not come back whole."""
        return Severity.WARNING if self.answered else Severity.FAULT

    def _finding(
        self,
        name: str,
        severity: Severity,
        text: str,
        advice: str = "",
        *,
        error: type[DrivebusError] | None = None,
        **more: Any,
    ) -> Finding:
        """A finding about the unit, with all that was counted and *more*."""
        values = {
            "echoes": self.asked,
            "answered": self.answered,
            "silent": self.silent,
            "damaged": self.damaged,
            "bad": self.bad,
            **more,
        }
        return Finding("unit", name, severity, text, advice, self.unit, values, error)

    def _turnaround(self) -> Finding:
        """How long the unit takes to begin, and whether it does so evenly."""
        low, middle, high = min(self.turnarounds), median(self.turnarounds), max(self.turnarounds)
        values = {"turnaround_min": low, "turnaround_median": middle, "turnaround_max": high}
        text = f"unit {self.unit} responds after {low * 1e3:.1f} to {high * 1e3:.1f} ms (median {middle * 1e3:.1f} ms)"
        slow = sum(each - middle > _UNEVEN for each in self.turnarounds)
        if slow == 0:
            return Finding("unit", "turnaround", Severity.OK, text, unit=self.unit, values=values)
        if slow == 1 and self.answered > _ENOUGH:
            advice = "only one was so slow, which a busy computer may cause"
            return Finding("unit", "turnaround", Severity.NOTE, text, advice, self.unit, values)
        return Finding(
            "unit",
            "turnaround",
            Severity.WARNING,
            text,
            "such uneven times rarely come from the line or the unit: check the adapter's latency timer, the load of "
            "this computer, or the gateway",
            unit=self.unit,
            values=values,
            error=NoAnswer,
        )
