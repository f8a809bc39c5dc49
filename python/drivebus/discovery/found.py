"""What a discovery found, and the profile that is made of it."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from drivebus import checks
from drivebus.backup import atomic_file
from drivebus.backup.unread import Unread
from drivebus.discovery import sister_family
from drivebus.errors import BadArgument, NotAllowed
from drivebus.profile import Profile, profiles
from drivebus.values import Description

__all__ = ["Discovery"]

_COLUMNS = (
    *("code", "name", "label", "unit", "scale", "signed", "low", "low_from", "high", "high_from", "default"),
    *("access", "choices", "verified", "note", "source"),
)

_ONLY_READ = "Where this family takes its commands is not known; it might be here, so this is only read."
_NAME = re.compile("[a-z0-9][a-z0-9_-]*")

_RULES = """\
# What one drive answered when it was asked for every parameter: parameters.csv has those that {title} has no row for.
# Fill in what your manual says of a row: name, label, unit, scale, range. A row with neither a name nor a scale is a
# plain number. It is written only with --unverified, and given back by `restore` only with --raw.
# Check it with: drivebus profiles check FOLDER

name = "{name}"
title = {said}
version = 1
source = {source}

[overlay]
profile = {base}
"""


@dataclass(frozen=True, slots=True)
class Discovery:
    """What one drive answered when it was asked for every parameter of its family's form.

    Attributes:
        unit: Its address, 1..247.
        profile: What it was asked by.
        taken: When the search began.
        words: The word of each code that it has, as it is on the wire.
        refused: Codes that it has and keeps closed, with what it said.
        unsettled: Codes of which nothing is known: no answer came, or it refused for a reason that says nothing of the
            address. Each with that reason, whose `why` is `"lost"` or `"refused"`.
        doubtful: Groups that answer alike to whatever is asked, so that an answer tells nothing, such as `"P05"`.
        groups: What was searched.
        requests: How many reads it took.
    """

    unit: int
    profile: Profile
    taken: datetime
    words: Mapping[str, int]
    refused: Mapping[str, str]
    unsettled: Mapping[str, Unread]
    doubtful: tuple[str, ...]
    groups: tuple[str, ...]
    requests: int

    @property
    def unlisted(self) -> dict[str, int]:
        """Those of *words* that the profile has no row for."""
        listed = {row.code for row in self._rows()}
        return {code: word for code, word in self.words.items() if code not in listed}

    @property
    def missing(self) -> list[str]:
        """Parameters that the profile lists in the groups that were searched, and this drive has not."""
        searched = set(self.groups) - set(self.doubtful)
        return sorted(
            row.code
            for row in self._rows()
            if row.code is not None
            and row.address is not None
            and f"P{row.address >> 8:02}" in searched
            and row.code not in {*self.words, *self.refused, *self.unsettled}
        )

    @property
    def complete(self) -> bool:
        """Whether of each number that was asked for it is known whether the drive has it."""
        return not self.unsettled

    def save(self, folder: str | os.PathLike[str], base: str | None = None) -> Path:
        """Writes a profile that lies over that of the drive, as a folder with `profile.toml` and `parameters.csv`.

        Args:
            folder: A new one, or an empty one; its name becomes that of the profile.
            base: What it lies over, as `[overlay]` names it; None: the drive's profile, which must be a shipped one.

        Raises:
            NotAllowed: See `check`; or it cannot be written there.
        """
        place = Path(checks.path("folder", folder))
        self.check(self.profile, place, base)
        return self.write(place, base)

    def write(self, place: Path, base: str | None) -> Path:
        """The same, whatever is there.

        Raises:
            NotAllowed: It cannot be written there.
        """
        made = self.files(place.name, base)
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise NotAllowed(f"{place} cannot be made: {error.strerror or error}") from None
        for name, text in made.items():
            atomic_file.write(place / name, text)
        return place

    def files(self, name: str, base: str | None) -> dict[str, str]:
        """The text of each file of a profile called *name*, by its name."""
        return {"parameters.csv": self.table(), "profile.toml": self.rules(name, base)}

    @staticmethod
    def check(profile: Profile, folder: Path, base: str | None = None) -> None:
        """Raises `NotAllowed` if a profile over *profile* cannot be put into *folder*.

        That is where something is there already, since people edit what was found; where its name cannot be that of a
        profile; or where *profile* is one of somebody's own, and *base* does not say where it is.
        """
        _base(profile, base)
        if not _NAME.fullmatch(folder.name):
            raise BadArgument(
                f"{folder.name or folder} cannot be the name of a profile: lower-case letters, digits, - and _; "
                "nothing was asked"
            )
        if folder.name in profiles():
            raise BadArgument(f"{folder.name} is the name of a shipped profile; give another one. Nothing was asked")
        if atomic_file.is_there(folder) and (not folder.is_dir() or any(folder.iterdir())):
            raise BadArgument(
                f"{folder} is there already, and what is in it would be lost; give another name. Nothing was asked"
            )

    def _rows(self) -> Iterator[Description]:
        """The parameters that the profile lists."""
        rows = (self.profile.describe(name) for name in self.profile.names())
        return (row for row in rows if row.kind == "parameter")

    def rules(self, name: str, base: str | None = None) -> str:
        """The text of profile.toml, for a profile called *name*."""
        return _RULES.format(
            name=name,
            title=self.profile.title,
            said=_quoted(f"{self.profile.title}, with the parameters that unit {self.unit} has"),
            source=_quoted(self._source()),
            base=_quoted(_base(self.profile, base)),
        )

    def table(self) -> str:
        """The text of parameters.csv: a row for each code that the profile has not, in the order of codes."""
        out = io.StringIO()
        rows = csv.DictWriter(out, _COLUMNS, restval="", lineterminator="\n")
        rows.writeheader()
        is_no_command = self.profile.command_address is not None
        told = "Found by asking the drive; it was {word} ({word:04X}H)."
        for code, word in sorted(self.unlisted.items()):
            guess = sister_family.guess(self.profile, code, word)
            rows.writerow(
                {
                    "code": code,
                    "label": "Not known; the drive has it",
                    "signed": "no",
                    "access": "unknown" if is_no_command else "ro",
                    "verified": "no",
                    "note": " ".join(
                        filter(None, (told.format(word=word), guess, "" if is_no_command else _ONLY_READ))
                    ),
                    "source": self._source(),
                }
            )
        return out.getvalue()

    def _source(self) -> str:
        return f"the drive itself, asked on {self.taken:%Y-%m-%d}"


def _base(profile: Profile, base: str | None) -> str:
    """What a profile lies over that is made of *profile*, as `[overlay]` names it."""
    if base is not None:
        return checks.path("base", base)
    if profile.name not in profiles():
        raise BadArgument(
            f"{profile.name} is a profile of your own: say where it is, seen from the new folder, such as "
            f'base="../{profile.name}"; nothing was asked'
        )
    return profile.name


def _quoted(text: str) -> str:
    """*text* as a TOML string: JSON has the same escapes."""
    return json.dumps(text, ensure_ascii=False)
