"""drivebus and a Modbus TCP server of others that closes its connections behind each answer."""

from __future__ import annotations

import socket
from collections.abc import Callable

import pytest

import drivebus


def test_pymodbus_that_closes_behind_each_answer(serve: Callable[..., str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    serve("pymodbus_tcp_server", str(port))
    with drivebus.Bus(f"tcp://127.0.0.1:{port}", timeout=5.0, retries=0) as bus:
        for place in range(10):
            assert bus.read(1, place, 3) == [place, place + 1, place + 2]
        bus.write(1, 100, 0xFFFF)
        bus.write(1, 101, [1, 2])
        assert bus.read(1, 100, 3) == [0xFFFF, 1, 2]
        with pytest.raises(drivebus.Refused):
            bus.read(1, 0x400)
        stats = bus.stats()
        assert stats.reconnects == 0
        assert "closes the connection behind each answer" in stats.notes[-1]
