"""Files written whole or not at all, and read with a limit. Knows nothing of what stands in them."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from drivebus.errors import BadArgument, NotAllowed

__all__ = ["is_there", "part_of", "read", "remove", "write"]

_MOST = 1 << 20
"""Bytes a backup may have: some ten thousand parameters."""


def is_there(path: Path) -> bool:
    """Whether *path* leads to anything.

    Raises:
        NotAllowed: The system cannot tell: the path is too long, for one.
    """
    try:
        return path.exists()
    except (OSError, ValueError) as error:
        raise NotAllowed(f"{path} cannot be looked at: {_reason(error)}") from None


def read(path: Path) -> bytes:
    """What stands in *path*.

    Raises:
        NotAllowed: There is no such file, it is none, it cannot be read, or it is too large.
    """
    try:
        if not path.is_file():
            raise BadArgument(f"{path} is not a file" if path.exists() else f"there is no file {path}")
        with path.open("rb") as file:
            data = file.read(_MOST + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, NotAllowed):
            raise
        raise NotAllowed(f"{path} cannot be read: {_reason(error)}") from None
    if len(data) > _MOST:
        raise BadArgument(f"{path} is larger than a backup can be ({_MOST >> 20} MiB)")
    return data


def write(path: Path, text: str) -> None:
    """Puts *text* into *path* in one step: who is cut off at any moment leaves the old file or the new one.

    Raises:
        NotAllowed: It cannot be written there; what was there before is still there.
    """
    try:
        # A link goes on leading to the file, and the file is replaced.
        path = Path(os.path.realpath(path))
        if path.exists() and not path.is_file():
            raise BadArgument(f"{path} is not a file, and a backup cannot take its place")
        # Always the same name: what a killed process left behind is overwritten by the next, and does not pile up.
        passing = path.with_name(f"{path.name}.tmp")
        passing.unlink(missing_ok=True)
        try:
            # Never through a link that somebody else put there.
            handle = os.open(passing, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            passing.replace(path)
        except OSError:
            # On a disk that is full, half a file keeps the next one from being written.
            remove(passing)
            raise
        _settle(path.parent)
    except (OSError, ValueError) as error:
        if isinstance(error, NotAllowed):
            raise
        raise NotAllowed(f"{path} cannot be written: {_reason(error)}") from None


def _reason(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error)


def remove(path: Path) -> None:
    """Takes *path* away if it is there."""
    with contextlib.suppress(OSError):
        path.unlink()


def part_of(path: Path) -> Path:
    """Where a backup stands until it is complete."""
    return path.with_name(f"{path.name}.part")


def _settle(folder: Path) -> None:
    """Has the new name outlive a power cut, where a folder can be opened (not on Windows)."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
