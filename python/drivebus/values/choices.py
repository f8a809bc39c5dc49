"""Numbers in engineering units, and those that a drive gives a name."""

from __future__ import annotations

__all__ = ["Choice", "Value", "counted", "digits_of"]


class Choice(int):
    """A number that the drive gives a name: an int in every respect, and its label as text.

    `str()` and f-strings show the label, `int()` and comparisons the number.
    """

    label: str

    def __new__(cls, value: int, label: str) -> Choice:
        """The number *value*, called *label*."""
        self = super().__new__(cls, value)
        self.label = label
        return self

    def __str__(self) -> str:
        return self.label

    def __repr__(self) -> str:
        return f"Choice({int(self)}, {self.label!r})"

    def __getnewargs__(self) -> tuple[int, str]:  # type: ignore[override]
        return int(self), self.label


Value = int | float
"""A value in engineering units: float where the drive measures, int where it counts, `Choice` where it names."""


def counted(value: Value, scale: float) -> str:
    """*value* with as many digits after the point as a drive counts that has *scale* counts per unit."""
    if isinstance(value, int):
        return str(int(value))
    shown = f"{value:.{digits_of(scale)}f}"
    return shown if float(shown) == value else repr(value)


def digits_of(scale: float) -> int:
    """How many digits after the point a value has of a drive that has *scale* counts per unit; 9 at most."""
    digits = 0
    while digits < 9 and 10**digits < scale:
        digits += 1
    return digits
