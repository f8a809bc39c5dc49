"""Which parameters a drive turned out to have."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drivebus
from drivebus.cli.present.output import Output, counted

__all__ = ["Discovered"]


@dataclass(frozen=True)
class Discovered:
    """What was *found* of the drive that people call *called*; *folder* has what its profile did not."""

    found: drivebus.Discovery
    folder: Path
    called: str

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it in one object."""
        found = self.found
        yield {
            "folder": str(self.folder),
            "profile": found.profile.name,
            "unit": found.unit,
            "taken": f"{found.taken:%Y-%m-%dT%H:%M:%SZ}",
            "parameters": len(found.words),
            "unlisted": found.unlisted,
            "missing": found.missing,
            "refused": dict(found.refused),
            "complete": found.complete,
            "unsettled": {code: {"why": why.why, "reason": why} for code, why in found.unsettled.items()},
            "doubtful": list(found.doubtful),
            "requests": found.requests,
        }

    def lay_out(self, out: Output) -> None:
        """The same, and how to use it."""
        found, new = self.found, self.found.unlisted
        out.say(
            f"{self.folder}: {self.called} has {counted(len(found.words), 'parameter')}. {len(found.words) - len(new)} "
            f"of them have a row in the profile {found.profile.name}; {len(new)} more are in {self.folder}."
        )
        if found.missing:
            out.say(f"The profile lists, and the drive has not: {', '.join(found.missing)}.")
        if found.refused:
            out.say("There, but not told:")
            out.rows(["code", "reason"], found.refused.items())
        if found.unsettled:
            out.say("Not settled:")
            out.rows(["code", "why", "reason"], [[code, why.why, why] for code, why in found.unsettled.items()])
        out.say(f"Use it: drivebus --profile {_as_given(self.folder)} read {next(iter(new), 'P00.00')}")


def _as_given(folder: Path) -> str:
    """*folder* so that it is not taken for the name of a shipped profile."""
    text = str(folder)
    return text if folder.is_absolute() or len(folder.parts) > 1 else f"./{text}"
