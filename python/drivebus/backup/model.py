"""What was read of one drive, whose it is, and the words of its parameters.

Plain data beside the profile that says what they mean; how it looks in a file is in `text` and `parse`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from drivebus import checks
from drivebus.advice import Text, argument
from drivebus.backup import atomic_file, parse, text
from drivebus.backup.compare import Diff, Side, compare, factory
from drivebus.backup.rules import Rules
from drivebus.backup.unread import Unread, is_open
from drivebus.errors import BadArgument, NotAllowed, WrongDrive
from drivebus.profile import Profile
from drivebus.values import Value

__all__ = ["Backup", "Origin"]


@dataclass(frozen=True)
class Origin:
    """Whose parameters these are.

    Attributes:
        family: The family of the drive, such as `"gd350"`.
        profile: The profile that it was read with: the family's, or somebody's additions to it.
        title: The family as its maker calls it.
        unit: Its address, 1..247.
        identification: What it said it is; None if it would not tell, or its family has no such code.
        firmware: Its firmware, where its family says where to read that.
        profile_version: The version of the profile it was read with.
        drivebus: The version of this package.
        taken: When the first of them was read, in UTC.
    """

    family: str
    profile: str
    title: str
    unit: int
    identification: int | None
    firmware: str | None
    profile_version: int
    drivebus: str
    taken: datetime

    def other(self, than: Origin, *, unit: bool = False) -> list[str]:
        """In what this is another drive than *than*, in words; with *unit* its address counts too."""
        found = []
        if self.family != than.family:
            found.append(f"its family is {self.family}, not {than.family}")
        if self.identification != than.identification:
            found.append(f"its identification is {_code(self.identification)}, not {_code(than.identification)}")
        if self.firmware != than.firmware:
            found.append(f"its firmware is {self.firmware or 'unknown'}, not {than.firmware or 'unknown'}")
        if unit and self.unit != than.unit:
            found.append(f"its unit is {self.unit}, not {than.unit}")
        return found


def _code(identification: int | None) -> str:
    return "unknown" if identification is None else f"{identification:04X}H"


class Backup(Mapping[str, Value]):
    """The parameters of one drive as they were: a mapping of codes to values in engineering units, in code order.

    Attributes:
        origin: Whose they are.
        raw: The word of each as the drive told it; a parameter of two words is one number.
        unread: Why each of the others is not among them: texts, each with its kind in `why` (`"not asked"`, `"not
            there"`, `"closed"`, `"refused"`, `"lost"`).
        interrupted: Whether it was broken off before all was asked for.
        complete: Whether all was read but what the drive has not, or keeps closed: nothing was interrupted, lost, or
            refused for another reason.
        profile: What its words mean.
        told: The words that the drive told: those of `raw`, unless a file was changed by hand.
        in_ram: What the program that took it had written to RAM alone before: lost when the drive is switched off.
        translated_from: The family whose codes they were, where the same values stand under the codes of another.
    """

    __slots__ = ("in_ram", "interrupted", "origin", "profile", "raw", "told", "translated_from", "unread")

    def __init__(
        self,
        origin: Origin,
        raw: Mapping[str, int],
        unread: Mapping[str, Unread],
        profile: Profile,
        *,
        interrupted: bool = False,
        told: Mapping[str, int] | None = None,
        in_ram: Iterable[str] = (),
        translated_from: str | None = None,
    ) -> None:
        place = Rules(profile).place
        self.origin = origin
        self.raw: Mapping[str, int] = dict(sorted(raw.items(), key=lambda item: place(item[0])))
        self.unread: Mapping[str, Unread] = dict(sorted(unread.items(), key=lambda item: place(item[0])))
        self.profile = profile
        self.interrupted = interrupted
        self.told: Mapping[str, int] = self.raw if told is None else dict(told)
        self.in_ram = frozenset(in_ram)
        self.translated_from = translated_from

    @classmethod
    def load(cls, path: str | os.PathLike[str], profile: Profile | None = None) -> Backup:
        """A backup from its file. Nothing in it is executed, and each line is checked against the profile.

        Args:
            path: The file, of 1 MiB at most.
            profile: What its words mean, if the file is of that family; the shipped profile of its family otherwise.

        Raises:
            NotAllowed: The file is no backup, or lines in it are wrong: the message names every one of them, with what
                is wrong and the closest name.
        """
        path = Path(checks.path("file", path))
        found = parse.parse(path, atomic_file.read(path), _shipped if profile is None else _meant_by(profile))
        return cls(
            Origin(**found.origin),
            found.raw,
            found.unread,
            found.profile,
            interrupted=found.interrupted,
            told=found.told,
            in_ram=found.in_ram,
        )

    @property
    def complete(self) -> bool:
        """See the class."""
        return not self.interrupted and not any(map(is_open, self.unread.values()))

    def diff(self, other: Backup | None = None, *, everything: bool = False) -> Diff:
        """How *other* differs from this backup. None: how this differs from the factory settings, as far as known.

        What tells nothing about how a drive is set (the fault history, what can only be read) is left out, unless
        *everything*.

        Raises:
            NotAllowed: They are of two families: a code may mean another thing.
        """
        ours = Side(f"unit {self.origin.unit} of {self.origin.taken:%Y-%m-%d %H:%M:%S}", self.raw, self.unread)
        if other is None:
            return compare(self.profile, factory(self.profile), ours, everything=everything)
        if other.origin.family != self.origin.family:
            raise WrongDrive(
                f"a backup of a {self.origin.family} and one of a {other.origin.family} cannot be compared: a code may "
                "mean another thing"
            )
        theirs = Side(f"unit {other.origin.unit} of {other.origin.taken:%Y-%m-%d %H:%M:%S}", other.raw, other.unread)
        return compare(self.profile, ours, theirs, everything=everything)

    def translated(self, profile: Profile) -> Backup:
        """The same values in the words of another family, where a code has the same name; the others in `unread`."""
        raw: dict[str, int] = {}
        unread = {code: why for code, why in self.unread.items() if why.open}
        for code, value in self.items():
            here = self.profile.describe(code)
            try:
                there = profile.describe(code)
                if not there.listed:
                    raise BadArgument(f"{profile.name} does not list {code}")
                if (there.code, there.name, there.unit) != (here.code, here.name, here.unit):
                    raise BadArgument(f"{code} is another thing in a {profile.title}: {there.label}")
                raw[code] = profile.encode(code, value)
            except NotAllowed as error:
                unread[code] = Unread(str(error), "not there")
        return Backup(
            self.origin, raw, unread, profile, interrupted=self.interrupted, told={}, translated_from=self.origin.family
        )

    def unproved(self, code: str) -> str | None:
        """Why the word of *code* is not verified for the family; None if it is.

        What a drive told is its own word, whatever it means.
        """
        known = self.profile.describe(code)
        if known.evidence == "verified" or self.told.get(code) == self.raw[code]:
            return None
        return known.reason or "no document of this family says so"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the file, whole or not at all: an older file stays until the new one is complete."""
        atomic_file.write(Path(checks.path("file", path)), self.text())

    def text(self) -> str:
        """The text of the file: sorted, one parameter a line."""
        return text.text(self)

    def __getitem__(self, code: str) -> Value:
        return text.worded(self.profile, code, self.raw[code])

    def __iter__(self) -> Iterator[str]:
        return iter(self.raw)

    def __len__(self) -> int:
        return len(self.raw)

    def __repr__(self) -> str:
        of = self.origin
        rest = "" if self.complete else ", interrupted" if self.interrupted else ", not complete"
        return (
            f"<Backup of unit {of.unit}, {of.family}, {of.taken:%Y-%m-%d %H:%M:%S}: {len(self.raw)} parameters{rest}>"
        )


def _meant_by(profile: Profile) -> Callable[[str], Profile]:
    """Finds what the words of a family mean: *profile* its own, a shipped profile all others."""
    return lambda family: profile if family == profile.family else _shipped(family)


def _shipped(family: str) -> Profile:
    try:
        return Profile.builtin(family)
    except NotAllowed as error:
        raise BadArgument(Text(error.text, "; for a profile of your own give ", argument("profile"))) from None
