"""One unit: whether its answers come whole and in time, and what the drive behind it says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from drivebus.advice import Text
from drivebus.bus import Bus
from drivebus.doctor.drive import DriveExamination
from drivebus.doctor.echo_test import Echoes
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import DrivebusError, NotAllowed
from drivebus.identify.results import Found
from drivebus.profile import Profile

__all__ = ["UnitExamination"]


@dataclass(frozen=True)
class UnitExamination:
    """An examination of one unit, by echoes and a few reads; it writes nothing.

    Attributes:
        bus: The line it hangs on.
        found: Who answered, and as what.
        echoes: How many it is asked for.
        tell: Is called with what is being done.
        named: What it is taken for, unless it says itself that it is something else.
        unverified: Whether what no document of its family proves is read too.
    """

    bus: Bus
    found: Found
    echoes: int
    tell: Callable[[str], None]
    named: Profile | None = None
    unverified: bool = False

    def findings(self) -> Iterator[Finding]:
        """What is found: by its echoes, then by what its drive says if it answers at all."""
        unit = self.found.unit
        echoes = Echoes.of(self.bus, unit, self.echoes, self.tell)
        yield from echoes.findings(self.found.profile)
        # To refuse an echo is an answer too.
        if not echoes.answered and echoes.refused is None:
            return
        self.tell(f"reading the settings of unit {unit}")
        try:
            yield from self._drive(echoes.turnarounds)
        except NotAllowed as error:
            yield Finding("unit", "family", Severity.NOTE, error.text, unit=unit)
        except DrivebusError as error:
            yield Finding(
                "unit",
                "settings",
                Severity.WARNING,
                Text("its settings could not be read: ", error.text),
                unit=unit,
                error=type(error),
            )

    def _drive(self, turnarounds: list[float]) -> Iterator[Finding]:
        """What is found of the drive, which is taken for what it was named or says that it is.

        Raises:
            DrivebusError: It could not be read.
        """
        named = self.named
        if named is not None and self.found.certainty == "certain" and self.found.profile != named.family:
            yield self._another(named)
            named = None
        drive = self.bus.drive(self.found.unit, named or self.found.profile, unverified=self.unverified)
        yield from DriveExamination(drive, self.bus.timeout, turnarounds, named is not None).findings()

    def _another(self, named: Profile) -> Finding:
        """The finding that the unit says it is something else than it was *named*."""
        return Finding(
            "unit",
            "family",
            Severity.WARNING,
            f"unit {self.found.unit} says that it is a {self.found.profile}, and it was named {named.name}; it is "
            "taken for what it says",
            "leave --profile out, or unset DRIVEBUS_PROFILE: the same word can mean another command to another family",
            unit=self.found.unit,
            error=NotAllowed,
        )
