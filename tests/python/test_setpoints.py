"""Setpoints in engineering units, and words whose bits have names. GD350: chapter 9.4.5. VFD500: p. 135.

P09.00 = 6 and P09.02 = 4 are what sister series print for a PID whose setpoint and feedback come over the bus.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, Simulator

PID_SOURCE, FEEDBACK_SOURCE = 0x0900, 0x0902
VIRTUAL_INPUTS, VIRTUAL_OUTPUTS, SPECIAL = 0x200A, 0x200B, 0x2009


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.25) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus, simulator: Simulator) -> Drive:
    drive = bus.drive(1)
    drive.prepare_control()
    simulator.drive(1).take_writes()
    return drive


def taken(simulator: Simulator, unit: int = 1) -> list[tuple[int, int]]:
    return [word[1:] for word in simulator.drive(unit).take_writes()]


VALUES = [
    # name, value, address and word of a GD350
    ("torque", -50.0, 0x2004, 0x10000 - 500),
    ("forward_limit", 45.5, 0x2005, 4550),
    ("reverse_limit", 12.25, 0x2006, 1225),
    ("motoring_torque_limit", 150.0, 0x2007, 1500),
    ("braking_torque_limit", 300.0, 0x2008, 3000),
    ("vf_voltage", 33.3, 0x200C, 333),
    ("analog_output_1", 100.0, 0x200D, 1000),
    ("analog_output_2", -12.5, 0x200E, 0x10000 - 125),
]


@pytest.mark.parametrize(("name", "value", "address", "word"), VALUES)
def test_what_is_set_goes_out_in_counts_and_is_read_back(
    simulator: Simulator, drive: Drive, name: str, value: float, address: int, word: int
) -> None:
    drive.write_setpoint(value, name)
    assert taken(simulator) == [(address, word)]
    assert drive.read_setpoint(name) == value


@pytest.mark.parametrize(
    ("name", "value", "address", "word"),
    [
        ("torque", -50.0, 0x7002, 0x10000 - 5000),
        ("motoring_torque_limit", 150.0, 0x7005, 1500),
        ("braking_torque_limit", 299.9, 0x7006, 2999),
        ("pid", 50.0, 0x7007, 5000),
        ("pid_feedback", -0.01, 0x7008, 0xFFFF),
        ("vf_voltage", 33.3, 0x7009, 333),
    ],
)
def test_another_family_counts_otherwise(
    simulator: Simulator, bus: Bus, name: str, value: float, address: int, word: int
) -> None:
    drive = bus.drive(2, "vfd500", unverified=True)
    drive.write_setpoint(value, name)
    assert taken(simulator, 2) == [(address, word)]
    with pytest.raises(NotAllowed, match="can only be written"):
        drive.read_setpoint(name)


@pytest.mark.parametrize(
    ("name", "value"),
    [("torque", 300.1), ("torque", float("nan")), ("torque", "much"), ("torque", True), ("vf_voltage", -0.1)],
)
def test_a_value_that_is_none_is_not_sent(simulator: Simulator, drive: Drive, name: str, value: object) -> None:
    with pytest.raises(NotAllowed):
        drive.write_setpoint(value, name)  # type: ignore[arg-type]
    assert taken(simulator) == []


def test_a_bit_whose_place_is_not_printed_is_set_only_for_who_says_so(bus: Bus, simulator: Simulator) -> None:
    """VFD500, 700AH: the page has lost the empty cells of its table, so the places of the outputs are probable."""
    drive = bus.drive(2, "vfd500")
    assert drive.describe("virtual_output").unverified_bits == ("DO1", "DO2", "RL1", "RL2", "VDO1", "VDO2")
    with pytest.raises(NotAllowed, match=r"virtual_output .*probable, not printed.*unverified=True"):
        drive.set_virtual_outputs(RL1=True)
    assert taken(simulator, 2) == []
    drive.set_virtual_outputs(RL1=True, unverified=True)
    assert taken(simulator, 2) == [(0x700A, 0x0004)]


def test_true_is_no_number(drive: Drive, simulator: Simulator) -> None:
    for name in ("P00.11", "set_frequency", "P00.01"):
        with pytest.raises(NotAllowed, match=f"{name} = True: (not|neither) a number"):
            drive.write(name, True)
    assert taken(simulator) == []
    drive.write("P01.21", True)
    assert taken(simulator) == [(0x8000 | 0x0115, 1)]


def test_a_limit_is_held_against_the_drives_own_maximum(simulator: Simulator, drive: Drive) -> None:
    with pytest.raises(NotAllowed, match=r"fwd_upper_frequency .*= 60 Hz is above P00\.03 .*is 50 Hz"):
        drive.write_setpoint(60.0, "forward_limit")
    assert taken(simulator) == []


def test_what_the_family_does_not_have_is_said(bus: Bus, simulator: Simulator) -> None:
    drive = bus.drive(2, "vfd500")
    attempts: list[Callable[[], None]] = [
        lambda: drive.write_setpoint(5.0, "analog_output_1"),
        lambda: drive.write_setpoint(5.0, "speed"),
        lambda: drive.set_virtual_inputs(S1=True),
    ]
    for attempt in attempts:
        with pytest.raises(NotAllowed, match="of Veikong VFD500 is known, only frequency, torque"):
            attempt()
    with pytest.raises(NotAllowed, match='setpoint "speed" is unknown'):
        drive.check_control("speed")
    assert taken(simulator, 2) == []


BAD_NAMES: list[Callable[[Any], object]] = [
    lambda drive: drive.read([]),
    lambda drive: drive.read(["output_current", "bus_voltage"]),
    lambda drive: drive.read("output_current", 5),
    lambda drive: drive.monitor({}),
    lambda drive: drive.readable([]),
    lambda drive: drive.bits([]),
    lambda drive: drive.write([1], 2),
    lambda drive: drive.write({None: 1}),
    lambda drive: drive.write("P00.11", 2.0, store="yes"),
    lambda drive: drive.write_setpoint(1, []),
    lambda drive: drive.write_setpoint("torque", 40.0),
    lambda drive: drive.read_setpoint(None),
    lambda drive: drive.check_control([]),
    lambda drive: drive.prepare_control(store="yes"),
    lambda drive: drive.prepare_control(setpoint=5),
    lambda drive: drive.special_control(motor=[1]),
    lambda drive: drive.set_virtual_inputs(S1=2),
    lambda drive: drive.set_virtual_inputs(S1=True, force=3),
    lambda drive: drive.write_words("a", 1),
    lambda drive: drive.write_words(0x2001, []),
    lambda drive: drive.bus.drive(1, "gd350", variants="Hz"),
    lambda drive: drive.bus.drive(2, "vfd500", variants={"speed_unit": 5}),
    lambda drive: drive.bus.identify("one"),
]


@pytest.mark.parametrize("call", BAD_NAMES)
def test_what_is_no_name_and_no_value_is_refused_in_words(
    simulator: Simulator, drive: Drive, call: Callable[[Any], object]
) -> None:
    with pytest.raises(NotAllowed):
        call(drive)
    assert taken(simulator) == []


class TestWhatTheDriveHeeds:
    @pytest.mark.parametrize(
        ("name", "source", "number", "register"),
        [("pid", "P09.00", 6, 0x2002), ("pid_feedback", "P09.02", 4, 0x2003)],
    )
    def test_a_setpoint_that_would_be_ignored_is_not_sent(
        self, simulator: Simulator, drive: Drive, name: str, source: str, number: int, register: int
    ) -> None:
        with pytest.raises(NotAllowed, match=rf'would ignore.*\n{source}.*needs {number}.*\n.*setpoint="{name}"'):
            drive.write_setpoint(50.0, name)
        assert taken(simulator) == []
        assert not drive.check_control(name)
        with pytest.raises(NotAllowed, match=rf"{source}.*not verified"):
            drive.prepare_control(setpoint=name)
        assert taken(simulator) == []
        control = drive.prepare_control(setpoint=name, unverified=True)
        assert [item.code for item in control] == ["P00.01", "P00.02", source]
        assert taken(simulator) == [(0x8000 | drive.profile.address(source), number)]
        drive.write_setpoint(50.0, name)
        assert taken(simulator) == [(register, 500)]

    def test_by_its_own_name_it_is_written_all_the_same(self, simulator: Simulator, drive: Drive) -> None:
        drive.write("pid_reference", 50.0)
        assert taken(simulator) == [(0x2002, 500)]


class TestBits:
    def test_terminals_have_names(self, simulator: Simulator, bus: Bus, drive: Drive) -> None:
        simulator.drive(1).inputs = 0b100010
        inputs = drive.inputs()
        assert inputs == {"S1": False, "S2": True, "S3": False, "S4": False, "HDIA": False, "HDIB": True}
        assert drive.outputs() == {"Y1": False, "HDO": False, "RO1": False, "RO2": False}
        assert set(bus.drive(2, "vfd500").inputs()) == {"DI1", "DI2", "DI3", "DI4", "DI5"}
        with pytest.raises(NotAllowed, match="no output state word"):
            bus.drive(2, "vfd500").outputs()

    def test_any_word_is_told_in_the_words_of_its_fields(self, drive: Drive) -> None:
        fields = drive.bits("status_word_2")
        assert (fields["ready"], fields["control_channel"], fields["motor"]) == ("ready", "communication", "motor 1")
        assert drive.bits("bus_voltage") == {}

    def test_outputs_keep_what_is_not_named(self, simulator: Simulator, drive: Drive) -> None:
        drive.set_virtual_outputs(RO1=True, Y1=True)
        drive.set_virtual_outputs(Y1=False, RO2=True)
        assert taken(simulator) == [(VIRTUAL_OUTPUTS, 0b0101), (VIRTUAL_OUTPUTS, 0b1100)]

    def test_what_can_only_be_written_is_off_where_it_is_not_named(self, simulator: Simulator, bus: Bus) -> None:
        drive = bus.drive(2, "vfd500", unverified=True)
        drive.set_virtual_outputs(DO2=True, VDO1=True)
        drive.set_virtual_outputs(DO1=True)
        assert taken(simulator, 2) == [(0x700A, 0x0102), (0x700A, 0x0001)]

    def test_the_special_control_word(self, simulator: Simulator, drive: Drive) -> None:
        drive.special_control(motor=2, pre_excitation=True)
        drive.special_control(dc_brake="on", motor="motor 1", pre_excitation=False)
        assert taken(simulator) == [(SPECIAL, 0b010001), (SPECIAL, 0b100000)]

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"engine": 1}, '"engine" is unknown'),
            ({"motor": 5}, "motor is 5, which .*3 = motor 4"),
            ({"motor": True}, "motor is True"),
            ({"dc_brake": "maybe"}, 'dc_brake is "maybe"'),
            ({}, "nothing to set"),
        ],
    )
    def test_a_bit_that_is_none(self, simulator: Simulator, drive: Drive, given: dict[str, Any], message: str) -> None:
        with pytest.raises(NotAllowed, match=message):
            drive.special_control(**given)
        assert taken(simulator) == []

    def test_inputs_can_start_a_motor_so_they_are_checked_as_a_start(self, simulator: Simulator, drive: Drive) -> None:
        drive.set_virtual_inputs(S1=True, HDIA=True)
        drive.set_virtual_inputs(S8=True, S1=False)
        assert taken(simulator) == [(VIRTUAL_INPUTS, 0b0000010001), (VIRTUAL_INPUTS, 0b1000010000)]
        simulator.drive(1).trip("OL1")
        with pytest.raises(NotAllowed, match="in fault OL1"):
            drive.set_virtual_inputs(S1=True)
        assert taken(simulator) == []

    def test_and_they_are_sent_once(self, simulator: Simulator, drive: Drive) -> None:
        drive.bus.echo(1)  # type: ignore[attr-defined]
        for name in ("set_virtual_inputs", "special_control"):
            simulator.line.script([(3, "silence")])  # a look, the word as it is, and the one that is written
            field = {"S1": True} if name == "set_virtual_inputs" else {"dc_brake": True}
            with pytest.raises(drivebus.Unconfirmed, match=r"the motor may turn.*not repeated"):
                getattr(drive, name)(**field)
            assert len(taken(simulator)) == 1


def test_the_awaitable_face_has_the_same(simulator: Simulator) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(1)
            await drive.prepare_control()
            simulator.drive(1).take_writes()
            for name, value, address, word in VALUES:
                await drive.write_setpoint(value, name)
                assert await drive.read_setpoint(name) == value
                assert taken(simulator) == [(address, word)]
            with pytest.raises(NotAllowed, match="would ignore"):
                await drive.write_setpoint(50.0, "pid")
            await drive.set_virtual_outputs(Y1=True)
            assert (await drive.inputs())["S1"] is False
            assert (await drive.bits("virtual_output"))["Y1"] == "on"
            await drive.special_control(motor=3)
            await drive.write_words(0x2001, 1000)
            assert await drive.read_setpoint() == 10.0
            assert taken(simulator) == [(VIRTUAL_OUTPUTS, 1), (SPECIAL, 2), (0x2001, 1000)]

    asyncio.run(main())


def test_no_start_at_a_speed_that_comes_from_elsewhere(drive: Drive, simulator: Simulator) -> None:
    """P00.06 = 0: the keypad's 50 Hz, whatever the bus says. GD350 manual, chapter 9.4.5."""
    drive.write("P00.06", 0, unverified=True)
    simulator.drive(1).take_writes()
    with pytest.raises(NotAllowed, match=r"would not take its speed from the bus:\nP00\.06 .*: 0, needs 8"):
        drive.run(5.0)
    assert taken(simulator) == []
    drive.run()  # the speed it has is what is asked for


