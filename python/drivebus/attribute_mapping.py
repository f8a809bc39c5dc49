"""A mapping whose names are attributes too: `values["output_current"]` and `values.output_current`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

__all__ = ["Named"]

K = TypeVar("K", bound="str | int")
T = TypeVar("T")


class Named(Mapping[K, T]):
    """Reads *values*, and never changes them."""

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[K, T]) -> None:
        self._values: dict[Any, T] = dict(values)

    def __getitem__(self, name: K) -> T:
        return self._values[name]

    def __iter__(self) -> Iterator[K]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, name: str) -> T:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[name]
        except KeyError:
            raise AttributeError(self._lacks(name)) from None

    def _lacks(self, name: str) -> str:
        return f'this {type(self).__name__} does not hold "{name}", only {", ".join(map(str, self._values))}'

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self._values if isinstance(name, str))]

    def _repr_html_(self) -> str:
        """A table, for a notebook."""
        from html import escape

        rows = (f"<tr><th>{escape(str(name))}</th><td>{escape(str(value))}</td></tr>" for name, value in self.items())
        return f"<table>{''.join(rows)}</table>"

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.items())})"
