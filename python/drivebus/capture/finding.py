"""Frames in the text of any tool: found by their CRC among the numbers on a line, or over several lines.

Which form a tool has nobody needs to say: `tokens` reads the numbers of a line in every way they may be meant, the core
finds the frames in them, and what gives frames was meant so. `layout` says what stands beside them, `speakers` who sent
each. Modbus TCP is known by its head, whose length must be that of what follows.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from drivebus._native import frames_in, judge
from drivebus.capture.layout import Beside, body, without_times
from drivebus.capture.tokens import MAY, READINGS, Reading, Run
from drivebus.errors import DrivebusError
from drivebus.rtu import SHORTEST, framed, is_frame

__all__ = ["Piece", "pieces"]

_HEAD = 6
"""Bytes of a Modbus TCP frame before the unit: transaction, protocol and length."""

_GLUED_LABEL = re.compile(r"(?<![0-9a-z])([tr]x)(?=(?:[0-9a-f]{2}){4,}(?![0-9a-z]))", re.IGNORECASE)
"""A label without anything between it and the bytes: `TX0303…`."""

_USUAL = ("hexadecimal", "decimal", "quoted")
"""How bytes may be meant in a text that has no frame at all."""

_ROW = ("row", "")
_DIGITS = re.compile(r"(?<![^\W_])(?:0x)?(?=[a-f]*[0-9])[0-9a-f]+(?![^\W_])|[0-9]+|~+", re.IGNORECASE)
_BLANKS = re.compile(r"\s+")
_SAYS = re.compile(r"[^\W\d_]|[<>→←⇒⇐]")
_FIRST = re.compile(r"[\s\[(#]*(\d+)(?![\w.])")


@dataclass(slots=True)
class Piece:
    """A frame that was found, or bytes that look as if they were meant and are in no frame.

    Attributes:
        line: The number of its line, from 0 on.
        column: Where on it.
        data: The frame, with its CRC; of Modbus TCP with one that was added. Or the bytes.
        is_frame: Which of the two.
        label: What stands before it on the line, without numbers.
        transaction: The number that a Modbus TCP frame has; None of any other.
    """

    line: int
    column: int
    data: bytes
    is_frame: bool
    label: str = ""
    transaction: int | None = None


@dataclass(slots=True)
class _Line:
    """One line, and what was found on it."""

    number: int
    text: str
    masked: str = ""
    found: list[Piece] = field(default_factory=list)
    by: str = ""
    ways: set[tuple[str, str]] = field(default_factory=set)
    before: list[Piece] = field(default_factory=list)
    behind: list[Piece] = field(default_factory=list)

    def pieces(self) -> Iterator[Piece]:
        """All of it, in the order of the line."""
        yield from sorted([*self.before, *self.found, *self.behind], key=lambda piece: piece.column)


def pieces(text: str) -> list[Piece]:
    """What is found in *text*, in its order."""
    lines = [_Line(number, _GLUED_LABEL.sub(r"\1 ", line)) for number, line in enumerate(text.splitlines())]
    for line in lines:
        line.masked = without_times(line.text)
    counts = dict.fromkeys(READINGS, 0)
    # What one reading knows by function, length and CRC goes before what another takes by a head or a CRC alone.
    for name, reading in READINGS.items():
        _look_at_each(lines, name, reading, _with_known)
    for name, reading in READINGS.items():
        _look_at_each(lines, name, reading, _frames)
        _join(lines, name, reading)
        counts[name] = sum(line.by == name for line in lines)
    _without_counters(lines)
    best = max(counts, key=lambda name: counts[name])
    _told_of_the_rest(lines, [best] if counts[best] else _USUAL)
    return [piece for line in lines for piece in line.pieces()]


_Finds = Callable[[Run], list[tuple[int, int]]]


def _look_at_each(lines: Sequence[_Line], name: str, reading: Reading, finds: _Finds) -> None:
    """Looks at those of *lines* on which nothing was found yet."""
    for line in lines:
        if not line.found and MAY[name].search(line.masked):
            _look(line, name, reading, finds)


def _look(line: _Line, name: str, reading: Reading, finds: _Finds) -> None:
    """Takes the frames that stand on *line* as a whole."""
    runs = reading(line.text)
    found = [finds(run) for run in runs]
    if finds is _with_known and any(found):
        # Beside a frame that is known, the others on the line are read as it is.
        found = [_frames(run) for run in runs]
    after = 0
    for run, spans in zip(runs, found, strict=True):
        for index, (start, end) in enumerate(spans):
            before = _leftover(line, run, 0, start, spans) if index == 0 else []
            until = before[0].column if before else run.spans[start][0]
            line.found.append(_piece(line, run, start, end, _label(line.text[after:until])))
            following = spans[index + 1][0] if index + 1 < len(spans) else len(run.data)
            behind = _leftover(line, run, end, following, spans)
            line.before += before
            line.behind += behind
            line.by = name
            line.ways |= _ways(run.cut(start, end))
            after = run.spans[end - 1 + sum(len(piece.data) for piece in behind)][1]


def _piece(line: _Line, run: Run, start: int, end: int, label: str) -> Piece:
    data, column = bytes(run.data[start:end]), run.spans[start][0]
    if is_frame(data):
        return Piece(line.number, column, data, True, label)
    return Piece(line.number, column, framed(data[_HEAD:]), True, label, int.from_bytes(data[:2], "big"))


def _label(text: str) -> str:
    """*text* without what differs from line to line, or opens the bytes; empty where it says nothing."""
    text = text.rstrip("<[({\"'")
    said = _BLANKS.sub(" ", _DIGITS.sub("#", without_times(text))).strip()
    return said if _SAYS.search(said) else ""


def _with_known(run: Run) -> list[tuple[int, int]]:
    """Where the frames in *run* stand, if one of them has a function that is known."""
    data = bytes(run.data)
    return _frames(run) if len(data) >= SHORTEST and frames_in(data) else []


def _frames(run: Run) -> list[tuple[int, int]]:
    """Where the frames in *run* stand."""
    data = bytes(run.data)
    if len(data) < SHORTEST:
        return []
    known = frames_in(data)
    edges = _edges(run)
    spans, free = list[tuple[int, int]](), 0
    for start, end in [*known, (len(data), len(data))]:
        spans += _by_edges(run, [edge for edge in edges if free <= edge <= start])
        spans.append((start, end))
        free = end
    spans.pop()
    return spans or _tcp(data, edges)


def _edges(run: Run) -> list[int]:
    """Where in *run* a frame of a form that nobody knows may begin or end: where it looks other than before."""
    edges = {0, len(run.data)}
    if len(run.data) > SHORTEST:
        edges.add(run.spans.count(run.spans[0]))
    inner = [gap for gap, span, before in zip(run.gaps[1:], run.spans[1:], run.spans, strict=False) if span != before]
    usual = max(set(inner), key=inner.count) if inner else ""
    for at in range(1, len(run.data)):
        if run.spans[at] != run.spans[at - 1] and (
            run.gaps[at] != usual or run.styles[at].startswith("plain") != run.styles[at - 1].startswith("plain")
        ):
            edges.add(at)
    return sorted(edges)


def _by_edges(run: Run, edges: Sequence[int]) -> list[tuple[int, int]]:
    """Frames in *run* that begin and end at *edges*: whatever is in them, their CRC is right."""
    spans, free = list[tuple[int, int]](), 0
    for start in edges:
        if start < free:
            continue
        for end in reversed(edges):
            if is_frame(bytes(run.data[start:end])) and _is_meant(run, start, end):
                spans.append((start, end))
                free = end
                break
    return spans


def _is_meant(run: Run, start: int, end: int) -> bool:
    """Whether it cannot be chance by its looks: an address of a hexdump is one number among others."""
    is_all = start == 0 and end == len(run.data)
    is_one = run.spans[start] == run.spans[end - 1]
    return run.data[start + 1] & 0x7F != 0 and (is_all or (not is_one and end - start > SHORTEST))


def _tcp(data: bytes, edges: Sequence[int] | None = None) -> list[tuple[int, int]]:
    """Where the Modbus TCP frames in *data* stand: one behind the other, or one that ends where the bytes end."""
    if b"\0\0\0" not in data:
        return []
    for first in edges if edges is not None else range(len(data) - _HEAD):
        spans, at = list[tuple[int, int]](), first
        while at + _HEAD + 2 <= len(data) and data[at + 2 : at + 5] == b"\0\0\0":
            end = at + _HEAD + data[at + 5]
            if end > len(data) or not _is_said(data[at + _HEAD : end]):
                break
            spans.append((at, end))
            at = end
        if spans and (edges is None or at in edges) and (edges is not None or at == len(data)):
            return spans
    return []


def _is_said(data: bytes) -> bool:
    """Whether a master or a unit may have said *data*, which is a unit and a PDU."""
    if len(data) < 2 or data[1] & 0x7F == 0:
        return False
    try:
        # Unit 0 answers here: it is the gateway.
        asks, answers, wrong = judge(framed(b"\x01" + data[1:]))
    except DrivebusError:
        return False
    return (asks or answers) and wrong is None


def _leftover(line: _Line, run: Run, start: int, end: int, spans: Sequence[tuple[int, int]]) -> list[Piece]:
    """The bytes of *run* from *start* to *end* that look as those of the frames beside them do."""
    if start == end:
        return []
    frames = [at for first, last in spans for at in range(first, last)]
    styles = {run.styles[at] for at in frames}
    if "row" in styles:
        styles.add("plain2")
    gaps = {_BLANKS.sub(" ", run.gaps[at]) for first, last in spans for at in range(first + 1, last)}
    # A number by itself at the start is told from a byte by how it is written, or by what the other lines begin with.
    at_front = start == 0
    order = range(end - 1, start - 1, -1) if at_front else range(start, end)
    like = list[int]()
    for at in order:
        gap = _BLANKS.sub(" ", run.gaps[at + 1] if at_front else run.gaps[at])
        edge = line.masked[run.spans[at][0] : run.spans[at][1]]
        if run.styles[at] == "letter" or run.styles[at] not in styles or gap not in gaps or "~" in edge:
            break
        like.append(at)
    like.sort()
    if not like or (at_front and _is_count(line, run, like, end, spans)):
        return []
    data = bytes(run.data[like[0] : like[-1] + 1])
    return [Piece(line.number, run.spans[like[0]][0], data, False)]


def _is_count(line: _Line, run: Run, like: Sequence[int], end: int, spans: Sequence[tuple[int, int]]) -> bool:
    """Whether the one number before a frame says how long it is."""
    first, last = spans[0]
    start, stop = run.spans[like[0]]
    text = line.text[start:stop]
    return len(like) == 1 and like[0] + 1 == end == first and text in (str(last - first), f"{last - first:02}")


def _without_counters(lines: Sequence[_Line]) -> None:
    """Leaves out a number before a frame that counts the lines: one more than the line before it begins with."""
    firsts = [(line, int(match[1]), match.end()) for line in lines if (match := _FIRST.match(line.text))]
    for at, (line, number, end) in enumerate(firsts):
        around = [firsts[other][1] - (other - at) for other in (at - 1, at + 1) if 0 <= other < len(firsts)]
        if number in around and len(line.before) == 1:
            first = line.before[0]
            if len(first.data) == 1 and first.column < end:
                line.before.clear()


def _join(lines: Sequence[_Line], name: str, reading: Reading) -> None:
    """Takes the frames that stand on several of *lines*."""
    for block in _blocks(lines, name, reading):
        if len({row.line.number for row in block}) > 1:
            attempts = [_whole(chosen) for chosen in _choices(block)]
            best, unused = max(attempts, key=lambda attempt: sum(len(piece.data) for piece, _ in attempt[0]))
            for piece, rows in best:
                rows[0].line.found.append(piece)
                for row in rows:
                    row.line.by = name
                    row.take()
            taken = {id(row): row for _, rows in best for row in rows}
            for row in taken.values():
                row.leave(*unused[id(row)], b"\0" if name in ("swapped", "octal") else b"")


@dataclass(slots=True)
class _Row:
    """The bytes of one line in a block.

    Attributes:
        line: The line.
        data: Its bytes that are in no frame.
        column: Where they begin.
        label: What stands before them.
        is_weak: Whether it is one number among words.
        place: Whether they stand before or behind the frames of the line, or alone.
        last: The bytes that stand last on it, where those may be meant instead.
        rest: The bytes behind the first number, where that may count the lines.
    """

    line: _Line
    data: bytes
    column: int
    label: str
    is_weak: bool
    place: str
    last: bytes = b""
    rest: bytes = b""

    def take(self) -> None:
        """They are in a frame now."""
        if self.place == "before":
            self.line.before.clear()
        elif self.place == "behind":
            self.line.behind.pop()
        self.place = "taken"

    def leave(self, before: bytes, behind: bytes, filled_up_with: bytes) -> None:
        """Those *before* and *behind* the frame are in none; what a tool fills its last word up with is nothing."""
        if before:
            self.line.before.append(Piece(self.line.number, self.column, before, False, self.label))
        if behind not in (b"", filled_up_with):
            self.line.behind.append(Piece(self.line.number, self.column, behind, False, self.label))


def _blocks(lines: Sequence[_Line], name: str, reading: Reading) -> Iterator[list[_Row]]:
    """The bytes of lines that may go on from each other."""
    block, beside, label = list[_Row](), Beside(), ""
    for line in lines:
        if line.found:
            if line.by == name and line.before:
                first = line.before[0]
                block.append(_Row(line, first.data, first.column, label, False, "before"))
            yield block
            block = []
            if line.by == name and line.behind and line.behind[-1].column > line.found[-1].column:
                last = line.behind[-1]
                label = line.found[-1].label
                block.append(_Row(line, last.data, last.column, label, False, "behind"))
            if line.by == name:
                body(line.text, line.masked, reading, beside)
            continue
        if not MAY[name].search(line.masked):
            continue
        seen = body(line.text, line.masked, reading, beside)
        run = seen.best
        if not run.data:
            continue
        column = run.spans[0][0]
        own = _label(line.text[:column])
        around = line.text[:column] + ("" if seen.says_again else line.text[run.spans[-1][1] :])
        is_weak = len(run.data) == 1 and run.styles[0].startswith(("plain", "decimal")) and bool(_SAYS.search(around))
        if own and label and own != label and not is_weak:
            yield block
            block = []
        label = label if is_weak else own or label
        rest = bytes(run.data[run.spans.count(run.spans[0]) :])
        block.append(_Row(line, bytes(run.data), column, own, is_weak, "alone", bytes(seen.last.data), rest))
    yield block


def _choices(block: Sequence[_Row]) -> Iterator[list[_Row]]:
    """Which rows of *block* may be meant: the strong ones, all, or those that begin alike."""
    yield [row for row in block if not row.is_weak]
    if any(row.is_weak for row in block):
        yield list(block)
        for label in dict.fromkeys(row.label for row in block if row.is_weak):
            yield [row for row in block if row.label == label]
    firsts = [int(match[1]) for row in block if (match := _FIRST.match(row.line.text))]
    if len(firsts) == len(block) and all(after == before + 1 for before, after in pairwise(firsts)):
        yield [replace(row, data=row.rest or row.data) for row in block]
    if any(row.last not in (b"", row.data) for row in block):
        yield [replace(row, data=row.last or row.data) for row in block]


_Attempt = tuple[list[tuple[Piece, list[_Row]]], dict[int, tuple[bytes, bytes]]]


def _whole(rows: Sequence[_Row]) -> _Attempt:
    """The frames in *rows* one behind the other, each with the rows that it stands on; and what of a row is in none."""
    data = b"".join(row.data for row in rows)
    of = [row for row in rows for _ in row.data]
    spans, is_tcp = frames_in(data), False
    if not spans and len(data) >= SHORTEST:
        is_one = is_frame(data) and data[1] & 0x7F != 0
        spans = [(0, len(data))] if is_one else _tcp(data)
        is_tcp = bool(spans) and not is_one
    found = list[tuple[Piece, list[_Row]]]()
    for start, end in spans:
        mine = list({id(row): row for row in of[start:end]}.values())
        raw = data[start:end]
        piece = Piece(mine[0].line.number, mine[0].column, raw, True, mine[0].label)
        if is_tcp:
            piece.data, piece.transaction = framed(raw[_HEAD:]), int.from_bytes(raw[:2], "big")
        found.append((piece, mine))
    used = {at for start, end in spans for at in range(start, end)}
    unused, first = dict[int, tuple[bytes, bytes]](), 0
    for row in rows:
        places = range(first, first + len(row.data))
        begins = next((at for at in places if at in used), first)
        before = data[first:begins]
        unused[id(row)] = before, bytes(data[at] for at in places if at > begins and at not in used)
        first += len(row.data)
    return found, unused


def _told_of_the_rest(lines: Sequence[_Line], names: Sequence[str]) -> None:
    """Keeps of each line without a frame the bytes that are written as those of frames are, here or elsewhere."""
    ways = {way for line in lines if line.by in names for way in line.ways}
    labels = {piece.label for line in lines for piece in line.found}
    besides, last = {name: Beside() for name in names}, b""
    for line in lines:
        bodies = [body(line.text, line.masked, READINGS[name], beside).best for name, beside in besides.items()]
        run = max(bodies, key=lambda run: len(run.data))
        if line.found or line.by:
            last = line.found[-1].data if line.found else last
            continue
        if not run.data:
            continue
        own = _label(line.text[: run.spans[0][0]])
        written = _ways(run)
        is_alike = written <= ways if ways else len(written) == 1 and (written != {_ROW} or len(run.data) > SHORTEST)
        is_meant = is_alike and (len(run.data) >= SHORTEST or (len(run.data) > 1 and own in labels))
        data = bytes(run.data)
        # Some tools say the inside of a frame once more.
        if is_meant and data not in last:
            line.behind.append(Piece(line.number, run.spans[0][0], data, False, own))


def _ways(run: Run) -> set[tuple[str, str]]:
    """How the bytes of *run* are written, and parted from each other."""
    return {
        ("plain2" if style == "plain1" else style, gap) for style, gap in zip(run.styles[1:], run.gaps[1:], strict=True)
    }
