"""Adapters that hand back what is sent: their echo is never taken for the answer."""

from __future__ import annotations

import pytest

from drivebus import Bus, NoAnswer


class EchoingPort:
    """Looks like a `serial.Serial` on an adapter that echoes; nobody else is on its line."""

    baudrate = 115200
    bytesize = 8
    parity = "N"
    stopbits = 1
    timeout: float | None = None

    def __init__(self) -> None:
        self.queued = b""

    @property
    def in_waiting(self) -> int:
        return len(self.queued)

    def read(self, size: int = 1) -> bytes:
        came, self.queued = self.queued[:size], self.queued[size:]
        return came

    def write(self, data: bytes) -> int:
        self.queued += bytes(data)
        return len(data)


@pytest.mark.parametrize("value", [7, [7, 8]])
def test_the_echo_of_an_opened_port_confirms_no_write(value: int | list[int]) -> None:
    with Bus(EchoingPort(), timeout=0.02, retries=0) as bus:
        for _ in range(3):
            with pytest.raises(NoAnswer):
                bus.write(1, 0x2001, value)


def test_the_echo_of_an_opened_port_answers_no_request_of_ones_own() -> None:
    with Bus(EchoingPort(), timeout=0.02, retries=0) as bus, pytest.raises(NoAnswer):
        bus.transact(1, bytes.fromhex("04 0000 0001"))
