"""What became of each parameter that was to be given back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

from drivebus.backup.compare import shown
from drivebus.values import Value

__all__ = ["FAILED", "RESULTS", "Restoration", "Restored"]

RESULTS = {
    "restored": "written to the drive's memory, and read back",
    "planned": "would be written",
    "same": "the drive had it already",
    "skipped": "left alone",
    "refused": "the drive would not take it",
    "blocked": "not sent: the drive would not take it",
    "differs": "the drive shows another value, after it was written or another parameter was",
    "missing": "the drive does not have it",
    "unread": "what the drive, or the backup, has could not be read",
}
"""What can become of a parameter."""

FAILED = ("refused", "blocked", "differs", "missing", "unread")
"""What leaves the drive otherwise than the backup."""


@dataclass(frozen=True)
class Restored:
    """What became of one parameter.

    Attributes:
        code: The parameter.
        label: What it is, in words.
        unit: Its engineering unit.
        before: What the drive had; None where it did not tell.
        wanted: What the backup has; None where that means nothing to this drive.
        after: What the drive has now; None where it did not tell.
        result: One of `"restored"`, `"planned"` (in a dry run), `"same"`, `"skipped"`, and of those that failed:
            `"refused"`, `"blocked"`, `"differs"`, `"missing"`, `"unread"`.
        reason: Why, where it was not restored, and whether the drive took what was sent.
    """

    code: str
    label: str
    unit: str
    before: Value | None
    wanted: Value | None
    after: Value | None
    result: str
    reason: str = ""

    @property
    def failed(self) -> bool:
        """Whether the drive has another value than the backup, or may have."""
        return self.result in FAILED

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        before, wanted = ("?" if value is None else shown(value) for value in (self.before, self.wanted))
        change = f"{wanted}{unit}" if before == wanted else f"{before} -> {wanted}{unit}"
        why = f" ({self.reason})" if self.reason else ""
        return f"{self.code} {self.label}: {change}, {self.result}{why}"


class Restoration(Sequence[Restored]):
    """What became of every parameter of a backup, in code order.

    Attributes:
        dry_run: Whether nothing was written.
        ok: Whether none failed: what is not as in the backup was left alone on purpose.
        order: The codes that were (or would be) written, in the order of their writes; a code whose value needed an
            intermediate step stands there twice.
    """

    __slots__ = ("_items", "dry_run", "order")

    def __init__(self, items: Sequence[Restored], order: Sequence[str], dry_run: bool) -> None:
        self._items = tuple(items)
        self.order = tuple(order)
        self.dry_run = dry_run

    @property
    def ok(self) -> bool:
        """See the class."""
        return not any(item.failed for item in self)

    def having(self, *results: str) -> list[Restored]:
        """The parameters that ended as one of *results*."""
        return [item for item in self if item.result in results]

    @overload
    def __getitem__(self, index: int) -> Restored: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Restored]: ...
    def __getitem__(self, index: int | slice) -> Restored | Sequence[Restored]:
        return self._items[index]

    def __len__(self) -> int:
        return len(self._items)

    def __str__(self) -> str:
        counts = {result: len(self.having(result)) for result in RESULTS}
        head = ", ".join(f"{count} {result}" for result, count in counts.items() if count)
        return "\n".join([head or "nothing to restore", *(str(item) for item in self if item.result != "same")])

    def __repr__(self) -> str:
        return f"<Restoration: {str(self).splitlines()[0]}>"
