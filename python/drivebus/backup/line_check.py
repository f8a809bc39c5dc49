"""One parameter line of a backup: whether value, unit and raw word fit the profile and each other."""

from __future__ import annotations

from typing import Any

from drivebus import checks
from drivebus.backup.unread import WHY, Unread
from drivebus.errors import NotAllowed
from drivebus.profile import Profile
from drivebus.values import Description, counted

__all__ = ["FIELDS", "Wrong", "lacking", "word"]

_VALUE = ("value", "unit", "raw", "told", "beyond", "ram")
_LACKING = ("unread", "reason")

FIELDS = (*_VALUE, *_LACKING)
"""What may stand in the line of a parameter: its value, or why there is none."""


class Wrong(Exception):
    """What is wrong with one line."""


def lacking(profile: Profile, code: str, fields: object) -> Unread | None:
    """Why the drive did not tell *code*, where its line says so; None where the line is to have a value.

    Raises:
        Wrong: Something does not fit.
    """
    if not isinstance(fields, dict) or "unread" not in fields:
        return None
    _known(profile, code)
    why, reason = (fields.get(key) for key in _LACKING)
    if why not in WHY[1:]:
        raise Wrong(f"{code}: unread {_shown(why)} is none of {', '.join(WHY[1:])}")
    if not isinstance(reason, str):
        raise Wrong(f"{code} is unread, and its line needs the reason: a text")
    for key in fields:
        if key not in _LACKING:
            raise Wrong(f"{code} is unread, and its line has {_shown(key)} all the same: take one of them out")
    return Unread(reason, why)


def word(profile: Profile, code: str, fields: object) -> tuple[int, int | None]:
    """The word that the line of *code* stands for, and the word that the drive told, where the line has that.

    Raises:
        Wrong: Something does not fit.
    """
    known = _known(profile, code)
    if not isinstance(fields, dict):
        raise Wrong(f"{code} must be {_example(profile, known)}, and is {_shown(fields)}")
    for key in fields:
        if key not in _VALUE:
            raise Wrong(f'{code} has no field "{key}"{checks.closest(key, FIELDS)}')
    if "value" not in fields:
        raise Wrong(f"{code} lacks its value; write {_example(profile, known)}")
    value, unit, raw, told, beyond, _ = (fields.get(key) for key in _VALUE)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Wrong(f"{code}: value {_shown(value)} is not a number")
    if "unit" in fields and unit != known.unit:
        raise Wrong(f"{code} is in {known.unit or 'a plain number'}, not in {_shown(unit)}")
    for key in ("beyond", "ram"):
        if not isinstance(fields.get(key, False), bool):
            raise Wrong(f"{code}: {key} must be true or false, and is {_shown(fields[key])}")
    most = (1 << 16 * known.words) - 1
    for key in ("raw", "told"):
        given = fields.get(key, 0)
        if isinstance(given, bool) or not isinstance(given, int) or not 0 <= given <= most:
            raise Wrong(f"{code}: {key} {_shown(given)} is not a whole number from 0 to {most}")
    return _meant(profile, known, value, raw, beyond is True), told


def _meant(profile: Profile, known: Description, value: float, raw: int | None, beyond: bool) -> int:
    """The word for *value*, with which *raw* has to agree."""
    code = known.code or ""
    if raw is not None and (beyond or known.words > 1):
        if profile.decode(code, raw) != value:
            raise Wrong(_disagree(profile, known, value, raw))
        return raw
    if known.words > 1:
        raise Wrong(f"{code} has two words: its line needs `raw`")
    try:
        meant = profile.encode(code, value)
    except NotAllowed as error:
        raise Wrong(str(error)) from None
    if raw is not None and raw != meant:
        raise Wrong(_disagree(profile, known, value, raw))
    return meant


def _known(profile: Profile, code: str) -> Description:
    try:
        known = profile.describe(code)
    except NotAllowed as error:
        raise Wrong(str(error)) from None
    if not known.listed:
        near = checks.closest(known.code or code, [row for row in profile.names() if "." in row])
        raise Wrong(f"{profile.name} does not list {known.code}, and a backup keeps only what its profile lists{near}")
    if known.kind != "parameter" or known.code is None:
        raise Wrong(f"{code} is a register, and no parameter that a drive keeps")
    if known.code != code:
        raise Wrong(f'"{code}" must be written as its code, {known.code}')
    return known


def _example(profile: Profile, known: Description) -> str:
    shown = counted(profile.decode(known.code or "", 0), known.scale)
    unit = f', unit = "{known.unit}"' if known.unit else ""
    return f"{{ value = {shown}{unit}, raw = 0 }}"


def _disagree(profile: Profile, known: Description, value: float, raw: int) -> str:
    code, unit = known.code or "", f" {known.unit}" if known.unit else ""
    means = counted(profile.decode(code, raw), known.scale)
    return (
        f"{code}: value {value}{unit} and raw {raw} do not agree: raw {raw} is {means}{unit}. Change both, or take "
        "`raw` out"
    )


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
