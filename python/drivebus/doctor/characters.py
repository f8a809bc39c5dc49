"""Characters of seven data bits, at the unit or here: Modbus RTU has eight, so no CRC is right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, Refused
from drivebus.identify import codes
from drivebus.line.seven_bits import SevenBits, agreed, seen_in
from drivebus.line.stats import noisy
from drivebus.line_search.settings import Settings

__all__ = ["SEVEN_BITS", "asked_of", "of_settings", "of_unit"]

SEVEN_BITS = "seven_bits"
"""The name of the finding."""

_TIMES = 5
"""How often a unit is asked whose answers make no frame."""

_PATIENCE = 0.25
"""Seconds each time."""

_MOST_UNITS = 3
"""Units that are asked so."""

_ADVICE = "Modbus RTU has 8 data bits, and drivebus speaks nothing else: set the unit to RTU with 8E1 or 8N1"


def of_settings(given: Settings) -> Finding:
    """The finding that the settings *given* have seven data bits."""
    return Finding(
        "line",
        SEVEN_BITS,
        Severity.FAULT,
        f"{given} has 7 data bits, and Modbus RTU has 8: each byte loses its highest bit, and no CRC is right",
        f"give 8, such as --format 8{given.parity}{given.stopbits}. A unit that is set to {given.format} speaks Modbus "
        "ASCII at best: set it to RTU",
        values={"format": given.format},
        error=NotAllowed,
    )


def of_unit(unit: int, sent: SevenBits, settings: Settings) -> Finding:
    """The finding that *unit* was heard to send seven data bits, at *settings*."""
    if sent.ascii:
        text = f"unit {unit} answers in {sent} at {settings.baudrate} bit/s"
        why = ", which is no Modbus RTU"
    elif sent.format is None:
        text = f"the answers of unit {unit} come without the highest bit of each byte"
        why = ": it sends 7 data bits, or something between it and here does"
    else:
        text = f"unit {unit} answers with {sent} at {settings.baudrate} bit/s"
        bit = "stop bit" if sent.format == "7N2" else "parity bit"
        why = f": the highest bit of each byte is its {bit}, so no CRC is right"
    return Finding(
        "unit",
        SEVEN_BITS,
        Severity.FAULT,
        f"{text}{why}",
        _ADVICE,
        unit,
        values={"format": sent.format, "ascii": sent.ascii, "came": sent.wire.hex(" ").upper()},
        error=BadAnswer,
    )


def asked_of(bus: Bus, units: Sequence[int], tell: Callable[[str], None]) -> Finding | None:
    """The finding that one of *units*, of which no answer was whole, sends seven data bits.

    Those from which bytes came that are no answer are asked a few times more, for what a scan asks.
    """
    settings = Settings.of(bus)
    made_noise = noisy(bus.stats())
    for unit in [each for each in units if each in made_noise][:_MOST_UNITS]:
        tell(f"looking at the bytes of unit {unit} at {settings}")
        answers: list[SevenBits | None] = []
        for _ in range(_TIMES):
            came = _came(bus, unit)
            answers += [seen_in(unit, came)] if came else []
            sent = agreed(answers)
            if sent is not None:
                return of_unit(unit, sent, settings)
    return None


def _came(bus: Bus, unit: int) -> bytes:
    """What comes where *unit* is asked once."""
    with suppress(Refused):
        try:
            bus.read(unit, codes.registers()[0], timeout=_PATIENCE, retries=0)
        except (NoAnswer, BadAnswer) as error:
            return error.raw
    return b""
