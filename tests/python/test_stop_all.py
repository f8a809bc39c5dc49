"""One call stops every drive that is known: all stops go out first, each in its family's own code, then come the looks.

The codes are from the documents: 5 at 2000H stops an INVT drive, 5 at 7000H lets a VFD500 coast and 6 stops it.
"""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, NotStopped, Simulator, State
from drivebus.cli import cli
from drivebus.rtu import encode_write
from drivebus.site import families_on, known_family, remember

STOPS = {
    1: encode_write(1, 0x2000, 5),
    2: encode_write(2, 0x7000, 6),
    3: encode_write(3, 0x2000, 5),
    4: encode_write(4, 0x2000, 5),
}
FAMILIES = {1: "gd350", 2: "vfd500", 3: "gd600", 4: "gd3000"}
SILENT = 9


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(dict(FAMILIES), transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.25) as bus:
        yield bus


ECHO_OF_THE_ADAPTER = bytes.fromhex("03 00 00 00 01")
"""What a bus asks once, behind its first write: whether the echo came from the unit or from the adapter."""


def asked(simulator: Simulator, since: int = 0) -> list[bytes]:
    frames = [frame for _, who, frame in simulator.line.trace()[since:] if who == "master"]
    return [frame for frame in frames if frame[1:6] != ECHO_OF_THE_ADAPTER]


def started(bus: Bus) -> list[Drive]:
    """A drive of each family, at its speed."""
    drives = [bus.drive(unit, family, unverified=True) for unit, family in FAMILIES.items()]
    for drive in drives:
        drive.prepare_control(store=True)
        drive.run(20.0)
    for drive in drives:
        drive.wait_for_speed(timeout=60)
    return drives


class TestTheLine:
    def test_every_stop_goes_out_before_the_first_look(self, simulator: Simulator, bus: Bus) -> None:
        drives = started(bus)
        since = len(simulator.line.trace())
        assert bus.stop_all() == [1, 2, 3, 4]
        frames = asked(simulator, since)
        assert frames[:4] == [STOPS[unit] for unit in FAMILIES]
        assert {frame[1] for frame in frames[4:]} == {3}, "then only reads"
        for drive in drives:
            drive.wait_until_stopped(timeout=60)
        assert all(drive.state() is State.STOPPED for drive in drives)

    def test_the_proofs_go_on_side_by_side(self, bus: Bus) -> None:
        """Four in turn would take four times what the slowest takes."""
        started(bus)
        begun = bus.now()
        bus.stop_all()
        together = bus.now() - begun
        each = []
        for drive in started(bus):
            begun = bus.now()
            drive.stop()
            each.append(bus.now() - begun)
        assert together < 0.7 * sum(each)

    def test_a_silent_unit_is_named_and_all_others_are_stopped(self, bus: Bus) -> None:
        drives = started(bus)
        bus.drive(SILENT, "gd350")
        with pytest.raises(NotStopped, match=r"4 of 5 drives were proved to stop; not proved: unit 9\. ") as caught:
            bus.stop_all()
        assert list(caught.value.failures) == [SILENT]
        assert isinstance(caught.value.failures[SILENT], drivebus.Unconfirmed)
        for drive in drives:
            drive.wait_until_stopped(timeout=60)

    def test_one_that_was_silent_last_time_keeps_nobody_waiting(self, simulator: Simulator, bus: Bus) -> None:
        bus.drive(SILENT, "gd350")
        drive = bus.drive(1)
        with pytest.raises(drivebus.NoAnswer):
            bus.read(SILENT, 0x2100)
        since = len(simulator.line.trace())
        with pytest.raises(NotStopped):
            bus.stop_all()
        first, *others = asked(simulator, since)
        assert first == STOPS[1]
        # What it is is asked before, and silence is no evidence.
        assert encode_write(SILENT, 0x2000, 5) in others
        assert drive.state() is State.STOPPED

    def test_one_that_takes_the_stop_and_does_not_obey_is_named(self, bus: Bus) -> None:
        started(bus)[0].write({"P00.02": 1}, unverified=True)  # its commands come by another bus now
        with pytest.raises(NotStopped, match="unit 1") as caught:
            bus.stop_all()
        assert list(caught.value.failures) == [1]
        assert "the motor may still turn" in str(caught.value)

    def test_a_stop_is_sent_until_it_is_taken_and_never_to_all(self, simulator: Simulator, bus: Bus) -> None:
        for unit, family in FAMILIES.items():
            bus.drive(unit, family, unverified=True)
        since = len(simulator.line.trace())
        simulator.line.drop_answers(2)
        assert bus.stop_all(unverified=True) == [1, 2, 3, 4]
        frames = asked(simulator, since)
        assert all(frames.count(stop) >= 1 for stop in STOPS.values())
        assert len([frame for frame in frames if frame[1] == 6]) <= len(STOPS) + 2, "two answers were lost"
        assert all(frame[0] != 0 for frame in frames)

    def test_what_was_started_on_trust_is_stopped_on_trust(self, bus: Bus) -> None:
        drive = bus.drive(3, "gd600")
        drive.prepare_control(store=True, unverified=True)
        drive.run(10.0, unverified=True)
        assert bus.stop_all() == [3]

    def test_a_family_whose_stop_is_not_proved_is_named(self, bus: Bus, simulator: Simulator) -> None:
        bus.drive(3, "chv100")
        bus.drive(1, "gd350")
        since = len(simulator.line.trace())
        with pytest.raises(NotStopped) as caught:
            bus.stop_all()
        assert isinstance(caught.value.failures[3], NotAllowed)
        assert [frame for frame in asked(simulator, since) if frame[1] == 6] == [STOPS[1]]

    def test_nobody_known_is_no_success(self, simulator: Simulator, bus: Bus) -> None:
        with pytest.raises(NotAllowed, match="no drive is known on this bus"):
            bus.stop_all()
        assert asked(simulator) == []

    def test_a_closed_bus_says_so_for_each(self, simulator: Simulator) -> None:
        with Bus(simulator) as bus:
            bus.drive(1, "gd350")
        with pytest.raises(NotStopped) as caught:
            bus.stop_all()
        assert isinstance(caught.value.failures[1], drivebus.PortError)

    def test_asyncio_sends_the_same(self, simulator: Simulator) -> None:
        async def all_of_it() -> list[int]:
            async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
                for unit, family in FAMILIES.items():
                    await bus.drive(unit, family, unverified=True)
                return await bus.stop_all()

        assert asyncio.run(all_of_it()) == [1, 2, 3, 4]
        assert sorted(frame for frame in asked(simulator) if frame[1] == 6) == sorted(STOPS.values())


