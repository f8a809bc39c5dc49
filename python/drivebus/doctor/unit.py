"""One unit: whether its answers come whole, how long it takes to begin, and whether it is set to obey the bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from statistics import median

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.doctor.traffic import frames_in, is_frame
from drivebus.drive import Drive
from drivebus.errors import BadAnswer, CrcError, DrivebusError, NoAnswer, NotAllowed, Refused
from drivebus.identify.results import Found
from drivebus.profile import Profile, profiles

__all__ = ["unit_findings"]

_ECHO_CHARS = 8
"""Characters of an echo's request, and of its answer: unit, function, sub-function, word, CRC."""

_UNEVEN = 0.02
"""Seconds between the usual and the longest turnaround that a sound line with a sound unit does not show."""

_SPARE = 0.5
"""The share of a time-out that answers may take before one that is a little later is lost."""

_COMMUNICATION_FAULT = "CE"
"""What a Goodrive calls the fault of a bus that was silent for too long."""


@dataclass
class _Echoes:
    """What became of a number of echoes."""

    asked: int = 0
    silent: int = 0
    damaged: int = 0
    bad: int = 0
    late: int = 0
    refused: Refused | None = None
    last: str = ""
    """What the last bad one was, in words."""
    turnarounds: list[float] = field(default_factory=list)

    @property
    def answered(self) -> int:
        return len(self.turnarounds)


def unit_findings(
    bus: Bus,
    found: Found,
    echoes: int,
    tell: Callable[[str], None],
    named: Profile | None = None,
    unverified: bool = False,
) -> Iterator[Finding]:
    """About the unit that was *found* on *bus*. Asks *echoes* echoes and a few reads; writes nothing.

    It is taken for what it was *named*, unless it says itself that it is something else.
    """
    unit = found.unit
    tally = _ask(bus, unit, echoes, tell)
    tally.late = int(bus.stats()["units"].get(unit, {}).get("late_replies", 0))
    yield from _answers(unit, tally, found)
    if tally.answered:
        yield _turnaround(unit, tally.turnarounds)
    # To refuse an echo is an answer too.
    if not tally.answered and tally.refused is None:
        return
    tell(f"reading the settings of unit {unit}")
    try:
        if named is not None and found.certainty == "certain" and found.profile != named.family:
            yield _another(found, named)
            named = None
        drive = bus.drive(unit, named or found.profile, unverified=unverified)
        yield from _settings(drive, bus, tally.turnarounds, named is not None)
    except NotAllowed as error:
        yield Finding("unit", "family", Severity.NOTE, str(error), unit=unit)
    except DrivebusError as error:
        yield Finding(
            "unit",
            "settings",
            Severity.WARNING,
            f"its settings could not be read: {error}",
            unit=unit,
            error=type(error),
        )


def _another(found: Found, named: Profile) -> Finding:
    return Finding(
        "unit",
        "family",
        Severity.WARNING,
        f"unit {found.unit} says that it is a {found.profile}, and it was named {named.name}; it is taken for what it "
        "says",
        "leave --profile out, or unset DRIVEBUS_PROFILE: the same word can mean another command to another family",
        unit=found.unit,
        error=NotAllowed,
    )


def _ask(bus: Bus, unit: int, echoes: int, tell: Callable[[str], None]) -> _Echoes:
    tally = _Echoes()
    on_the_wire = 2 * _ECHO_CHARS * bus.format.char_time
    for count in range(1, echoes + 1):
        tell(f"echo {count} of {echoes} from unit {unit}")
        tally.asked = count
        try:
            tally.turnarounds.append(max(bus.echo(unit) - on_the_wire, 0.0))
        except Refused as error:
            tally.refused = error
            return tally
        except NoAnswer:
            tally.silent += 1
        except CrcError:
            tally.damaged += 1
        except BadAnswer as error:
            # What holds no whole frame was one before something happened to it.
            if frames_in(error.raw) or is_frame(error.raw):
                tally.bad += 1
                tally.last = str(error)
            else:
                tally.damaged += 1
    return tally


def _answers(unit: int, tally: _Echoes, found: Found) -> Iterator[Finding]:
    """How many answers came whole."""
    values = {
        "echoes": tally.asked,
        "answered": tally.answered,
        "silent": tally.silent,
        "damaged": tally.damaged,
        "bad": tally.bad,
    }
    if tally.refused is not None:
        yield Finding(
            "unit",
            "no_echo",
            Severity.NOTE,
            f"unit {unit} answers, and refuses echoes (08H): {tally.refused}",
            "a master must make sure of it by reads after a time-out, which takes longer",
            unit=unit,
            values=values,
        )
        return
    failed = tally.silent + tally.damaged + tally.bad
    if not failed:
        yield Finding(
            "unit",
            "answers",
            Severity.OK,
            f"unit {unit}{f', a {found.profile},' if found.profile else ''} returned {tally.answered} of {tally.asked} "
            "echoes whole",
            unit=unit,
            values=values,
        )
        return
    severity = Severity.WARNING if tally.answered else Severity.FAULT
    if tally.damaged and not tally.answered:
        yield Finding(
            "unit",
            "two_units",
            Severity.FAULT,
            f"not one of {tally.asked} echoes of unit {unit} came back whole, and {tally.damaged} came damaged, at "
            "whatever baud rate and parity",
            "most likely two units have this address and talk at once: switch one off after the other, and give "
            "each its own (INVT: P14.00). If it is alone: terminators, + and -, the common wire",
            unit=unit,
            values=values,
            error=CrcError,
        )
    elif tally.damaged:
        yield Finding(
            "unit",
            "damaged",
            severity,
            f"{tally.damaged} of {tally.asked} echoes of unit {unit} came back damaged",
            "reflections or interference: 120 ohm at both ends of the line and nowhere else, short stubs, the shield "
            "earthed, motor cables far; if only this unit has it: its connector, or a second unit with its address",
            unit=unit,
            values=values,
            error=CrcError,
        )
    if tally.bad:
        yield Finding(
            "unit",
            "bad_answers",
            severity,
            f"{tally.bad} of {tally.asked} echoes of unit {unit} brought something else, the last: {tally.last}",
            "another master on the line, a gateway that mixes answers up, or two units with one address",
            unit=unit,
            values=values,
            error=BadAnswer,
        )
    if tally.silent and tally.late:
        yield Finding(
            "unit",
            "late_answers",
            severity,
            f"{tally.silent} of {tally.asked} echoes of unit {unit} did not come back in time, and {tally.late} "
            "answers came after it",
            "lower its response delay (INVT: P14.03), or give a longer time-out; behind a gateway or a radio link both "
            "are usual",
            unit=unit,
            values={**values, "late": tally.late},
            error=NoAnswer,
        )
    elif tally.silent:
        yield Finding(
            "unit",
            "lost_answers",
            severity,
            f"{tally.silent} of {tally.asked} echoes of unit {unit} did not come back in time",
            "a loose wire, an adapter that switches its direction too late, or a unit that takes longer than the time-"
            "out (INVT: P14.03)",
            unit=unit,
            values=values,
            error=NoAnswer,
        )


