"""What the page is given: what it shows, and what it may order. Whoever starts it fills this in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

from drivebus.sinks.picture import Picture

__all__ = ["Happened", "Person", "Shown", "ShownDrive", "Told"]


@dataclass(frozen=True)
class Person:
    """Who may log in.

    Attributes:
        name: What one types.
        password: The hash of the password.
        role: `"look"`, or `"command"` who may order, too.
    """

    name: str
    password: str = field(repr=False)
    role: Literal["look", "command"] = "look"


@dataclass(frozen=True)
class ShownDrive:
    """A drive of the file.

    Attributes:
        name: What it is called.
        line: The line that it hangs on.
        unit: Its address.
        family: What it is, in words; empty where no profile says.
        may: What may be ordered of it: `"run"`, `"setpoint"`, `"reset"`, `"stop"`, `"coast"`.
        why_not: Why it cannot be stopped from here, where that is so.
        hold: Seconds between two samples of a value that stays the same, at most; 0: nothing is kept of it.
    """

    name: str
    line: str
    unit: int
    family: str
    may: frozenset[str] = frozenset()
    why_not: str = ""
    hold: float = 0.0


class Happened(NamedTuple):
    """Something that happened: Unix time in seconds, to whom, of which kind, and in words."""

    time: float
    subject: str
    kind: str
    text: str


class Told(NamedTuple):
    """An order as it was given: to which drive, what, at how many Hz, whether in reverse, by whom and from where.

    It is not to be sent later than `until`, in seconds of `time.monotonic`.
    """

    drive: str
    what: str
    hz: float | None
    reverse: bool
    person: str
    address: str
    until: float


@dataclass(frozen=True)
class Shown:
    """A plant, as the page sees it. Each call may come from any thread.

    Attributes:
        title: What the plant is called.
        drives: Its drives by name, in the order of the file.
        people: Who may log in.
        look: Gives how it is now.
        events: Gives what happened, the oldest first.
        order: Carries an order out; its result, such as "done" or "not sent", and what more there is to say.
        stop_all: Stops all drives that can be, for a person at an address; the same for each by its name.
        started: Gives who set which drive in motion by the page, by the name of the drive.
        here: Hears that a person gave a sign of life.
        tell: Hears in words what people should know.
        dead_man: Seconds without a sign of life after which what somebody set in motion is halted; None: never.
        spool: The file of samples, if there is one.
        audit: The file of writes over the network, if there is one.
    """

    title: str
    drives: Mapping[str, ShownDrive]
    people: Sequence[Person]
    look: Callable[[], Picture]
    events: Callable[[], Iterable[Happened]]
    order: Callable[[Told], tuple[str, str]]
    stop_all: Callable[[str, str], Mapping[str, tuple[str, str]]]
    started: Callable[[], Mapping[str, str]]
    here: Callable[[str], None]
    tell: Callable[[str], None]
    dead_man: float | None = None
    spool: Path | None = None
    audit: Path | None = None
