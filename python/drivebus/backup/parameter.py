"""One parameter line of a backup: whether value, unit and raw word fit the profile and each other."""

from __future__ import annotations

from typing import Any

from drivebus import checks
from drivebus.backup.text import number
from drivebus.errors import NotAllowed
from drivebus.protocols import ProfileProtocol
from drivebus.values import Description

__all__ = ["FIELDS", "Wrong", "word"]

FIELDS = ("value", "unit", "raw", "beyond")
"""What may stand in the line of a parameter."""


class Wrong(Exception):
    """What is wrong with one line."""


def word(profile: ProfileProtocol, code: str, fields: object) -> int:
    """The word that the line of *code* stands for.

    Raises:
        Wrong: Something does not fit.
    """
    known = _known(profile, code)
    if not isinstance(fields, dict):
        raise Wrong(f"{code} must be {_example(profile, known)}, and is {_shown(fields)}")
    for key in fields:
        if key not in FIELDS:
            raise Wrong(f"{code} has no field {key!r}{checks.closest(key, FIELDS)}")
    if "value" not in fields:
        raise Wrong(f"{code} lacks its value; write {_example(profile, known)}")
    value, unit, raw, beyond = (fields.get(key) for key in FIELDS)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Wrong(f"{code}: value {_shown(value)} is no number")
    if "unit" in fields and unit != known.unit:
        raise Wrong(f"{code} is in {known.unit or 'a plain number'}, not in {_shown(unit)}")
    if "beyond" in fields and not isinstance(beyond, bool):
        raise Wrong(f"{code}: beyond must be true or false, and is {_shown(beyond)}")
    most = (1 << 16 * known.words) - 1
    if "raw" in fields and (isinstance(raw, bool) or not isinstance(raw, int) or not 0 <= raw <= most):
        raise Wrong(f"{code}: raw {_shown(raw)} is no whole number in 0..{most}")
    if raw is not None and (beyond or known.words > 1):
        if profile.decode(code, raw) != value:
            raise Wrong(_disagree(profile, known, value, raw))
        return int(raw)
    if known.words > 1:
        raise Wrong(f"{code} has two words: its line needs `raw`")
    try:
        meant = profile.encode(code, value)
    except NotAllowed as error:
        raise Wrong(str(error)) from None
    if raw is not None and raw != meant:
        raise Wrong(_disagree(profile, known, value, raw))
    return meant


def _known(profile: ProfileProtocol, code: str) -> Description:
    try:
        known = profile.describe(code)
    except NotAllowed as error:
        raise Wrong(str(error)) from None
    if known.kind != "parameter" or known.code is None:
        raise Wrong(f"{code} is a register, and no parameter that a drive keeps")
    if known.code != code:
        raise Wrong(f"{code!r} must be written as its code, {known.code}")
    return known


def _example(profile: ProfileProtocol, known: Description) -> str:
    shown = number(profile.decode(known.code or "", 0), known.scale)
    unit = f', unit = "{known.unit}"' if known.unit else ""
    return f"{{ value = {shown}{unit}, raw = 0 }}"


def _disagree(profile: ProfileProtocol, known: Description, value: float, raw: int) -> str:
    code, unit = known.code or "", f" {known.unit}" if known.unit else ""
    means = number(profile.decode(code, raw), known.scale)
    return (
        f"{code}: value {value}{unit} and raw {raw} do not agree: raw {raw} is {means}{unit}. Change both, or take "
        "`raw` out"
    )


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
