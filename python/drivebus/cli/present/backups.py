"""What was read into a backup, what came of giving it back, and what differs from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drivebus
from drivebus.backup.unread import Unread, counts, in_words
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import Output

__all__ = ["BackupTaken", "Differences", "RestoreReport"]


@dataclass(frozen=True)
class BackupTaken:
    """What was *kept* of the drive that people call *called*, in *place*."""

    kept: drivebus.Backup
    place: Path
    called: str

    def records(self) -> Iterator[dict[str, Any]]:
        """Where it comes from, how much it has, and what it has not, and why."""
        kept = self.kept
        origin = {name: value for name, value in vars(kept.origin).items() if name != "taken"}
        yield {
            "file": str(self.place),
            **origin,
            "taken": f"{kept.origin.taken:%Y-%m-%dT%H:%M:%SZ}",
            "parameters": len(kept),
            "complete": kept.complete,
            "counts": counts(kept.unread.values()),
            "unread": kept.unread,
        }

    def lay_out(self, out: Output) -> None:
        """The same."""
        origin, profile, unread = self.kept.origin, self.kept.profile, self.kept.unread
        known = sum(profile.describe(name).kind == "parameter" for name in profile.names())
        out.say(
            f"{self.place}: {len(self.kept)} of the {known} parameters that the profile {profile.name} knows, of "
            f"{self.called}, {origin.title}, begun {origin.taken:%Y-%m-%d %H:%M} UTC."
        )
        if unread:
            out.say(f"Not read: {in_words(unread.values())}.")
            out.rows(["code", "reason", "why"], [[code, why, why.why] for code, why in unread.items()])


@dataclass(frozen=True)
class RestoreReport:
    """What came of each parameter.

    Attributes:
        report: That.
        profile: Says how its values are shown.
        end: What it comes to, in a sentence.
    """

    report: drivebus.Restoration
    profile: drivebus.Profile
    end: str

    def records(self) -> Iterator[dict[str, Any]]:
        """Every parameter."""
        yield from map(vars, self.report)

    def lay_out(self, out: Output) -> None:
        """Those of which there is something to say, and how many others there are."""
        rows = [
            [
                item.code,
                *_texts(self.profile, item.code, item.before, item.wanted),
                item.unit,
                item.result,
                item.label,
                in_commands(item.reason),
            ]
            for item in self.report
            if _is_told(item)
        ]
        if rows:
            out.rows(["code", "drive", "backup", "unit", "result", "label", "reason"], rows)
        same, skipped = (len(self.report.having(result)) for result in ("same", "skipped"))
        out.say(
            f"{self.end} The same: {same}. Left alone: {skipped} (fault history, read-only, and what has to be asked "
            "for: serial settings, motor data).".strip()
        )


def _is_told(item: drivebus.Restored) -> bool:
    """Whether there is something to say of *item*: what failed always, what was left alone where it differs."""
    if item.failed:
        return True
    differs = item.result != "same" and item.before != item.wanted
    return differs and (item.result != "skipped" or item.before is not None)


@dataclass(frozen=True)
class Differences:
    """What differs between two sides.

    Attributes:
        diff: That.
        profile: Says how its values are shown.
        sides: What both are called.
        everything: Whether all is listed that was not compared, and not only what could not be.
    """

    diff: drivebus.Diff
    profile: drivebus.Profile
    sides: tuple[str, str]
    everything: bool

    def records(self) -> Iterator[Mapping[str, Any]]:
        """Each parameter that differs; then each that could not be compared."""
        yield from map(vars, self.diff)
        for code, why in self.diff.unsettled().items():
            yield {"code": code, "not_compared": why.why, "reason": why}

    def lay_out(self, out: Output) -> None:
        """How many differ, which, and what was not compared."""
        found, uncompared = self.diff, self.diff.uncompared
        told = in_words(why for why in uncompared.values() if isinstance(why, Unread))
        kinds = f" ({told})" if told else ""
        rest = f" {len(uncompared)} were not compared{kinds}." if uncompared else ""
        hint = " --all lists them." if rest and not self.everything else ""
        out.say(f"{' -> '.join(self.sides)}: {len(found)} of {found.compared} parameters differ.{rest}{hint}")
        rows = [
            [
                each.code,
                *_texts(self.profile, each.code, each.left, each.right),
                each.unit,
                each.label,
                in_commands(each.reason),
            ]
            for each in found
        ]
        if rows:
            out.rows(["code", "was", "is", "unit", "label", "reason"], rows)
        listed = uncompared if self.everything else found.unsettled()
        if listed:
            out.say("Not compared:")
            out.rows(["code", "reason"], listed.items())


def _texts(profile: drivebus.Profile, code: str, *values: Any) -> list[str]:
    """*values* of *code* with as many digits as the drive counts; empty for None."""
    known = profile.describe(code)
    return ["" if value is None else known.text(value) for value in values]
