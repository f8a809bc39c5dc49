"""Numbers as somebody types them into a dialog."""

from __future__ import annotations

import math

from drivebus import BadArgument
from drivebus.cli.option_types import with_a_point

__all__ = ["number"]


def number(text: str, what: str, most: float | None = None) -> float:
    """The number of *what* in *text*, 0 to *most*.

    Raises:
        NotAllowed: It is none. Nothing was sent.
    """
    try:
        given = float(text)
    except ValueError:
        raise BadArgument(f'"{text}" is not a number of {what}{with_a_point(text)}; nothing was sent') from None
    if not math.isfinite(given) or given < 0 or (most is not None and given > most):
        allowed = "0 or more" if most is None else f"0 to {most:g}"
        raise BadArgument(f"{text} {what} is out of range; allowed is {allowed}; nothing was sent")
    return given
