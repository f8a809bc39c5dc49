"""Why a motor may not be started, in words; the core has the kind of the reason.

A new reason against a start is a check in the core (`crates/drive/src/ready.rs`), its words here, its word in
`errors.Why`, and a line in docs/developers/guarantees.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drivebus.advice import Advice, Text, argument, call
from drivebus.errors import BadLink, DrivebusError, NotReady
from drivebus.operations import bus_control, glances
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import Evidence, refusal_of

if TYPE_CHECKING:
    from drivebus.line.stats import Link

__all__ = ["in_words"]

_SET_OTHERWISE = {
    "words": "has its words elsewhere",
    "commands": "does not take its commands from the bus",
    "speed": "would not take its speed from the bus",
}


def in_words(unit: DriveView, command: str | None, kind: str, told: Any) -> DrivebusError:
    """Why *unit* may not be given *command*, or None: a word that can move its motor.

    Args:
        unit: The unit.
        command: What was to be sent.
        kind: Of which kind the reason is, as `_native.Unit.start` has it.
        told: What is told of it.
    """
    if kind == "may_not":
        return refusal_of(unit.evidence.require_command, command)
    if kind == "unseen":
        return _unseen(unit)
    if kind == "unstoppable":
        return _unstoppable(unit)
    if kind == "bad_link":
        from drivebus.line.stats import Link

        link, lost, looks = told
        return _bad_link(unit, Link(*link), lost, looks)
    if kind == "settings":
        then, wrong = told
        return _settings(unit, then, wrong)
    seen = glances.shown(unit, told)
    if kind == "in_fault":
        return NotReady(
            Text(
                f"unit {unit.address} is in fault {seen.fault or '(not named)'}; nothing that moves it was sent. "
                "Remove the cause, then ",
                call("reset_fault"),
            ),
            why="fault",
            unit=unit.address,
        )
    if kind == "no_voltage":
        return NotReady(
            f"unit {unit.address} has no voltage on its DC bus; nothing that moves it was sent",
            why="no_voltage",
            unit=unit.address,
        )
    if kind == "unknown_state":
        return NotReady(
            Text(
                f"the state word of unit {unit.address} is {seen.word:04X}H, and {unit.profile.title} has no such "
                "state; nothing that moves it was sent. Look whether it is such a drive: ",
                call("identify"),
                " asks it",
            ),
            why="unknown_state",
            unit=unit.address,
        )
    if kind == "other_source":
        return NotReady(
            Text(
                f"unit {unit.address} takes its commands from the {seen.source}, not from the bus; nothing that moves "
                "it was sent. ",
                *bus_control.preparing(unit),
                " sets it to obey the bus",
            ),
            why="control_source",
            unit=unit.address,
        )
    return NotReady(
        Text(
            f"unit {unit.address} turns already ({seen.state}); nothing that moves it was sent. ",
            Advice("stop_and_wait", None, "stop() it, and wait_until_stopped(),"),
            " before a jog",
        ),
        why="turning",
        unit=unit.address,
    )


def _unseen(unit: DriveView) -> DrivebusError:
    what = f"unit {unit.address} is started by several words, and its state must be seen between them"
    return unit.evidence.missing(what, unit.evidence.without_state() or "", Evidence.without_state)


def _unstoppable(unit: DriveView) -> DrivebusError:
    reasons = {halt: unit.evidence.unusable(halt) or "" for halt in ("stop", "coast")}
    told = "; ".join(f"{halt}: {reason.rstrip('.')}" for halt, reason in reasons.items())
    what = f"a motor that unit {unit.address} starts could not be stopped over the bus"
    return unit.evidence.missing(what, told, _both_unusable)


def _both_unusable(evidence: Evidence) -> str | None:
    """Why a motor could not be stopped; None if it could."""
    return evidence.unusable("stop") and evidence.unusable("coast")


def _bad_link(unit: DriveView, link: Link, lost: int, looks: int) -> BadLink:
    return BadLink(
        Text(
            f"the link to unit {unit.address} is bad: {link}, and {lost} of {looks} looks at its state failed; "
            "nothing that moves it was sent, for its stop might be lost as well. Mend the line (",
            Advice("stats", None, "bus.stats()"),
            " may say how), or start anyway with ",
            argument("force", True),
        ),
        unit=unit.address,
    )


def _settings(unit: DriveView, then: str, wrong: list[Any]) -> NotReady:
    by_hand = [bus_control.item_of(unit, row) for row in wrong if row[6]]
    advice: tuple[str | Advice, ...] = (*bus_control.preparing(unit), " sets what is needed")
    if len(by_hand) == len(wrong):
        advice = (f"{by_hand[0].code} is set by hand: {by_hand[0].note.rstrip('.')}",)
    return NotReady(
        Text(
            f"unit {unit.address} {_SET_OTHERWISE[then]}:\n"
            f"{bus_control.shown(unit, wrong)}\nNothing that moves it was sent. ",
            *advice,
        ),
        why="settings",
        unit=unit.address,
    )
