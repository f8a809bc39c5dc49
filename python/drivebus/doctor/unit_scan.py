"""Who is there: which units are asked, which of them answer, and what is said where none does at the given settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from drivebus.bus import Bus
from drivebus.checks import UNITS
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import BadAnswer, NoAnswer
from drivebus.identify.results import Found
from drivebus.line_search.settings import Settings

__all__ = ["found_elsewhere", "look", "nobody", "units_to_ask", "whole"]

_PATIENCE = 0.25
"""Seconds each is given: INVT's response delay (P14.03) can be set to 200 ms."""


def units_to_ask(unit: int | None, full: bool, elsewhere: bool = False) -> Sequence[int]:
    """Whom to ask: *unit*, or those that are likely; *elsewhere* fewer, for each costs a time-out at each setting."""
    if unit is not None:
        return [unit]
    if full:
        return range(1, 33) if elsewhere else UNITS
    return range(1, 4) if elsewhere else range(1, 33)


def look(bus: Bus, units: Sequence[int], tell: Callable[[str], None], times: int = 1) -> list[Found]:
    """Those of *units* that answer, by one read each; of several answers the first that is whole.

    Who answers with damage is asked up to *times* times, and who is silent too if there is no other to be asked.
    """
    found = []
    for unit in units:
        tell(f"asking unit {unit} at {Settings.of(bus)}")
        answer: Found | None = None
        for _ in range(times):
            answer = next(bus.scan([unit], _PATIENCE, protocol="modbus"), None) or answer
            if answer is None and len(units) > 1:
                break
            if answer is not None and answer.problem is None:
                break
        else:
            # A whole frame that came too late was sent at these settings all the same.
            if _came_late(bus, unit):
                answer = Found(unit, None, None, bus.timeout)
        if answer is not None:
            found.append(answer)
    return found


def _came_late(bus: Bus, unit: int) -> bool:
    of_unit = bus.stats()["units"].get(unit)
    return of_unit is not None and of_unit["late_replies"] > 0


def whole(found: Iterable[Found]) -> list[Found]:
    """Those of *found* whose answer was whole."""
    return [each for each in found if each.problem is None]


def found_elsewhere(given: Settings, other: Settings, found: Sequence[Found]) -> Finding:
    """The finding that those in *found* answer at *other* settings than the ones given."""
    units = ", ".join(str(each.unit) for each in found)
    what = [name for name in ("baudrate", "parity", "stopbits") if getattr(given, name) != getattr(other, name)]
    names = {"baudrate": "baud rate", "stopbits": "stop bits"}
    wrong = " and ".join(names.get(name, name) for name in what)
    return Finding(
        "unit",
        "wrong_baud" if "baudrate" in what else "wrong_parity",
        Severity.FAULT,
        f"unit {units} answers at {other}, not at {given}: the {wrong} {'differ' if len(what) > 1 else 'differs'}",
        f"use --baud {other.baudrate} --format {other.format}, or set the unit to "
        f"{given} (INVT: P14.01, P14.02; VFD500: P30.02 and the format beside it)",
        unit=found[0].unit,
        values={"baudrate": other.baudrate, "format": other.format},
        error=NoAnswer,
    )


def nobody(given: Settings, unit: int | None, asked: Sequence[int], tried: int, noise: int) -> Finding:
    """The finding that nobody gives a right answer, at whatever settings. *noise*: how many bytes came instead."""
    who = f"unit {unit}" if unit is not None else f"units {asked[0]} to {asked[-1]}"
    where = f"at {given}" + (f" nor at {tried} other settings" if tried else "")
    if noise:
        return Finding(
            "unit",
            "garbled",
            Severity.FAULT,
            f"{who} gave no valid answer {where}, but {noise} bytes came that belong to none",
            "a baud rate or parity that was not tried (--full tries all), + and - swapped, or no termination: compare "
            "P14.01 and P14.02 on the keypad, swap the two wires, look for a second unit with this address, "
            "then try with one unit on a short cable",
            unit=unit,
            values={"noise_bytes": noise},
            error=BadAnswer,
        )
    return Finding(
        "unit",
        "nobody_answers",
        Severity.FAULT,
        f"{who} did not answer {where}",
        "check the unit's power, that + goes to + and - to -, the common wire, its address (INVT: P14.00), its baud "
        "rate and format (P14.01, P14.02), and that it is set to Modbus RTU: one set to ASCII is silent"
        + ("" if unit is None else "; leave --unit out to look for others")
        + "; a port on a board, wired to a bare transceiver, needs --rs485",
        unit=unit,
        error=NoAnswer,
    )
