"""A backup file as people leave it: every line is checked, and everything that is wrong is said at once.

The file is TOML, and each of its lines is TOML by itself, so it is handed to the parser line by line: one that reads
the whole file ends at the first error and does not say where the others are. Nothing is executed.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from drivebus import checks
from drivebus.backup.line_check import FIELDS, Wrong, lacking, word
from drivebus.backup.text import FORMAT, printable
from drivebus.backup.unread import Unread
from drivebus.errors import BadArgument, NotAllowed
from drivebus.profile import Profile

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Parsed", "parse"]

_LONGEST = 1000
"""Characters a line may have."""
_SHOWN = 100
"""Wrong lines that a message names; the rest is counted."""
_SHOWN_OF_NO_BACKUP = 20
"""The same where no line says that it is one: it may be anything."""

_ANYBODYS = "not TOML, or nothing that a backup has"
"""Said of a line where nothing says that the file is a backup: it may be anybody's, and none of it is repeated."""

_TOP: dict[str, tuple[type, str]] = {
    "format": (int, "a number"),
    "complete": (bool, "true or false"),
    "interrupted": (bool, "true or false"),
}
_DRIVE: dict[str, tuple[type, str]] = {
    "family": (str, "a text"),
    "profile": (str, "a text"),
    "title": (str, "a text"),
    "unit": (int, "a number"),
    "identification": (int, "a number such as 0x01A0"),
    "firmware": (str, "a text"),
    "profile_version": (int, "a number"),
    "drivebus": (str, "a text"),
    "taken": (datetime, "a moment such as 2026-01-31T12:00:00Z"),
}
_SECTIONS = ("drive", "parameters", "readings")


@dataclass
class Parsed:
    """What a file holds.

    Attributes:
        profile: What its words mean.
        origin: The fields of an `Origin`.
        raw: The word of each parameter.
        told: The word that the drive told, of those whose line has that.
        in_ram: The codes whose line says that the drive had them in RAM alone.
        unread: Why the drive did not tell others, of those whose line has that.
        interrupted: Whether not all was asked for.
    """

    profile: Profile
    origin: dict[str, Any]
    raw: dict[str, int]
    told: dict[str, int]
    in_ram: frozenset[str]
    unread: dict[str, Unread]
    interrupted: bool


@dataclass
class _File:
    """What was found so far."""

    path: Path
    wrong: list[tuple[int, str]] = field(default_factory=list)
    top: dict[str, Any] = field(default_factory=dict)
    drive: dict[str, Any] = field(default_factory=dict)
    parameters: list[tuple[int, str, object]] = field(default_factory=list)
    section: str = ""
    tried: set[str] = field(default_factory=set)
    lacks: list[str] = field(default_factory=list)

    def lack(self, reason: str) -> None:
        """Notes what a backup has and this file has not."""
        self.lacks.append(reason)
        self.wrong.append((1, reason))

    def refuse(self, profile: Profile | None = None) -> NotAllowed:
        """The error that names each wrong line; *profile* is what they were checked against."""
        self.wrong.sort()
        is_backup = "family" in self.drive or self.top.get("format") == FORMAT
        most = _SHOWN if is_backup else _SHOWN_OF_NO_BACKUP
        # What cannot be printed would do something to the terminal that shows it.
        lines = [
            f"{self.path}:{line}: {printable(reason) if is_backup or reason in self.lacks else _ANYBODYS}"
            for line, reason in self.wrong[:most]
        ]
        if len(self.wrong) > most:
            lines.append(f"and {len(self.wrong) - most} more")
        read_with = self.drive.get("profile")
        if profile is not None and read_with not in (None, profile.name):
            lines.append(
                f'it was read with the profile "{read_with}", and checked against "{profile.name}"; to use it '
                "as it is, give the profile that it was read with"
            )
        count = "one line is" if len(self.wrong) == 1 else f"{len(self.wrong)} lines are"
        return BadArgument("\n".join([f"{self.path} cannot be used, {count} wrong; nothing was sent:", *lines]))


