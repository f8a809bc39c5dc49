"""An adapter that is unplugged and comes back under another name, in a running poll."""

from __future__ import annotations

import gc
import itertools
import os
import struct
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivebus import Bus, PortError, Simulator

from .reopened import read_once_open

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="adapters are known on Linux only")
if sys.platform != "win32":
    import fcntl
    import termios

IDENTIFICATION, STATE, SETTINGS = 0x2103, 0x2100, 0x0E00
# What a drive that stands has there: its family, "stopped", its address and 19200 bit/s. No two alike.
EXPECTED = {IDENTIFICATION: [0x01A0], STATE: [3], SETTINGS: [1, 4]}
PATIENCE = 60.0  # seconds; only a test that fails takes them


@pytest.fixture
def by_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder in the place of /dev/serial/by-id."""
    folder = tmp_path / "by-id"
    folder.mkdir()
    monkeypatch.setenv("DRIVEBUS_SERIAL_BY_ID", str(folder))
    return folder


@pytest.fixture
def simulator(by_id: Path) -> Iterator[Simulator]:
    """A drive behind an adapter with a link of its own."""
    with Simulator({1: "gd350"}, link=by_id / "usb-Simulated_RS485_A50285BI-if00-port0") as simulator:
        yield simulator


class Poll(threading.Thread):
    """Reads one register after another until it is told to end; what it got can be waited for."""

    def __init__(self, bus: Bus) -> None:
        super().__init__(daemon=True)
        self.bus = bus
        self.right = self.errors = 0
        self.wrong: list[object] = []
        self.ending = False
        self.moved = threading.Condition()

    def run(self) -> None:
        while not self.ending:
            for address, expected in EXPECTED.items():
                try:
                    words: object = self.bus.read(1, address, len(expected))
                except PortError:
                    words = None
                except Exception as error:
                    words = error
                with self.moved:
                    self.right += words == expected
                    self.errors += words is None
                    if words not in (expected, None):
                        self.wrong.append((address, words))
                    self.moved.notify_all()

    def wait_for(self, name: str) -> None:
        """Until there is one more of *name*, asked for after this call began."""
        with self.moved:
            enough = getattr(self, name) + 2  # the first may have been under way
            assert self.moved.wait_for(lambda: getattr(self, name) >= enough, PATIENCE), f"no more {name}"


def open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def test_twenty_times_under_another_name(simulator: Simulator) -> None:
    with Bus(simulator.port) as bus:
        gc.collect()  # or what other tests left is closed meanwhile
        open_before = open_files()
        poll = Poll(bus)
        poll.start()
        names = [simulator.port]
        for round_number in range(1, 21):
            poll.wait_for("right")
            simulator.line.unplug()
            poll.wait_for("errors")
            simulator.line.replug()
            names.append(simulator.port)
            poll.wait_for("right")
            assert bus.stats()["reconnects"] == round_number
        poll.ending = True
        poll.join(PATIENCE)
        assert open_files() == open_before, "each lost port was closed"
    assert poll.wrong == []
    assert all(before != after for before, after in itertools.pairwise(names))


def test_another_adapter_under_its_name_is_left_alone(simulator: Simulator, by_id: Path, tmp_path: Path) -> None:
    name = tmp_path / "ttyUSB0"
    name.symlink_to(simulator.port)
    with Bus(name) as bus, Simulator({1: "gd350"}, link=by_id / "usb-Another_RS485-if00-port0") as another:
        assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]
        (by_id / "usb-Simulated_RS485_A50285BI-if00-port0").unlink()
        name.unlink()
        name.symlink_to(another.port)
        simulator.line.unplug()
        with pytest.raises(PortError):
            bus.read(1, IDENTIFICATION)
        with pytest.raises(PortError, match=r"expected usb-Simulated_RS485_A50285BI.*found usb-Another_RS485"):
            bus.read(1, IDENTIFICATION)
        assert another.drive(1).writes() == []
        simulator.line.replug()  # its link is back with it
        assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]


def test_a_port_of_which_only_the_name_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRIVEBUS_SERIAL_BY_ID", str(tmp_path / "nothing here"))
    with Simulator({1: "gd350"}, link=tmp_path / "drive") as simulator, Bus(tmp_path / "drive") as bus:
        for _ in range(3):
            assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]
            simulator.line.unplug()
            with pytest.raises(PortError):
                bus.read(1, IDENTIFICATION)
            simulator.line.replug()
        assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]


def test_a_serial_server_that_comes_back() -> None:
    with Simulator({1: "gd350"}, transport="tcp") as simulator, Bus(simulator.port) as bus:
        for _ in range(3):
            assert read_once_open(bus, IDENTIFICATION) == EXPECTED[IDENTIFICATION]
            simulator.line.unplug()
            with pytest.raises(PortError):
                bus.read(1, IDENTIFICATION)
            simulator.line.replug()
        assert read_once_open(bus, IDENTIFICATION) == EXPECTED[IDENTIFICATION]


def test_who_has_a_busy_port_is_named(simulator: Simulator) -> None:
    with Bus(simulator.port), pytest.raises(PortError, match=r"this program has it open already: .*process \d+"):
        Bus(simulator.port, share="never")


def test_a_bus_made_from_a_simulator_follows_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("DRIVEBUS_SERIAL_BY_ID", str(tmp_path / "nothing here"))
    with Simulator({1: "gd350"}, transport="pty") as simulator, Bus(simulator) as bus:
        for _ in range(3):
            assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]
            simulator.line.unplug()
            with pytest.raises(PortError):
                bus.read(1, IDENTIFICATION)
            simulator.line.replug()
        assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]


def test_a_pseudo_terminal_is_not_opened_again_by_its_number_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its number is given to whoever opens the next one."""
    monkeypatch.setenv("DRIVEBUS_SERIAL_BY_ID", str(tmp_path / "nothing here"))
    with Simulator({1: "gd350"}, transport="pty") as simulator, Bus(simulator.port) as bus:
        name = simulator.port
        assert bus.read(1, IDENTIFICATION) == EXPECTED[IDENTIFICATION]
        simulator.line.unplug()
        with pytest.raises(PortError):
            bus.read(1, IDENTIFICATION)
        simulator.close()
        ends: list[int] = []
        try:
            # The lowest number that is free; other programs may take some.
            while not ends or (os.ttyname(ends[-1]) != name and len(ends) < 64):
                ends += os.openpty()
            assert os.ttyname(ends[-1]) == name
            with pytest.raises(PortError, match="it was a pseudo-terminal, and another one has its number now"):
                bus.read(1, IDENTIFICATION)
            assert struct.unpack("i", fcntl.ioctl(ends[-2], termios.FIONREAD, b"\0" * 4))[0] == 0
        finally:
            for end in ends:
                os.close(end)
