"""Bad input: the right class, a message that names value, range and the closest match, and nothing sent."""

from __future__ import annotations

import asyncio
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, PortError, Profile, Simulator

SHIPPED = Path(__file__).resolve().parent.parent.parent / "crates/drives/profiles/gd350"

Call = Callable[[Bus, Drive], object]

BUS: list[tuple[Call, str]] = [
    (lambda bus, _: bus.read(0, 0), r"unit 0 .*1 to 247"),
    (lambda bus, _: bus.read(248, 0), r"unit 248 .*1 to 247"),
    (lambda bus, _: bus.read(-1, 0), r"unit -1 .*1 to 247"),
    (lambda bus, _: bus.read("1", 0), r'unit "1" .*1 to 247'),  # type: ignore[arg-type]
    (lambda bus, _: bus.read(1.0, 0), r"unit 1\.0 .*1 to 247"),  # type: ignore[arg-type]
    (lambda bus, _: bus.read(True, 0), r"unit True .*1 to 247"),
    (lambda bus, _: bus.read(None, 0), r"unit None .*1 to 247"),  # type: ignore[arg-type]
    (lambda bus, _: bus.read(1, 0x10000), r"address 0x10000 .*0xffff"),
    (lambda bus, _: bus.read(1, -1), r"address -1 .*0xffff"),
    (lambda bus, _: bus.read(1, 0, 0), r"count 0 .*1 to 125"),
    (lambda bus, _: bus.read(1, 0, 126), r"count 126 .*1 to 125"),
    (lambda bus, _: bus.read(1, 0xFFFF, 2), r"2 words from FFFFH"),
    (lambda bus, _: bus.read(1, 0, 10**30), r"count 10+ .*1 to 125"),
    (lambda bus, _: bus.write(1, 0, 0x10000), r"value 65536 .*0 to 65535"),
    (lambda bus, _: bus.write(1, 0, -1), r"value -1 .*0 to 65535"),
    (lambda bus, _: bus.write(1, 0, 1.5), r"value 1\.5 .*0 to 65535"),  # type: ignore[arg-type]
    (lambda bus, _: bus.write(1, 0, "5"), r'value "5" .*0 to 65535'),  # type: ignore[arg-type]
    (lambda bus, _: bus.write(1, 0, []), r"number of values 0 .*1 to 123"),
    (lambda bus, _: bus.write(1, 0, [0] * 124), r"number of values 124 .*1 to 123"),
    (lambda bus, _: bus.write(1, 0, [1, 70000]), r"value 1 of the sequence: 70000 .*0 to 65535"),
    (lambda bus, _: bus.write(0, 0, 1), r"unit 0 .*broadcast\(\)"),
    (lambda bus, _: bus.broadcast(0x10000, 1), r"address 0x10000"),
    (lambda bus, _: bus.echo(1, 0x10000), r"word 0x10000 .*0xffff"),
    (lambda bus, _: bus.transact(1, b""), r"PDU of 0 bytes .*1 to 253"),
    (lambda bus, _: bus.transact(1, bytes(254)), r"PDU of 254 bytes .*1 to 253"),
    (lambda bus, _: bus.transact(1, "03"), r'"03" is not; .*1 to 253'),  # type: ignore[arg-type]
    (lambda bus, _: bus.transact(1, b"\x03", 254), r"reply_length 254 .*1 to 253"),
    (lambda bus, _: list(bus.scan([300])), r"unit 300 .*1 to 247"),
    (lambda bus, _: list(bus.scan([1], timeout=0)), r"timeout 0 .*more than 0"),
    (lambda bus, _: bus.scan(5), r"units is 5; .*1 to 247"),  # type: ignore[arg-type]
    (lambda bus, _: bus.drive(0), r"unit 0"),
    (lambda bus, _: bus.drive(1, "gd355"), r"gd355.*gd350"),
    (lambda bus, _: bus.drive(1, "/nowhere/at/all"), r"/nowhere/at/all"),
    (lambda bus, _: bus.drive(1, 5), r"5 is not a profile"),  # type: ignore[arg-type]
    (lambda bus, _: bus.sleep(-1), r"seconds -1"),
]

