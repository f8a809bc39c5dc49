"""The matrix of halts: what a case is, how a unit is set going, and who judges.

A unit of one family is named as another and told to halt, in every way there is to tell it. The judge is the simulated
drive's own log: each word that it took must be one by which its own family halts, and its shaft must turn as before or
stand. A case is one element of all pairs of families times all that can be said, known and turning.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from types import TracebackType
from typing import NamedTuple

import drivebus
from drivebus import Bus, DrivebusError, Profile, Simulator

__all__ = [
    "ALL",
    "FAMILIES",
    "MOTIONS",
    "WAYS",
    "Case",
    "Judge",
    "Machine",
    "cases",
    "own_halts",
    "refusals",
    "sample",
    "set_going",
]

ALL = os.environ.get("DRIVEBUS_MATRIX") == "all"
"""Whether all of it is run, which takes some minutes: `make matrix`."""

FAMILIES = drivebus.profiles()
HALTS = {
    "stop": "stop",
    "coast": "coast",
    "jog_stop": "jog_stop",
    "reset_fault": "reset_fault",
    "stop_all": "stop",
    "block": "run_forward",
    "jog block": "jog_forward",
}
"""What a unit is told, with the command that its name must have for that. A reset halts nothing, and starts nothing."""

WAYS = {
    "python": (tuple(HALTS), ("named", "trusted", "identified")),
    "asyncio": (tuple(HALTS), ("named", "trusted", "identified")),
    "command line": (
        ("stop", "coast", "reset_fault", "stop_all", "jog block"),
        ("named", "trusted", "remembered", "identified"),
    ),
}
"""Who tells it, with what each of them can say and how the name came to it."""

HEEDS_MEMORY = ("stop", "coast", "stop_all")
"""What the command line tells a unit as the family that it was when it was asked last."""

MOTIONS = ("at rest", "forward", "reverse", "tripped")
TURNING = ("forward", "reverse")
OWN_HALTS = ("stop", "coast", "jog_stop")

RECTIFIERS = ("gd600-rectifier", "gd3000-rectifier")
"""They have no motor and no commands; the simulated ones take INVT's words."""
INVT_STOP = (0x2000, 5)

UNLOCKS = {"smd": {(0x0030, 0)}}
"""The word before which a drive that is locked takes nothing, no halt either. It moves nothing."""

_STEP = 25
"""From one case of the sample to the next: one by which the sample meets each kind of case, which a test says."""


class Case(NamedTuple):
    """One unit, and who tells it what.

    Attributes:
        family: What it is.
        named: What it is named as.
        halt: What it is told.
        by: Who tells it.
        known: How it came to that name.
        motion: What it does meanwhile.
    """

    family: str
    named: str
    halt: str
    by: str
    known: str
    motion: str

    @property
    def is_block(self) -> bool:
        """Whether it is the end of a block, which begins by a start."""
        return self.halt.endswith("block")

    @property
    def before(self) -> str:
        """What it does before it is told: nothing starts in a fault, so a block of a program is begun before that."""
        begins_before = self.is_block and self.by != "command line" and self.motion == "tripped"
        return "at rest" if begins_before else self.motion


def cases(family: str, by: str) -> list[Case]:
    """All cases of a unit of *family* that is told by *by*."""
    of_it = Profile.builtin(family).commands()
    halts, ways_to_know = WAYS[by]
    return [
        Case(family, named, halt, by, known, motion)
        for motion in MOTIONS
        if motion not in TURNING or of_it
        if motion != "reverse" or "run_reverse" in of_it
        for named in FAMILIES
        for halt in halts
        if HALTS[halt] in Profile.builtin(named).commands()
        for known in ways_to_know
        if known != "remembered" or halt in HEEDS_MEMORY
        # The command line identifies what nobody named: as what it is, and none of those of which it only knows.
        if (by, known) != ("command line", "identified") or (named == family and halt != "stop_all")
    ]


def sample(family: str, by: str) -> list[Case]:
    """Those of all cases that are run: some, or all where that is asked for."""
    every = cases(family, by)
    if ALL:
        return every
    begin = FAMILIES.index(family) * len(WAYS) + list(WAYS).index(by)
    # What asyncio tells is what Python tells, awaited: half as many show that.
    step = 2 * _STEP if by == "asyncio" else _STEP
    # Of those without a name there is one for each family, and they are few.
    taken = [
        case
        for number, case in enumerate(every)
        if number % step == begin % step or (case.by, case.known) == ("command line", "identified")
    ]
    if by != "python":
        return taken
    # However many families there are, each is named as each other one.
    left_out = {case.named: case for case in every} | {case.named: None for case in taken}
    return taken + [case for case in left_out.values() if case is not None]


def refusals(ends: list[str]) -> list[tuple[str, int, float]]:
    """How a halt is refused at each of *ends*: by every exception, for times that take turns in the sample."""
    whiles = (0.02, 0.5, 2.0, 5.0)
    return [
        (end, exception, seconds)
        for number, end in enumerate(ends)
        for exception in range(0x01, 0x0C)
        for place, seconds in enumerate(whiles)
        if ALL or (number + exception) % len(whiles) == place
    ]


def own_halts(family: str) -> set[tuple[int, int]]:
    """The words by which units of *family* halt, each with its place."""
    if family in RECTIFIERS:
        return {INVT_STOP}
    return _words(family, OWN_HALTS)


def _words(family: str, commands: tuple[str, ...]) -> set[tuple[int, int]]:
    profile = Profile.builtin(family)
    known = [name for name in commands if name in profile.commands()]
    firsts = [first for name in known if (first := profile.command_first(name)) is not None]
    return {*map(profile.command, known), *firsts}


