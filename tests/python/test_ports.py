"""What counts as a port: simulators, paths, URLs, and serial ports that a program already opened."""

from __future__ import annotations

import os
import pathlib
from types import SimpleNamespace

import pytest
import serial

import drivebus
from drivebus import Bus, NotAllowed, SerialFormat, Simulator

pty_only = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")


def test_a_simulator_in_process() -> None:
    with Bus("sim://1=gd350,7=gd350?clock=virtual&seed=1") as bus:
        assert bus.simulator is not None
        assert [found.unit for found in bus.scan(range(1, 10))] == [1, 7]
        assert bus.simulator.drive(7).state == "stopped"


@pytest.mark.parametrize(("text", "echoes"), [("1", True), ("true", True), ("0", False), ("False", False)])
def test_a_simulator_is_told_what_it_is_not(text: str, echoes: bool) -> None:
    with Bus(f"sim://gd350?clock=virtual&echo={text}") as bus:
        assert bus.simulator is not None
        assert bus.simulator.line.echo is echoes


@pytest.mark.parametrize("option", ["echo=off", "echo=", "strict_silence=2"])
def test_what_is_neither_yes_nor_no_is_refused(option: str) -> None:
    with pytest.raises(NotAllowed, match="allowed is 0, 1, false, true"):
        Bus(f"sim://gd350?{option}")


def test_a_simulator_in_real_time() -> None:
    with Bus("sim://gd350") as bus:
        assert bus.drive(1).profile.name == "gd350"


def test_a_simulator_keeps_its_own_format() -> None:
    with Simulator({1: "gd350"}, baudrate=9600, parity="N", transport="process") as simulator, Bus(simulator) as bus:
        assert bus.format == SerialFormat(9600, "N")
        assert bus.simulator is simulator
        assert bus.read(1, 0x2103) == [0x01A0]


@pty_only
def test_a_path_and_a_path_object() -> None:
    with Simulator({1: "gd350"}) as simulator:
        for port in (simulator.port, pathlib.Path(simulator.port)):
            with Bus(port) as bus:
                assert bus.read(1, 0x2103) == [0x01A0]
                assert simulator.port in bus.port
                assert bus.simulator is None


@pty_only
def test_an_open_serial_port_keeps_its_own_settings() -> None:
    with (
        Simulator({1: "gd350"}, baudrate=9600) as simulator,
        serial.Serial(simulator.port, 9600, timeout=0) as port,
        Bus(port) as bus,
    ):
        assert bus.format == SerialFormat(9600, "N")
        assert bus.read(1, 0x2103) == [0x01A0]
        assert bus.drive(1).read("P00.03") == 50.0


@pty_only
def test_pyserials_urls(capfd: pytest.CaptureFixture[str]) -> None:
    # No parity: pyserial cannot change the settings of a pseudo-terminal that has dropped it.
    with Simulator({1: "gd350"}, parity="N") as simulator, Bus(f"spy://{simulator.port}", parity="N") as bus:
        assert bus.read(1, 0x2103) == [0x01A0]
    assert "TX   0000  01 03 21 03 00 01" in capfd.readouterr().err


def test_rtu_over_tcp() -> None:
    with Simulator({1: "gd350"}, transport="tcp") as simulator, Bus(simulator.port) as bus:
        assert simulator.port.startswith("socket://127.0.0.1:")
        assert bus.read(1, 0x2103) == [0x01A0]


def _adapter(device: str, description: str = "n/a", serial_number: str | None = None) -> SimpleNamespace:
    """What pyserial tells of a port."""
    hwid = f"USB VID:PID=0403:6001 SER={serial_number}" if serial_number else "n/a"
    return SimpleNamespace(device=device, description=description, serial_number=serial_number, hwid=hwid)


def test_the_ports_of_the_machine_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter = _adapter("/dev/ttyUSB0", "USB-RS485", "A1")
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [adapter])
    [port] = drivebus.ports()
    assert (port.path, str(port), os.fspath(port)) == ("/dev/ttyUSB0",) * 3
    assert (port.description, port.serial_number) == ("USB-RS485", "A1")
    assert port.hardware == "USB VID:PID=0403:6001 SER=A1"
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    assert drivebus.ports() == []


@pty_only
def test_a_port_that_was_listed_can_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    with Simulator({1: "gd350"}, transport="pty") as simulator:
        monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [_adapter(simulator.port)])
        with Bus(drivebus.ports()[0]) as bus:
            assert bus.port == simulator.port
            assert bus.drive(1).profile.name == "gd350"
