"""Who answered on a line: what a scan and a search found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus.cli.present.output import Output, counted

__all__ = ["FoundUnit", "LocatedUnits"]

_MEANINGS = {
    "shared": "several families report this code.",
    "by answers": "it has no code, but answers and refuses the same registers as this family. --profile names it.",
    "unverified": "no document prints this code for this family, or its state does not fit. --profile names it.",
}
"""What the column `certainty` says, but for `certain` and `unknown`, which say it themselves."""


@dataclass(frozen=True)
class FoundUnit:
    """A unit that a scan found."""

    found: drivebus.Found

    def records(self) -> Iterator[dict[str, Any]]:
        """All that is known of it."""
        yield {**vars(self.found), "identification": _code(self.found.identification)}

    def lay_out(self, out: Output) -> None:
        """What it is, how sure that is, and how fast it answers."""
        found, after = self.found, f"{self.found.round_trip * 1000:.1f} ms"
        if found.protocol != "modbus" and found.problem is not None:
            out.say(f"unit {found.unit}: {found.problem.removeprefix('it ')}, {after}")
            return
        family = found.profile or " or ".join(found.candidates) or "unknown family"
        if found.certainty == "shared" and found.profile is not None:
            others = (name for name in found.candidates if name != found.profile)
            family += f" (or {' or '.join(others)})"
        code = "" if found.identification is None else f", identification {_code(found.identification)}"
        sure = "" if found.certainty in ("certain", "unknown") else f", {found.certainty}"
        problem = f" ({found.problem})" if found.problem else ""
        out.say(f"unit {found.unit}: {family}{code}{sure}, {after}{problem}")


class LocatedUnits:
    """The units that a search finds: each as it comes for a program, one table in the end for people.

    Args:
        out: Where they go.
        how: What to type to talk to one of them, which has to be named if a family is given.
    """

    def __init__(self, out: Output, how: Callable[[drivebus.Located, str | None], str]) -> None:
        self._out = out
        self._how = how
        self._found: list[drivebus.Located] = []

    def __len__(self) -> int:
        return len(self._found)

    def take(self, located: drivebus.Located) -> None:
        """One more."""
        self._found.append(located)
        known = located.identification
        self._out.record(
            {
                "unit": located.unit,
                "baudrate": located.settings.baudrate,
                "format": located.settings.format,
                "profile": located.profile,
                "certainty": located.certainty,
                "candidates": () if known is None else known.candidates,
                "identification": None if known is None else _code(known.code),
                "problem": located.problem,
                "protocol": located.protocol,
            }
        )

    @staticmethod
    def in_a_line(located: drivebus.Located) -> str:
        """One of them, for who watches the search."""
        problem = f" ({located.problem})" if located.problem else ""
        return f"unit {located.unit} at {located.settings}: {_family(located)}{problem}"

    def end(self) -> None:
        """Those that came in a table, what its words mean, and what to type next."""
        if not self._found or self._out.as_json:
            return
        say = self._out.say
        rows = [[each.unit, str(each.settings), _family(each), each.certainty, each.problem] for each in self._found]
        self._out.rows(["unit", "settings", "family", "certainty", "problem"], rows)
        for certainty, meaning in _MEANINGS.items():
            if any(located.certainty == certainty for located in self._found):
                say(f"{certainty}: {meaning}")
        known = [each for each in self._found if each.protocol == "modbus"]
        talk = f" Talk to the first: `{self._how(known[0], _to_be_named(known[0]))}`" if known else ""
        say(f"{counted(len(self._found), 'unit')}.{talk}")
        for located in known[1:]:
            if (family := _to_be_named(located)) is not None:
                say(f"Unit {located.unit} has to be named: `{self._how(located, family)}`")


def _family(located: drivebus.Located) -> str:
    """What *located* is, or may be."""
    known = located.identification
    may_be = " or ".join(known.candidates) if known is not None else ""
    return located.profile or may_be or ("unknown family" if located.protocol == "modbus" else "no Modbus")


def _to_be_named(located: drivebus.Located) -> str | None:
    """The family that --profile has to name before the drive is used; None where it is known, or not to be told."""
    known = located.identification
    in_doubt = located.certainty in ("by answers", "unverified") and known is not None and len(known.candidates) == 1
    return located.profile if in_doubt else None


def _code(code: int | None) -> str | None:
    return None if code is None else f"{code:#06x}"
