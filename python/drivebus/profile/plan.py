"""A read plan: what to read for some names, and what the words that come mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

from drivebus import _native
from drivebus.errors import BadAnswer

if TYPE_CHECKING:
    from drivebus.values import Description, Value

__all__ = ["ReadPlan", "labelled"]


def labelled(row: Description, value: float) -> Value:
    """*value* with its label, where *row* has one for it. A float is no choice, although one may equal its number."""
    label = row.choices.get(value) if row.choices and isinstance(value, int) else None
    if label is None:
        return value
    from drivebus.values import Choice

    return Choice(int(value), label)


class ReadPlan:
    """What to read for some names, and what the words that come mean: worked out once, used for every answer.

    Attributes:
        names: As they were asked for.
        reads: Address and number of words of each read: the fewest that hold all of them.
        units: The engineering unit of each name.
        native: The same for the compiled core, which knows no labels.
    """

    __slots__ = ("_labels", "names", "native", "reads", "units")

    def __init__(self, native: _native.Plan, known: Sequence[Description]) -> None:
        self.native = native
        self.names = tuple(native.names)
        self.reads = tuple(native.reads)
        self.units: Mapping[str, str] = {name: row.unit for name, row in zip(self.names, known, strict=True)}
        self._labels = [
            (index, {value: labelled(row, value) for value in row.choices})
            for index, row in enumerate(known)
            if row.choices
        ]

    def values(self, answers: Sequence[Sequence[int]], *, unit: int | None = None) -> list[Value]:
        """The value of each name, in their order, out of the words that each read brought.

        Raises:
            BadAnswer: Words of *unit* that stand for nothing: it has no such register.
        """
        return self.named(self.native.values(answers), unit=unit)

    def named(self, values: list[Value | None], *, unit: int | None = None) -> list[Value]:
        """*values*, with a `Choice` for each that the profile has a label for; the list itself is changed.

        Raises:
            BadAnswer: One is None: *unit* says that it has no such register.
        """
        if None in values:
            absent = ", ".join(name for name, value in zip(self.names, values, strict=True) if value is None)
            who = "the drive" if unit is None else f"unit {unit}"
            raise BadAnswer(
                f"{who} has no {absent}: the word that it answered stands for nothing in its family. "
                f"Leave {absent} out",
                unit=unit,
            )
        told = cast("list[Value]", values)
        for index, labels in self._labels:
            value = told[index]
            # A float is never a choice, although one may equal its number.
            if isinstance(value, int):
                told[index] = labels.get(value, value)
        return told
