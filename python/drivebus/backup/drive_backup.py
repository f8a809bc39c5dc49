"""Backup, restore and diff of one drive, written once to be awaited: `drivebus.Drive` carries them out at once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from drivebus import checks
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, WrongDrive
from drivebus.operations.drive_view import DriveView

# Every drive has these three, and few programs use them: what they need is loaded when one is called.
if TYPE_CHECKING:
    from pathlib import Path

    from drivebus.backup.compare import Diff
    from drivebus.backup.create import Progress
    from drivebus.backup.model import Backup
    from drivebus.backup.results import Restoration

__all__ = ["backup", "diff", "restore"]

BackupOrPath: TypeAlias = "Backup | str | os.PathLike[str]"
"""A backup, or the file of one."""


async def backup(
    unit: DriveView,
    path: str | os.PathLike[str] | None = None,
    resume: bool = True,
    progress: Progress | None = None,
    *,
    unverified: bool = False,
    force: bool = False,
) -> Backup:
    """Reads every parameter that can be read, in the fewest requests. Nothing is written to the drive.

    With *path* the backup goes into that file, in one step when it is complete. Until then it grows in
    `PATH.part`: after a break (a pulled cable, a killed process) the same call goes on where it was.

    It is `complete` if nothing lacks but what the drive has not, or keeps closed; `unread` has the reason of each. What
    was lost is asked for once more, after the rest. If it stays lost, or was refused for another reason, the backup is
    not complete and stays in `PATH.part`, and the same call asks for what it lacks.

    Args:
        path: Where to keep it; None keeps no file. `Backup.save` writes one later.
        resume: Go on with what a break left behind; False begins anew.
        progress: Is called with how many parameters are done, and how many there are.
        unverified: Read also what this family is only assumed to have.
        force: Replace a file that is another drive's, or no backup.

    Raises:
        NotAllowed: The file is another drive's, or cannot be written; or the family has no known parameters.
        Refused: The drive is locked by a password.
        NoAnswer, BadAnswer, PortError: Nothing is answered any more; what was read until then is kept.
    """
    from drivebus.backup import create

    resume, force = checks.flag("resume", resume), checks.flag("force", force)
    place = None if path is None else _path(path)
    return await create.take(unit.trusting(unverified), place, resume=resume, force=force, progress=progress)


async def restore(
    unit: DriveView,
    backup: BackupOrPath,
    dry_run: bool = False,
    *,
    groups: Sequence[str] | None = None,
    serial: bool = False,
    motor: bool = False,
    raw: Sequence[str] = (),
    force: bool = False,
    twice: bool = False,
    unverified: bool = False,
    progress: Progress | None = None,
) -> Restoration:
    """Writes the values of *backup* back to the drive: only those that differ, to EEPROM, and each is read back.

    Limits come before what they limit, and what decides where commands come from comes last. Left alone are the
    settings of the serial line, the data of the motor, what can only be read, the fault history, what does something
    when it is written, and what nothing is known of; the report says so of each. What the drive has and does not tell
    is not written either: it ends as `"unread"`. Cut off at any moment, the same call
    goes on where it was: the memory of no parameter is written twice, unless *twice*.

    Args:
        backup: A backup, or its file.
        dry_run: Write nothing, and report what would be.
        groups: Only these, such as `["P00", "P09"]`; single codes may be among them.
        serial: Also the settings of the serial line. The drive may then not be heard any more.
        motor: Also the data of the motor.
        raw: Also these codes, of which nothing is known but that the drive has them, as after a discovery. They go to
            EEPROM, or to RAM alone where the backup has them with `ram = true`.
        force: Also to a drive of another identification or firmware, or of another family: then what has the same
            code there gets the same value.
        twice: Where a drive stands beyond its own limits and only another value on the way leads to the wanted one,
            write that to its memory too, if it cannot be written to RAM alone.
        unverified: Also what this family is only assumed to have.
        progress: Is called with how many parameters are done, and how many are to be written.

    Raises:
        NotAllowed: The file is wrong, or not of this drive; or the motor turns, or another drive answers at this
            address since the port was opened again. Nothing was written.
        NoAnswer, BadAnswer, PortError: The line failed; the error's note names what was restored before. Say it
            again, and the rest follows.
        Unconfirmed: The drive has all values, in RAM, and is not known to have stored them.

    A refusal of one parameter ends nothing: it stands in the report.
    """
    from drivebus.backup.restoring import Restore

    dry_run, force = checks.flag("dry_run", dry_run), checks.flag("force", force)
    serial, motor, twice = checks.flag("serial", serial), checks.flag("motor", motor), checks.flag("twice", twice)
    kept = _kept(unit, backup, force)
    work = Restore(unit.trusting(unverified), kept, dry_run=dry_run, twice=twice, progress=progress)
    return await work.run(groups=groups, serial=serial, motor=motor, raw=raw, force=force)


async def diff(
    unit: DriveView,
    backup: BackupOrPath | None = None,
    *,
    everything: bool = False,
    force: bool = False,
    unverified: bool = False,
) -> Diff:
    """How the drive differs from *backup*. None: how it differs from the factory settings, as far as they are known.

    Only what *backup* has is read and compared. What tells nothing about how the drive is set (the fault history,
    what can only be read) is left out, unless *everything*. The result is false where nothing differs and nothing was
    lost, or refused for a reason that says nothing: `Diff.complete`.

    Args:
        backup: A backup, its file, or None.
        everything: Compare also what changes by itself.
        force: Compare also with a backup of another identification or firmware, or of another family: then what is
            called the same there.
        unverified: Also what this family is only assumed to have.

    Raises:
        NotAllowed: The file is wrong, or of another family; nothing was sent.
        NoAnswer, BadAnswer, PortError, Refused: See each.
    """
    from dataclasses import replace

    from drivebus.backup import create
    from drivebus.backup.compare import Side, compare, factory
    from drivebus.backup.reading import Reader
    from drivebus.backup.rules import Rules

    everything, force = checks.flag("everything", everything), checks.flag("force", force)
    unit = unit.trusting(unverified)
    if backup is None:
        left = factory(unit.profile)
    else:
        kept = _kept(unit, backup, force)
        others = [] if force else kept.origin.other(await create.origin_of(unit))
        if others:
            raise WrongDrive(
                Text(
                    f"the backup is not of the drive at unit {unit.address}: {'; '.join(others)}. To compare them all "
                    "the same, say ",
                    argument("force", True),
                ),
                unit=unit.address,
            )
        left = Side(os.fspath(backup) if isinstance(backup, (str, os.PathLike)) else "backup", kept.raw, kept.unread)
    rules = Rules(unit.profile)
    unasked: dict[str, str] = {
        code: reason for code in left.raw if (reason := rules.unread(code, unit.unverified)) is not None
    }
    left = replace(left, raw={code: word for code, word in left.raw.items() if code not in unasked})
    codes = [code for code in left.raw if everything or rules.uncompared(code) is None]
    words = await Reader(unit, sorted(codes, key=rules.place)).rest()
    right = Side(f"unit {unit.address}", words.raw, words.unread)
    found = compare(unit.profile, left, right, everything=everything)
    found.uncompared.update(unasked)
    # What was not read, because there is nothing to hold it against.
    unknown = [code for code in rules.codes() if code not in left.raw and code not in found.uncompared]
    found.uncompared.update({code: rules.uncompared(code) or left.lacks(code) for code in unknown})
    return found


def _kept(unit: DriveView, backup: BackupOrPath, force: bool = False) -> Backup:
    """*backup* in the words of this drive's family."""
    from drivebus.backup.model import Backup

    kept = backup if isinstance(backup, Backup) else Backup.load(_path(backup), unit.profile)
    if kept.interrupted:
        raise BadArgument(
            f"the backup of {kept.origin.taken:%Y-%m-%d %H:%M} was never completed; nothing was sent. Take it "
            "again with the same path to have the rest",
            unit=unit.address,
        )
    if kept.origin.family == unit.profile.family:
        return kept
    if not force:
        raise WrongDrive(
            Text(
                f"the backup is of a {kept.origin.family}, and unit {unit.address} is a {unit.profile.family}: a code "
                "may mean another thing there; nothing was sent. If that is right, say ",
                argument("force", True),
            ),
            unit=unit.address,
        )
    return kept.translated(unit.profile)


def _path(path: object) -> Path:
    """*path*, if it can be that of a file."""
    from pathlib import Path

    if not isinstance(path, (str, os.PathLike)) or not isinstance(os.fspath(path), str) or not Path(path).name:
        raise BadArgument(f"{checks.shown(path)} is neither a backup nor the path of a file")
    return Path(checks.path("file", path))
