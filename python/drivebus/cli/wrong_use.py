"""What was asked for and cannot be done, although each word of it was one."""

from __future__ import annotations

from typing import IO, Any

import click

__all__ = ["WrongUse"]


class WrongUse(click.UsageError):
    """A wrong use that its message explains: the usage of the command, which was kept to, is not shown above it."""

    def show(self, file: IO[Any] | None = None) -> None:
        """Shows the message alone."""
        click.ClickException.show(self, file)
