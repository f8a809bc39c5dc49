"""Who sent each frame of a text: told by the frames, and by labels only where these leave a doubt.

`TX` is the request in the log of a master, and the answer in that of a unit. So a label means what the frames behind it
show; what its word usually means counts only where no frame of the file shows anything.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

from drivebus._native import judge
from drivebus.capture.finding import Piece

__all__ = ["Speakers", "without_repeats"]

_KINDS = (
    # What stands in front in each row means a request, the other an answer; the rows above go before those below.
    (
        r"[→⇒]|-+>|=+>|>>+|\b(?:tx|txd|snd|send|sends|sent|sending|out|dte)\b",
        r"[←⇐]|<-+|<=+|<<+|\b(?:rx|rxd|rcv|recv|receive|received|receiving|in|dce)\b",
    ),
    (
        r"\b(?:request|req|query|command|cmd|ask|asks|poll|q)\b",
        r"\b(?:response|resp|rsp|answer|answers|reply|replies|confirmation)\b",
    ),
    (r"\b(?:master|client|host|plc|hmi)\b", r"\b(?:slave|server|device|unit|drive)\b"),
    (
        r"(?:\b|_)(?:write|writes|writing|wrote|written|down)(?:\b|_)|^\W*>",
        r"(?:\b|_)(?:read|reads|reading|up)(?:\b|_)|^\W*<",
    ),
)
_WORDS = tuple((re.compile(asks, re.IGNORECASE), re.compile(answers, re.IGNORECASE)) for asks, answers in _KINDS)


def _usually(label: str) -> bool | None:
    """Whether the words of *label* usually mean a request; None where they mean neither."""
    for asks, answers in _WORDS:
        last = [max((match.end() for match in words.finditer(label)), default=-1) for words in (asks, answers)]
        if last[0] != last[1]:
            return last[0] > last[1]
    return None


class Speakers:
    """Tells who sent the frames among *pieces*."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._by_label = defaultdict[str, set[bool]](set)
        self._by_word = defaultdict[bool, set[bool]](set)
        self._transactions = set[int]()
        before: Piece | None = None
        for piece in pieces:
            if not piece.is_frame:
                continue
            shown = _shows(piece)
            if before is not None and shown is None and before.data == piece.data and before.label != piece.label:
                # A write and its answer: whoever speaks first asks.
                self._count(before.label, True)
                self._count(piece.label, False)
                before = None
                continue
            if shown is not None:
                self._count(piece.label, shown)
            before = piece if shown is None else None

    def _count(self, label: str, asks: bool) -> None:
        if not label:
            return
        self._by_label[label].add(asks)
        word = _usually(label)
        if word is not None:
            self._by_word[word].add(asks)

    def asks(self, piece: Piece) -> bool | None:
        """Whether a master sent *piece*; None where nothing tells."""
        if piece.transaction is not None:
            return self._asks_by_number(piece)
        shown = _shows(piece)
        if shown is not None or not piece.label:
            return shown
        for known in (self._by_label.get(piece.label), self._by_word.get(_usually(piece.label))):  # type: ignore[arg-type]
            if known:
                return next(iter(known)) if len(known) == 1 else None
        word = _usually(piece.label)
        if word is None or self._by_word:
            # The other word has shown what it means, so this one means the other.
            other = self._by_word.get(not word) if word is not None else None
            return not next(iter(other)) if other and len(other) == 1 else None
        return word

    def _asks_by_number(self, piece: Piece) -> bool:
        """As `asks`, of Modbus TCP: a number that comes for the second time is that of the answer."""
        number = piece.transaction or 0
        shown = _shows(piece)
        asks = number not in self._transactions if shown is None else shown
        (self._transactions.add if asks else self._transactions.discard)(number)
        return asks


def _shows(piece: Piece) -> bool | None:
    """Whether the form of *piece* is that of a request, or of an answer; None where it may be either."""
    asks, answers, _ = judge(piece.data)
    return None if asks == answers else asks


def without_repeats(pieces: Sequence[Piece]) -> tuple[list[Piece], int]:
    """*pieces* without frames that the tool has told twice, and how many of them there were.

    It does so under another label, which says that it works on the frame and not that one went or came.
    """
    kept, repeats = list[Piece](), 0
    frames = list[Piece]()
    for piece in pieces:
        if piece.is_frame and _is_repeat(piece, frames):
            repeats += 1
            continue
        kept.append(piece)
        if piece.is_frame:
            frames.append(piece)
    return kept, repeats


def _is_repeat(piece: Piece, frames: Sequence[Piece]) -> bool:
    same = [before for before in frames[-2:] if before.data == piece.data and before.transaction == piece.transaction]
    if not same or frames[-1] is not same[-1] or any(before.label == piece.label for before in same):
        return False
    if not piece.label or _usually(piece.label) is not None:
        return False
    return _shows(piece) is not None or len(same) == 2