@pytest.mark.skipif(os.name == "nt", reason="no pty")
class TestTheCommand:
    @pytest.fixture
    def simulator(self) -> Iterator[Simulator]:
        with Simulator(dict(FAMILIES), transport="pty") as simulator:
            yield simulator

    @staticmethod
    def run(*words: str) -> Result:
        return CliRunner().invoke(cli, words)

    def test_what_a_scan_found_is_known(self, simulator: Simulator) -> None:
        assert self.run("--port", simulator.port, "scan", "--units", "1-4").exit_code == 0
        known = families_on(simulator.port)
        assert known[1] == "gd350"
        since = len(simulator.line.trace())
        result = self.run("--port", simulator.port, "--unverified", "stop", "--all")
        assert result.exit_code == 0, result.output
        frames = [frame for frame in asked(simulator, since) if frame[1] == 6]
        assert sorted(frames) == sorted(STOPS[unit] for unit in known)

    def test_drives_of_the_file_are_known_by_its_families(self, simulator: Simulator, tmp_path: Path) -> None:
        file = tmp_path / "drivebus.toml"
        drives = "".join(
            f'[drives.pump{unit}]\nline = "hall"\nunit = {unit}\nprofile = "{family}"\n'
            for unit, family in FAMILIES.items()
        )
        file.write_text(f'[lines.hall]\nport = "{simulator.port}"\n{drives}')
        since = len(simulator.line.trace())
        result = self.run("--config", str(file), "--unverified", "--json", "stop", "--all")
        assert result.exit_code == 0, result.output
        assert [json.loads(row)["unit"] for row in result.stdout.splitlines()] == [1, 2, 3, 4]
        frames = [frame for frame in asked(simulator, since) if frame[1] == 6]
        assert sorted(frames) == sorted(STOPS.values())

    @pytest.mark.parametrize(("family", "stop"), [("gd350", STOPS[1]), ("eds300", encode_write(1, 0x2000, 6))])
    def test_a_drive_that_is_another_now_is_stopped_by_its_own_code(self, family: str, stop: bytes) -> None:
        """6 stops an EDS300 (its manual, p. 46), which 5 would run."""
        with Simulator({1: family}, transport="pty") as simulator:
            remember(simulator.port, 1, "gd600")
            result = self.run("--port", simulator.port, "--unverified", "stop", "--all")
            assert result.exit_code == 0, result.output
            assert {frame for frame in asked(simulator) if frame[1] == 6} == {stop}
            assert known_family(simulator.port, 1) in ("gd350", None)
            assert simulator.drive(1).state == "stopped"

    def test_who_is_silent_is_named_and_the_exit_code_says_it(self, simulator: Simulator) -> None:
        remember(simulator.port, 1, "gd350")
        remember(simulator.port, SILENT, "gd350")
        result = self.run("--port", simulator.port, "stop", "--all")
        assert result.exit_code == 7
        assert "1 of 2 drives were proved to stop; not proved: unit 9" in result.stderr

    def test_nobody_known_is_said(self, simulator: Simulator) -> None:
        result = self.run("--port", simulator.port, "stop", "--all")
        assert result.exit_code == 2
        assert "no drive is known on" in result.stderr
        assert asked(simulator) == []

    @pytest.mark.parametrize("words", [["-u", "2"], ["-d", "pump1"]])
    def test_all_is_not_some(self, simulator: Simulator, words: list[str]) -> None:
        result = self.run("--port", simulator.port, *words, "stop", "--all")
        assert result.exit_code == 2

    def test_read_only_refuses_it(self, simulator: Simulator) -> None:
        assert self.run("--port", simulator.port, "--read-only", "stop", "--all").exit_code == 2
