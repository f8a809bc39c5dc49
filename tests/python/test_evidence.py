"""What no document of a family proves is done only for who says so, and nothing is sent to whoever does not.

The facts are those of the shipped profiles. GD350: P14.03 is printed for sister series only, P00.11 in its own manual.
GD600: the address of the output frequency, the codes of its states and a way to RAM alone are on no page at hand.
GD3000: of the commands only 1 (run) is printed. VFD500: the address of its status words is on none, r25.00 is.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, Simulator, State

GD350, GD600, GD3000, VFD500 = 1, 2, 3, 4
UNITS = {GD350: "gd350", GD600: "gd600", GD3000: "gd3000", VFD500: "vfd500"}
PROFILES = Path(__file__).parents[2] / "crates/drives/profiles"
HOW = r"unverified=True"


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(UNITS, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.25) as bus:
        for unit in UNITS:
            bus.echo(unit)  # first contact is over
        yield bus


@pytest.fixture
def refuses(simulator: Simulator) -> Callable[..., None]:
    """That a call is refused with these words, and that nothing was sent."""

    def check(call: Callable[[], Any], match: str) -> None:
        before = simulator.line.requests
        with pytest.raises(NotAllowed, match=match):
            call()
        assert simulator.line.requests == before

    return check


def frames(simulator: Simulator, unit: int) -> list[str]:
    """What the master sent to *unit*, without the CRC."""
    return [
        data[:-2].hex(" ") for _, who, data in simulator.line.trace() if who == "master" and data[:1] == bytes([unit])
    ]


class TestRows:
    def test_what_is_printed_for_a_sister_is_read_and_not_written(
        self, bus: Bus, refuses: Callable[..., None], simulator: Simulator
    ) -> None:
        drive = bus.drive(GD350)
        assert drive.read("P14.03") == 5
        refuses(lambda: drive.write("P14.03", 7), f"P14.03.*GD300-class.*{HOW}")
        refuses(lambda: drive.write({"P00.11": 2.0, "P14.03": 7}), "P14.03")
        drive.write("P14.03", 7, unverified=True)
        assert simulator.drive(GD350).register(0x0E03) == 7

    def test_what_nothing_prints_is_not_even_read(self, bus: Bus, refuses: Callable[..., None]) -> None:
        drive = bus.drive(GD600, "gd600")
        for call in (
            lambda: drive.read("running_frequency"),
            lambda: drive.monitor("status_word_1", "running_frequency"),
            lambda: bus.poll({drive: ["running_frequency"]}),
        ):
            refuses(call, f"running_frequency.*{HOW}")
        assert drive.read("running_frequency", unverified=True) == 0.0
        assert list(drive.monitor()) == ["status_word_1"]
        assert "running_frequency" in drive.monitor(unverified=True)

    def test_what_has_no_address_is_not_asked_for_in_any_case(
        self, bus: Bus, refuses: Callable[..., None], tmp_path: Path
    ) -> None:
        folder = tmp_path / "gd350"
        shutil.copytree(PROFILES / "gd350", folder)
        rows = (folder / "registers.csv").read_text("utf-8")
        assert "\n0x300F," in rows
        (folder / "registers.csv").write_text(rows.replace("\n0x300F,", "\n,"), "utf-8")
        for unverified in (False, True):
            drive = bus.drive(GD350, folder, unverified=unverified)
            refuses(lambda drive=drive: drive.read("analog_input_4"), "address of analog_input_4.*not known.*overlay")
            assert len(drive.monitor()) == 22
            # What stands at an address is told all the same.
            assert drive.profile.name_at(0x3010) == "hdi_frequency_1"
            refuses(lambda: bus.write(GD350, 0x7000, 1), "7000H is the command register of Veikong VFD500")

    def test_a_drive_may_be_trusted_for_good(self, bus: Bus, simulator: Simulator) -> None:
        drive = bus.drive(GD350, unverified=True)
        assert (drive.unverified, bus.drive(GD350).unverified) == (True, False)
        assert repr(drive) == "<Drive 1: gd350, unverified>"
        drive.write("P14.03", 9)
        assert simulator.drive(GD350).register(0x0E03) == 9

    def test_a_flag_is_true_or_false(self, bus: Bus, refuses: Callable[..., None]) -> None:
        drive = bus.drive(GD350)
        for call in (
            lambda: drive.read("P14.03", unverified="yes"),  # type: ignore[call-overload]
            lambda: bus.drive(GD350, "gd350", unverified=1),  # type: ignore[arg-type]
            lambda: bus.write(GD350, 0x2001, 5, force="no"),  # type: ignore[arg-type]
        ):
            refuses(call, "neither True nor False")


class TestCommands:
    def test_no_motor_is_started_that_cannot_be_stopped(self, bus: Bus, refuses: Callable[..., None]) -> None:
        drive = bus.drive(GD3000, "gd3000")
        refuses(lambda: drive.run(10.0), f"could not be stopped.*stop: .*GD350.*coast: .*{HOW}")
        refuses(lambda: drive.stop(), f"command stop .*not verified.*{HOW}")
        refuses(lambda: drive.jog(), "jog_forward")
        with pytest.raises(NotAllowed), drive.running(10.0):
            pytest.fail("the block must not be entered")

    def test_who_started_it_so_can_stop_it_without(self, bus: Bus, simulator: Simulator) -> None:
        drive = bus.drive(GD3000, "gd3000")
        drive.prepare_control(store=True, unverified=True)
        drive.run(10.0, unverified=True)
        drive.stop()
        with drive.running(10.0, unverified=True):
            pass
        taken = [value for _, address, value in simulator.drive(GD3000).writes() if address == 0x2000]
        assert taken == [1, 5, 1, 5]
        assert not drive.unverified

    def test_a_rectifier_has_none(self) -> None:
        with (
            Simulator({1: "gd3000-rectifier"}, transport="process", clock="virtual") as simulator,
            Bus(simulator) as bus,
        ):
            drive = bus.drive(1, "gd3000-rectifier", unverified=True)
            for call in (drive.run, drive.jog, drive.stop, drive.coast, drive.reset_fault, drive.jog_stop):
                with pytest.raises(NotAllowed, match="Goodrive3000 rectifier") as refused:
                    call()
                assert "unverified=True" not in str(refused.value)
            with pytest.raises(NotAllowed):
                drive.run(10.0)
            with pytest.raises(NotAllowed, match="no frequency setpoint"):
                drive.setpoint = 10.0
            assert simulator.drive(1).writes() == []


@pytest.fixture
def printed(tmp_path: Path) -> Path:
    """A VFD500 as if a page printed where its commands go: commands that may be used, and states that may not."""
    folder = tmp_path / "vfd500"
    shutil.copytree(PROFILES / "vfd500", folder)
    file = folder / "registers.csv"
    lines = file.read_text(encoding="utf-8").splitlines()
    row = next(place for place, line in enumerate(lines) if line.startswith("0x7000,"))
    assert ",wo,no," in lines[row]
    lines[row] = lines[row].replace(",wo,no,", ",wo,yes,")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


class TestStates:
    def test_a_start_is_proved_by_its_answer_and_the_fault_number(
        self, bus: Bus, simulator: Simulator, printed: Path
    ) -> None:
        drive = bus.drive(VFD500, printed, variants={"speed_unit": "Hz"})
        simulator.drive(VFD500).take_writes()
        before = len(frames(simulator, VFD500))
        drive.run(10.0)
        drive.stop()
        sent = frames(simulator, VFD500)[before:]
        identity = ["04 03 19 00 00 01", "04 03 1e 0e 00 01", "04 03 21 03 00 01"]
        look, start, stop = "04 03 19 00 00 01", "04 10 70 00 00 02 04 00 01 03 e8", "04 06 70 00 00 06"
        assert sent == [look, *identity, start, look, stop]

    @pytest.mark.parametrize("block", ["running", "jogging"])
    def test_a_block_ends_by_the_states_that_it_began_with(self, bus: Bus, simulator: Simulator, block: str) -> None:
        """Its keypad takes a VFD500 over: it confirms every frame and goes on turning."""
        drive = bus.drive(VFD500, "vfd500")
        drive.prepare_control(unverified=True)

        def end_elsewhere() -> None:
            with getattr(drive, block)(unverified=True):
                bus.write(VFD500, 0x0002, 0)
                simulator.drive(VFD500).take_writes()

        with pytest.raises(drivebus.Unconfirmed, match="its state does not show it"):
            end_elsewhere()
        assert [word[1:] for word in simulator.drive(VFD500).writes()] == [(0x7000, 6)] * 3 + [(0x7000, 5)]
        assert simulator.drive(VFD500).state == "forward"

    @pytest.mark.parametrize("block", ["running", "jogging"])
    def test_an_awaited_block_as_well(self, simulator: Simulator, block: str) -> None:
        async def main() -> None:
            async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
                drive = await bus.drive(VFD500, "vfd500")
                await drive.prepare_control(unverified=True)
                async with getattr(drive, block)(unverified=True):
                    await bus.write(VFD500, 0x0002, 0)

        with pytest.raises(drivebus.Unconfirmed, match="its state does not show it"):
            asyncio.run(main())

    def test_a_fault_is_seen_before_and_after(self, bus: Bus, simulator: Simulator, printed: Path) -> None:
        drive = bus.drive(VFD500, printed, variants={"speed_unit": "Hz"})
        simulator.drive(VFD500).trip(18)
        with pytest.raises(NotAllowed, match=r"in fault 18: Earth fault"):
            drive.run(10.0)
        assert simulator.drive(VFD500).writes() == []
        drive.prepare_control(unverified=True)
        drive.reset_fault()
        drive.reset_fault()
        assert [word[1:] for word in simulator.drive(VFD500).writes()] == [(0x0002, 2), (0x7000, 8)]

    def test_what_needs_them_is_refused_and_the_rest_is_told(self, bus: Bus, refuses: Callable[..., None]) -> None:
        drive = bus.drive(VFD500, "vfd500")
        for call in (drive.state, drive.wait_for_speed, drive.wait_until_stopped):
            refuses(call, f"needs a state word.*from memory.*{HOW}")
        status = drive.status()
        assert (status.state, status.ready, status.source, status.frequency) == (State.UNKNOWN, None, None, None)
        assert {*status.missing} == {
            "state",
            "ready",
            "source",
            "motor",
            "overload_alarm",
            "frequency",
            "setpoint",
        }
        assert "from memory" in status.missing["state"]
        assert str(status) == "state not told"
        assert drive.fault() is None
        full = drive.status(unverified=True)
        assert (full.state, full.frequency, {*full.missing}) == (State.STOPPED, 0.0, {"overload_alarm"})

    def test_where_nothing_is_told_nothing_is_asked(self, bus: Bus, simulator: Simulator) -> None:
        drive = bus.drive(GD600, "gd600")
        before = simulator.line.requests
        status = drive.status()
        assert (str(status), status.time) == ("state not told, fault not told", 0.0)
        assert simulator.line.requests == before
        with pytest.raises(NotAllowed, match=HOW):
            drive.look()
        with pytest.raises(NotAllowed, match="fault"):
            drive.fault()
        assert drive.fault(unverified=True) is None


class TestControl:
    def test_a_value_that_is_not_printed_is_not_written(self, bus: Bus, simulator: Simulator) -> None:
        """GD350: the number of the Modbus choice of P00.02 is not printed. One that is there already is left alone."""
        drive = bus.drive(GD350)
        bus.write(GD350, 0x8002, 1)
        simulator.drive(GD350).take_writes()
        control = drive.check_control()
        assert [(item.code, item.actual, item.verified) for item in control] == [
            ("P00.01", 0, True),
            ("P00.02", 1, False),
            ("P00.06", 0, True),
        ]
        with pytest.raises(NotAllowed, match=f"P00.02.*to 0 is not verified.*{HOW}"):
            drive.prepare_control()
        assert simulator.drive(GD350).writes() == []
        assert drive.prepare_control(unverified=True)
        assert [word[1:] for word in simulator.drive(GD350).writes()] == [(0x8001, 2), (0x8002, 0), (0x8006, 8)]

    def test_what_may_not_be_read_is_shown_as_that(self, bus: Bus) -> None:
        control = bus.drive(VFD500, "vfd500").check_control()
        assert [(item.code, item.actual, item.ok) for item in control] == [("P00.02", None, False)]
        assert "not read" in str(control)
        assert not control


class TestRules:
    def test_a_watchdog_of_a_sister_series(self, bus: Bus, refuses: Callable[..., None]) -> None:
        drive = bus.drive(GD350)
        refuses(lambda: drive.watchdog(30.0), f"P14.04, P14.05.*GD300.*{HOW}")
        with drive.watchdog(30.0, unverified=True) as watchdog:
            assert watchdog.armed
        refuses(lambda: bus.drive(GD600, "gd600").watchdog(30.0, unverified=True), "no communication time-out")

    def test_a_memory_that_is_taken_over(self) -> None:
        """GD300: that 800BH is RAM is printed for the GD350 only. 000BH, EEPROM, is the parameter's own address."""
        with Simulator({1: "gd300"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            drive = bus.drive(1, "gd300")
            with pytest.raises(NotAllowed, match=f"keeps a parameter in RAM is not verified.*{HOW}"):
                drive.write("P00.11", 3.0)
            drive.write("P00.11", 3.0, store=True)
            drive.write("P00.11", 4.0, unverified=True)
            assert [word[1:] for word in simulator.drive(1).writes()] == [(0x000B, 30), (0x800B, 40)]

    def test_a_unit_that_a_parameter_decides(
        self, bus: Bus, simulator: Simulator, refuses: Callable[..., None], printed: Path
    ) -> None:
        """VFD500, P30.14: percent, Hz or rpm; the three are printed, their numbers are not."""
        drive = bus.drive(VFD500, printed)
        calls: list[Callable[[], None]] = [lambda: drive.run(10.0), lambda: drive.write("speed_reference", 10.0)]
        for call in calls:
            with pytest.raises(NotAllowed, match=rf"P30\.14.*variants=.*'Hz'.*{HOW}"):
                call()
        assert simulator.drive(VFD500).writes() == []
        fixed = bus.drive(VFD500, printed, variants={"speed_unit": "%"})
        bus.write(VFD500, 0x1E0E, 0)
        fixed.write("speed_reference", -50.0)
        assert simulator.drive(VFD500).writes()[-1][1:] == (0x7001, 0x10000 - 5000)
        refuses(lambda: fixed.run(10.0), "is in %, not in Hz")
        refuses(lambda: setattr(fixed, "setpoint", 10.0), "is in %, not in Hz")
        with pytest.raises(NotAllowed, match="speed_unit"):
            bus.drive(VFD500, "vfd500", variants={"speed_unit": "furlongs"})
        asked = bus.drive(VFD500, "vfd500", unverified=True)
        for number, value, word in ((1, 12.5, 1250), (2, 1250, 1250)):
            bus.write(VFD500, 0x1E0E, number)
            simulator.drive(VFD500).take_writes()
            asked.write("speed_reference", value)
            assert [taken[1:] for taken in simulator.drive(VFD500).take_writes()] == [(0x7001, word)]

    def test_what_decides_a_unit_does_not_change_under_a_value(
        self, bus: Bus, refuses: Callable[..., None], simulator: Simulator
    ) -> None:
        """P30.14 of a VFD500: 10.0 would go out as 10.00 Hz and be taken for 1000 rpm."""
        drive = bus.drive(VFD500, "vfd500", unverified=True)
        together = "decides what speed_reference means"
        refuses(lambda: drive.write({"P30.14": 2, "speed_reference": 10.0}), together)
        refuses(lambda: drive.write({"speed_reference": 10.0, "bus_speed_unit": 2}), together)
        hertz = bus.drive(VFD500, "vfd500", variants={"speed_unit": "Hz"})
        refuses(lambda: hertz.write("P30.14", 2), "P30.14 = 2 would change the speed_unit of unit 4.*said to be Hz")
        hertz.write("P30.14", 1, unverified=True)
        drive.write("P30.14", 2, unverified=True)
        simulator.drive(VFD500).take_writes()
        drive.write("speed_reference", 10)
        assert [word[1:] for word in simulator.drive(VFD500).writes()] == [(0x7001, 10)]

    def test_a_locked_drive_says_what_to_do(self, bus: Bus, simulator: Simulator) -> None:
        """INVT's 09H is the user password, P07.00. A VFD500's 05H is a word that cannot be read (p. 134)."""
        invt, other = bus.drive(GD350), bus.drive(VFD500, "vfd500")
        for unit, code in ((GD350, 9), (GD350, 5), (VFD500, 5)):
            body = bytes([unit, 0x83, code])
            simulator.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))
            with pytest.raises(drivebus.Refused) as refused:
                (invt if unit == GD350 else other).read("P00.07")
            said = str(refused.value)
            assert ("P07.00 holds the user password" in said, "keypad" in said) == (unit == GD350, unit == GD350)


