"""What must be set before a drive obeys the bus."""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.values.choices import Value

__all__ = ["Control", "ControlItem"]


@dataclass(frozen=True)
class ControlItem:
    """One thing that must be set before the drive obeys the bus.

    Attributes:
        code: The parameter, such as `"P00.01"`.
        wanted: The value it needs.
        actual: The value it has; None if it may not be read.
        ok: Whether they are equal.
        verified: Whether a document of this family prints the wanted value.
        label: The parameter in words.
        note: What else is known about it.
    """

    code: str
    wanted: Value
    actual: Value | None
    ok: bool
    verified: bool
    label: str
    note: str = ""


class Control(tuple[ControlItem, ...]):
    """The list that `Drive.check_control` gives: true if every item is as required."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return all(item.ok for item in self)

    def __str__(self) -> str:
        lines = []
        for item in self:
            verdict = "ok" if item.ok else f"needs {int(item.wanted)}"
            unverified = "" if item.verified else " [value unverified]"
            actual = "not read" if item.actual is None else int(item.actual)
            lines.append(f"{item.code} {item.label}: {actual}, {verdict}{unverified}")
        return "\n".join(lines)