def _turnaround(unit: int, times: list[float]) -> Finding:
    """From the end of a request to the first bit of its answer, by the round trip less the time of its characters."""
    low, middle, high = min(times), median(times), max(times)
    values = {"turnaround_min": low, "turnaround_median": middle, "turnaround_max": high}
    text = f"unit {unit} begins to answer {low * 1e3:.1f} to {high * 1e3:.1f} ms after a request, half of them within "
    text += f"{middle * 1e3:.1f} ms"
    if high - middle > _UNEVEN:
        return Finding(
            "unit",
            "turnaround",
            Severity.WARNING,
            text,
            "so uneven is neither line nor unit as a rule: an adapter's latency timer, a busy machine, or a gateway",
            unit=unit,
            values=values,
            error=NoAnswer,
        )
    return Finding("unit", "turnaround", Severity.OK, text, unit=unit, values=values)


def _settings(drive: Drive, bus: Bus, turnarounds: list[float], is_named: bool) -> Iterator[Finding]:
    """What the drive itself says about the bus: its delay, its time-out, its fault, and whom it obeys."""
    unit, profile = drive.unit, drive.profile
    known = set(profile.names())
    if "P14.03" in known:
        delay = float(drive.read("P14.03")) / 1e3
        took = f", and it took {median(turnarounds) * 1e3:.1f} ms" if turnarounds else ""
        text = f"unit {unit}: its response delay (P14.03) is {delay * 1e3:g} ms{took}"
        values = {"response_delay": delay, "timeout": bus.timeout}
        if max([delay, *turnarounds]) > _SPARE * bus.timeout:
            yield Finding(
                "unit",
                "timeout",
                Severity.WARNING,
                f"{text}: much of the time-out of {bus.timeout:g} s",
                "lower P14.03, or give a longer time-out",
                unit=unit,
                values=values,
                error=NoAnswer,
            )
        else:
            yield Finding("unit", "response_delay", Severity.OK, text, unit=unit, values=values)
    if "P14.04" in known:
        limit = float(drive.read("P14.04"))
        text = f"unit {unit} trips {_COMMUNICATION_FAULT} when the bus is silent for {limit:g} s (P14.04)"
        if limit == 0:
            text = f"unit {unit} does not notice when the bus falls silent (P14.04 is 0)"
        yield Finding("unit", "watchdog", Severity.OK, text, unit=unit, values={"silence": limit})
    try:
        fault = drive.fault()
    except NotAllowed as error:
        fault = None
        yield Finding("unit", "fault", Severity.NOTE, str(error), unit=unit)
    if fault is not None:
        is_ours = fault.mnemonic == _COMMUNICATION_FAULT
        yield Finding(
            "unit",
            "fault",
            Severity.WARNING if is_ours else Severity.NOTE,
            f"unit {unit} stands in fault {fault}",
            fault.remedy or ("the bus was silent for longer than P14.04" if is_ours else ""),
            unit=unit,
            error=NoAnswer if is_ours else None,
        )
    control = drive.check_control()
    if not len(control):
        text = f"what makes unit {unit} obey the bus is not known of {profile.title}"
        yield Finding("unit", "control", Severity.NOTE, text, unit=unit)
    elif control:
        yield Finding("unit", "control", Severity.OK, f"unit {unit} is set to obey the bus", unit=unit)
    else:
        wrong = "; ".join(
            f"{item.code} ({item.label}) is {'not known' if item.actual is None else int(item.actual)}, "
            f"needs {int(item.wanted)}"
            for item in control
            if not item.ok
        )
        surely = any(item.actual is not None and not item.ok for item in control)
        # Only unit 1 needs no --unit, only one that says what it is no --profile; and prepare writes without a
        # word only what is verified.
        others = "" if unit == 1 else f" --unit {unit}"
        name = drive.profile.name if drive.profile.name in profiles() else "FOLDER"
        given = f" --profile {name}" if is_named or drive.profile.role("identification") is None else ""
        doubtful = any(not item.ok and not item.verified for item in control)
        yield Finding(
            "unit",
            "control",
            Severity.NOTE,
            f"unit {unit} answers, and {'does not obey the bus yet' if surely else 'may not obey the bus'}: {wrong}",
            f"`drivebus{others}{given}{' --unverified' if doubtful else ''} prepare` sets it, if that is wanted",
            unit=unit,
        )