class TestRanges:
    """P00.04 is not above P00.03. GD350 manual, section 9.4.8: P00.03 from P00.04 to 630.00 Hz."""

    @pytest.fixture
    def drive(self, bus: Bus, simulator: Simulator) -> Drive:
        drive = bus.drive(GD350, unverified=True)
        drive.write({"P00.04": 40.0, "P00.03": 45.0})
        simulator.drive(GD350).take_writes()
        return drive

    @pytest.mark.parametrize(
        ("wanted", "message"),
        [
            ({"P00.03": 39.0}, r"P00\.03 .*= 39 Hz is below P00\.04 .*is 40 Hz in unit 1"),
            ({"P00.04": 46.0}, r"P00\.04 .*= 46 Hz is above P00\.03 .*is 45 Hz in unit 1"),
            ({"P00.03": 30.0, "P00.04": 30.0}, r"P00\.03 .*is below P00\.04.*before it in the same call"),
            ({"set_frequency": 45.5}, r"set_frequency .*= 45\.5 Hz is above P00\.03 .*is 45 Hz"),
        ],
    )
    def test_what_the_drive_has_is_the_limit(
        self, drive: Drive, simulator: Simulator, wanted: dict[str, float], message: str
    ) -> None:
        with pytest.raises(NotAllowed, match=message):
            drive.write(wanted)
        assert simulator.drive(GD350).writes() == []

    def test_what_is_written_before_counts(self, drive: Drive, simulator: Simulator) -> None:
        drive.write({"P00.04": 30.0, "P00.03": 30.0})
        assert [word[1:] for word in simulator.drive(GD350).writes()] == [(0x8004, 3000), (0x8003, 3000)]

    def test_state_and_limits_are_asked_for_together(self, drive: Drive, simulator: Simulator) -> None:
        before = len(frames(simulator, GD350))
        drive.write("P00.03", 50.0)
        assert frames(simulator, GD350)[before:] == [
            "01 03 00 04 00 01",
            "01 03 21 00 00 01",
            "01 06 80 03 13 88",
        ]


