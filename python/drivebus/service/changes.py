"""Which samples of a drive are kept: those that say something else, and now and then one that says the same."""

from __future__ import annotations

from collections.abc import Sequence

from drivebus.values import Value

__all__ = ["Changes"]


class Changes:
    """The samples of one drive. Time is an argument.

    Args:
        bands: For each value, how far it may go from the one that was kept last.
        heartbeat: Seconds after which a sample is kept though nothing changed.
    """

    def __init__(self, bands: Sequence[float], heartbeat: float) -> None:
        self._bands = tuple(bands)
        self._heartbeat = heartbeat
        self._kept: tuple[float, str, tuple[Value, ...]] | None = None

    def keeps(self, at: float, missing: str, values: Sequence[Value]) -> bool:
        """Whether the sample of moment *at* is kept, which has *values*, or none because of what *missing* names.

        A clock that was set back, or far ahead, is no reason to keep nothing.
        """
        new = (at, missing, tuple(values))
        if self._kept is None or self._is_news(*self._kept, *new):
            self._kept = new
            return True
        return False

    def _is_news(
        self, then: float, lacked: str, before: tuple[Value, ...], at: float, missing: str, values: tuple[Value, ...]
    ) -> bool:
        if not 0.0 <= at - then < self._heartbeat or missing != lacked:
            return True
        return any(abs(new - old) > band for new, old, band in zip(values, before, self._bands, strict=False))