def set_going(simulator: Simulator, family: str, motion: str) -> bool:
    """Has the unit run as its own family, over a bus that is closed again. Whether it does."""
    profile, unit = Profile.builtin(family), simulator.drive(1)
    with Bus(simulator) as bus:
        drive = bus.drive(1, family, unverified=True, trust_profile=True)
        with suppress(DrivebusError):
            drive.prepare_control(store=profile.memory() is None)
        if motion in TURNING:
            for hz in (30.0, None):
                with suppress(DrivebusError):
                    drive.run(hz, reverse=motion == "reverse", force=True)
                    break
            bus.sleep(8.0)
    if motion == "tripped":
        trip(simulator)
        return unit.state == "fault"
    return motion == "at rest" or unit.state == motion


def trip(simulator: Simulator) -> None:
    """Lets the unit trip, and its cause pass."""
    simulator.drive(1).trip(2)
    simulator.advance(10.0)


class Machine:
    """A unit of one family on a line of its own. Cases share it for as long as none of them wrote anything to it.

    Setting a motor going is what costs most, and what nobody wrote to turns as it did. What a program learnt of the
    unit goes with its bus, of which each case has one of its own.
    """

    def __init__(self, family: str) -> None:
        self._family = family
        self._simulator: Simulator | None = None
        self._left: tuple[str, str, int] | None = None

    def put(self, motion: str) -> Simulator:
        """The line, with the unit in *motion*."""
        simulator = self._simulator
        if simulator is not None and self._left == self._now(simulator, motion):
            return simulator
        self.close()
        self._simulator = simulator = Simulator({1: self._family}, transport="process", clock="virtual")
        assert set_going(simulator, self._family, motion), f"{self._family} does not go {motion}"
        self._left = self._now(simulator, motion)
        return simulator

    def close(self) -> None:
        """Ends it."""
        if self._simulator is not None:
            self._simulator.close()

    def __enter__(self) -> Machine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @staticmethod
    def _now(simulator: Simulator, motion: str) -> tuple[str, str, int]:
        unit = simulator.drive(1)
        return motion, unit.state, unit.words_written


class Judge:
    """What a unit took and did since this was made, or since `begin`.

    Attributes:
        has_begun: Whether a block did.
    """

    def __init__(self, simulator: Simulator, case: Case) -> None:
        self._simulator, self._unit, self._case = simulator, simulator.drive(1), case
        self.has_begun = False
        self._begin()

    def begin(self) -> None:
        """A block was begun: from here on it is to be halted. Who trusts a wrong name may start what they like."""
        if self._case.motion == "tripped":
            trip(self._simulator)
        self.has_begun = True
        self._begin()

    def _begin(self) -> None:
        self._before, self._eeprom = self._unit.state, self._unit.eeprom_writes
        self._unit.take_writes()

    def verdict(self, failure: str) -> Iterator[str]:
        """Whatever is wrong, once it is over: it ended with *failure*, which is empty where it ended well."""
        case, unit = self._case, self._unit
        for each in self._wrong(failure):
            yield f"{each}: a {case.family} {self._before}, {case}: {failure or 'it ended well'}"
        unit.take_writes()

    def _wrong(self, failure: str) -> Iterator[str]:
        case, unit, simulator = self._case, self._unit, self._simulator
        own = own_halts(case.family) | UNLOCKS.get(case.family, set())
        if case.halt == "reset_fault":
            own |= _words(case.family, ("reset_fault",))
        foreign = [(place, word) for place, word in self._taken() if (place, word) not in own]
        if foreign:
            yield "it took " + ", ".join(f"{place:04X}H = {word:04X}H" for place, word in foreign)
        if case.is_block and not self.has_begun:
            return  # what a start that failed on the way has done, nobody halts but by words of its own
        if unit.eeprom_writes != self._eeprom and case.halt != "reset_fault":
            yield "its EEPROM was written"
        yield from self._wrong_motion("at once")
        simulator.advance(60.0)
        yield from self._wrong_motion("later")
        turns = unit.state in TURNING or unit.frequency != 0.0
        if case.halt != "reset_fault" and not failure and turns:
            yield "a stop was proved and it turns"
        is_told = case.named == case.family and case.known != "identified"
        if is_told and case.halt in ("stop", "coast", "stop_all", "block") and turns:
            yield "it is what it was named, and was not halted"
        if case.halt != "reset_fault" and failure and self._before in TURNING and not turns:
            yield "it was halted and that was not told"

    def _wrong_motion(self, when: str) -> Iterator[str]:
        state, before = self._unit.state, self._before
        expected = {before, "stopped"} if before in TURNING or self._case.halt == "reset_fault" else {before}
        if state not in expected:
            yield f"it was {'reversed' if before in TURNING else 'started'} {when} ({state})"

    def _taken(self) -> list[tuple[int, int]]:
        """What it took, without the words of a start that was meant and of which nobody could see the end."""
        taken = [(place, word) for _, place, word in self._unit.take_writes()]
        if self._case.is_block and not self.has_begun:
            start = self._start()
            while taken and taken[0] in start:
                del taken[0]
        return taken

    def _start(self) -> set[tuple[int, int]]:
        profile = Profile.builtin(self._case.named)
        command = HALTS[self._case.halt]
        place = profile.command(command)[0]
        lead = {(place, step["word"]) for step in profile.start_sequence()}
        return lead | _words(self._case.named, (command,))
