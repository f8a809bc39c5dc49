"""What a drive is, what it does, and what was read of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import drivebus
from drivebus.cli.present import profile_rules
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.output import Output
from drivebus.cli.present.screen import MARKS

__all__ = ["DriveStatus", "Identity", "KnownDrive", "Reading", "Readings", "Written"]


@dataclass(frozen=True)
class Identity:
    """What a unit says that it is.

    Attributes:
        found: What it was identified as.
        port: Where it hangs.
        line: The settings of the line, such as `19200 8E1`.
        device: Who made it, by its own words; None unless that was asked and told.
    """

    found: drivebus.Identification
    port: str
    line: str
    device: drivebus.DeviceIdentification | None = None

    def facts(self) -> dict[str, Any]:
        """What is known of it, by name."""
        return {
            "unit": self.found.unit,
            "identification": None if self.found.code is None else f"{self.found.code:#06x}",
            "certainty": self.found.certainty,
            "reason": self.found.reason,
            "may_be": self.found.candidates,
            **({} if self.device is None else _made(self.device)),
            "port": self.port,
            "line": self.line,
        }

    def facts_in_words(self) -> dict[str, Any]:
        """The same for people."""
        return {**self.facts(), "may_be": " or ".join(self.found.candidates)}

    def records(self) -> Iterator[dict[str, Any]]:
        """What is known of it."""
        yield self.facts()

    def lay_out(self, out: Output) -> None:
        """The same."""
        out.facts(self.facts_in_words())


def _made(device: drivebus.DeviceIdentification) -> dict[str, str]:
    """Who made it, and what it is, as far as it says so."""
    product = [device.product_name or device.model_name, device.product_code, device.revision]
    told = {"vendor": device.vendor, "product": ", ".join(text for text in product if text)}
    return {name: text for name, text in told.items() if text}


@dataclass(frozen=True)
class KnownDrive:
    """A drive of which the family is known.

    Attributes:
        identity: What it says that it is.
        profile: What it is treated as.
        against: What of its answers speaks against that, in words; None for nothing.
        round_trip: Seconds that an echo takes there and back; None where it takes none.
        status: What it does.
        control: Whether it obeys the bus, and which parameter says so.
    """

    identity: Identity
    profile: drivebus.Profile
    against: str | None
    round_trip: float | None
    status: drivebus.Status
    control: drivebus.Control

    def _facts(self, identity: Mapping[str, Any], round_trip: object, status: object) -> dict[str, Any]:
        return {
            "unit": identity["unit"],
            "profile": self.profile.name,
            "family": self.profile.family,
            "title": self.profile.title,
            "kind": self.profile.kind,
            **identity,
            "contradiction": self.against,
            "memory": "; ".join(profile_rules.memory(self.profile)),
            "round_trip": round_trip,
            "status": status,
            "obeys_bus": bool(self.control) if len(self.control) else None,
        }

    def records(self) -> Iterator[dict[str, Any]]:
        """What it is; then each parameter that decides whether it obeys the bus."""
        seconds = None if self.round_trip is None else round(self.round_trip, 6)
        yield self._facts(self.identity.facts(), seconds, DriveStatus(self.status).facts())
        for item in self.control:
            yield {
                "code": item.code,
                "is": item.actual,
                "needed": item.wanted,
                "ok": item.ok,
                "verified": item.verified,
                "label": item.label,
                "note": item.note,
            }

    def lay_out(self, out: Output) -> None:
        """The same, and what is to be noted of it."""
        after = None if self.round_trip is None else f"{self.round_trip * 1e3:.1f} ms"
        out.facts(self._facts(self.identity.facts_in_words(), after, str(self.status)))
        if not len(self.control):
            out.say("What makes it obey the bus is not known.")
            return
        out.rows(
            ["code", "is", "needed", "ok", "label"],
            [[item.code, item.actual, item.wanted, item.ok, item.label] for item in self.control],
        )
        for item in self.control:
            if item.note:
                out.say(f"{item.code}{'' if item.verified else ' is not verified'}: {item.note}")


_ASSUMED = MARKS["assumed"]


@dataclass(frozen=True)
class DriveStatus:
    """What a drive is doing.

    Attributes:
        status: What it tells.
        measured: What it measures at its motor, by name.
        described: What is known of those names.
        assumed: The same as *status* by registers that are only assumed, too; None where that tells no more.
        assumed_measured: What such registers measure, by name.
    """

    status: drivebus.Status
    measured: Mapping[str, Any] = field(default_factory=dict)
    described: Mapping[str, drivebus.Description] = field(default_factory=dict)
    assumed: drivebus.Status | None = None
    assumed_measured: Mapping[str, Any] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """What it tells, by name, and what it does not, and why."""
        return {
            "state": self.status.state,
            "ready": self.status.ready,
            "frequency": self.status.frequency,
            "setpoint": self.status.setpoint,
            "commands_from": self.status.source,
            "motor": self.status.motor,
            "overload_alarm": self.status.overload_alarm,
            "fault": self.status.fault,
            "missing": dict(self.status.missing),
        }

    def records(self) -> Iterator[dict[str, Any]]:
        """What it tells, and what it measures; apart from that, what is only assumed."""
        told = {**self.facts(), **self.measured}
        if self.assumed is not None:
            seen = DriveStatus(self.assumed).facts()
            told["assumed"] = {
                **{name: value for name, value in seen.items() if self._is_assumed(name)},
                **self.assumed_measured,
            }
        yield told

    def lay_out(self, out: Output) -> None:
        """The same with units, and what is assumed with a mark; then what is missing, and why.

        In one line where there are several drives.
        """
        shown = self.status if self.assumed is None else self.assumed
        measured = {**self.measured, **self.assumed_measured}
        if out.drive:
            mark = "" if self.assumed is None else f" {_ASSUMED}"
            out.say(f"{out.drive}: {', '.join([str(shown), *map(self._measured, measured)])}{mark}")
            return
        values = DriveStatus(shown).facts()
        missing = values.pop("missing")
        if "state" in missing:
            values["state"] = None
        for name in ("frequency", "setpoint"):
            if values[name] is not None:
                values[name] = f"{values[name]:.2f} Hz"
        for name, value in values.items():
            if value is not None and self._is_assumed(name):
                values[name] = f"{('no', 'yes')[value] if isinstance(value, bool) else value} {_ASSUMED}"
        out.facts({**values, **{name: self._measured(name) for name in measured}})
        if self.assumed is not None:
            out.say(f"{_ASSUMED} assumed: no document of this family proves it; --unverified uses it for commands too.")
        if missing:
            by_reason: dict[str, list[str]] = {}
            for name, reason in missing.items():
                by_reason.setdefault(reason, []).append(name.replace("_", " "))
            out.say("Missing:")
            out.facts({", ".join(names): reason for reason, names in by_reason.items()})

    def _is_assumed(self, name: str) -> bool:
        """Whether what is shown as *name* is only assumed."""
        role = {"commands_from": "source"}.get(name, name)
        return self.assumed is not None and role in self.status.missing and role not in self.assumed.missing

    def _measured(self, name: str) -> str:
        """A measured value with its unit, and a mark if it is only assumed."""
        known = self.described[name]
        value = self.measured.get(name, self.assumed_measured.get(name))
        return f"{known.text(value)} {known.unit}{f' {_ASSUMED}' if name in self.assumed_measured else ''}"


@dataclass
class Reading:
    """One value that was asked for.

    Attributes:
        name: As people know it: its code, its name, or its address.
        unit: Of the value, such as `Hz`.
        label: What it is.
        evidence: How well that is proved; None for an address that the profile does not know.
        value: What came; None if nothing did.
        text: The same as the drive shows it.
        bits: What its bits mean, where it has such.
        error: Why nothing came.
    """

    name: str
    unit: str
    label: str
    evidence: str | None
    value: Any = None
    text: str = ""
    bits: Mapping[str, Any] | None = None
    error: drivebus.DrivebusError | None = None


_COLUMNS = ("name", "value", "unit", "label")


@dataclass(frozen=True)
class Readings:
    """What was asked for, in its order: a program gets all of it, people what came."""

    rows: Sequence[Reading]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each value, or why it did not come."""
        for row in self.rows:
            told = {name: getattr(row, name) for name in ("name", "value", "unit", "label", "evidence")}
            if row.bits:
                told["bits"] = row.bits
            if row.error is not None:
                told |= {"error": in_commands(row.error), "exit_code": exit_code(row.error)}
            yield told

    def lay_out(self, out: Output) -> None:
        """A table, and the bits of words that have such; how well it is proved only where that is in doubt."""
        came = [row for row in self.rows if row.error is None]
        columns = list(_COLUMNS)
        if any(row.evidence not in ("verified", None) for row in came):
            columns.append("evidence")
        if came:
            out.rows(columns, [_shown(row, columns) for row in came])
        for row in came:
            if row.bits:
                out.say(f"{row.name}: {', '.join(f'{name} = {meaning}' for name, meaning in row.bits.items())}")


@dataclass(frozen=True)
class Written:
    """What is there now, of what was written."""

    rows: Sequence[Reading]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each value; None where it could not be read back."""
        for row in self.rows:
            yield {name: getattr(row, name) for name in _COLUMNS}

    def lay_out(self, out: Output) -> None:
        """The same in a table."""
        out.rows(_COLUMNS, [_shown(row, _COLUMNS) for row in self.rows])


def _shown(row: Reading, columns: Sequence[str]) -> list[Any]:
    return [getattr(row, "text" if column == "value" else column) for column in columns]
