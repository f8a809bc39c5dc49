"""One look at a drive: its status words, read in the fewest requests, kept and told.

Which words those are, and what they mean, the profile says. What no document of the family proves is left out, and the
reason is kept: half of a state is better than none.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from drivebus._native import Looks
from drivebus.look import Look
from drivebus.operations import events
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import carried_out_of
from drivebus.profile.evidence import Evidence
from drivebus.profile.profile import native_of
from drivebus.values import State

__all__ = ["glance", "keep", "planned", "remember", "seen_last", "shown"]


class _Plan(NamedTuple):
    """What a look reads, worked out once for each profile and trust."""

    looks: Looks
    state: str | None
    fault: str | None
    missing: Mapping[str, str]


async def glance(unit: DriveView, *, urgent: bool = False) -> Look:
    """As `look`; where nothing may be read, nothing is, and nothing is told."""
    plan = planned(unit.evidence)
    if plan.looks.is_blind:
        return Look(State.UNKNOWN, {}, None, 0.0, plan.missing, False, None)
    seen = shown(unit, await carried_out_of(unit, plan.looks.look(unit.address, urgent)))
    keep(unit, seen)
    return seen


def shown(unit: DriveView, told: Any) -> Look:
    """What a look at *unit* showed, of which the core *told*."""
    doing, word, number, in_fault, fields, asked = told
    fault = unit.profile.fault(number) if number else None
    return Look(State(doing), dict(fields), fault, asked, planned(unit.evidence).missing, in_fault, word)


def keep(unit: DriveView, seen: Look) -> None:
    """Keeps what was *seen*, and tells what changed since the look before."""
    remember(unit, str(seen))
    events.saw(unit, seen.state, str(seen.fault or "not named") if seen.tripped else None)


def planned(evidence: Evidence) -> _Plan:
    """What a look reads at a unit of whose family that is known."""
    return evidence.cached(_plan)


def _plan(evidence: Evidence) -> _Plan:
    reasons = {"state": evidence.without_state(), "fault": evidence.without_fault()}
    looks = Looks(native_of(evidence.profile), evidence.unverified)
    missing = {what: reason for what, reason in reasons.items() if reason is not None}
    return _Plan(looks, looks.state, looks.fault, missing)


def remember(unit: DriveView, seen: str) -> None:
    """Keeps the last state that was seen, for errors after which none can be read."""
    unit.record.last_state = (seen, unit.bus.now())


def seen_last(unit: DriveView, now: float | None = None) -> str:
    """The last state that was seen, and how long ago on the line's clock: before *now*, if that is given."""
    if unit.record.last_state is None:
        return "no state was ever seen"
    seen, at = unit.record.last_state
    # A line that is lost may have no clock.
    age = max((unit.bus.now() if now is None else now) - at, 0.0)
    return f"state seen last, {age:.1f} s ago: {seen}"
