"""Refusals that are no decisions: what a drive could not take is asked again, and never reported as what it refuses.

What a drive took, its own log tells (`SimulatedDrive.take_writes`), and how often it was asked, the line.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator

import pytest

import drivebus
from drivebus import Bus, Drive, Refused, Simulator, aio
from drivebus.profile import profiles

BUSY = 0x06
STATE, CONTROL, SPEED, ACCELERATION = 0x2100, 0x2000, 0x2001, 0x000B
IN_RAM = 0x8000
CALLS = 300
# Requests a read at most where a share p of them is refused: 1 / (1 - p) on the average, and some five standard
# deviations on 300 calls. A write is looked up, too, behind each refusal of it.
MOST = {0.05: 1.15, 0.20: 1.45}


@pytest.fixture(params=[0.05, 0.20])
def share(request: pytest.FixtureRequest) -> float:
    share: float = request.param
    return share


@pytest.fixture
def busy(share: float) -> Iterator[tuple[Simulator, Bus, Drive]]:
    """A drive in virtual time that answers a share of what it is asked by 06H, once it is known."""
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual", seed=11) as simulator,
        Bus(simulator) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        simulator.drive(1).take_writes()
        simulator.drive(1).refuse(BUSY, share=share)
        yield simulator, bus, drive


def asked(simulator: Simulator, before: int) -> float:
    return (simulator.line.requests - before) / CALLS


class TestAShareOfTheRequestsIsDamaged:
    """5 % and 20 % of all requests are answered by 06H."""

    def test_no_read_is_refused(self, busy: tuple[Simulator, Bus, Drive], share: float) -> None:
        simulator, bus, drive = busy
        before = simulator.line.requests
        for _ in range(CALLS):
            assert bus.read(1, STATE) == [3]
        assert asked(simulator, before) <= MOST[share]
        for _ in range(CALLS):
            assert drive.status().state is drivebus.State.STOPPED

    def test_no_write_of_a_value_is_refused_and_each_is_taken_once(
        self, busy: tuple[Simulator, Bus, Drive], share: float
    ) -> None:
        simulator, _, drive = busy
        before = simulator.line.requests
        for number in range(CALLS):
            drive.write("P00.11", 1 + number / 10)
        assert asked(simulator, before) <= 2 * MOST[share]
        taken = [(address, value) for _, address, value in simulator.drive(1).take_writes()]
        assert taken == [(IN_RAM | ACCELERATION, 10 + number) for number in range(CALLS)]

    @pytest.mark.filterwarnings("ignore::drivebus.StoreWarning")
    def test_nor_is_one_that_is_stored(self, busy: tuple[Simulator, Bus, Drive]) -> None:
        simulator, _, drive = busy
        for number in range(100):
            drive.write("P00.11", 1 + number / 10, store=True)
        assert simulator.drive(1).eeprom_writes_of(ACCELERATION) == 100

    @pytest.mark.filterwarnings("ignore::drivebus.StoreWarning")
    def test_what_is_in_force_already_is_stored_once(self, busy: tuple[Simulator, Bus, Drive]) -> None:
        # Reading tells nothing of what EEPROM has then: the drive's own word that it did not take it is what counts.
        simulator, _, drive = busy
        for number in range(50):
            drive.write("P00.11", 1 + number / 10)
            drive.write("P00.11", 1 + number / 10, store=True)
        assert simulator.drive(1).eeprom_writes_of(ACCELERATION) == 50

    def test_no_setpoint_is_refused(self, busy: tuple[Simulator, Bus, Drive]) -> None:
        simulator, _, drive = busy
        for number in range(1, CALLS):
            drive.setpoint = number / 10
        taken = [(address, value) for _, address, value in simulator.drive(1).take_writes()]
        assert taken == [(SPEED, 10 * number) for number in range(1, CALLS)]

    def test_no_sample_of_a_poll_is_refused(self, busy: tuple[Simulator, Bus, Drive]) -> None:
        simulator, bus, _ = busy
        with bus.poll({1: [(STATE, 1)]}, interval=0.05) as poll:
            samples = list(itertools.islice(poll, CALLS))
        missing = [sample.missing for sample in samples if sample.missing is not None]
        assert not any(isinstance(error, Refused) for error in missing)
        assert len(missing) <= 1
        assert simulator.line.requests >= CALLS

    def test_asyncio_does_the_same(self, share: float) -> None:
        async def read_all(simulator: Simulator) -> None:
            async with aio.Bus(simulator) as bus:
                simulator.drive(1).refuse(BUSY, share=share)
                for _ in range(CALLS):
                    assert await bus.read(1, STATE) == [3]

        with Simulator({1: "gd350"}, transport="process", clock="virtual", seed=11) as simulator:
            asyncio.run(read_all(simulator))


class TestForEver:
    """A unit that answers by 06H whatever it is asked."""

    def test_a_read_ends_with_what_the_drive_says(self, virtual: Simulator, virtual_drive: Drive) -> None:
        virtual.drive(1).refuse(BUSY)
        before = virtual.line.requests
        with pytest.raises(Refused, match="frame_error") as error:
            virtual_drive.read("P00.11")
        assert (error.value.means, error.value.is_decision) == ("ask_again", False)
        assert virtual.line.requests - before == 5

    def test_a_command_is_sent_once(self, virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive) -> None:
        virtual.drive(1).refuse(BUSY, asked="writes")
        for word in (1, 3, 7):
            before = len(sent(virtual, CONTROL))
            with pytest.raises(Refused):
                virtual_drive.write_words(CONTROL, word)
            with pytest.raises(Refused):
                virtual_bus.write(1, CONTROL, word)
            assert len(sent(virtual, CONTROL)) - before == 2
        assert virtual.drive(1).state == "stopped"

    def test_a_poll_says_that_it_is_missing_and_not_refused(self, virtual: Simulator, virtual_bus: Bus) -> None:
        virtual.drive(1).refuse(BUSY)
        with virtual_bus.poll({1: [(STATE, 1)]}, interval=0.5) as poll:
            error = next(iter(poll)).missing
        assert isinstance(error, drivebus.BadAnswer)
        assert "busy, or the request reached it damaged (exception 06H), asked 5 times" in str(error)


def sent(simulator: Simulator, address: int) -> list[bytes]:
    """The writes to *address* that went over the line."""
    frames = [frame for _, side, frame in simulator.line.trace() if side == "master"]
    return [frame for frame in frames if frame[1] in (0x06, 0x10) and frame[2:4] == address.to_bytes(2, "big")]


class TestIdentification:
    @pytest.mark.parametrize("family", [name for name in profiles() if name != "huanyang-hy"])
    def test_who_is_there_does_not_depend_on_what_was_damaged(self, family: str) -> None:
        def found(share: float, seed: int) -> drivebus.Identification:
            with (
                Simulator({1: family}, transport="process", clock="virtual", seed=seed) as simulator,
                Bus(simulator) as bus,
            ):
                simulator.drive(1).refuse(BUSY, share=share)
                return bus.identify(1)

        sound = found(0.0, 0)
        assert {found(0.20, seed) for seed in range(8)} == {sound}

    def test_a_scan_finds_the_same(self) -> None:
        def found(share: float) -> list[tuple[int, str | None]]:
            units = dict(enumerate(profiles(), 1))
            with (
                Simulator(units, transport="process", clock="virtual", seed=5) as simulator,
                Bus(simulator) as bus,
            ):
                for unit in units:
                    simulator.drive(unit).refuse(BUSY, share=share)
                return [(each.unit, each.profile) for each in bus.scan(units)]

        assert found(0.20) == found(0.0)

    def test_a_unit_that_is_always_busy_is_not_told_by_that(self, virtual: Simulator, virtual_bus: Bus) -> None:
        virtual.drive(1).refuse(BUSY)
        with pytest.raises(drivebus.BadAnswer, match="unit 1 is busy, or gets requests damaged"):
            virtual_bus.identify(1)
        [found] = virtual_bus.scan([1])
        assert found.profile is None
        assert "busy" in str(found.problem)


class TestAcknowledged:
    """05H: by the specification the unit took it. To an INVT drive it is a wrong password, and that is a decision."""

    @staticmethod
    def drive_of(family: str) -> tuple[Simulator, Bus, Drive]:
        simulator = Simulator({1: family}, transport="process", clock="virtual", seed=3)
        bus = Bus(simulator)
        return simulator, bus, bus.drive(1, profile=family, unverified=True)

    def test_what_was_taken_is_not_called_refused(self) -> None:
        simulator, bus, drive = self.drive_of("a1000")
        with simulator, bus:
            simulator.drive(1).refuse(0x05, asked="writes", taken=True)
            drive.setpoint = 12.0
            drive.run(hz=12.0)
            assert simulator.drive(1).state == "forward"
            drive.stop()
            with pytest.raises(Refused, match="took the request") as error:
                bus.write(1, 0x0002, [1300])
            assert error.value.means == "taken"
            assert simulator.drive(1).register(0x0002) == 1300

    def test_a_family_that_lists_the_code_means_what_it_says(self, virtual: Simulator, virtual_drive: Drive) -> None:
        virtual.drive(1).refuse(0x05, asked="writes")
        with pytest.raises(Refused, match="password_error") as error:
            virtual_drive.write("P00.11", 5.0)
        assert error.value.means == "not_now"


class TestLimited:
    """A drive that takes less than was written, and says so in its answer."""

    def test_a_value_in_ram_and_one_in_eeprom_are_written_once(self, virtual: Simulator, virtual_drive: Drive) -> None:
        for address in (ACCELERATION, IN_RAM | ACCELERATION):
            virtual.drive(1).limit(address, 100)
        for store, address in ((False, IN_RAM | ACCELERATION), (True, ACCELERATION)):
            virtual.drive(1).take_writes()
            before = len(sent(virtual, address))
            with pytest.raises(drivebus.Unconfirmed, match=r"the unit says that it took 100 \(0064H\) instead"):
                virtual_drive.write("P00.11", 20.0, store=store)
            assert len(sent(virtual, address)) - before == 1
            assert [write[1:] for write in virtual.drive(1).take_writes()] == [(address, 100)]
        assert virtual.drive(1).eeprom_writes_of(ACCELERATION) == 1

    def test_a_setpoint_that_is_limited_starts_nothing(self, virtual: Simulator, virtual_drive: Drive) -> None:
        virtual_drive.prepare_control()
        virtual.drive(1).limit(SPEED, 1000)
        with pytest.raises(drivebus.Unconfirmed, match="took 1000"):
            virtual_drive.setpoint = 20.0
        virtual_drive.setpoint = 10.0
        assert virtual_drive.setpoint == 10.0

    def test_a_raw_write_says_so_too(self, virtual: Simulator, virtual_bus: Bus) -> None:
        virtual.drive(1).limit(ACCELERATION, 100)
        with pytest.raises(drivebus.BadAnswer, match=r"the unit says that it took 100 \(0064H\) instead"):
            virtual_bus.write(1, ACCELERATION, 200)
        assert virtual.drive(1).eeprom_writes_of(ACCELERATION) == 1
