"""How a line and its units do: how well one is reached, and what was counted.

Plain data: nothing here reads from a line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypedDict

from drivebus.attribute_mapping import Named

__all__ = ["Latency", "Link", "ProgramStats", "Stats", "UnitStats", "noisy"]


@dataclass(frozen=True)
class Link:
    """How well one unit could be reached: its last exchanges, ten at most.

    Attributes: *good*, how many of them brought an answer (a refusal is one), and *asked*, how many there were.
    """

    good: int
    asked: int

    @property
    def failed(self) -> int:
        """How many of them brought no answer, or a damaged one."""
        return self.asked - self.good

    def __str__(self) -> str:
        return f"{self.good} of the last {self.asked} exchanges brought an answer"


def noisy(stats: Mapping[str, Any]) -> list[int]:
    """The units of whom bytes came, by the figures in *stats*, and all of them were no answer."""

    def is_noise(figures: Mapping[str, int]) -> bool:
        came = figures["noise_bytes"] + figures["crc_errors"] + figures["bad_answers"]
        return bool(came) and not figures["answers"] and not figures["refusals"]

    return [unit for unit, figures in stats["units"].items() if is_noise(figures)]


class Latency(Named[str, float]):
    """Seconds that answers took; 0.0 each where none came.

    Attributes: *min*, *mean* and *max*.
    """

    __slots__ = ()

    min: float
    mean: float
    max: float


class UnitStats(Named[str, Any]):
    """Counters of one unit, or of all on a line: a mapping whose names are attributes too.

    Attributes:
        requests: Requests that went out, probes included.
        answers: Right answers.
        refusals: Exceptions.
        timeouts: Requests without an answer in time.
        crc_errors: Answers whose CRC was wrong.
        bad_answers: Whole frames that could not be the answer.
        retries: Requests sent once more.
        verified: Reads asked twice, because the answer to another one might have been taken for theirs.
        not_asked: Calls that were not sent, because the unit was silent before and others use the line.
        resyncs: Requests that found the way back after one was left open, such as echoes.
        late_replies: Whole frames that came before the request went out, or that the unit still owed.
        foreign_frames: Whole frames of others, or of another function, while an answer was waited for.
        noise_bytes: Bytes that belong to no frame.
        noise_idle: Those of them that are 00H or FFH.
        own_echoes: Requests that the adapter sent back.
        other_answers: Requests without an answer in time, but with something else in its place. They count as
            time-outs, too.
        other_functions: Those of them to which the unit sent a whole frame of another function.
        other_transactions: Those of them that were answered under another transaction number of Modbus TCP.
        noise_events: How often bytes came that belong to no frame.
        occupied: Seconds that requests had the line: each from its first bit until its answer was there or waited for
            no more, and the silence after it.
        round_trip: From the first bit of the request to the last byte of the answer.
        delay: From the last character of the request to the first of the answer: how long unit, adapter and this
            computer took.
    """

    __slots__ = ()

    requests: int
    answers: int
    refusals: int
    timeouts: int
    crc_errors: int
    bad_answers: int
    retries: int
    verified: int
    not_asked: int
    resyncs: int
    late_replies: int
    foreign_frames: int
    noise_bytes: int
    noise_idle: int
    own_echoes: int
    other_answers: int
    other_functions: int
    other_transactions: int
    noise_events: int
    occupied: float
    round_trip: Latency
    delay: Latency

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__({key: self._nested(key, value) for key, value in values.items()})

    def _nested(self, name: str, value: Any) -> Any:
        return Latency(value) if name in ("round_trip", "delay") else value


class ProgramStats(TypedDict):
    """What one program asked of a port that it shares with others.

    Keys: *name*, as it calls itself; *process*, its number in the system, 0 of a client over the network; *here*,
    whether it still uses the port; *calls* that it wanted, and how many of them were *answered*.
    """

    name: str
    process: int
    here: bool
    calls: int
    answered: int


class Stats(UnitStats):
    """Counters of a line: those of all its units together, and of each in `units`.

    `stats.answers`, `stats.units[1].timeouts`.

    Attributes:
        reconnects: How often the port was opened again after it was lost.
        settings_changed: How often another program had changed the settings of the open port.
        notes: What the port says of itself, in words.
        wills: What was halted for programs that are gone, in words.
        hints: What the counters most likely mean, and what to do, in words.
        hint_names: The names of the hints.
        programs: The programs that use the port through the one that has it, since that opened it, and the clients that
            it serves over the network now.
        units: The counters of each unit, by its address.
    """

    __slots__ = ()

    reconnects: int
    settings_changed: int
    notes: list[str]
    wills: list[str]
    hints: list[str]
    hint_names: list[str]
    programs: list[ProgramStats]
    units: dict[int, UnitStats]

    def _nested(self, name: str, value: Any) -> Any:
        if name == "units":
            return {address: UnitStats(figures) for address, figures in value.items()}
        return super()._nested(name, value)
