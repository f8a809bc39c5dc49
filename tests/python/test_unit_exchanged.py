"""Another drive hangs at the address since the line identified one, and the port did not notice: a cable was moved.

What goes out first is the halt of the drive that was there. What is there now is asked anew where it does not show that
halt, and where it shows it, too, if nobody asked it for a while: it may show it in the words of its own family. Then it
is halted as what it is. 2000H = 5 runs an EDS300 (its manual, p. 46), and 1 a Goodrive (GD350 manual, chapter 9.4.5).
"""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from typing import NamedTuple

import pytest

from drivebus import Bus, Drive, DrivebusError, NoAnswer, NotStopped, Simulator, Unconfirmed
from drivebus.line.asking import Read, Write
from drivebus.line.blocking import BlockingBus


class Cable:
    """A serial server whose line leads to one of two drives: what comes goes there, and the answers come back."""

    def __init__(self, *places: str) -> None:
        self._places = [place.removeprefix("socket://").rsplit(":", 1) for place in places]
        self._to = 0
        self._server = socket.create_server(("127.0.0.1", 0))
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    @property
    def port(self) -> str:
        return f"socket://127.0.0.1:{self._server.getsockname()[1]}"

    def move(self) -> None:
        """Hangs the other drive at the line."""
        self._to = 1

    def close(self) -> None:
        self._server.close()
        self._thread.join()

    def _carry(self) -> None:
        """Until the client goes."""
        with ExitStack() as opened, suppress(OSError):
            client = opened.enter_context(self._server.accept()[0])
            drives = [opened.enter_context(socket.create_connection((host, int(port)))) for host, port in self._places]
            while True:
                for ready in select.select([client, *drives], [], [])[0]:
                    received = ready.recv(4096)
                    if not received:
                        return
                    (drives[self._to] if ready is client else client).sendall(received)


class Line(NamedTuple):
    """The drive that is there first, which a program ran and stopped; the one that comes; and the cable to both."""

    bus: Bus
    drive: Drive
    cable: Cable
    comes: Simulator


@pytest.fixture
def line(request: pytest.FixtureRequest) -> Iterator[Line]:
    was, now = request.param
    with (
        Simulator({1: was}, transport="tcp") as before,
        Simulator({1: now}, transport="tcp") as after,
    ):
        # The one that comes takes its commands from the bus, as in the plant that it comes from.
        with Bus(after.port) as bus, suppress(DrivebusError):
            bus.drive(1, now, unverified=True).prepare_control(store=True)
        with closing(Cable(before.port, after.port)) as cable, Bus(cable.port, timeout=1.0) as bus:
            drive = bus.drive(1, was, unverified=True)
            with suppress(DrivebusError):
                drive.prepare_control(store=True)
            # What a busy machine answers late is no bad link.
            drive.run(1.0, force=True)
            with suppress(DrivebusError):
                drive.stop()
            drive.wait_until_stopped(timeout=30.0)
            after.drive(1).take_writes()
            yield Line(bus, drive, cable, after)


def runs(unit: Simulator) -> bool:
    return unit.drive(1).state in ("forward", "reverse")


