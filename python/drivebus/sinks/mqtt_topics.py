"""Where each thing is found at a broker: the topics of one gateway, and what a topic means that a message came by."""

from __future__ import annotations

import hashlib
import re
from typing import NamedTuple

__all__ = ["Place", "Topics", "why_no_level", "why_no_prefix"]

_LONGEST = 100
"""Bytes of one level."""
_PLAIN = re.compile(r"[A-Za-z0-9_-]+")


class Place(NamedTuple):
    """What a topic of this gateway is about.

    Attributes:
        drive: The name of a drive, which need not exist.
        kind: `"cmd"`, `"state"` or `"availability"`.
        order: Of a command what is ordered, which need not be known.
    """

    drive: str
    kind: str
    order: str = ""


class Topics:
    """The topics of one gateway.

    Args:
        prefix: What all of them begin with, such as `drivebus`.
        gateway: The name of the gateway, one level.
    """

    def __init__(self, prefix: str, gateway: str) -> None:
        self.base = f"{prefix}/{gateway}"
        """What all its topics begin with."""
        self.node = _plain(gateway)
        """The name of the gateway in letters, digits, `_` and `-`; two gateways have two."""
        self.availability = f"{self.base}/availability"
        self.history = f"{self.base}/history"
        self.event = f"{self.base}/event"
        self.beat = f"{self.base}/beat"
        self.commands = f"{self.base}/+/cmd/+"
        """All commands, to subscribe to."""
        self.kept = (f"{self.base}/+/state", f"{self.base}/+/availability")
        """What a broker keeps of drives, to subscribe to."""

    def of(self, drive: str, kind: str) -> str:
        """The topic of what is told of *drive*; where that is empty, of what is told of none in particular."""
        return "/".join(filter(None, (self.base, drive, kind)))

    def order(self, drive: str, order: str) -> str:
        """The topic by which *drive* is told *order*."""
        return f"{self.base}/{drive}/cmd/{order}"

    def place(self, topic: str) -> Place | None:
        """What *topic* is about; None: nothing that is heard here."""
        if not topic.startswith(f"{self.base}/"):
            return None
        drive, _, rest = topic[len(self.base) + 1 :].partition("/")
        kind, _, order = rest.partition("/")
        if kind == "cmd" and order and "/" not in order:
            return Place(drive, kind, order)
        return Place(drive, kind) if rest in ("state", "availability") else None


def why_no_level(text: str) -> str:
    """Why *text* cannot be one level of a topic, in words; empty if it can."""
    if any(each in text for each in "/+#"):
        return 'it may not have "/", "+" or "#" in it'
    if not text.isprintable():
        return "it may not have characters in it that cannot be seen"
    if not text.strip() or text.startswith("$"):
        return 'it may not be empty, nor begin with "$"'
    return f"it may not have more than {_LONGEST} bytes" if len(text.encode()) > _LONGEST else ""


def why_no_prefix(text: str) -> str:
    """Why *text* cannot be the levels that topics begin with, in words; empty if it can."""
    return next(filter(None, map(why_no_level, text.split("/"))), "")


def _plain(text: str) -> str:
    if _PLAIN.fullmatch(text):
        return text
    # What was replaced is in the hash, so that two names stay two.
    return re.sub(r"[^A-Za-z0-9-]+", "_", text) + "_" + hashlib.sha256(text.encode()).hexdigest()[:8]
