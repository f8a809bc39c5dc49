"""The panel leaves no motor running whose drive refuses to be halted for a while: by Space, by its end, by a signal.

The whole panel runs in this process, from its command to its last motor; only the terminal is textual's own for tests,
and the line's time is virtual. `test_panel_stops` has a real terminal, and nobody who refuses.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

pytest.importorskip("textual")
if sys.platform == "win32":
    pytest.skip("needs the signals of POSIX", allow_module_level=True)

from textual.app import App
from textual.pilot import Pilot

import drivebus
from drivebus import Bus, Simulator
from drivebus.cli.panel import program
from drivebus.cli.panel.app import Panel
from drivebus.cli.present.output import Output
from drivebus.cli.session import DEFAULT_BAUD, DEFAULT_FORMAT, Session

from .matrix import ALL

COMMAND, FORWARD, STOP, COAST = 0x2000, 1, 5, 6
SECONDS = (0.02, 0.5, 2.0, 5.0)
EXCEPTIONS = range(0x01, 0x0C)
"""Of the Modbus specification (V1.1b3, section 7): some say that they pass, and others that they do not."""
CASES = [(exception, seconds) for exception in EXCEPTIONS for seconds in SECONDS]
if not ALL:
    # Prime to how many times there are: each of them is met.
    CASES = CASES[::5]


class Shown:
    """One panel under a test, with the drive that it shows."""

    def __init__(self, panel: Panel, pilot: Pilot[object], simulator: Simulator) -> None:
        self.panel, self._pilot, self.simulator = panel, pilot, simulator
        [self.member] = panel.members
        self.unit = simulator.drive(1)

    async def until(self, holds: Callable[[], object]) -> None:
        """Gives the screen its turns until it is so; the limit is the test's own."""
        limit = time.monotonic() + 60.0
        while not holds():
            assert time.monotonic() < limit, self.said(0)
            await self._pilot.pause(0.005)

    async def press(self, *keys: str) -> None:
        await self._pilot.press(*keys)

    async def start(self, whose: str = "its own") -> None:
        """Has the motor run: by the panel, or by another program of which the panel knows nothing."""
        await self.until(lambda: self.member.drive)
        drive, motor = self.member.drive, self.member.motor
        assert drive is not None
        if whose == "its own":
            since = self.panel.journal.count
            motor.run(drive, 20.0, False, motor.stops)
            await self.until(lambda: self.said(since))
        else:
            with Bus(self.simulator) as bus:
                bus.drive(1, "gd350").run(20.0)
        self.simulator.advance(5.0)
        assert (self.unit.state, self.unit.frequency) == ("forward", 20.0), self.said(0)
        self.unit.take_writes()

    async def until_stopped(self, since: int) -> None:
        """Until the panel has said what came of the stop that it said first behind the line *since*."""
        await self.until(lambda: len(self.said(since)) > 1 and not self.member.motor.started)

    def said(self, since: int) -> list[str]:
        """What the panel said behind the first *since* lines."""
        new = self.panel.journal.count - since
        return [line.text for line in self.panel.journal.lines()[-new:]] if new else []

    def refuse(self, exception: int, seconds: float) -> None:
        """Has the drive refuse whatever is written to it, from the moment at which the panel is about to stop it."""
        motor, stop = self.member.motor, self.member.motor.stop
        self._since, self._seconds = self.simulator.now(), seconds

        def stop_refused() -> None:
            del motor.stop
            self.unit.refuse(exception, asked="writes", seconds=seconds)
            stop()

        motor.stop = stop_refused  # type: ignore[method-assign]

    def judge(self) -> None:
        """What the drive did, once nobody tells it anything any more."""
        frames = [frame for at, who, frame in self.simulator.line.trace() if at >= self._since and who == "unit"]
        # What the panel asks meanwhile takes time of the line as well: of the shortest refusal all of it.
        assert self._seconds == min(SECONDS) or any(frame[1] in (0x86, 0x90) for frame in frames)
        self.simulator.advance(60.0)
        assert (self.unit.state, self.unit.frequency) == ("stopped", 0.0), self.said(0)
        assert {word for _, place, word in self.unit.take_writes() if place == COMMAND} <= {STOP, COAST}


def run_panel(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch, work: Callable[[Shown], Awaitable[None]]
) -> program.Ended:
    """The panel on *simulator* to its end, with *work* for the person before it."""
    failed: list[BaseException] = []

    def run(panel: Panel, **_: object) -> None:
        async def person(pilot: Pilot[object]) -> None:
            try:
                await work(Shown(panel, pilot, simulator))
            except BaseException as error:
                failed.append(error)
                panel.exit()

        App.run(panel, headless=True, size=(80, 24), auto_pilot=person)

    def opened(_: object, **settings: Any) -> Bus:
        return Bus(simulator, **settings)

    monkeypatch.setattr(Panel, "run", run)
    monkeypatch.setattr(drivebus, "Bus", opened)
    # Nothing here is judged by how long a busy machine takes for a screen.
    monkeypatch.setattr(program, "_PATIENCE", 600.0)
    session = Session("/dev/panel", DEFAULT_BAUD, DEFAULT_FORMAT, 1, "gd350", Output(False))
    ended = program.run(session, None)
    if failed:
        raise failed[0]
    return ended


@pytest.fixture
def simulator() -> Any:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        with Bus(simulator) as bus:
            drive = bus.drive(1)
            drive.prepare_control()
            drive.write({"P00.11": 2.0, "P00.12": 2.0})
        yield simulator


@pytest.mark.parametrize("whose", ["its own", "another's"])
def test_space_stops_it(simulator: Simulator, monkeypatch: pytest.MonkeyPatch, whose: str) -> None:
    """One after another on one panel: each begins from standstill."""
    tried = 0

    async def person(shown: Shown) -> None:
        nonlocal tried
        for exception, seconds in CASES:
            await shown.start(whose)
            since = shown.panel.journal.count
            shown.refuse(exception, seconds)
            await shown.press("space")
            await shown.until_stopped(since)
            assert "stop confirmed" in shown.said(since)[-1], shown.said(since)
            shown.judge()
            tried += 1
        await shown.press("q")

    ended = run_panel(simulator, monkeypatch, person)
    assert (ended.failures, ended.mistake, tried) == ([], None, len(CASES))


async def leave(shown: Shown) -> None:
    await shown.press("q")
    await shown.press("y")


async def terminate(_: Shown) -> None:
    signal.raise_signal(signal.SIGTERM)


ENDS = {"q": (leave, 0), "SIGTERM": (terminate, signal.SIGTERM)}


@pytest.mark.parametrize(("exception", "seconds"), CASES)
@pytest.mark.parametrize("end", ENDS)
def test_its_end_stops_it(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch, end: str, exception: int, seconds: float
) -> None:
    give, number = ENDS[end]
    panels: list[Shown] = []

    async def person(shown: Shown) -> None:
        panels.append(shown)
        await shown.start()
        shown.refuse(exception, seconds)
        await give(shown)

    ended = run_panel(simulator, monkeypatch, person)
    assert (ended.failures, ended.mistake, ended.signal) == ([], None, number)
    [shown] = panels
    shown.judge()
