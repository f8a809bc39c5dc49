"""The drive behind a unit: what it says itself about the bus, about its fault, and about whom it obeys."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

from drivebus.doctor.findings import Finding, Severity
from drivebus.drive import Drive
from drivebus.errors import NoAnswer, NotAllowed
from drivebus.profile import profiles
from drivebus.values import Control, Description, WatchdogSettings

__all__ = ["DriveExamination"]

_SPARE = 0.5
"""The share of a time-out that answers may take before one that is a little later is lost."""

_DELAY = "response_delay"
"""What profiles call the parameter with the time that a drive waits before it answers."""


@dataclass(frozen=True)
class DriveExamination:
    """An examination of one drive: each step reads what it is set to, and writes nothing.

    Attributes:
        drive: The drive.
        timeout: Seconds that its bus waits for an answer.
        turnarounds: Seconds that it took to begin its answers.
        is_named: Whether it was named what it is, and did not say it itself.
    """

    drive: Drive
    timeout: float
    turnarounds: Sequence[float]
    is_named: bool

    def findings(self) -> Iterator[Finding]:
        """What is found: its delay, its time-out, its fault, and whom it obeys.

        Raises:
            DrivebusError: It could not be read.
        """
        delay = self._row(_DELAY)
        if delay is not None and delay.unit == "ms":
            yield self._response_delay(delay)
        watchdog = self.drive.profile.watchdog
        if watchdog is not None and self.drive.describe(watchdog.timeout).evidence != "assumed":
            yield self._watchdog(watchdog)
        fault = self._fault()
        if fault is not None:
            yield fault
        yield self._control()

    def _row(self, name: str) -> Description | None:
        """What the family knows as *name*, if it may be read."""
        try:
            row = self.drive.describe(name)
        except NotAllowed:
            return None
        return None if row.evidence == "assumed" else row

    def _response_delay(self, row: Description) -> Finding:
        delay = float(self.drive.read(row.name)) / 1e3
        took = f", and it took {median(self.turnarounds) * 1e3:.1f} ms" if self.turnarounds else ""
        text = f"unit {self.drive.unit}: its response delay ({row.code}) is {delay * 1e3:g} ms{took}"
        values = {"response_delay": delay, "timeout": self.timeout}
        if max([delay, *self.turnarounds]) <= _SPARE * self.timeout:
            return Finding("unit", "response_delay", Severity.OK, text, unit=self.drive.unit, values=values)
        return Finding(
            "unit",
            "timeout",
            Severity.WARNING,
            f"{text}: much of the time-out of {self.timeout:g} s",
            f"lower {row.code}, or give a longer time-out",
            unit=self.drive.unit,
            values=values,
            error=NoAnswer,
        )

    def _watchdog(self, watchdog: WatchdogSettings) -> Finding:
        limit = float(self.drive.read(watchdog.timeout))
        return Finding(
            "unit",
            "watchdog",
            Severity.OK,
            f"unit {self.drive.unit}: {self._on_silence(watchdog, limit)}",
            unit=self.drive.unit,
            values={"silence": limit},
        )

    def _on_silence(self, watchdog: WatchdogSettings, limit: float) -> str:
        """What the drive does when the bus is silent for *limit* seconds, as it is set."""
        if limit == 0:
            return f"it does not notice when the bus falls silent ({watchdog.timeout} is 0)"
        when = f"when the bus is silent for {limit:g} s ({watchdog.timeout})"
        fault = "" if watchdog.fault is None else f" {self.drive.profile.fault(watchdog.fault)}"
        if watchdog.action is None:
            return f"it trips{fault} {when}; what that does to the motor is set elsewhere in the drive"
        action = self.drive.read(watchdog.action)
        set_to = f"{watchdog.action} is {action}"
        done = next((done for done, word in watchdog.actions.items() if word == action), None)
        if done == "trip":
            return f"it trips{fault} {when}; what that does to the motor is set elsewhere in the drive: {set_to}"
        if done == "coast" and "trip" not in watchdog.actions:
            return f"it trips{fault} and coasts {when}: {set_to}"
        if done is not None:
            return f"it {done}s, and trips nothing, {when}: {set_to}"
        # The motor may run on.
        return f"what it does {when}, this alone tells: {set_to}"

    def _fault(self) -> Finding | None:
        try:
            fault = self.drive.fault()
        except NotAllowed as error:
            return Finding("unit", "fault", Severity.NOTE, error.text, unit=self.drive.unit)
        if fault is None:
            return None
        watchdog = self.drive.profile.watchdog
        is_ours = watchdog is not None and watchdog.fault == fault.code
        cause = "" if watchdog is None else f"the bus was silent for longer than {watchdog.timeout}"
        return Finding(
            "unit",
            "fault",
            Severity.WARNING if is_ours else Severity.NOTE,
            f"unit {self.drive.unit} is in fault {fault}",
            fault.remedy or (cause if is_ours else ""),
            unit=self.drive.unit,
            error=NoAnswer if is_ours else None,
        )

    def _control(self) -> Finding:
        unit = self.drive.unit
        control = self.drive.check_control()
        if not len(control):
            text = f"it is not known how {self.drive.profile.title} (unit {unit}) is set to obey the bus"
            return Finding("unit", "control", Severity.NOTE, text, unit=unit)
        if control:
            return Finding("unit", "control", Severity.OK, f"unit {unit} is set to obey the bus", unit=unit)
        wrong = "; ".join(
            f"{item.code} ({item.label}) is {'not known' if item.actual is None else int(item.actual)}, "
            f"needs {int(item.wanted)}"
            for item in control
            if not item.ok
        )
        surely = any(item.actual is not None and not item.ok for item in control)
        return Finding(
            "unit",
            "control",
            Severity.NOTE,
            f"unit {unit} answers, and {'does not obey the bus yet' if surely else 'may not obey the bus'}: {wrong}",
            f"`{self._preparing(control)}` sets it, if that is wanted",
            unit=unit,
        )

    def _preparing(self, control: Control) -> str:
        """The command that sets what is wrong in *control*.

        Only unit 1 needs no --unit, only one that says what it is no --profile; and prepare writes without a word only
        what is verified.
        """
        profile = self.drive.profile
        words = ["drivebus"]
        if self.drive.unit != 1:
            words += ["--unit", str(self.drive.unit)]
        if self.is_named or profile.role("identification") is None:
            words += ["--profile", profile.name if profile.name in profiles() else "FOLDER"]
        if any(not item.ok and not item.verified for item in control):
            words += ["--unverified"]
        return " ".join([*words, "prepare"])