@pytest.mark.parametrize("line", [("gd350", "eds300"), ("ms300", "gd35"), ("eds300", "gd20")], indirect=True)
@pytest.mark.parametrize("by", ["stop", "stop_all"])
def test_one_that_the_halt_of_another_started_is_halted_as_itself(
    line: Line, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = BlockingBus.now
    line.cable.move()
    # It is long ago that it said what it is.
    monkeypatch.setattr(BlockingBus, "now", lambda bus: now(bus) + 20.0)
    with suppress(DrivebusError):
        line.drive.stop() if by == "stop" else line.bus.stop_all()
    assert not runs(line.comes)
    # From now on the line knows better: nothing that starts it goes out.
    line.comes.drive(1).take_writes()
    with suppress(DrivebusError):
        line.drive.stop()
    assert not runs(line.comes)
    sent = {word for _, place, word in line.comes.drive(1).take_writes() if place == 0x2000}
    assert sent <= {5, 6} if line.comes.drive(1).profile.startswith("gd") else 5 not in sent


@pytest.mark.parametrize("line", [("gd350", "ms300"), ("eds300", "sunfar-e300")], indirect=True)
def test_what_shows_no_halt_is_asked_what_it_is(line: Line) -> None:
    """However lately the one before it told: a halt that nothing shows is reason enough."""
    line.cable.move()
    with suppress(DrivebusError):
        line.drive.coast(confirm=0.3)
    assert not runs(line.comes)


@pytest.mark.parametrize("line", [("gd350", "ms300")], indirect=True)
def test_an_answer_that_is_lost_leaves_it_not_running(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is asked what it is until it says so: the line lost the first two answers."""
    ask = BlockingBus.ask
    lost: list[Read] = []

    async def lost_twice(bus: BlockingBus, request: Read | Write) -> list[int] | None:
        # Before a halt it is given less time to answer.
        if isinstance(request, Read) and request.timeout is not None and len(lost) < 2:
            lost.append(request)
            raise NoAnswer("lost", unit=request.unit, started=0.0)
        return await ask(bus, request)

    monkeypatch.setattr(BlockingBus, "ask", lost_twice)
    line.cable.move()
    with suppress(DrivebusError):
        line.drive.coast(confirm=0.3)
    assert len(lost) == 2
    assert not runs(line.comes)


@pytest.mark.parametrize("line", [("gd350", "eds300")], indirect=True)
def test_a_value_is_not_written_to_it_afterwards(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    now = BlockingBus.now
    line.cable.move()
    # It is long ago that it said what it is.
    monkeypatch.setattr(BlockingBus, "now", lambda bus: now(bus) + 20.0)
    with suppress(DrivebusError):
        line.drive.stop()
    before = line.comes.drive(1).eeprom_writes
    with pytest.raises(DrivebusError, match="nothing was written"):
        line.drive.write_words(0x000B, 20)
    assert line.comes.drive(1).eeprom_writes == before


class TestTheSameOne:
    """It is what it was, and is asked no more than that takes."""

    @pytest.fixture
    def one(self) -> Iterator[tuple[Simulator, Bus, Drive]]:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            drive = bus.drive(1, "gd350")
            drive.prepare_control()
            drive.run(20.0)
            yield simulator, bus, drive

    def asked(self, simulator: Simulator, since: int) -> list[bytes]:
        return [frame for _, who, frame in simulator.line.trace()[since:] if who == "master"]

    def test_one_that_told_lately_is_not_asked(self, one: tuple[Simulator, Bus, Drive]) -> None:
        simulator, _, drive = one
        before = len(simulator.line.trace())
        drive.stop()
        assert not [frame for frame in self.asked(simulator, before) if frame[2:4] == b"\x21\x03"]

    def test_one_that_told_long_ago_is_asked_behind_the_proof(self, one: tuple[Simulator, Bus, Drive]) -> None:
        simulator, bus, drive = one
        bus.sleep(3600.0)
        before = len(simulator.line.trace())
        drive.stop()
        frames = self.asked(simulator, before)
        assert frames[0][1] == 0x06
        assert [frame[2:4] for frame in frames].count(b"\x21\x03") == 1
        assert frames[-1][2:4] == b"\x21\x03"

    def test_a_halt_that_it_does_not_show_is_told_and_sent_once(self, one: tuple[Simulator, Bus, Drive]) -> None:
        """Its terminals command it: it takes the word, and turns on."""
        simulator, bus, drive = one
        drive.write("P00.01", 1)
        simulator.drive(1).inputs = 1
        bus.sleep(5.0)
        simulator.drive(1).take_writes()
        with pytest.raises((Unconfirmed, NotStopped)):
            drive.stop()
        assert [word for _, place, word in simulator.drive(1).take_writes() if place == 0x2000] == [5]
