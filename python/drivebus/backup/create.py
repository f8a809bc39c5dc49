"""Takes a backup of a drive, into a file that grows as it goes and outlives whatever ends the program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

from drivebus._native import __version__
from drivebus.advice import Text, argument
from drivebus.backup import atomic_file
from drivebus.backup.model import Backup, Origin
from drivebus.backup.reading import Reader
from drivebus.backup.rules import Rules
from drivebus.backup.unread import Unread, refused
from drivebus.errors import BadArgument, NotAllowed, Refused, WrongDrive
from drivebus.operations import kept, raw_words, registers
from drivebus.operations.drive_view import DriveView

__all__ = ["Progress", "origin_of", "take"]

Progress = Callable[[int, int], object]
"""Is told how many are done, and how many there are."""

_REQUESTS_A_STEP = 8
"""Requests after which the file is written anew: what a power cut costs, against the wear of the disk."""

_LINES = 5
"""Lines that are told of a file which is no backup: it may be anything."""

_FIRMWARE = "firmware_version"
"""The parameter or register of this name tells the firmware, where a profile has one."""


async def origin_of(unit: DriveView) -> Origin:
    """Whose parameters are read: what the drive says of itself now."""
    profile = unit.profile
    identification = firmware = None
    register = profile.role("identification")
    if register is not None and unit.evidence.unreadable(register) is None:
        identification = await _told(unit, register)
    if _FIRMWARE in profile.names() and unit.evidence.unreadable(_FIRMWARE) is None:
        word = await _told(unit, _FIRMWARE)
        firmware = None if word is None else str(registers.value(unit, _FIRMWARE, word))
    now = datetime.now(timezone.utc).replace(microsecond=0)
    return Origin(
        profile.family,
        profile.name,
        profile.title,
        unit.address,
        identification,
        firmware,
        profile.version,
        __version__,
        now,
    )


async def _told(unit: DriveView, name: str) -> int | None:
    """The word of the register *name*; None if the drive has none, or does not tell it.

    Raises:
        Refused: Twice it was busy, or got a damaged request: that does not say who it is.
    """
    address = unit.profile.address(name)
    for last in (False, True):
        try:
            [word] = await raw_words.read_words(unit, address)
        except Refused as error:
            if refused(unit.profile, error).why != "lost":
                return None
            if last:
                raise
        else:
            return word
    raise AssertionError  # the second read returned or raised


async def take(unit: DriveView, path: Path | None, *, resume: bool, force: bool, progress: Progress | None) -> Backup:
    """Reads every parameter that can be read. What was read before a break is not read again.

    What was lost or refused for another reason than that it is not there, or closed, leaves the file's `.part`.

    Raises:
        NotAllowed: Where the file would be, another drive's is; nothing but the identity was asked.
        Refused: The drive is locked by a password.
        NoAnswer, BadAnswer, PortError: The line failed; what was read is in the file's `.part`.
    """
    rules = Rules(unit.profile)
    codes = rules.codes()
    if not codes:
        raise BadArgument(f"{unit.profile.name} has no parameters that are known: there is nothing to keep")
    unread: dict[str, Unread] = {
        code: reason for code in codes if (reason := rules.unread(code, unit.unverified)) is not None
    }
    codes = [code for code in codes if code not in unread]
    origin = await origin_of(unit)
    raw: dict[str, int] = {}
    were_in_ram: frozenset[str] = frozenset()
    if path is not None:
        _check_old(path, origin, unit, force)
        before = _begun(atomic_file.part_of(path), origin, unit) if resume else None
        if before is not None:
            origin = replace(origin, taken=before.origin.taken)
            raw = {code: word for code, word in before.raw.items() if code in codes}
            were_in_ram = before.in_ram
            for code in raw.keys() & before.told.keys():
                # What was changed by hand meanwhile is read again.
                if before.told[code] != raw[code]:
                    del raw[code]
    reader = Reader(unit, [code for code in codes if code not in raw])
    total, done, steps = len(codes), len(raw), 0

    def taken(interrupted: bool) -> Backup:
        in_ram = [code for code in raw if code in were_in_ram or kept.is_in_ram(unit, code)]
        return Backup(origin, raw, unread, unit.profile, interrupted=interrupted, in_ram=in_ram)

    def keep() -> None:
        if path is not None:
            taken(interrupted=True).save(atomic_file.part_of(path))

    # Whether it can be written there at all is known before the drive is asked for an hour.
    keep()
    try:
        if progress is not None:
            progress(done, total)
        while (came := await reader.next()) is not None:
            raw.update(came.raw)
            unread.update(came.unread)
            steps += 1
            if steps % _REQUESTS_A_STEP == 0:
                keep()
            if progress is not None and (came.raw or came.unread):
                done += len(came.raw) + len(came.unread)
                progress(done, total)
    except BaseException as error:
        keep()
        if path is not None and hasattr(error, "add_note"):
            error.add_note(f"{len(raw)} of {total} parameters are in {atomic_file.part_of(path)}; the rest follows")
        raise
    backup = taken(interrupted=False)
    if path is not None and not backup.complete:
        backup.save(atomic_file.part_of(path))
    elif path is not None:
        backup.save(path)
        atomic_file.remove(atomic_file.part_of(path))
    return backup


def _check_old(path: Path, origin: Origin, unit: DriveView, force: bool) -> None:
    """Refuses to put a backup in the place of another drive's, or of what is none."""
    if atomic_file.is_there(path) and not path.is_file():
        raise BadArgument(f"{path} is not a file, and a backup cannot take its place; nothing was read")
    if force or not atomic_file.is_there(path):
        return
    try:
        others = Backup.load(path, unit.profile).origin.other(origin, unit=True)
    except NotAllowed as error:
        told = str(error).splitlines()
        why = "\n".join(told[:_LINES] + ["…"] * (len(told) > _LINES))
        raise NotAllowed(
            Text(f"{path} is there and would be replaced, but: {why}\nTake another name, or ", argument("force", True))
        ) from None
    if others:
        raise WrongDrive(
            Text(
                f"{path} is the backup of another drive: {'; '.join(others)}; nothing was read. Take another name, or ",
                argument("force", True),
            ),
            unit=unit.address,
        )


def _begun(part: Path, origin: Origin, unit: DriveView) -> Backup | None:
    """What was read before a break, if it was read of this drive."""
    if not atomic_file.is_there(part):
        return None
    try:
        before = Backup.load(part, unit.profile)
    except NotAllowed as error:
        raise NotAllowed(
            Text(
                error.text,
                "\nThat is what an interrupted backup left; with ",
                argument("resume", False),
                " it starts again",
            ),
            unit=unit.address,
        ) from None
    others = before.origin.other(origin, unit=True)
    if before.origin.profile_version != origin.profile_version:
        others.append(f"it was read with version {before.origin.profile_version} of the profile")
    if others:
        raise WrongDrive(
            Text(
                f"{part} was begun with another drive: {'; '.join(others)}; nothing was read. With ",
                argument("resume", False),
                " it starts again",
            ),
            unit=unit.address,
        )
    return before
