"""What an examination says: one finding at a time, in words a technician can act on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal, TypeAlias

from drivebus.errors import DrivebusError

__all__ = ["Finding", "Severity", "Step"]

Step: TypeAlias = Literal["adapter", "line", "unit"]
"""What was examined."""


class Severity(str, Enum):
    """How bad a finding is. It equals its name: `Severity.FAULT == "fault"`."""

    OK = "ok"
    NOTE = "note"
    WARNING = "warning"
    FAULT = "fault"

    @property
    def rank(self) -> int:
        """0 if all is well; the higher, the worse."""
        return list(Severity).index(self)

    def __str__(self) -> str:
        return self.value

    def __format__(self, form: str) -> str:
        return format(str(self), form)


@dataclass(frozen=True)
class Finding:
    """One thing that was examined.

    Attributes:
        step: `"adapter"`, `"line"` or `"unit"`.
        name: What was found, such as `"latency_timer"`; the same finding has the same name.
        severity: Whether that is well, worth knowing, costs something, or keeps the line from working.
        text: What was seen.
        advice: What to do about it; empty if nothing.
        unit: The unit it is about, or None.
        values: What was measured; times in seconds.
        error: The kind of error that calls end with because of it; None where none does.
    """

    step: Step
    name: str
    severity: Severity
    text: str
    advice: str = ""
    unit: int | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    error: type[DrivebusError] | None = None

    @property
    def wrong(self) -> bool:
        """Whether something should be done about it."""
        return self.severity in (Severity.WARNING, Severity.FAULT)

    def __str__(self) -> str:
        return f"{self.text}. {self.advice}" if self.advice else self.text
