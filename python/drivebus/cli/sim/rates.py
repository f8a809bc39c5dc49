"""How often which fault of the line happens, as it is typed: `late=0.02`."""

from __future__ import annotations

from drivebus.cli.wrong_use import WrongUse

__all__ = ["rates_of"]


def rates_of(every: float | None, single: tuple[str, ...]) -> dict[str, float]:
    """Rates by kind: *every* for all of them, and each of *single*, such as `late=0.02`."""
    rates = {} if every is None else {"all": every}
    for kind, rate in map(_rate, single):
        if kind in rates:
            raise WrongUse(f"the rate of {kind} is given twice")
        rates[kind] = rate
    return rates


def _rate(text: str) -> tuple[str, float]:
    kind, _, rate = text.partition("=")
    try:
        return kind.strip().replace("-", "_"), float(rate)
    except ValueError:
        raise WrongUse(f'"{text}" is not a fault; write KIND=RATE, such as late=0.02') from None
