"""What else makes a frequency fall: a drive that ignores a stop meanwhile is never taken for one that obeys it.

Each row is a motor that slows down for a reason of its own when the stop comes. Once its drive ignores the stop, and
nothing may prove it. Once it obeys, and ramps down from where it is: that is proved, and soon where nothing else goes
on. The slave is made by hand and keeps its own motor; words, codes and parameters are those of the GD350 manual,
chapter 9.4: P00.12 is the time from P00.03 to 0 Hz, here 10 s for 50 Hz, so that the drive's own ramp is 5 Hz/s.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import drivebus
import drivebus.aio
from drivebus import Profile, Unconfirmed
from drivebus.line.asking import Read, Stamped, Write
from drivebus.line.blocking import BlockingBus

COMMAND, STATE, FREQUENCY = 0x2000, 0x2100, 0x3000
STOP, COAST = 5, 6
FORWARD, REVERSE, STOPPED = 1, 2, 3
KEYPAD, COMMUNICATION = 1, 2 << 5 | 1
JOG_STOP = 8
RAMP = 5.0
EXCHANGE = 0.016
"""Seconds from a request to its answer: 8 bytes each way at 19 200 bit/s, and the drive's 5 ms."""

Points = Sequence[tuple[float, float]]


def at(points: Points, time: float) -> float:
    """The value at *time* of a line through *points*, which stays as it is before the first and after the last."""
    before = [point for point in points if point[0] <= time]
    after = [point for point in points if point[0] > time]
    if not before or not after:
        return (before[-1] if before else after[0])[1]
    (begin, low), (end, high) = before[-1], after[0]
    return low + (high - low) * (time - begin) / (end - begin)


def wave(middle: float, height: float, slope: float) -> Points:
    """Up and down for ever, and down through *middle* at 0."""
    quarter = height / slope
    return [(quarter * (2 * turn - 1), middle + height * (1 if turn % 2 == 0 else -1)) for turn in range(-10, 200)]


class Explained(NamedTuple):
    """Why the frequency falls. Times are seconds from the moment at which the drive hears the stop.

    Attributes:
        hz: The output frequency, negative in reverse, as long as nothing stops it.
        setpoint: What the drive shows as the setpoint in force.
        parameters: What is set otherwise than for a drive that obeys the bus, by address.
        flash: Below so many hertz its state word says that it is stopped, while it goes on.
        channel: Status word 2.
        delay: Seconds after which a drive that obeys begins its ramp.
    """

    hz: Points
    setpoint: Points
    parameters: dict[int, int] = {}  # noqa: RUF012 - nobody writes to it
    flash: float = 0.0
    channel: int = COMMUNICATION
    delay: float = 0.0


def along_the_ramp(since: float, hz: float, to: float) -> Points:
    return [(since, hz), (since + (hz - to) / RAMP, to)]


