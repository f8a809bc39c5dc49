"""What options and arguments take: numbers and paths, and words for whoever gives something else."""

from __future__ import annotations

import math
import os
import re
from typing import Any, ClassVar

import click

__all__ = ["Amperes", "Hertz", "Place", "Rpm", "Seconds", "Share", "Size", "Whole", "with_a_point"]


class Number(click.FloatRange):
    """A finite number of *what*. "nan" and "inf" are refused before anything moves: they are neither early nor late."""

    what = "units"

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as a finite float in the range."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f'"{value}" is not a number of {self.what}{with_a_point(value)}.', parameter, context)
        if not math.isfinite(number):
            self.fail(f"{value} is not a number of {self.what}.", parameter, context)
        if _is_outside(number, self.min, self.max):
            self.fail(f"{value} is out of range; allowed is {_allowed(self.min, self.max)}.", parameter, context)
        return number


class Seconds(Number):
    """A time in seconds."""

    what = "seconds"


class Hertz(Number):
    """A frequency in Hz."""

    what = "Hz"


class Rpm(Number):
    """A speed in turns per minute."""

    what = "turns per minute"


class Share(Number):
    """A part of a whole, 1 being all of it."""

    what = "shares"


class Amperes(Number):
    """A current in A; `off` is infinite: no bound."""

    what = "amperes"

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as a float in the range, or infinity."""
        return math.inf if value == "off" else super().convert(value, parameter, context)


class Whole(click.IntRange):
    """A whole number."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as an int in the range."""
        allowed = _allowed(self.min, self.max)
        try:
            number = int(value)
        except ValueError:
            self.fail(f'"{value}" is not a whole number; allowed is {allowed}.', parameter, context)
        if _is_outside(number, self.min, self.max):
            self.fail(f"{value} is out of range; allowed is {allowed}.", parameter, context)
        return number


class Size(click.ParamType[int]):
    """A number of bytes, such as 500kB, 10MB or 1GB."""

    name = "size"
    _factors: ClassVar = {"": 1, "B": 1, "K": 10**3, "KB": 10**3, "M": 10**6, "MB": 10**6, "G": 10**9, "GB": 10**9}

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as whole bytes."""
        if isinstance(value, int):
            return value
        known = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([A-Za-z]*)\s*", value)
        factor = self._factors.get(known[2].upper()) if known else None
        if known is None or factor is None or float(known[1]) * factor < 1:
            self.fail(f'"{value}" is not a size; write one such as 10MB.', parameter, context)
        return int(float(known[1]) * factor)


class Place(click.Path):
    """A path. An empty one, as of a variable that is not set, would be the folder one happens to be in."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as a path."""
        if not str(value).strip():
            self.fail("an empty text is not a path.", parameter, context)
        try:
            nameless = b"\0" in os.fsencode(value)
        except UnicodeError:
            nameless = True
        if nameless:
            self.fail(f'"{value}" is not a path.', parameter, context)
        return super().convert(value, parameter, context)


def with_a_point(text: str) -> str:
    """`"; write 1.5"` for `1,5`, which half of the world writes; nothing for any other *text*."""
    return f"; write {text.replace(',', '.')}" if re.fullmatch(r"[+-]?\d+,\d+", text) else ""


def _is_outside(number: float, low: float | None, high: float | None) -> bool:
    return (low is not None and number < low) or (high is not None and number > high)


def _allowed(low: float | None, high: float | None) -> str:
    return f"{low:g} or more" if high is None else f"{low:g} to {high:g}"
