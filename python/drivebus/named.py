"""A mapping whose names are attributes too: `values["output_current"]` and `values.output_current`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

__all__ = ["Named"]

T = TypeVar("T")


class Named(Mapping[str, T]):
    """Reads *values*, and never changes them."""

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[str, T]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> T:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, name: str) -> T:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[name]
        except KeyError:
            kind = type(self).__name__
            raise AttributeError(f'this {kind} does not hold "{name}", only {", ".join(self._values)}') from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._values]
