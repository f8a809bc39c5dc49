"""The drive's own time-out: what is set, what is given back, and when the drive is left to act.

In virtual time, and with time-outs so long that the thread, which keeps real time, never wakes up; but where it is what
the test is about. P14.04 and P14.05: GD300 manual, p. 122. What a program's death leaves behind is in
test_end_of_program.py.
"""

from __future__ import annotations

import itertools
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, Simulator
from drivebus.line.asking import Read, Stamped
from drivebus.line.blocking import BlockingBus

RAM, ACTION, TIMEOUT = 0x8000, 0x0E05, 0x0E04
CE = 18
PROFILE = Path(__file__).parents[2] / "crates/drives/profiles/gd350"


def settings(simulator: Simulator) -> tuple[int, int]:
    drive = simulator.drive(1)
    return drive.register(TIMEOUT), drive.register(ACTION)


def written(simulator: Simulator) -> list[tuple[int, int]]:
    """What the drive took of the two parameters, in order."""
    taken = [(address, value) for _, address, value in simulator.drive(1).writes()]
    return [(address & ~RAM, value) for address, value in taken if address & ~RAM in (TIMEOUT, ACTION)]


def test_it_is_set_in_ram_action_first_and_put_back_time_out_first(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.write("P14.05", 1, unverified=True)
    with virtual_drive.watchdog(30.0, "stop", unverified=True) as watchdog:
        assert settings(virtual) == (300, 3)
        assert (watchdog.armed, watchdog.timeout, watchdog.action) == (True, 30.0, "stop")
        assert "unverified" in repr(watchdog)
    assert written(virtual)[1:] == [(ACTION, 3), (TIMEOUT, 300), (TIMEOUT, 0), (ACTION, 1)]
    assert (watchdog.armed, watchdog.error) == (False, None)
    assert virtual.drive(1).eeprom_writes == 0


def test_a_family_without_an_action_trips_and_says_what_that_leaves_open() -> None:
    """VFD500 manual, p. 97: a slave that hears nothing for P30.05 trips Er.485, which is fault 34 on p. 136."""
    with Simulator({1: "vfd500"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive, simulated = bus.drive(1, "vfd500"), simulator.drive(1)
        with pytest.raises(drivebus.NotAllowed, match="may keep running"):
            drive.watchdog(30.0, "trip")
        with pytest.raises(drivebus.NotAllowed, match="allowed is trip"):
            drive.watchdog(30.0, unverified=True)
        assert simulated.words_written == 0
        with drive.watchdog(30.0, "trip", unverified=True) as watchdog:
            assert (simulated.register(0x1E05), watchdog.armed) == (300, True)
        # Plain addresses are RAM alone here.
        assert [(address, value) for _, address, value in simulated.take_writes()] == [(0x1E05, 300), (0x1E05, 0)]
        assert simulated.eeprom_writes == 0
        watchdog = drive.watchdog(30.0, "trip", unverified=True)
        simulator.advance(31.0)
        assert simulated.fault == 34
        watchdog.close()


@pytest.mark.parametrize(
    ("ramp", "hz"),
    [
        pytest.param(100.0, 10.0, id="for half the time-out"),
        pytest.param(3600.0, 0.2, id="though its frequency falls a step in 0.7 s"),
    ],
)
def test_a_motor_that_stops_is_waited_for(virtual: Simulator, virtual_drive: Drive, ramp: float, hz: float) -> None:
    virtual_drive.write("P00.12", ramp)  # seconds from 50 Hz
    with virtual_drive.watchdog(40.0, unverified=True), virtual_drive.running(hz, confirm=5.0):
        virtual_drive.wait_for_speed(timeout=100)
    assert settings(virtual) == (0, 0)
    virtual.advance(100)
    assert (virtual.drive(1).state, virtual.drive(1).fault) == ("stopped", 0)


def test_a_motor_that_goes_on_is_left_to_the_drive(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(10.0)
    virtual_drive.wait_for_speed(timeout=100)
    with virtual_drive.watchdog(40.0, unverified=True) as watchdog:
        pass
    assert (settings(virtual), watchdog.armed) == ((400, 0), True)
    virtual.advance(39)
    assert virtual.drive(1).state == "forward"
    virtual.advance(2)
    assert (virtual.drive(1).state, virtual.drive(1).fault) == ("fault", CE)


def test_one_that_cannot_be_asked_is_left_to_the_drive(virtual: Simulator, virtual_drive: Drive) -> None:
    watchdog = virtual_drive.watchdog(40.0, unverified=True)
    virtual.line.drop_answers(1000)
    watchdog.close()
    assert isinstance(watchdog.error, drivebus.NoAnswer)
    assert "NoAnswer" in repr(watchdog) or "no answer" in repr(watchdog)
    assert (settings(virtual), watchdog.armed) == ((400, 0), True)


def test_closing_again_does_nothing(virtual: Simulator, virtual_drive: Drive) -> None:
    watchdog = virtual_drive.watchdog(40.0, unverified=True)
    watchdog.close()
    asked = virtual.line.requests
    watchdog.close()
    assert virtual.line.requests == asked


def test_one_inside_another_gives_back_what_the_other_set(virtual: Simulator, virtual_drive: Drive) -> None:
    with virtual_drive.watchdog(40.0, unverified=True):
        with virtual_drive.watchdog(30.0, "stop", unverified=True):
            assert settings(virtual) == (300, 3)
        assert settings(virtual) == (400, 0)
    assert settings(virtual) == (0, 0)


@pytest.mark.parametrize("timeout", [0, -1, 60.1, 0.05, 0.25, float("nan"), float("inf"), "1", None, True])
def test_a_time_out_that_the_drive_does_not_have_sends_nothing(
    virtual: Simulator, virtual_drive: Drive, timeout: float
) -> None:
    asked = virtual.line.requests
    with pytest.raises(drivebus.NotAllowed):
        virtual_drive.watchdog(timeout, unverified=True)
    assert virtual.line.requests == asked


def test_an_action_that_the_drive_does_not_have_is_named(virtual: Simulator, virtual_drive: Drive) -> None:
    asked = virtual.line.requests
    with pytest.raises(drivebus.NotAllowed, match=r'action "halt" .*coast, stop'):
        virtual_drive.watchdog(1.0, "halt", unverified=True)
    assert virtual.line.requests == asked


def test_a_family_without_one_is_told_so(tmp_path: Path, virtual: Simulator, virtual_bus: Bus) -> None:
    folder = tmp_path / "plain"
    shutil.copytree(PROFILE, folder)
    manifest = folder / "profile.toml"
    before, _, rest = manifest.read_text("utf-8").partition("[watchdog]")
    manifest.write_text(before + rest.partition("\n\n")[2], "utf-8")
    drive = virtual_bus.drive(1, folder)
    with pytest.raises(drivebus.NotAllowed, match="no communication time-out"):
        drive.watchdog(1.0, unverified=True)
    assert virtual.drive(1).writes() == []


def test_a_drive_that_refuses_keeps_what_it_had(virtual: Simulator, virtual_drive: Drive) -> None:
    # The read of what it has; then the first write, refused. GD350 manual, chapter 9.4.7: 08 is locked while running.
    virtual.line.answer_with(bytes.fromhex("01 03 04 00 00 00 00 FA 33"))
    virtual.line.answer_with(bytes.fromhex("01 86 08 43 A6"))
    with pytest.raises(drivebus.Refused, match="locked_while_running"):
        virtual_drive.watchdog(1.0, unverified=True)
    assert settings(virtual) == (0, 0)


def asked_of(monkeypatch: pytest.MonkeyPatch, before: Callable[[int], None]) -> None:
    """Calls *before* each read of the bus from now on, with how many there were."""
    ask, reads = BlockingBus.ask_stamped, itertools.count()

    async def asked(self: BlockingBus, request: Read) -> Stamped:
        before(next(reads))
        return await ask(self, request)

    monkeypatch.setattr(BlockingBus, "ask_stamped", asked)


def test_a_drive_that_shows_something_else_gets_back_what_it_had(
    virtual: Simulator, virtual_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    virtual_drive.write("P14.05", 2, unverified=True)

    def before(read: int) -> None:
        if read == 1:
            # P14.04 = 1.0 s and P14.05 = 2, for what was written.
            virtual.line.answer_with(bytes.fromhex("01 03 04 00 0A 00 02 5B F0"))

    asked_of(monkeypatch, before)
    with pytest.raises(drivebus.Unconfirmed, match=r"unit 1 took .* and shows P14\.05 = 2, P14\.04 = 1 s; it has back"):
        virtual_drive.watchdog(1.0, unverified=True)
    assert settings(virtual) == (0, 2)


def test_one_that_is_interrupted_gives_back_what_the_drive_had(
    virtual: Simulator, virtual_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    def before(read: int) -> None:
        if read == 1:
            raise KeyboardInterrupt

    asked_of(monkeypatch, before)
    with pytest.raises(KeyboardInterrupt):
        virtual_drive.watchdog(1.0, unverified=True)
    assert written(virtual)[:2] == [(ACTION, 0), (TIMEOUT, 10)]
    assert settings(virtual) == (0, 0)


def test_the_thread_says_what_went_wrong_and_goes_on() -> None:
    with (
        Simulator({1: "gd350"}, transport="process") as simulator,
        Bus(simulator, timeout=0.05, retries=0) as bus,
    ):
        drive = bus.drive(1)
        pause = threading.Event()
        with drive.watchdog(2.0, unverified=True) as watchdog:
            simulator.line.drop_answers(1)
            while watchdog.error is None:  # the limit is the test's own
                pause.wait(0.01)
            asked = simulator.line.requests
            while simulator.line.requests < asked + 3:
                pause.wait(0.01)
            assert simulator.drive(1).fault == 0
        assert isinstance(watchdog.error, drivebus.NoAnswer)
        assert not watchdog.armed


def test_the_thread_ends_with_its_bus() -> None:
    with Simulator({1: "gd350"}, transport="process") as simulator:
        bus = Bus(simulator)
        drive = bus.drive(1)
        others = set(threading.enumerate())
        watchdog = drive.watchdog(0.4, unverified=True)
        [thread] = (thread for thread in threading.enumerate() if "watchdog" in thread.name and thread not in others)
        bus.close()
        thread.join()
        assert isinstance(watchdog.error, drivebus.PortError)
        watchdog.close()
        assert watchdog.armed


def test_none_is_set_where_it_would_wear_eeprom_each_time() -> None:
    """GD3000 manual, p. 214: the rectifier has its time-out at P11.04. No address for RAM alone is printed."""
    with Simulator({1: "gd3000-rectifier"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        with pytest.raises(drivebus.NotAllowed, match=r"P11\.04 .* to RAM alone .* for good"):
            bus.drive(1, "gd3000-rectifier").watchdog(1.0)
        assert simulator.drive(1).writes() == []
