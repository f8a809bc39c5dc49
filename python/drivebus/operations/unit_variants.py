"""What a parameter of the drive decides of the meaning of its words, and asking the drive how it is set."""

from __future__ import annotations

from collections.abc import Mapping, Set
from typing import TYPE_CHECKING, Any

from drivebus.advice import Advice, Text
from drivebus.errors import DrivebusError, NotReady
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import Evidence, not_verified, refusal_of

if TYPE_CHECKING:
    from drivebus.profile.facts import Variant

__all__ = ["given", "is_open", "not_settled", "rules", "settled", "undecided"]


def rules(unit: DriveView) -> Mapping[str, Variant]:
    """Each variant of the family, with the parameter that decides it and what that may say."""
    return unit.evidence.cached(_rules)


def is_open(unit: DriveView, name: str) -> bool:
    """Whether a parameter of the drive decides what *name* means, and nobody said how."""
    return unit.profile.describe(name).variant in unit.evidence.cached(undecided)


def undecided(evidence: Evidence) -> Set[str]:
    """The variants of the family that nobody said how they are."""
    return set(evidence.cached(_rules)) - set(evidence.profile.variants_chosen)


async def settled(unit: DriveView, *names: str) -> DriveView:
    """The same unit, with everything fixed on which the meaning of *names* depends."""
    still_open = unit.evidence.cached(undecided)
    if not still_open:
        return unit
    if all(unit.profile.describe(name).variant not in still_open for name in names):
        return unit
    kind, told = await call_core(unit, lambda core: core.settled(names))
    if kind != "done":
        raise not_settled(unit, *told)
    return unit.with_profile(unit.profile.with_variants(told))


def given(unit: DriveView, variant: str) -> Text:
    """How *variant* is given, for people."""
    rule = rules(unit)[variant]
    choices = ", ".join(map(repr, rule.choices)) if rule.between is None else "{!r} to {!r}".format(*rule.between)
    return Text(Advice("variants", variant, f"variants={{{variant!r}: …}} for bus.drive()"), f" ({choices})")


def not_settled(unit: DriveView, kind: str, told: Any) -> DrivebusError:
    """Why nobody knows what words of *unit* mean: *kind* and *told* as `_native.Unit.settled` has them."""
    variant = told[0] if kind == "unknown" else told
    parameter = rules(unit)[variant].parameter
    says = Text(given(unit, variant), " says which")
    if kind == "unproved":
        reason = unit.evidence.undecided(variant) or ""
        return not_verified(
            f"what {parameter} decides in {unit.profile.title}, and so what the word means (its {variant})",
            Text(f"{reason.rstrip('.')}; ", says),
            unit.address,
        )
    if kind == "unknown":
        return NotReady(
            Text(
                f"{parameter} of unit {unit.address} is {told[1]}, which means nothing known; ",
                says,
                ". Nothing was written",
            ),
            why="settings",
            unit=unit.address,
        )
    return refusal_of(unit.evidence.require_readable, [parameter])


def _rules(evidence: Evidence) -> Mapping[str, Variant]:
    return evidence.profile.variants()