EXPLAINED = {
    "a reversal under way": Explained(along_the_ramp(-0.3, 30.0, -30.0), [(0, 30.0)]),
    "a reversal that passes through zero": Explained(along_the_ramp(-6.0, 30.0, -30.0), [(0, 30.0)]),
    "a reversal that looks stopped at zero": Explained(along_the_ramp(-3.0, 30.0, -30.0), [(0, 30.0)], flash=0.2),
    "a current limit": Explained([(0.0, 50.0), (7.5, 20.0)], [(0, 50.0)]),
    "a current limit along the ramp": Explained(along_the_ramp(-0.1, 50.0, 20.0), [(0, 50.0)]),
    "a traverse": Explained(wave(40.0, 4.0, 4.0), [(0, 40.0)]),
    "a traverse along the ramp": Explained(wave(40.5, 4.0, RAMP), [(0, 40.0)]),
    "a PID controller": Explained(along_the_ramp(0.0, 40.0, 5.0), [(0, 40.0)], {0x0006: 7}),
    "a PID controller whose output is the setpoint": Explained(
        along_the_ramp(0.0, 40.0, 5.0), along_the_ramp(0.0, 40.0, 5.0)
    ),
    "an undershoot": Explained([(-8.0, 50.0), (0.0, 10.0), (0.3, 8.5), (1.5, 10.0)], [(-8.1, 50.0), (-8.0, 10.0)]),
    "a setpoint that was lowered": Explained(along_the_ramp(-1.0, 50.0, 10.0), [(-1.1, 50.0), (-1.0, 10.0)]),
    "a flying start": Explained([(-0.1, 50.0), (3.7, 12.0), (11.3, 50.0)], [(0, 50.0)]),
    "a flying start along the ramp": Explained([(-0.1, 50.0), (7.5, 12.0), (15.1, 50.0)], [(0, 50.0)]),
    "a jog that caught the motor": Explained(along_the_ramp(-0.5, 50.0, 5.0), [(0, 50.0)]),
    # Of our own: who else may slow a motor down, in the very moment of the stop and along the very ramp.
    "another bus that commands": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], {0x0002: 1}),
    "terminals that command": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], {0x0001: 1}),
    "a step speed": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], {0x0006: 6}),
    "a setpoint that another master lowers": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0.0, 50.0), (0.001, 10.0)]),
    "a keypad that took over by a key": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], channel=KEYPAD),
    "a setpoint that another master lowers later": Explained(
        along_the_ramp(0.3, 50.0, 10.0), [(0.3, 50.0), (0.301, 10.0)]
    ),
    "a limit that is lowered later": Explained(along_the_ramp(0.3, 50.0, 10.0), [(0, 50.0)]),
    "a motor that rocks": Explained(
        [(0.0, 5.0), (1.2, -1.0), (1.6, 1.0), (2.0, -1.0), (3.2, 5.0)], [(0, 8.0)], flash=0.2
    ),
    "a drive that tells no ramp": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], {0x000C: 0}),
    "a drive that tells no maximum": Explained(along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)], {0x0003: 0}),
    "an upper limit that was lowered": Explained(along_the_ramp(-0.15, 50.0, 10.0), [(0, 50.0)]),
    "a setpoint that rises while the motor falls behind": Explained(
        [(0.0, 40.0), (10.0, 20.0)], [(0.0, 40.0), (3.0, 49.0)]
    ),
    "a short dip along the ramp": Explained([(0.0, 50.0), (0.4, 48.0), (2.4, 50.0)], [(0, 50.0)]),
    "a shallow dip along a slow ramp": Explained([(0.0, 50.0), (1.8, 49.1), (4.0, 50.0)], [(0, 50.0)], {0x000C: 1000}),
    "a dip of the mains": Explained([(0.0, 50.0), (1.0, 42.0), (2.0, 42.0), (4.0, 50.0)], [(0, 50.0)]),
    "a dip of the mains to nothing": Explained([(0.0, 50.0), (5.0, 0.0), (9.0, 0.0), (15.0, 50.0)], [(0, 50.0)]),
    "torque control": Explained([(-5.0, 45.0), (40.0, 5.0)], [(0, 50.0)]),
    "droop under a load that grows": Explained([(0.0, 50.0), (200.0, 20.0)], [(0, 50.0)]),
    "a slow ramp": Explained([(-2.0, 50.0), (58.0, 20.0)], [(0, 50.0)], {0x000C: 1000}),
    "a standstill that is held": Explained(along_the_ramp(-4.0, 50.0, 0.0), [(-4.1, 50.0), (-4.0, 0.0)]),
}

USUAL = {
    "nothing, at its speed": Explained([(0, 50.0)], [(0, 50.0)]),
    "nothing, in reverse": Explained([(0, -30.0)], [(0, 30.0)]),
    "nothing, in a drive that takes its time": Explained([(0, 50.0)], [(0, 50.0)], delay=0.08),
    "nothing, at a low speed": Explained([(0, 4.0)], [(0, 4.0)]),
    "a start": Explained([(-4.0, 0.0), (6.0, 50.0)], [(0, 50.0)]),
    "nothing, on a ramp of a minute": Explained([(0, 50.0)], [(0, 50.0)], {0x000C: 600}),
    "nothing, on a ramp of an hour": Explained([(0, 50.0)], [(0, 50.0)], {0x000C: 36000}),
}


