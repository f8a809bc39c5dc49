"""What a discovery has found so far, in a file beside the folder that it will fill: a break costs one group."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from drivebus.advice import Text, argument
from drivebus.backup import atomic_file
from drivebus.backup.model import Origin
from drivebus.backup.unread import WHY, Unread
from drivebus.errors import BadArgument, WrongDrive

__all__ = ["Group", "ProgressFile"]


@dataclass(slots=True)
class Group:
    """What is known of one group.

    Attributes:
        words: The word of each number that is there.
        refused: Numbers that are there and closed, and what the drive said.
        unsettled: Numbers of which nothing is known, and why.
        doubtful: Whether it answers to numbers that cannot be there.
    """

    words: dict[int, int] = field(default_factory=dict)
    refused: dict[int, str] = field(default_factory=dict)
    unsettled: dict[int, Unread] = field(default_factory=dict)
    doubtful: bool = False


@dataclass(slots=True)
class ProgressFile:
    """A discovery that goes on.

    Attributes:
        path: Where it is kept; None keeps nothing.
        whose: What tells one drive from another.
        taken: When it began.
        groups: What was found, by group.
        requests: How many reads it took.
    """

    path: Path | None
    whose: dict[str, Any]
    taken: datetime
    groups: dict[int, Group] = field(default_factory=dict)
    requests: int = 0

    @classmethod
    def begin(cls, path: Path | None, origin: Origin, *, resume: bool) -> ProgressFile:
        """What an earlier call left in *path*, if it was of the same drive; else a new one.

        Raises:
            NotAllowed: It was of another drive, or it cannot be read or written.
        """
        whose = {
            "family": origin.family,
            "profile": origin.profile,
            "profile_version": origin.profile_version,
            "unit": origin.unit,
            "identification": origin.identification,
        }
        kept = cls(path, whose, origin.taken)
        if path is not None and resume and atomic_file.is_there(path):
            kept._take(cls.of(path))
        # Whether it can be written there at all is known before the drive is asked for minutes.
        kept.keep()
        return kept

    @classmethod
    def of(cls, path: Path) -> ProgressFile:
        """What an earlier call left in *path*, of whatever drive.

        Raises:
            NotAllowed: It cannot be read.
        """
        data = atomic_file.read(path)
        try:
            whole = json.loads(data)
            whose = dict(whole["discovery"])
            taken, requests = datetime.fromisoformat(whole["taken"]), int(whole["requests"])
            groups = {
                int(group): Group(
                    _numbered(one["words"], int),
                    _numbered(one["refused"], str),
                    _numbered(one.get("unsettled", {}), _why),
                    bool(one["doubtful"]),
                )
                for group, one in whole["groups"].items()
            }
        except (ValueError, TypeError, KeyError, AttributeError):
            raise BadArgument(
                Text(
                    f"{path} is not what an interrupted discovery left; nothing was asked. Give another name, or ",
                    argument("resume", False),
                    " replaces it",
                )
            ) from None
        return cls(path, whose, taken, groups, requests)

    def keep(self) -> None:
        """Writes the file anew, whole."""
        if self.path is None:
            return
        groups = {
            str(group): {
                "words": {str(index): word for index, word in one.words.items()},
                "refused": {str(index): told for index, told in one.refused.items()},
                "unsettled": {str(index): [why.why, str(why)] for index, why in one.unsettled.items()},
                "doubtful": one.doubtful,
            }
            for group, one in self.groups.items()
        }
        whole = {"discovery": self.whose, "taken": self.taken.isoformat(), "requests": self.requests, "groups": groups}
        atomic_file.write(self.path, json.dumps(whole, indent=1) + "\n")

    def done(self) -> None:
        """Takes the file away."""
        if self.path is not None:
            atomic_file.remove(self.path)

    def _take(self, left: ProgressFile) -> None:
        if left.whose != self.whose:
            other = ", ".join(
                f"{name} {left.whose.get(name)}" for name in self.whose if left.whose.get(name) != self.whose[name]
            )
            raise WrongDrive(
                Text(
                    f"{self.path} was begun with another drive ({other}); nothing was asked. Give another name, or ",
                    argument("resume", False),
                    " starts again",
                )
            )
        self.taken, self.requests, self.groups = left.taken, left.requests, left.groups


def _why(given: list[str]) -> Unread:
    why, reason = given
    if why not in WHY:
        raise ValueError(why)
    return Unread(str(reason), why)


def _numbered(given: dict[str, Any], kind: Callable[[Any], Any]) -> dict[int, Any]:
    return {int(index): kind(value) for index, value in given.items()}