DRIVE: list[tuple[Call, str]] = [
    (lambda _, drive: drive.read(*[]), r"at least one name"),
    (lambda _, drive: drive.read("output_curent"), r"output_curent.*output_current"),
    (lambda _, drive: drive.read("P00.1x"), r"P00\.1x.*P0"),
    (lambda _, drive: drive.read("P99.01"), r"P99\.01"),
    (lambda _, drive: drive.monitor("bus_voltag"), r"bus_voltag.*bus_voltage"),
    (lambda _, drive: drive.describe("rotation_sped"), r"rotation_speed"),
    (lambda _, drive: drive.write("P00.11", 3600.1), r"P00\.11.*3600\.1.*3600"),
    (lambda _, drive: drive.write("P00.11", -0.1), r"P00\.11.*-0\.1.*0"),
    (lambda _, drive: drive.write("P00.11", 0.05), r"P00\.11.*0\.05"),
    (lambda _, drive: drive.write("P00.11", math.nan), r"(?i)P00\.11.*nan"),
    (lambda _, drive: drive.write("P00.11", math.inf), r"(?i)P00\.11.*inf"),
    (lambda _, drive: drive.write("P00.11", "fast"), r"P00\.11.*fast"),
    (lambda _, drive: drive.write("P00.11", object()), r"P00\.11"),
    (lambda _, drive: drive.write("P00.11", None), r"P00\.11"),
    (lambda _, drive: drive.write("P00.06", "Modbos"), r"Modbos.*Modbus"),
    (lambda _, drive: drive.write("P00.111", 5.0), r"P00\.111.*P00\.11"),
    (lambda _, drive: drive.write("output_current", 1.0), r"output_current.*read-only"),
    (lambda _, drive: drive.write("control_command", 1), r"control_command.*run\(\)"),
    (lambda _, drive: drive.write("virtual_input", 1), r"virtual_input"),
    (lambda _, drive: drive.run(-1.0), r"setpoint -1\.0 .*0"),
    (lambda _, drive: drive.run(math.nan), r"setpoint nan"),
    (lambda _, drive: drive.run("10"), r'setpoint "10"'),  # type: ignore[arg-type]
    (lambda _, drive: drive.run(1e9), r"set_frequency|setpoint"),
    (lambda _, drive: drive.run(10.0, confirm=-1), r"confirm -1"),
    (lambda _, drive: setattr(drive, "setpoint", 700.0), r"700"),
    (lambda _, drive: drive.wait_for_speed(-1), r"frequency -1"),
    (lambda _, drive: drive.wait_for_speed(1, tolerance=-1), r"tolerance -1"),
    (lambda _, drive: drive.wait_until_stopped(timeout=-1), r"timeout -1"),
]


@pytest.mark.parametrize(("call", "message"), BUS + DRIVE, ids=lambda each: each if isinstance(each, str) else "")
def test_a_bad_argument_is_named_and_nothing_is_sent(
    virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive, call: Call, message: str
) -> None:
    before = virtual.line.requests
    with pytest.raises(NotAllowed, match=message) as refused:
        call(virtual_bus, virtual_drive)
    assert refused.value.request == b""
    assert virtual.line.requests == before


FORMATS: list[tuple[dict[str, Any], str]] = [
    ({"baudrate": 0}, "0"),
    ({"baudrate": -9600}, "-9600"),
    ({"baudrate": "fast"}, "fast"),
    ({"parity": "X"}, r"X.*N.*E.*O"),
    ({"parity": 1}, "1"),
    ({"stopbits": 3}, r"3.*1.*2"),
    ({"bytesize": 9}, r"9.*7.*8"),
    ({"silence": "strict"}, r"strict.*spec.*characters"),
    ({"silence": -1.0}, "-1"),
    ({"silence": math.nan}, "(?i)nan"),
]


