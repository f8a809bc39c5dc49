"""What a format of recordings has to do, and which one a file's name asks for."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Protocol

from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed
from drivebus.record.table import Row, Table

__all__ = ["FORMATS", "Sink", "format_of", "sink_for"]

FORMATS = {".csv": "csv_file", ".jsonl": "json_lines", ".parquet": "parquet", ".sqlite": "sqlite", ".db": "sqlite"}
"""The file of this room that has the format, by the end of the name."""

_EXTRAS = {"parquet"}
"""Those that need something to be installed, which an extra of that name has."""


class Sink(Protocol):
    """One file that grows.

    What `write` has returned from is in the file, whole, and a kill of this process cannot take it away.

    Attributes:
        every: Seconds between two calls of `write` that this format is made for.
        about_last: Whether the JSON about drives and registers stands before the `end`, out of a reader's way, and
            the first row tells it in words.
        path: Where it is.
    """

    every: float
    about_last: bool
    path: Path

    def write(self, rows: Sequence[Row]) -> None:
        """Writes *rows*, all of them or none.

        Raises:
            OSError: It cannot be written now; the file is as it was.
        """

    def size(self) -> int:
        """Bytes that it has by now."""

    def gone(self) -> str:
        """Why what it has written does not stand where it was written any more; empty while it does."""

    def move(self, path: Path) -> int | None:
        """Goes on in a new file at *path*, with what it has written.

        Returns:
            How many rows with values it had to leave behind; None: it cannot tell, and nothing was made.

        Raises:
            OSError: There is something at *path*, or it cannot be written there; nothing was made.
        """

    def close(self) -> None:
        """Ends it.

        Raises:
            OSError: The last of it cannot be written.
        """


def format_of(path: str | os.PathLike[str]) -> str:
    """The format that the name of *path* asks for.

    Raises:
        NotAllowed: None does.
    """
    ending = Path(path).suffix.lower()
    try:
        return FORMATS[ending]
    except KeyError:
        raise BadArgument(
            f"the name {os.fspath(path)} does not say which format it is; end it with {', '.join(FORMATS)}"
        ) from None


def sink_for(path: Path, table: Table, replace: bool) -> Sink:
    """A new file at *path*, in the format of its name.

    Raises:
        NotAllowed: It is there already and must not be replaced, cannot be written, or what its format needs is not
            installed. Nothing was changed.
    """
    known = format_of(path)
    if path.exists() and not replace:
        raise BadArgument(Text(f"{path} is there already; give another name, or ", argument("replace", True)))
    try:
        make: Callable[[Path, Table], Sink] = import_module(f"drivebus.record.{known}").open_new
        if replace:
            path.unlink(missing_ok=True)
        return make(path, table)
    except ImportError as error:
        if known not in _EXTRAS:
            raise
        raise NotAllowed(f"{path.suffix} files need {error.name}: pip install 'drivebus[{known}]'") from None
    except OSError as error:
        raise NotAllowed(f"{path} cannot be written: {error.strerror or error}; nothing was recorded") from None