def parse(path: Path, data: bytes, profile: Profile | Callable[[str], Profile]) -> Parsed:
    """What *data*, the file at *path*, holds.

    Args:
        path: For messages.
        data: The file.
        profile: What its words mean, or what finds that by the family.

    Raises:
        NotAllowed: It is no backup, or lines are wrong; the message names all of them.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise BadArgument(f"{path} was saved as UTF-16, and a backup is UTF-8: save it as that; nothing was sent")
    file = _File(path)
    for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").split(b"\n"), 1):
        try:
            _line(file, number, line)
        except Wrong as error:
            file.wrong.append((number, str(error)))
    _check_head(file)
    if "family" not in file.drive:
        raise file.refuse()
    if callable(profile):
        profile = profile(file.drive["family"])
    raw, told, unread = _parameters(file, profile)
    if file.wrong:
        raise file.refuse(profile)
    origin = {
        "profile": profile.name,
        "title": profile.title,
        "unit": 0,
        "identification": None,
        "firmware": None,
        "profile_version": 0,
        "drivebus": "",
        "taken": datetime.fromtimestamp(0, timezone.utc),
        **file.drive,
    }
    in_ram = frozenset(code for _, code, fields in file.parameters if isinstance(fields, dict) and fields.get("ram"))
    interrupted = file.top.get("interrupted", not file.top.get("complete", True))
    return Parsed(profile, origin, raw, told, in_ram, unread, interrupted)


def _line(file: _File, number: int, data: bytes) -> None:
    try:
        text = data.decode("utf-8").strip()
    except UnicodeDecodeError:
        raise Wrong("it is not UTF-8 text") from None
    if not text or text.startswith("#"):
        return
    if len(text) > _LONGEST:
        raise Wrong(f"it has more than {_LONGEST} characters")
    found = _toml(text)
    if text.startswith("["):
        file.section = text.partition("#")[0].strip(" \t[]")
        if found != {file.section: {}} or file.section not in _SECTIONS:
            raise Wrong(
                f"there is no section {text.partition('#')[0].strip()}{checks.closest(file.section, _SECTIONS)}"
            )
        return
    [(key, value)] = found.items()
    if file.section in ("parameters", "readings"):
        # `P00.03 = …` is TOML for a 03 inside of a P00.
        if isinstance(value, dict) and len(value) == 1 and not value.keys() & FIELDS:
            [(index, value)] = value.items()
            key = f"{key}.{index}"
        file.parameters.append((number, key, value))
    elif file.section in ("", "drive"):
        _head(file, key, value)


def _toml(text: str) -> dict[str, Any]:
    """*text*, one line, as TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise Wrong("it is nested too deeply") from None
    except ValueError as error:
        # The line is the parser's whole document; which line of the file it is, is said elsewhere.
        reason = re.sub(r"at line 1, column", "at column", str(error)).replace("end of document", "end of line")
        raise Wrong(f"{text if len(text) <= 80 else f'{text[:77]}...'} is not TOML: {reason}") from None


def _head(file: _File, key: str, value: object) -> None:
    """One line before the parameters."""
    file.tried.add(key)
    known, place = (_DRIVE, file.drive) if file.section else (_TOP, file.top)
    where = f"[{file.section}]" if file.section else "the beginning"
    if key not in known:
        raise Wrong(f'{where} has no "{key}"{checks.closest(key, known)}')
    kind, wanted = known[key]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise Wrong(f"{key} must be {wanted}")
    if key in place:
        raise Wrong(f"{key} is given twice")
    if isinstance(value, datetime):
        try:
            value = (value if value.tzinfo else value.replace(tzinfo=timezone.utc)).astimezone(timezone.utc)
        except OverflowError:
            raise Wrong(f"{key} is not a moment in time") from None
    place[key] = value


def _check_head(file: _File) -> None:
    given = file.top.get("format")
    if given != FORMAT and (given is not None or "format" not in file.tried):
        what = "no line `format = 1`: it is not a backup" if given is None else f"format {given}, which is not known"
        file.lack(f"the file has {what}")
    if "family" not in file.drive and "family" not in file.tried:
        file.lack('the file does not name its drive: [drive] lacks a line such as family = "gd350"')


def _parameters(file: _File, profile: Profile) -> tuple[dict[str, int], dict[str, int], dict[str, Unread]]:
    """The word of each parameter, what the drive told where a line has that, or why not; what is wrong is noted."""
    raw: dict[str, int] = {}
    told: dict[str, int] = {}
    unread: dict[str, Unread] = {}
    lines: dict[str, int] = {}
    for number, code, value in file.parameters:
        try:
            if (why := lacking(profile, code, value)) is not None:
                unread[code] = why
                continue
            meant, was = word(profile, code, value)
            if code in lines:
                raise Wrong(f"{code} is given twice; the first is in line {lines[code]}")
            raw[code], lines[code] = meant, number
            if was is not None:
                told[code] = was
        except Wrong as error:
            file.wrong.append((number, str(error)))
    # A value that somebody put there holds.
    return raw, told, {code: why for code, why in unread.items() if code not in raw}
