"""Where conversations are noted: a simulated drive in virtual time, how it stands, and what goes wrong meanwhile.

A `Mishap` is put on a `Stage` before the conversation begins, or at one of its requests, which are counted from 0. At
which, a conversation in which nothing goes wrong tells: so the answer that is lost may be that of the command.
"""

from __future__ import annotations

import zlib
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from typing import NamedTuple

from drivebus import Bus, DrivebusError, Profile, Simulator, profiles
from drivebus.line.asking import Read, Write

from .recorded_bus import UNIT

__all__ = ["COMMON", "MISHAPS", "NO_REQUEST", "Counts", "Mishap", "Stage", "stage_of"]

TIMEOUT, LATE = 0.06, 0.1
"""Seconds that an answer is waited for, and that one is late: short, so that silence takes few looks."""

HZ = 2.0
"""What a motor turns at: slow, so that it stands soon."""

_EVER = 1_000_000
_OTHER_UNIT = 2
_FAULT = 2


class Counts(NamedTuple):
    """Of a conversation: how many requests it had, and which of them was the first write, and the last."""

    requests: int
    first_write: int | None
    last_write: int | None


NO_REQUEST = Counts(0, None, None)

NOTED = [name for name in profiles() if Profile.builtin(name).requests().protocol == "modbus"]
"""What is noted is what they are asked in Modbus."""


def others_of(family: str) -> list[str]:
    """Two families whose drives are halted by other words than those of *family*, and than each other's."""
    names = NOTED
    begin = names.index(family)
    found: list[str] = []
    halts = [_halts(family)]
    for name in (*names[begin + 1 :], *names[:begin]):
        if _halts(name) and _halts(name) not in halts:
            found.append(name)
            halts.append(_halts(name))
    return found[:2]


def _halts(family: str) -> set[tuple[int, int]]:
    profile = Profile.builtin(family)
    return {profile.command(name) for name in ("stop", "coast") if name in profile.commands()}


@dataclass
class Stage:
    """A line with one drive on it, and what goes wrong at which request.

    Attributes:
        simulator: The line.
        bus: What asks over it.
        family: The family that the unit is named as.
        at: What is done before a request goes out, by its number.
        moved_at: From which request on another drive answers at the address.
        words: What the unit says in the place of what it has, by address.
        counts: What was asked so far.
    """

    simulator: Simulator
    bus: Bus
    family: str
    at: defaultdict[int, list[Callable[[], object]]] = field(default_factory=lambda: defaultdict(list))
    moved_at: int = _EVER
    words: dict[int, int] = field(default_factory=dict)
    counts: Counts = field(default_factory=lambda: NO_REQUEST)

    def before(self, request: Read | Write) -> Read | Write:
        """What goes out in the place of *request*."""
        number, first, _ = self.counts
        for act in self.at[number]:
            act()
        if isinstance(request, Write):
            self.counts = Counts(number + 1, number if first is None else first, number)
        else:
            self.counts = self.counts._replace(requests=number + 1)
        return request._replace(unit=_OTHER_UNIT) if number >= self.moved_at else request

    def after(self, read: Read, words: Sequence[int]) -> list[int]:
        """What is taken for the answer to *read* where *words* came."""
        if read.table != "holding":
            return list(words)
        return [self.words.get(read.address + place, word) for place, word in enumerate(words)]


class Mishap(NamedTuple):
    """What goes wrong, or stands otherwise than it should.

    Attributes:
        put: Puts it on the stage of a conversation that had so many requests without it; None: nothing goes wrong.
        stands: How the drive stands when it begins.
        is_of_writes: Whether it takes a write to meet it.
        other: Which of `others_of` the unit is in truth; None: it is what it is named as.
    """

    put: Callable[[Stage, Counts], object] | None = None
    stands: str = "ready"
    is_of_writes: bool = False
    other: int | None = None


def stage_of(family: str, stands: str, other: int | None, seed: str, left: ExitStack) -> Stage:
    """A drive that *stands* so. What random choices there are depend on *seed* alone."""
    others = others_of(family)
    real = family if other is None else others[other]
    number = zlib.crc32(seed.encode())
    simulator = left.enter_context(
        Simulator(
            {UNIT: real, _OTHER_UNIT: others[0]}, baudrate=9600, transport="process", clock="virtual", seed=number
        )
    )
    _stand(simulator, real, stands)
    bus = left.enter_context(Bus(simulator, timeout=TIMEOUT, retries=1))
    # So that the bus knows what the refusals of the family mean, and which commands it has.
    bus.drive(UNIT, family, unverified=True)
    return Stage(simulator, bus, family)


def _stand(simulator: Simulator, family: str, stands: str) -> None:
    """Has the unit stand so, over a bus that is closed again."""
    if stands == "keypad":
        return
    profile = Profile.builtin(family)
    with Bus(simulator) as bus:
        drive = bus.drive(UNIT, family, unverified=True, trust_profile=True)
        with suppress(DrivebusError):
            drive.prepare_control(store=profile.memory() is None)
        if stands in ("forward", "reverse", "fast"):
            for hz in (30.0 if stands == "fast" else HZ, None):
                with suppress(DrivebusError):
                    drive.run(hz, reverse=stands == "reverse", force=True)
                    break
            bus.sleep(8.0)
    if stands == "tripped":
        simulator.drive(UNIT).trip(_FAULT)
        simulator.advance(10.0)


