"""Draws a picture into a file, in the format of its name."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from drivebus.errors import BadArgument, NotAllowed
from drivebus.plot.picture import Picture

__all__ = ["check", "draw"]

_BY = {".png": "matplotlib_writer", ".svg": "matplotlib_writer", ".html": "plotly_writer"}


def check(path: str | os.PathLike[str]) -> None:
    """Nothing, if `draw` can draw what the name of *path* asks for.

    Raises:
        NotAllowed: The name asks for no kind of picture, or what draws it is not installed.
    """
    _drawing(path)


def draw(picture: Picture, path: str | os.PathLike[str]) -> None:
    """Writes *picture* to *path*: PNG, SVG or HTML by its name. What is there is replaced, when the new one is whole.

    Raises:
        NotAllowed: The name asks for no kind of picture, what draws it is not installed, or the file cannot be written.
    """
    write = _drawing(path)
    target = Path(path)
    fresh = target.with_name(f".{target.name}.new")
    try:
        write(picture, fresh, target.suffix[1:].lower())
        fresh.replace(target)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise NotAllowed(f"{target} cannot be written: {error.strerror or error}") from None


def _drawing(path: str | os.PathLike[str]) -> Callable[[Picture, Path, str], None]:
    """What draws into a file of this name."""
    known = _BY.get(Path(path).suffix.lower())
    if known is None:
        raise BadArgument(
            f"the name {os.fspath(path)} does not say which kind of picture it is; end it with {', '.join(_BY)}"
        )
    try:
        found: Callable[[Picture, Path, str], None] = import_module(f"drivebus.plot.{known}").write
    except ImportError as error:
        raise NotAllowed(f"pictures need {error.name}: pip install 'drivebus[plot]'") from None
    return found
