"""Figures as people read them: times with three digits and a unit, and tables."""

from __future__ import annotations

import json
from collections.abc import Sequence


def nanoseconds(value: float) -> str:
    """A time for people."""
    for factor, unit in ((1e9, "s"), (1e6, "ms"), (1e3, "µs")):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value:.3g} ns"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---:"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def show(as_json: bool, figures: object, table: str) -> None:
    """Prints one or the other."""
    print(json.dumps(figures, indent=1) if as_json else table)