def _half(counts: Counts) -> int:
    return counts.requests // 2


def _first(act: Callable[[Stage], object]) -> Mishap:
    return Mishap(lambda stage, _: stage.at[0].append(lambda: act(stage)))


def _at_command(act: Callable[[Stage], object]) -> Mishap:
    """At the first write: the command, or the first of several words."""
    return Mishap(lambda stage, counts: stage.at[counts.first_write or 0].append(lambda: act(stage)), is_of_writes=True)


def _half_way(act: Callable[[Stage], object]) -> Mishap:
    return Mishap(lambda stage, counts: stage.at[_half(counts)].append(lambda: act(stage)))


def _no_voltage(stage: Stage, _: Counts) -> None:
    profile = Profile.builtin(stage.family)
    state = profile.role("state")
    place = None if state is None else profile.describe(state).place
    if place is None:
        return
    word = next((word for word in range(0x10000) if profile.state(word) == "power_off"), None)
    if word is not None:
        stage.words[place] = word


def _moved(stage: Stage, counts: Counts) -> None:
    stage.moved_at = _half(counts)


def _halted(stage: Stage, counts: Counts) -> None:
    """Somebody else on the line tells it to halt just before the last word goes out."""
    other = stage.bus.drive(UNIT, stage.family, unverified=True, trust_profile=True)

    def halt() -> None:
        with suppress(DrivebusError):
            other.coast(confirm=0.0)

    stage.at[counts.last_write or 0].append(halt)


def _port_lost(stage: Stage, counts: Counts) -> None:
    stage.at[_half(counts)].append(stage.simulator.line.unplug)
    stage.at[_half(counts) + 1].append(stage.simulator.line.replug)


def _bad_link(stage: Stage, _: Counts) -> None:
    stage.simulator.line.drop_answers(3)
    for _each in range(3):
        with suppress(DrivebusError):
            stage.bus.read(UNIT, 0x2100, retries=0)


MISHAPS: dict[str, Mishap] = {
    "none": Mishap(),
    "first answer lost": _first(lambda stage: stage.simulator.line.drop_answers(1)),
    "first two answers lost": _first(lambda stage: stage.simulator.line.drop_answers(2)),
    "every answer lost": _first(lambda stage: stage.simulator.line.drop_answers(_EVER)),
    "first answer damaged": _first(lambda stage: stage.simulator.line.script([(1, "flip_bit"), (2, "flip_bit")])),
    "first answer late": _first(lambda stage: stage.simulator.line.delay_answers(LATE, 1)),
    "answer to command lost": _at_command(lambda stage: stage.simulator.line.drop_answers(1)),
    "all lost from command on": _at_command(lambda stage: stage.simulator.line.drop_answers(_EVER)),
    "answer to command damaged": _at_command(lambda stage: stage.simulator.line.script([(1, "flip_bit")])),
    "answer to command late": _at_command(lambda stage: stage.simulator.line.delay_answers(LATE, 1)),
    "busy": _first(lambda stage: stage.simulator.drive(UNIT).refuse(0x06)),
    "busy at first": _first(lambda stage: stage.simulator.drive(UNIT).refuse(0x06, count=3)),
    "refused 04": _first(lambda stage: stage.simulator.drive(UNIT).refuse(0x04)),
    "locked 09": _first(lambda stage: stage.simulator.drive(UNIT).refuse(0x09)),
    "write busy": _at_command(lambda stage: stage.simulator.drive(UNIT).refuse(0x06, asked="writes")),
    "write busy at first": _at_command(lambda stage: stage.simulator.drive(UNIT).refuse(0x06, asked="writes", count=2)),
    "write refused 04": _at_command(lambda stage: stage.simulator.drive(UNIT).refuse(0x04, asked="writes")),
    "write taken 05": _at_command(lambda stage: stage.simulator.drive(UNIT).refuse(0x05, asked="writes", taken=True)),
    "in fault": Mishap(stands="tripped"),
    "trips half-way": _half_way(lambda stage: stage.simulator.drive(UNIT).trip(_FAULT)),
    "no voltage": Mishap(_no_voltage),
    "switched off and on": _half_way(lambda stage: stage.simulator.drive(UNIT).power_cycle()),
    "keypad": Mishap(stands="keypad"),
    "running": Mishap(stands="forward"),
    "running in reverse": Mishap(stands="reverse"),
    "another family": Mishap(other=0),
    "another family, 2": Mishap(other=1),
    "another family, running": Mishap(stands="forward", other=0),
    "gone half-way": _half_way(lambda stage: stage.simulator.line.drop_answers(_EVER)),
    "exchanged half-way": Mishap(_moved),
    "halted meanwhile": Mishap(_halted, is_of_writes=True),
    "port lost": Mishap(_port_lost),
    "closed half-way": _half_way(lambda stage: stage.bus.close()),
    "bad link": Mishap(_bad_link),
    "noise": _first(lambda stage: stage.simulator.line.set_faults(silence=0.2, flip_bit=0.2)),
}
"""What may go wrong, by its name."""

COMMON = (
    "first answer lost",
    "every answer lost",
    "first answer damaged",
    "first answer late",
    "answer to command lost",
    "busy",
    "refused 04",
    "in fault",
    "no voltage",
    "keypad",
    "running",
    "another family",
    "gone half-way",
)
"""Those that a plant meets most, and that are noted most often."""