def test_both_faces_hold_the_same_rule(simulator: Simulator) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(GD350)
            with pytest.raises(NotAllowed, match=HOW):
                await drive.write("P14.03", 7)
            await drive.write("P14.03", 7, unverified=True)
            assert await drive.read("P14.03") == 7
            with pytest.raises(NotAllowed, match=HOW):
                drive.watchdog(30.0)
            other = await bus.drive(VFD500, "vfd500")
            with pytest.raises(NotAllowed, match=HOW):
                await other.state()
            assert (await other.status()).state is State.UNKNOWN
            with pytest.raises(NotAllowed, match="force=True"):
                await bus.write(VFD500, 0x2000, 5)

    asyncio.run(main())


@pytest.mark.parametrize(
    ("unit", "code", "word"),
    [(GD350, "P00.02", 1), (GD350, "P07.00", 1), (GD350, "P00.06", 6), (GD600, "P01.20", 10), (VFD500, "P30.14", 1)],
)
def test_what_has_no_printed_range_is_written_only_on_request(
    simulator: Simulator, bus: Bus, unit: int, code: str, word: int
) -> None:
    row = bus.drive(unit, UNITS[unit]).describe(code)
    assert (row.verified, row.bounded) == (True, False)
    with pytest.raises(NotAllowed, match=rf"writing {word} to {code} .*: its range is not printed. .*{HOW}"):
        bus.drive(unit, UNITS[unit]).write(code, word / row.scale, store=True)
    assert simulator.drive(unit).writes() == []


def test_a_choice_that_is_printed_needs_no_range(simulator: Simulator, bus: Bus) -> None:
    drive = bus.drive(GD350, "gd350")
    assert drive.describe("P00.06").choices[8] == "Modbus"
    drive.write("P00.06", 8, store=True)
    assert [write[1:] for write in simulator.drive(GD350).writes()] == [(0x0006, 8)]