class Slave:
    """A drive whose motor moves as it is *explained*, until it obeys a stop. A bus and the clock as well.

    Attributes:
        commands: The words that came, in order.
        clock: Seconds.
        seems_to_stand: Whether its state word says so all the time.
        failure: What a read of a parameter raises, if it does, and
        failure_takes: after how many seconds.
    """

    reconnects = 0
    closed = False

    def __init__(self, explained: Explained, *, obeys: bool) -> None:
        self._explained, self._obeys = explained, obeys
        self.clock = 1000.0
        self.commands: list[int] = []
        self._heard: float | None = None
        self._ramp: tuple[float, float] | None = None
        self._off = False
        self.seems_to_stand = False
        self.failure: drivebus.DrivebusError | None = None
        self.failure_takes = 0.0
        self._parameters = {0x0001: 2, 0x0002: 0, 0x0003: 5000, 0x0006: 8, 0x000C: 100} | explained.parameters

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float, /) -> None:
        self.clock += seconds

    def link(self, _: int, /) -> drivebus.Link:
        return drivebus.Link(10, 10)

    def read(self, _: int, address: int, count: int = 1, /, **__: object) -> list[int]:
        if self.failure is not None and address < COMMAND:
            self.clock += self.failure_takes
            raise self.failure
        self.clock += EXCHANGE / 2
        words = [self._word(address + offset) for offset in range(count)]
        self.clock += EXCHANGE / 2
        return words

    def read_stamped(self, unit: int, address: int, count: int = 1, /, **_: object) -> tuple[list[int], float, float]:
        return self.read(unit, address, count), self.clock - EXCHANGE, self.clock

    def write(self, _: int, address: int, value: int | Sequence[int], /, **__: object) -> None:
        assert address == COMMAND
        assert isinstance(value, int)
        self.clock += EXCHANGE / 2
        self._heard = self.clock if self._heard is None else self._heard
        self.commands.append(value)
        if self._obeys and value in (STOP, JOG_STOP) and self._ramp is None:
            self._ramp = self.clock + self._explained.delay, self.hz
        self._off |= self._obeys and value == COAST
        self.clock += EXCHANGE / 2

    @property
    def hz(self) -> float:
        """The output frequency, negative in reverse."""
        if self._off:
            return 0.0
        if self._ramp is None:
            return at(self._explained.hz, self._since())
        begun, hz = self._ramp
        slope = 500.0 / (self._parameters[0x000C] or 100)
        left = max(0.0, abs(hz) - slope * max(0.0, self.clock - begun))
        return left if hz >= 0 else -left

    @property
    def stands(self) -> bool:
        return self._off or (self._ramp is not None and self.hz == 0.0)

    def _since(self) -> float:
        """Seconds since it heard the stop, which comes half an exchange after the first request."""
        return self.clock - (1000.0 + EXCHANGE / 2 if self._heard is None else self._heard)

    def _word(self, address: int) -> int:
        hz = self.hz
        if address == STATE:
            looks_stopped = self.stands or self.seems_to_stand or abs(hz) < self._explained.flash
            return STOPPED if looks_stopped else FORWARD if hz >= 0 else REVERSE
        shown = {
            STATE + 1: self._explained.channel,
            STATE + 3: 0x01A0,
            FREQUENCY: round(abs(hz) * 100),
            FREQUENCY + 1: round(at(self._explained.setpoint, self._since()) * 100),
        }
        return shown.get(address, self._parameters.get(address, 0))


class Awaited:
    """The same slave, to be awaited."""

    reconnects = 0
    closed = False

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self.now = slave.now

    def __getattr__(self, name: str) -> Callable[..., Any]:
        asked = getattr(self._slave, name)

        async def answer(*what: Any, **how: Any) -> Any:
            return asked(*what, **how)

        return answer

    async def ask(self, request: Read | Write, /) -> Any:
        return await BlockingBus(self._slave).ask(request)

    async def ask_stamped(self, request: Read, /) -> Stamped:
        return await BlockingBus(self._slave).ask_stamped(request)

    def undisturbed(self) -> AbstractContextManager[Awaited]:
        return nullcontext(self)


def stop_at_once(slave: Slave, confirm: float = 1.0) -> None:
    drivebus.Drive(slave, 1, Profile.builtin("gd350"), 0x01A0).stop(confirm=confirm)


def stop_awaited(slave: Slave) -> None:
    asyncio.run(drivebus.aio.Drive(Awaited(slave), 1, Profile.builtin("gd350"), 0x01A0).stop())


@pytest.fixture(params=[stop_at_once, stop_awaited], ids=["at once", "awaited"])
def stop(request: pytest.FixtureRequest) -> Callable[..., None]:
    told: Callable[..., None] = request.param
    return told


@pytest.mark.parametrize("reason", EXPLAINED)
def test_a_drive_that_ignores_the_stop_is_never_proved(stop: Callable[..., None], reason: str) -> None:
    slave = Slave(EXPLAINED[reason], obeys=False)
    with pytest.raises(Unconfirmed, match=r"stop was sent.*the motor may still turn"):
        stop(slave)
    assert slave.commands == [STOP]


@pytest.mark.parametrize("confirm", [0.1, 30.0])
@pytest.mark.parametrize("reason", EXPLAINED)
def test_nor_is_it_by_more_patience_or_less(reason: str, confirm: float) -> None:
    with pytest.raises(Unconfirmed):
        stop_at_once(Slave(EXPLAINED[reason], obeys=False), confirm=confirm)


@pytest.mark.parametrize("reason", [*EXPLAINED, *USUAL])
def test_a_drive_that_obeys_it_is_proved(stop: Callable[..., None], reason: str) -> None:
    slave = Slave((EXPLAINED | USUAL)[reason], obeys=True)
    stop(slave)
    assert slave.commands == [STOP]


