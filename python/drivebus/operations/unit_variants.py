"""What a parameter of the drive decides of the meaning of its words, and asking the drive how it is set."""

from __future__ import annotations

from collections.abc import Mapping, Set

from drivebus.advice import Advice, Text
from drivebus.errors import NotReady
from drivebus.operations.drive_view import DriveView
from drivebus.operations.raw_words import read_words
from drivebus.profile.evidence import Evidence, not_verified
from drivebus.profile.facts import Variant

__all__ = ["is_open", "rules", "settled", "undecided"]


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
    wanted = [known.variant for name in names if (known := unit.profile.describe(name)).variant]
    chosen = {variant: await _chosen(unit, variant) for variant in wanted if variant in still_open}
    if not chosen:
        return unit
    return unit.with_profile(unit.profile.with_variants({**unit.profile.variants_chosen, **chosen}))


def given(unit: DriveView, variant: str) -> Text:
    """How *variant* is given, for people."""
    choices = ", ".join(map(repr, rules(unit)[variant]["choices"]))
    return Text(Advice("variants", variant, f"variants={{{variant!r}: …}} for bus.drive()"), f" ({choices})")


async def _chosen(unit: DriveView, variant: str) -> str:
    """What the drive's own parameter says of *variant*."""
    rule = rules(unit)[variant]
    parameter, choices = rule.parameter, rule.choices
    says = Text(given(unit, variant), " says which")
    reason = unit.evidence.undecided(variant)
    if reason is not None:
        raise not_verified(
            f"what {parameter} decides in {unit.profile.title}, and so what the word means (its {variant})",
            Text(f"{reason.rstrip('.')}; ", says),
            unit.address,
        )
    unit.evidence.require_readable([parameter])
    known = unit.profile.describe(parameter)
    raw = known.number(await read_words(unit, unit.profile.address(parameter), known.words))
    for choice, value in choices.items():
        if value == raw:
            return str(choice)
    raise NotReady(
        Text(
            f"{parameter} of unit {unit.address} is {raw}, which means nothing known; ", says, ". Nothing was written"
        ),
        why="settings",
        unit=unit.address,
    )


def _rules(evidence: Evidence) -> Mapping[str, Variant]:
    return evidence.profile.variants()