@pytest.mark.parametrize(("arguments", "message"), FORMATS, ids=str)
def test_a_bad_format_is_named(arguments: dict[str, Any], message: str) -> None:
    for make in (
        lambda: drivebus.SerialFormat(**arguments),
        lambda: Bus("sim://gd350", **arguments),
        lambda: Simulator({1: "gd350"}, transport="process", **arguments),
    ):
        with pytest.raises(NotAllowed, match=message):
            make()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"timeout": 0}, "timeout 0 .*more than 0"),
        ({"timeout": "1"}, 'timeout "1"'),
        ({"retries": -1}, r"retries -1 .*0 to 100"),
        ({"retries": 1.5}, r"retries 1\.5"),
        ({"echo": "maybe"}, "maybe"),
        ({"echo": None}, "echo None .*auto"),
        ({"turnaround": -1}, r"turnaround -1 .*0 to 3600"),
        ({"read_only": "no"}, 'read_only "no" .*True'),
        ({"learn_timeout": 0.1}, r"learn_timeout 0\.1 .*True"),
        ({"low_latency": 1}, "low_latency 1 .*True"),
        ({"rs485": {"mode": "rts"}}, "rs485 is for a serial port"),
    ],
    ids=str,
)
@pytest.mark.parametrize("port", ["sim://gd350", "socket://127.0.0.1:1"])
def test_a_bad_policy_is_named(port: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(NotAllowed, match=message):
        Bus(port, **arguments)
    with pytest.raises(NotAllowed, match=message):
        asyncio.run(drivebus.aio.Bus.open(port, **arguments))


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("", "not a port"),
        ("a\0b", "not a port"),
        (None, "not a port"),
        (7, "not a port"),
        ("sock://localhost:1", "sock://.*did you mean .socket"),
        ("sim://gd355", "gd355.*did you mean .gd35"),
        ("sim://0=gd350", r"unit 0 .*1 to 247"),
        ("sim://x=gd350", r"unit .x. .*1 to 247"),
        ("sim://1=gd350,1=gd350", "twice"),
        ("sim://gd350?clock=fast", "clock .fast. .*real, virtual"),
        ("sim://gd350?sede=1", "sede.*did you mean .seed"),
        ("sim://gd350?seed=x", "seed .x."),
    ],
    ids=str,
)
def test_a_port_that_is_none_is_named(port: object, message: str) -> None:
    with pytest.raises(NotAllowed, match=message):
        Bus(port)


