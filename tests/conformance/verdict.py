"""How a call ended, in the words of the table, and how long it takes until the next right read."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from .child import Child, Outcome

RIGHT, WRONG, ERROR, HUNG = "right", "wrong", "error", "hung"

TRIES = 10  # reads at least, and
PATIENCE = 3.0  # seconds at least, before a library counts as not recovered
PAUSE = 0.050  # after some failed tries each takes at least that long: what fails at once is not asked a thousand times


@dataclass(frozen=True)
class Verdict:
    """How the judged call ended."""

    kind: str
    detail: str
    seconds: float

    def keeps(self, must: str | tuple[str, ...]) -> bool:
        """Whether this is what *must* asks for: a right answer, or one of the errors named."""
        return self.kind == must if isinstance(must, str) else self.kind == ERROR and self.detail.split(" ")[0] in must


@dataclass(frozen=True)
class Recovery:
    """What came until the next right read; `seconds` is None where none came."""

    seconds: float | None
    wrong: int = 0
    errors: int = 0


def ended(outcome: Outcome) -> Verdict | None:
    """The verdict on a call that did not return."""
    if outcome.hung:
        return Verdict(HUNG, "", outcome.seconds)
    if outcome.error is not None:
        return Verdict(ERROR, outcome.error, outcome.seconds)
    return None


def of_read(outcome: Outcome, address: int, count: int) -> Verdict:
    """Register *a* holds *a*."""
    return judged(outcome, list(range(address, address + count)))


def judged(outcome: Outcome, expected: Sequence[int]) -> Verdict:
    """A read, whatever it should have brought."""
    if (verdict := ended(outcome)) is not None:
        return verdict
    if outcome.result == list(expected):
        return Verdict(RIGHT, "", outcome.seconds)
    return Verdict(WRONG, str(outcome.result), outcome.seconds)


def of_write(outcome: Outcome, address: int, value: int, times: int) -> Verdict:
    """A write, by the unit's own log: it was carried out *times* times."""
    told = {0: "not written", 1: "written"}.get(times, f"written {times} times")
    if times > 1:
        return Verdict(HUNG if outcome.hung else WRONG, told, outcome.seconds)
    if (verdict := ended(outcome)) is not None:
        return Verdict(verdict.kind, f"{verdict.detail} ({told})".strip(), verdict.seconds)
    said = outcome.result
    if times == 0:
        return Verdict(WRONG, f"confirmed, {told}", outcome.seconds)
    if said is not None and said != [address, value][-len(said) :]:
        return Verdict(WRONG, f"written, but the call returns {said}", outcome.seconds)
    return Verdict(RIGHT, "", outcome.seconds)


def pace(asked: float, failed: int) -> None:
    """Waits before the next try where many have failed. *asked*: when the last one began."""
    if failed >= TRIES:
        time.sleep(max(0.0, PAUSE - (time.monotonic() - asked)))


def recovery(child: Child) -> Recovery:
    """Reads registers that nobody asked for yet until one is right."""
    began = time.monotonic()
    wrong = errors = tries = 0
    while tries < TRIES or time.monotonic() - began < PATIENCE:
        asked = time.monotonic()
        verdict = of_read(child.read(500 + tries), 500 + tries, 1)
        tries += 1
        if verdict.kind == RIGHT:
            return Recovery(time.monotonic() - began, wrong, errors)
        if verdict.kind == HUNG:
            break
        wrong += verdict.kind == WRONG
        errors += verdict.kind == ERROR
        pace(asked, tries)
    return Recovery(None, wrong, errors)
