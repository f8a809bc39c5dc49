"""A bar that shows how far a command has come, for who watches a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from drivebus.cli.present.output import Output, remark, show

__all__ = ["progress_bar"]


@contextmanager
def progress_bar(out: Output, what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for who watches a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=out.console, transient=True, disable=not out.live) as bar:
        task = bar.add_task(what, total=None)
        first = True

        def progress(done: int, total: int) -> None:
            nonlocal first
            if first and done and what == "reading":
                remark(f"Going on where it was: {show(done)} of {show(total)} are there. `--fresh` reads them again.")
            first = False
            bar.update(task, completed=done, total=total)

        yield progress