@pytest.mark.parametrize(
    "port",
    ["/dev/drivebus-is-not-here", "/", "socket://127.0.0.1:1", "tcp://127.0.0.1:1", "rfc2217://127.0.0.1:1"],
)
def test_a_port_that_cannot_be_opened_is_named(port: str) -> None:
    with pytest.raises(PortError) as failed:
        Bus(port)
    assert port.partition("://")[2] in str(failed.value) or port in str(failed.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (({},), "units {} name no drive"),
        (("gd350",), 'units "gd350" name no drive'),
        (({0: "gd350"},), "unit 0"),
        (({1: "gd35O"},), 'gd35O.*the closest is "gd35'),
    ],
    ids=str,
)
def test_a_simulation_that_makes_no_sense_is_named(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(NotAllowed, match=message):
        Simulator(*arguments, transport="process")


@pytest.mark.parametrize("fifo", [0, 257])
def test_a_fifo_has_room_for_a_character_and_not_for_ever(fifo: int) -> None:
    with pytest.raises(NotAllowed, match=rf"fifo.*{fifo}.*1.*256"):
        Simulator({1: "gd350"}, fifo=fifo)


def test_virtual_time_is_for_this_process_only() -> None:
    with pytest.raises(NotAllowed, match='"process"'):
        Simulator({1: "gd350"}, clock="virtual")
    with (
        Simulator({1: "gd350"}, transport="process") as simulator,
        pytest.raises(NotAllowed),
    ):
        simulator.advance(1.0)


def test_the_machines_side_is_checked_too(virtual: Simulator) -> None:
    machine = virtual.drive(1)
    for load in (-0.1, 4.1, math.nan, "much"):
        with pytest.raises(NotAllowed, match="load"):
            machine.load = load  # type: ignore[assignment]
    with pytest.raises(NotAllowed, match=r"OL9.*did you mean"):
        machine.trip("OL9")
    with pytest.raises(NotAllowed, match="unit 3"):
        virtual.drive(3)


TIMES: dict[str, Callable[[Simulator, Bus, float], object]] = {
    "timeout of a bus": lambda simulator, _, time: Bus(simulator, timeout=time),
    "timeout of a read": lambda _, bus, time: bus.read(1, 0x2103, timeout=time),
    "timeout of a write": lambda _, bus, time: bus.write(1, 0x800B, 1, timeout=time),
    "timeout of a unit": lambda _, bus, time: bus.configure(1, timeout=time),
    "gap of a unit": lambda _, bus, time: bus.configure(1, gap=time),
    "sleep": lambda _, bus, time: bus.sleep(time),
    "listen": lambda _, bus, time: bus.listen(time),
    "advance": lambda simulator, _, time: simulator.advance(time),
}


@pytest.mark.parametrize("what", TIMES)
@pytest.mark.parametrize("time", [-1.0, -1e-9, -math.inf, math.inf, math.nan, 1e300])
def test_no_time_is_longer_than_a_clock_counts_or_none_at_all(virtual: Simulator, what: str, time: float) -> None:
    with Bus(virtual) as bus:
        requests = bus.stats()["requests"]
        with pytest.raises(NotAllowed, match=r"timeout|gap|second|time"):
            TIMES[what](virtual, bus, time)
        assert bus.stats()["requests"] == requests, "nothing was sent"


def test_a_closed_bus_says_so(virtual: Simulator) -> None:
    bus = Bus(virtual)
    bus.close()
    bus.close()
    assert bus.closed
    with pytest.raises(PortError, match="closed"):
        bus.read(1, 0)


class TestProfileFolders:
    def test_a_folder_that_is_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(NotAllowed, match="nothing"):
            Profile.load(tmp_path / "nothing")

    def test_an_empty_folder(self, tmp_path: Path) -> None:
        with pytest.raises(NotAllowed, match=r"No such file"):
            Profile.load(tmp_path)

    @pytest.mark.parametrize("text", ["name = ", "\0", "name = 5", "[[[", 'name = "x"'], ids=repr)
    def test_a_broken_file_is_named(self, tmp_path: Path, text: str) -> None:
        shutil.copytree(SHIPPED, tmp_path, dirs_exist_ok=True)
        assert Profile.load(tmp_path).name == "gd350"
        (tmp_path / "profile.toml").write_text(text, encoding="utf-8")
        with pytest.raises(NotAllowed, match=r"profile\.toml"):
            Profile.load(tmp_path)

    def test_a_name_that_is_none(self) -> None:
        with pytest.raises(NotAllowed, match=r"gd355.*gd350"):
            Profile.builtin("gd355")


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (0x0180, "a sd1, a family without a profile yet; it reports 0180H"),
        (0x4242, "4242H, which is not a known code"),
    ],
)
def test_a_family_without_a_profile_is_not_taken_for_another(
    virtual: Simulator, virtual_bus: Bus, code: int, says: str
) -> None:
    virtual_bus.read(1, 0x2100)  # first contact is over
    body = bytes([1, 3, 2, *code.to_bytes(2, "big")])
    virtual.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))
    with pytest.raises(NotAllowed, match=says):
        virtual_bus.drive(1)


def test_a_shipped_name_is_not_looked_for_in_the_present_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gd350").mkdir()
    monkeypatch.chdir(tmp_path)
    assert Profile.find("gd350") is Profile.builtin("gd350")
    with pytest.raises(NotAllowed, match=r"profile\.toml"):
        Profile.find("./gd350")