@pytest.mark.parametrize(
    ("reason", "soonest", "latest"),
    [
        # Half a second of the ramp, the looks at it, and one read of how the drive is set.
        ("nothing, at its speed", 0.5, 0.65),
        ("nothing, in reverse", 0.5, 0.65),
        ("nothing, in a drive that takes its time", 0.5, 0.65),
        # 0.83 Hz/s, so 1.2 s for a hertz.
        ("nothing, on a ramp of a minute", 1.2, 1.35),
        ("nothing, on a ramp of an hour", 71.0, 72.2),
        # 20 Hz and 4 Hz at 5 Hz/s, and the standstill itself.
        ("a start", 4.2, 4.4),
        ("nothing, at a low speed", 0.5, 0.65),
    ],
)
def test_an_honest_stop_is_proved_soon(stop: Callable[..., None], reason: str, soonest: float, latest: float) -> None:
    slave = Slave(USUAL[reason], obeys=True)
    begun = slave.now()
    stop(slave)
    assert soonest < slave.now() - begun < latest


@pytest.mark.parametrize(
    "turn",
    [
        pytest.param(lambda drive: drive.run(reverse=True, confirm=0), id="run"),
        pytest.param(lambda drive: drive.jog(reverse=True, confirm=0), id="jog"),
        pytest.param(lambda drive: drive.jog(confirm=0), id="jog that catches it"),
        pytest.param(lambda drive: drive.write_words(COMMAND, 2), id="by its word"),
    ],
)
def test_what_was_told_in_the_very_moment_is_known(turn: Callable[[drivebus.Drive], None]) -> None:
    """Nothing that the drive says tells it from a stop, until it has passed through zero."""
    slave = Slave(Explained(along_the_ramp(0.0, 30.0, -30.0), [(0, 30.0)]), obeys=False)
    slave.seems_to_stand = True
    drive = drivebus.Drive(slave, 1, Profile.builtin("gd350"), 0x01A0)
    turn(drive)  # a motor that seems to stand, so that it is jogged as well
    slave.seems_to_stand = False
    with pytest.raises(Unconfirmed):
        drive.stop()


def test_the_end_of_a_jog_is_its_standstill() -> None:
    """However it falls: what jogs is not at its setpoint, and has a ramp of its own."""
    slave = Slave(USUAL["nothing, at its speed"], obeys=True)
    drivebus.Drive(slave, 1, Profile.builtin("gd350"), 0x01A0).jog_stop()
    assert slave.stands


@pytest.mark.parametrize(
    ("failure", "takes"),
    [
        (drivebus.Refused("locked", code=9), EXCHANGE),
        (drivebus.NoAnswer("silent", started=1.0), 4.5),
        (drivebus.BadAnswer("noise", started=1.0), 1.5),
    ],
    ids=["refused", "silent", "spoilt"],
)
@pytest.mark.parametrize("obeys", [False, True])
def test_a_drive_that_does_not_tell_how_it_is_set_is_proved_by_its_standstill(
    stop: Callable[..., None], failure: drivebus.DrivebusError, takes: float, obeys: bool
) -> None:
    slave = Slave(Explained([(0.0, 50.0)] if obeys else along_the_ramp(0.0, 50.0, 10.0), [(0, 50.0)]), obeys=obeys)
    slave.failure, slave.failure_takes = failure, takes
    with nullcontext() if obeys else pytest.raises(Unconfirmed):
        stop(slave)
    assert slave.stands == obeys


@given(
    setpoint=st.integers(500, 5000),
    above=st.integers(-1000, 1000),
    since=st.floats(-3.0, 1.0),
    slope=st.floats(0.5, 20.0),
    depth=st.floats(0.0, 1.0),
)
@settings(max_examples=100, deadline=None)
def test_only_the_drives_own_ramp_from_its_setpoint_passes(
    setpoint: int, above: int, since: float, slope: float, depth: float
) -> None:
    """Any fall to anywhere, ignoring the stop: what passes cannot be told from a stop by anybody."""
    first = max(200, setpoint + (0 if abs(above) < 500 else above)) / 100
    to = first * (1 - depth)
    fall = [(since, first), (since + (first - to) / slope + 1e-9, to)]
    slave = Slave(Explained(fall, [(0, setpoint / 100)]), obeys=False)
    try:
        stop_at_once(slave)
    except Unconfirmed:
        return
    for moment in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5):
        begun = max(0.0, moment - max(0.0, min(since, 0.1)))
        assert at(fall, moment) == pytest.approx(setpoint / 100 - RAMP * begun, abs=0.2)
