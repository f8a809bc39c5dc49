"""Discovery of one drive, written once to be awaited: `drivebus.Drive` carries it out at once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from drivebus import checks
from drivebus.operations.drive_view import DriveView

# Every drive has this, and few programs use it: what it needs is loaded when it is called.
if TYPE_CHECKING:
    from drivebus.discovery.found import Discovery
    from drivebus.discovery.search import Progress

__all__ = ["discover"]


async def discover(
    unit: DriveView,
    folder: str | os.PathLike[str] | None = None,
    *,
    groups: Sequence[str] | None = None,
    resume: bool = True,
    progress: Progress | None = None,
    base: str | None = None,
) -> Discovery:
    """Asks the drive, by reads alone, which parameters it has. Nothing is written to it.

    A parameter is there if a read that covered it was answered, and not there if the drive said of it by itself that
    there is no such address. Closed ones are there, too. What was lost, or refused for another reason, is `unsettled`.

    With *folder*, a profile is made there that lies over that of the family, with a row for each parameter that it
    lacks. Until then what was found is in `FOLDER.part`: after a break, the same call goes on where it was. It stays
    there while something is unsettled: the same call asks for that again, if nobody edited the folder.

    Args:
        folder: Where to put the profile; None makes none. `Discovery.save` makes one later.
        groups: Only these, such as `["P00", "P09"]`; None: all but closed ones, which takes some thousand reads.
        resume: Go on with what a break left behind; False begins anew.
        progress: Is called with how many groups are done, and how many there are.
        base: What the profile lies over, as it has it in `[overlay]`; None: the drive's, which must be a shipped one.

    Raises:
        NotAllowed: The codes of the family do not tell addresses; or there is something in the folder; or the drive is
            another one, or answers to numbers that no parameter has.
        Refused: The drive is locked by a password.
        NoAnswer, BadAnswer, PortError: Nothing is answered any more; what was found until then is kept.
    """
    from pathlib import Path

    from drivebus.discovery.search import search

    place = None if folder is None else Path(checks.path("folder", folder))
    resume = checks.flag("resume", resume)
    return await search(unit, place, groups=groups, resume=resume, progress=progress, base=base)