def test_no_start_by_the_bus_where_only_a_parameter_tells_who_commands() -> None:
    """GD600: no status word tells, P00.01 does. Manual, p. 131."""
    with Bus("sim://3=gd600?clock=virtual") as bus:
        drive = bus.drive(3, "gd600")
        with pytest.raises(NotAllowed, match=r"does not take its commands from the bus:\nP00\.01 .*: 0, needs 2"):
            drive.run(5.0)
        drive.prepare_control(store=True)
        drive.run(5.0)


class TestCheckedBefore:
    """Setpoints that the drive was asked for once: each write is one request then."""

    def test_a_write_is_one_request_and_goes_to_the_nearest_count(
        self, virtual: Simulator, virtual_drive: Drive
    ) -> None:
        before = virtual.line.requests
        allowed = virtual_drive.check_setpoints(10.0, 30.0)
        assert virtual.line.requests - before == 1
        virtual.drive(1).take_writes()
        before = virtual.line.requests
        for hz in (10.0, 12.3449, 12.346, 30.0):
            virtual_drive.write_setpoint(hz, checked=allowed)
        assert virtual.line.requests - before == 4
        assert [word for _, _, word in virtual.drive(1).take_writes()] == [1000, 1234, 1235, 3000]
        assert (allowed.nearest(12.3449), allowed.address, allowed.low, allowed.high) == (12.34, 1, 10.0, 30.0)

    @pytest.mark.parametrize(
        ("low", "high"), [(10.0, 60.0), (10.0, 700.0), (30.0, 10.0), (-1.0, 10.0), (0.0, math.nan)]
    )
    def test_what_the_drive_would_not_take_is_told_and_nothing_is_sent(
        self, virtual: Simulator, virtual_drive: Drive, low: float, high: float
    ) -> None:
        virtual.drive(1).take_writes()
        with pytest.raises(NotAllowed):
            virtual_drive.check_setpoints(low, high)
        assert virtual.drive(1).take_writes() == []

    @pytest.mark.parametrize("hz", [9.99, 30.01, math.inf, math.nan, "10", True])
    def test_what_was_not_checked_is_not_sent(self, virtual: Simulator, virtual_drive: Drive, hz: Any) -> None:
        allowed = virtual_drive.check_setpoints(10.0, 30.0)
        virtual.drive(1).take_writes()
        with pytest.raises(NotAllowed):
            virtual_drive.write_setpoint(hz, checked=allowed)
        assert virtual.drive(1).take_writes() == []

    def test_what_was_checked_of_another_drive_is_not_taken(self, virtual: Simulator, virtual_bus: Bus) -> None:
        one, two = virtual_bus.drive(1), virtual_bus.drive(2)
        allowed = two.check_setpoints(10.0, 30.0)
        wrong: list[tuple[Any, str, str]] = [
            (allowed, "frequency", "the frequency of unit 2.*was checked, and not the frequency of unit 1"),
            (one.check_setpoints(10.0, 30.0), "torque", "and not the torque of unit 1"),
            (30.0, "frequency", "checked takes what check_setpoints gave"),
        ]
        for checked, name, message in wrong:
            with pytest.raises(NotAllowed, match=message):
                one.write_setpoint(20.0, name, checked=checked)
        assert virtual.drive(1).take_writes() == []


def test_a_profile_as_the_drive_is_set() -> None:
    """VFD500: P30.14 says whether the speed is in Hz or in hundredths of a percent (instruction manual, p. 135)."""
    with Simulator({1: "vfd500"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, unverified=True)
        name = drive.profile.role("setpoints.frequency") or ""
        seen = []
        for word in (0, 1):
            drive.write("P30.14", word)
            before = simulator.line.requests
            profile = drive.settled_profile(name)
            assert simulator.line.requests - before == 1
            seen.append((profile.describe(name).unit, profile.decode(name, 5000)))
        assert seen == [("%", 50.0), ("Hz", 50.0)]
        before = simulator.line.requests
        assert drive.settled_profile("P00.13").name == "vfd500"
        assert simulator.line.requests == before
