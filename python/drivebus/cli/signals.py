"""What a command does when it is told to end by a signal, for as long as it runs."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["heeded"]


@contextmanager
def heeded(numbers: Iterable[int], heed: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """A block in which *heed* is called for the signals *numbers*; behind it they do what they did before."""
    before = {number: signal.signal(number, heed) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
