"""What stands beside the bytes on a line: times, addresses of a hexdump, its column of text, counts.

None of it is told by its place alone: an address is one that counts the bytes, a column of text one that says them
again.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivebus.capture.tokens import Reading, Run

__all__ = ["Beside", "Body", "body", "without_times"]

_TIMES = re.compile(
    r"(?<![\w.:/-])(?:"
    r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}(?:[T_ ]+\d{1,2}:\d\d(?::\d\d(?:[.,:]\d+)?)?(?:Z|\s?[+-]\d\d:?\d\d)?)?|"
    r"\d{1,2}/\d{1,2}/\d{2,4}|\d{1,2}[-.]\d{1,2}[-.](?:19|20)\d\d|"
    r"\d{1,2}:\d\d(?::\d\d(?:[.,:]\d+)?)?(?:Z|\s?[+-]\d\d:?\d\d)?(?:\s?[ap]m)?|"
    r"[+-]?\d+[.,]\d+(?:e[+-]?\d+)?(?:\s?(?:[munµ]?s|sec|seconds))?|\d+\s?(?:[munµ]s|sec|seconds)|1\d{9}(?:\d{3}){0,3}"
    r")(?!\w|[:.,/-]\w)",
    re.IGNORECASE,
)
"""Dates, times of day, seconds with a point, and seconds or milliseconds since 1970."""


def without_times(line: str) -> str:
    """*line* with each time in it made unreadable, column by column."""
    return _TIMES.sub(lambda moment: "~" * len(moment[0]), line)


class Beside:
    """What a hexdump has counted so far.

    Attributes:
        offset: The address that the next line has, if it goes on.
    """

    def __init__(self) -> None:
        self.offset = 0

    def address(self, text: str) -> int | None:
        """The address that *text* is, of the next line or of a dump that begins; None where it is neither."""
        digits = text.lower().removeprefix("0x").rstrip("h:")
        for base in (16, 10, 8):
            try:
                value = int(digits, base)
            except ValueError:
                continue
            if value in (0, self.offset):
                return value
        return None


@dataclass(slots=True)
class Body:
    """The bytes of a line as far as its looks tell, where no frame was found on it.

    Attributes:
        best: What looks most as if it was meant; empty where nothing does.
        last: What stands last.
        says_again: Whether the text behind them says them again.
    """

    best: Run
    last: Run
    says_again: bool = False


def body(line: str, masked: str, reading: Reading, beside: Beside) -> Body:
    """The bytes of *line*, without times *masked*; an address in front of them is counted in *beside*."""
    runs = reading(masked)
    if not runs:
        return Body(Run(), Run())
    if runs[0].styles[0] == "quoted":
        best = max(runs, key=lambda run: len(run.data))
        return Body(best, best)
    runs[0], address = _without_address(line, runs[0], beside)
    says_again = False
    for index, run in enumerate(runs):
        shown = _shown_again(line, run)
        if shown:
            says_again, runs = True, [*runs[:index], run.cut(0, shown)]
            break
    if address is not None:
        beside.offset = address + sum(len(run.data) for run in runs)
    parts = [_without_count(part) for run in runs for part in _by_mark(run)]
    if not parts:
        return Body(Run(), Run())
    # What carries a mark, such as 0x, is meant; numbers without one stand beside it.
    best = max(reversed(parts), key=lambda run: (not run.styles[0].startswith(("plain", "row")), len(run.data)))
    return Body(best, parts[-1], says_again)


def _by_mark(run: Run) -> list[Run]:
    """The parts of *run* that are written with the same mark, or without one."""
    parts, start = list[Run](), 0
    for at in range(1, len(run.data) + 1):
        if at == len(run.data) or _mark(run.styles[at]) != _mark(run.styles[start]):
            parts.append(run.cut(start, at))
            start = at
    return parts


def _mark(style: str) -> str:
    return "plain" if style.startswith("plain") or style == "row" else style


def _without_address(line: str, run: Run, beside: Beside) -> tuple[Run, int | None]:
    """*run* without the address of a hexdump in front, and that address."""
    start, end = run.spans[0]
    if end - start < 4 or line[:start].strip(" \t[<(0x|"):
        return run, None
    address = beside.address(line[start:end])
    return run if address is None else run.cut(run.spans.count(run.spans[0]), len(run.data)), address


def _without_count(run: Run) -> Run:
    """*run* without a number in front that is parted from the bytes otherwise than they are from each other."""
    if len(run.data) < 2:
        return run
    count = run.spans.count(run.spans[0])
    if count >= len(run.data):
        return run
    gap, others = run.gaps[count], set(run.gaps[count + 1 :]) - {""}
    is_label = any(sign in gap for sign in ":)]>|\t") or "  " in gap
    if is_label and gap not in others:
        return run.cut(count, len(run.data))
    return run


def _shown_again(line: str, run: Run) -> int:
    """How many bytes of *run* the text behind them says again; 0 where none does."""
    for count in range(1, len(run.data) + 1):
        if count < len(run.data) and len(run.gaps[count].strip("|\"'<;:(")) < 2 and "|" not in run.gaps[count]:
            continue
        tail = line[run.spans[count - 1][1] :]
        if tail[:1] in (" ", "\t", "|") and _says(tail.strip(), bytes(run.data[:count])):
            return count
    return 0


def _says(text: str, data: bytes) -> bool:
    for opens, closes in (("|", "|"), ("'", "'"), ('"', '"'), ("<", ">"), ("(", ")"), (";", "")):
        if len(text) > 1 and text.startswith(opens) and text.endswith(closes):
            text = text[len(opens) : len(text) - len(closes)]
            break
    if len(text) > len(data) and text[8:9] == " ":
        text = text[:8] + text[9:]
    spare = len(data) - len(text)
    if not text or spare < 0:
        return False
    # Blanks at the ends are lost in many files.
    return any(
        all(_is_shown(sign, byte) for sign, byte in zip(text, data[start:], strict=False))
        and all(_is_shown(" ", byte) for byte in (*data[:start], *data[start + len(text) :]))
        for start in range(spare + 1)
    )


def _is_shown(sign: str, byte: int) -> bool:
    return ord(sign) == byte if 0x20 <= byte < 0x7F else not (sign.isascii() and sign.isalnum())
