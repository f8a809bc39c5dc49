"""Goodrive10, 20, 100 and 200A: a whole job with each, against bytes typed from their manuals.

2000H takes 1 forward, 5 stop, 6 coast, 7 reset: GD10 (manualshive 1058543), p. 88; GD20-EU (2085690), p. 141; GD100
(2085750), p. 167; GD200A (2085692), p. 146. 2001H counts 0.01 Hz; of a GD100 its sisters print it. Codes of 2103H:
GD10, p. 90 (010DH, and 010BH for a GD100); GD20 (2324086), p. 140 (0106H); GD200A, p. 147 (0107H). 8007H is P00.07
in RAM: GD20-EU, p. 132; GD100, p. 167; GD200A, p. 146.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from click.testing import CliRunner

import drivebus
import drivebus.aio
from drivebus import Bus, NotAllowed, Profile, Simulator, State
from drivebus.cli import cli

UNITS = {"gd10": 10, "gd20": 20, "gd100": 100, "gd200a": 200}
FAMILIES = list(UNITS)

FORWARD_AT_10_HZ = "10 2000 0002 04 0001 03E8"
STOP, COAST, RESET = "06 2000 0005", "06 2000 0006", "06 2000 0007"
TO_OBEY = ("06 0001 0002", "06 0006 0008")
"""P00.01 and P00.06, in EEPROM; P00.02 is 0 from the factory, where it is known."""

CODE = {"gd10": "03 02 010D", "gd20": "03 02 0106", "gd100": "03 02 010B", "gd200a": "03 02 0107"}

MEASURED = {
    # A GD10 calls 300EH to 3011H and 3013H reserved (p. 90), a GD20 3011H (p. 140): there nothing is read.
    "gd10": [*range(0x3000, 0x300E), 0x3012, 0x3014, 0x3015, 0x3016],
    "gd20": [*range(0x3000, 0x3011), *range(0x3012, 0x3017)],
    "gd100": [*range(0x3000, 0x3017)],
    # A GD200A calls 300FH and 3011H reserved (operation manual, p. 141).
    "gd200a": [*range(0x3000, 0x300F), 0x3010, *range(0x3012, 0x3017)],
}


FAULT = dict.fromkeys(UNITS, (35, "STo")) | {"gd200a": (33, "ETH2")}
"""GD10 manual, p. 94; GD200A operation manual, p. 72, which has no 35."""


def pdu(text: str) -> bytes:
    return bytes.fromhex(text)


def crc(data: bytes) -> bytes:
    """Modbus over Serial Line V1.02, section 6.2.2, bit by bit; the low byte travels first."""
    word = 0xFFFF
    for byte in data:
        word ^= byte
        for _ in range(8):
            word = (word >> 1) ^ (0xA001 if word & 1 else 0)
    return word.to_bytes(2, "little")


def on_wire(family: str, text: str) -> bytes:
    data = bytes([UNITS[family]]) + pdu(text)
    return data + crc(data)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({unit: name for name, unit in UNITS.items()}, transport="process", clock="virtual") as simulator:
        yield simulator


def frames(simulator: Simulator, side: str) -> list[bytes]:
    return [data for _, who, data in simulator.line.trace() if who == side]


def written(simulator: Simulator) -> list[bytes]:
    return [frame for frame in frames(simulator, "master") if frame[1] in (0x06, 0x10)]


def program(bus: Any, drive: Any, simulator: Simulator) -> list[Callable[[Any], Any]]:
    machine = simulator.drive(drive.unit)
    return [
        lambda _: bus.identify(drive.unit),
        lambda _: drive.prepare_control(store=True),
        lambda _: drive.run(10.0),
        lambda _: drive.wait_for_speed(timeout=100),
        lambda _: drive.monitor(),
        lambda _: machine.trip(FAULT[drive.profile.name][0]),
        lambda _: drive.fault(),
        lambda _: drive.reset_fault(),
        lambda _: drive.run(10.0),
        lambda _: drive.coast(),
        lambda _: simulator.advance(100.0),
        lambda _: drive.run(10.0),
        lambda _: drive.stop(),
        lambda _: drive.wait_until_stopped(timeout=100),
        lambda _: drive.status(),
    ]


def at_once(family: str, simulator: Simulator) -> list[Any]:
    with Bus(simulator, timeout=0.25) as bus:
        drive = bus.drive(UNITS[family], family, unverified=True)
        return [step(None) for step in program(bus, drive, simulator)]


def awaited(family: str, simulator: Simulator) -> list[Any]:
    async def main() -> list[Any]:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(UNITS[family], family, unverified=True)
            given = []
            for step in program(bus, drive, simulator):
                result = step(None)
                given.append(await result if inspect.isawaitable(result) else result)
            return given

    return asyncio.run(main())


@pytest.mark.parametrize("face", [at_once, awaited])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_whole_job(simulator: Simulator, family: str, face: Callable[[str, Simulator], list[Any]]) -> None:
    found, control, _, reached, seen, _, fault, *_, stopped, status = face(family, simulator)
    assert (found.certainty, found.family) == ("certain", family)
    assert on_wire(family, "03 2103 0001") in frames(simulator, "master")
    assert on_wire(family, CODE[family]) in frames(simulator, "unit")
    assert control
    assert (reached.state, stopped.state, status.state, status.fault) == (
        State.FORWARD,
        State.STOPPED,
        State.STOPPED,
        None,
    )
    assert reached.frequency == pytest.approx(10.0, abs=0.11)
    assert (fault.code, fault.mnemonic) == FAULT[family]
    assert seen["running_frequency"] == pytest.approx(10.0, abs=0.11)

    told = [*TO_OBEY, FORWARD_AT_10_HZ, RESET, FORWARD_AT_10_HZ, COAST, FORWARD_AT_10_HZ, STOP]
    assert written(simulator) == [on_wire(family, text) for text in told]
    others = {unit: simulator.drive(unit) for name, unit in UNITS.items() if name != family}
    assert {other.state for other in others.values()} == {"stopped"}
    assert sum(other.words_written for other in others.values()) == 0


@pytest.mark.parametrize("family", FAMILIES)
def test_the_monitor_reads_nothing_else(simulator: Simulator, family: str) -> None:
    with Bus(simulator) as bus:
        drive = bus.drive(UNITS[family], family, unverified=True)
        bus.echo(UNITS[family])
        before = len(frames(simulator, "master"))
        drive.monitor()
        requests = frames(simulator, "master")[before:]
    read: list[int] = []
    for frame in requests:
        assert frame[:2] == bytes([UNITS[family], 0x03])
        first, count = int.from_bytes(frame[2:4], "big"), int.from_bytes(frame[4:6], "big")
        read += range(first, first + count)
    assert sorted(read) == MEASURED[family]


@pytest.mark.parametrize(
    ("family", "store", "text"),
    [
        ("gd10", False, "06 800B 000F"),  # as on a GD350: no GD10 page at hand has the rule
        ("gd20", False, "06 800B 000F"),
        ("gd20", True, "06 000B 000F"),
        ("gd100", False, "06 800B 000F"),
        ("gd100", True, "06 000B 000F"),
        ("gd200a", False, "06 800B 000F"),
        ("gd200a", True, "06 000B 000F"),
    ],
)
def test_p00_11_goes_to_the_memory_that_was_meant(simulator: Simulator, family: str, store: bool, text: str) -> None:
    with Bus(simulator) as bus:
        bus.drive(UNITS[family], family, unverified=True).write("P00.11", 1.5, store=store)
    assert written(simulator) == [on_wire(family, text)]
    assert simulator.drive(UNITS[family]).eeprom_writes == int(store)


@pytest.mark.parametrize(
    ("family", "started"),
    [
        # 2001H, the commands and the state are printed for GD10 and GD200A.
        ("gd10", True),
        ("gd200a", True),
        # Of a GD20 the commands and 2001H are; of a GD100 no page with 2001H is at hand.
        ("gd20", True),
        ("gd100", False),
    ],
)
def test_what_runs_without_more_trust(simulator: Simulator, family: str, started: bool) -> None:
    with Bus(simulator) as bus:
        bus.drive(UNITS[family], family, unverified=True).prepare_control()
        drive = bus.drive(UNITS[family], family)
        if not started:
            with pytest.raises(NotAllowed, match="No GD100 page at hand prints it"):
                drive.run(10.0)
            drive.run()  # the command alone is printed
        else:
            drive.run(10.0)
        simulator.advance(5.0)
        assert simulator.drive(UNITS[family]).state == "forward"
        drive.coast(confirm=0)
        assert simulator.drive(UNITS[family]).state == "stopped"


@pytest.mark.parametrize(("family", "told"), [("gd10", True), ("gd20", False), ("gd100", False), ("gd200a", True)])
def test_a_state_that_no_page_prints_takes_trust(simulator: Simulator, family: str, told: bool) -> None:
    with Bus(simulator) as bus:
        assert bus.drive(UNITS[family], family).status().state == (State.STOPPED if told else State.UNKNOWN)
        assert bus.drive(UNITS[family], family, unverified=True).status().state == State.STOPPED


@pytest.mark.parametrize("family", FAMILIES)
def test_none_of_them_says_that_it_is_ready(simulator: Simulator, family: str) -> None:
    """Bit 0 of 2101H, which says so on a GD350, is the bus voltage: GD10 manual, p. 88; GD200A manual, p. 147."""
    with Bus(simulator) as bus:
        status = bus.drive(UNITS[family], family, unverified=True).status()
    assert status.ready is None
    assert Profile.builtin(family).fields("status_word_2", 0x0001).get("ready") is None


def test_a_goodrive10_is_not_given_a_torque_or_a_limit(simulator: Simulator) -> None:
    """GD10 manual, p. 88: 2004H to 2009H, 200CH and 200EH are not in its table."""
    with Bus(simulator) as bus:
        drive = bus.drive(UNITS["gd10"], "gd10", unverified=True)
        with pytest.raises(NotAllowed):
            drive.write_setpoint(10.0, "torque")
        for setpoint in ("forward_limit", "braking_torque_limit", "vf_voltage"):
            with pytest.raises(NotAllowed):
                drive.write_setpoint(10.0, setpoint)
        with pytest.raises(NotAllowed):
            drive.special_control(motor=2)
    assert written(simulator) == []


def test_torque_control_of_a_goodrive200a_is_a_one(simulator: Simulator) -> None:
    """GD200A manual, p. 147; the same bit of a GD350 takes torque control away."""
    with Bus(simulator) as bus:
        bus.drive(UNITS["gd200a"], "gd200a").special_control(torque_control=True)
    assert written(simulator) == [on_wire("gd200a", "06 2009 0004")]


def test_a_goodrive100_that_reports_0110h_is_named_and_written_to(simulator: Simulator) -> None:
    """Its own manual, p. 171, prints 0110H; no list has that code, so it contradicts nothing."""
    unit = UNITS["gd100"]
    with Bus(simulator) as bus:
        bus.echo(unit)
        simulator.line.answer_with(on_wire("gd100", "03 02 0110"))
        found = bus.identify(unit)
        assert (found.family, found.code) == (None, 0x0110)
        simulator.line.answer_with(on_wire("gd100", "03 02 0110"))
        bus.drive(unit, "gd100").write_words(0x000B, 20)
    assert written(simulator) == [on_wire("gd100", "06 000B 0014")]


def test_the_immediate_stop_of_a_vfd500_has_a_name() -> None:
    """VFD500 manual, p. 135: 7. INVT's 7 resets a fault."""
    profile = Profile.builtin("vfd500")
    assert profile.command_codes()[7] == "immediate stop"
    assert "immediate stop" in str(profile.describe("control_command").choices)
    data = pdu("04 06 7000 0007")
    told = CliRunner().invoke(cli, ["--profile", "vfd500", "decode", (data + crc(data)).hex()])
    assert "unit 4: write control_command = 7 (immediate stop)" in told.stdout


def test_the_delay_of_a_vfd500_is_no_proved_factory_value() -> None:
    """VFD500 manual, p. 97: P30.04 takes 1 to 20 ms; its factory value is not printed."""
    serial = Profile.builtin("vfd500").serial()
    assert serial is not None
    assert (serial["baud_rate"], serial["format"], serial["response_delay"]) == (9600, "8N1", 0.02)
    assert not serial["verified"]
    assert "end of a range" in serial["source"]
