"""Other people's masters on the simulated GD350: they must find a drive that keeps the protocol.

Expected words come from the drive's manual: state word 3 = stopped, identification 01A0H, exception codes 01 to 07.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator

import minimalmodbus
import pytest
from pymodbus.client import ModbusSerialClient

from drivebus.sim import Simulator

STATE, IDENTIFICATION = 0x2100, 0x2103
STOPPED, NO_FAULT, GD350 = 3, 0, 0x01A0
MONITOR = 0x3000
ACCELERATION_RAM, ACCELERATION, DECELERATION = 0x800B, 0x000B, 0x000C
FACTORY_GROUP = 0x6300  # P99.00: neither read nor written
TOO_LONG = 36001  # P00.11 takes 0.0 to 3600.0 s


class TestPymodbus:
    @pytest.fixture
    def client(self, simulator: Simulator) -> Iterator[ModbusSerialClient]:
        client = ModbusSerialClient(simulator.port, baudrate=19200, parity="N", timeout=2, retries=0)
        assert client.connect()
        yield client
        client.close()  # type: ignore[no-untyped-call]

    def test_reads(self, client: ModbusSerialClient) -> None:
        state = client.read_holding_registers(STATE, count=4, device_id=1).registers
        assert (state[0], state[2], state[3]) == (STOPPED, NO_FAULT, GD350)
        monitor = client.read_holding_registers(MONITOR, count=16, device_id=1).registers
        assert len(monitor) == 16
        assert monitor[0] == 0, "a stopped drive puts out 0.00 Hz"

    def test_writes(self, client: ModbusSerialClient, simulator: Simulator) -> None:
        client.write_register(ACCELERATION_RAM, 50, device_id=1)
        assert client.read_holding_registers(ACCELERATION, count=1, device_id=1).registers == [50]
        client.write_registers(ACCELERATION, [100, 200], device_id=1)
        assert client.read_holding_registers(ACCELERATION, count=2, device_id=1).registers == [100, 200]
        assert simulator.drive(1).register(DECELERATION) == 200

    @pytest.mark.parametrize(
        ("request_", "code"),
        [
            (lambda client: client.read_holding_registers(FACTORY_GROUP, count=1, device_id=1), 2),
            (lambda client: client.read_holding_registers(MONITOR, count=17, device_id=1), 3),
            (lambda client: client.write_register(ACCELERATION_RAM, TOO_LONG, device_id=1), 4),
            (lambda client: client.write_register(MONITOR, 1, device_id=1), 7),
            (lambda client: client.read_coils(0, count=1, device_id=1), 1),
        ],
        ids=["no such address", "17 words", "out of range", "read only", "no such function"],
    )
    def test_exceptions(
        self, client: ModbusSerialClient, request_: Callable[[ModbusSerialClient], object], code: int
    ) -> None:
        answer = request_(client)
        assert answer.isError()  # type: ignore[attr-defined]
        assert answer.exception_code == code  # type: ignore[attr-defined]

    def test_loop_back(self, client: ModbusSerialClient) -> None:
        answer = client.diag_query_data(b"\x12\xab", device_id=1)
        assert not answer.isError()
        assert answer.message == b"\x12\xab"  # type: ignore[attr-defined]


class TestMinimalmodbus:
    @pytest.fixture
    def instrument(self, simulator: Simulator) -> Iterator[minimalmodbus.Instrument]:
        instrument = minimalmodbus.Instrument(simulator.port, 1)
        instrument.serial.baudrate = 19200
        instrument.serial.timeout = 1  # it waits that long for the rest of an exception, which is shorter
        yield instrument
        instrument.serial.close()

    def test_reads(self, instrument: minimalmodbus.Instrument) -> None:
        state = instrument.read_registers(STATE, 4)
        assert (state[0], state[2], state[3]) == (STOPPED, NO_FAULT, GD350)
        assert len(instrument.read_registers(MONITOR, 16)) == 16

    def test_writes(self, instrument: minimalmodbus.Instrument) -> None:
        instrument.write_register(ACCELERATION_RAM, 5.0, number_of_decimals=1, functioncode=6)
        assert instrument.read_register(ACCELERATION, number_of_decimals=1) == 5.0
        instrument.write_registers(ACCELERATION, [100, 200])
        assert instrument.read_registers(ACCELERATION, 2) == [100, 200]

    def test_exceptions(self, instrument: minimalmodbus.Instrument) -> None:
        with pytest.raises(minimalmodbus.IllegalRequestError, match="data address"):
            instrument.read_register(FACTORY_GROUP)
        with pytest.raises(minimalmodbus.IllegalRequestError, match="data value"):
            instrument.read_registers(MONITOR, 17)
        with pytest.raises(minimalmodbus.SlaveReportedException):
            instrument.write_register(ACCELERATION_RAM, TOO_LONG, functioncode=6)
        with pytest.raises(minimalmodbus.NegativeAcknowledgeError):
            instrument.write_register(MONITOR, 1, functioncode=6)


class TestMbpoll:
    @pytest.fixture
    def poll(
        self, mbpoll: Callable[..., subprocess.CompletedProcess[str]], simulator: Simulator
    ) -> Callable[..., subprocess.CompletedProcess[str]]:
        def poll(address: int, *values: int, count: int = 1) -> subprocess.CompletedProcess[str]:
            fixed = ["-m", "rtu", "-a", 1, "-b", 19200, "-P", "none", "-0", "-t", "4", "-1", "-o", 2]
            # With values to write, mbpoll takes their number for the count.
            counted = [] if values else ["-c", count]
            return mbpoll(*fixed, "-r", address, *counted, simulator.port, *values)

        return poll

    @staticmethod
    def words(done: subprocess.CompletedProcess[str]) -> list[int]:
        assert done.returncode == 0, done.stdout + done.stderr
        return [int(word) for word in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]

    def test_reads(self, poll: Callable[..., subprocess.CompletedProcess[str]]) -> None:
        state = self.words(poll(STATE, count=4))
        assert (state[0], state[2], state[3]) == (STOPPED, NO_FAULT, GD350)
        assert len(self.words(poll(MONITOR, count=16))) == 16

    def test_writes(self, poll: Callable[..., subprocess.CompletedProcess[str]]) -> None:
        assert poll(ACCELERATION_RAM, 50).returncode == 0
        assert self.words(poll(ACCELERATION)) == [50]
        assert poll(ACCELERATION, 100, 200).returncode == 0
        assert self.words(poll(ACCELERATION, count=2)) == [100, 200]

    def test_exceptions(self, poll: Callable[..., subprocess.CompletedProcess[str]]) -> None:
        assert "Illegal data address" in poll(FACTORY_GROUP).stderr
        assert "Illegal data value" in poll(MONITOR, count=17).stderr
        assert "Slave device or server failure" in poll(ACCELERATION_RAM, TOO_LONG).stderr
        assert "Negative acknowledge" in poll(MONITOR, 1).stderr
