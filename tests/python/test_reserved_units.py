"""Units that the specification reserves: over Modbus TCP, and on serial lines where somebody asks for them by name."""

from __future__ import annotations

import asyncio
import sys

import pytest

import drivebus
from drivebus import Bus, NotAllowed, aio

from .closing_server import ClosingServer, closing_server
from .odd_slave import good, on_a_terminal

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals")


def kept_open(*, mbap: bool) -> ClosingServer:
    return ClosingServer(mbap, ends=lambda _: None)


def test_over_modbus_tcp_they_are_asked_by_their_numbers() -> None:
    with closing_server(kept_open(mbap=True)) as server, Bus(server.url, timeout=5.0, retries=0) as bus:
        for unit in (0, *range(248, 256)):
            assert bus.read(unit, 5, 2) == [5, 6]
            assert bus.echo(unit) > 0.0
            assert bus.transact(unit, b"\x03\x00\x07\x00\x01", 4) == b"\x03\x02\x00\x07"
            assert bus.link(unit).good == 3
            bus.configure(unit, timeout=4.0)
            if unit:
                bus.write(unit, 0x2000, 1)
        units = bus.stats().units
        assert sorted(units) == [0, *range(248, 256)]
        assert (units[0].answers, units[255].answers) == (3, 4)
        assert {request[0] for request in server.writes()} == set(range(248, 256))


def test_a_write_to_unit_0_is_asked_for_by_name() -> None:
    with closing_server(kept_open(mbap=True)) as server:
        with Bus(server.url, timeout=5.0) as bus:
            writes = (
                lambda: bus.write(0, 0x2000, 1),
                lambda: bus.write(0, 0x2000, [1, 2]),
                lambda: bus.write(0, 1, 1, table="coil"),
                lambda: bus.transact(0, b"\x06\x20\x00\x00\x01"),
                lambda: bus.transact(0, b"\x41"),
                lambda: bus.transact(0, b"\x03\x01\x01"),  # runs a Huanyang HY
                lambda: bus.drive(0, "gd350"),
            )
            for write in writes:
                with pytest.raises(NotAllowed, match=r"every unit behind it.*reserved=True.*broadcast\(\)"):
                    write()
            assert server.asked == []
        with Bus(server.url, timeout=5.0, retries=0, reserved=True) as bus:
            bus.write(0, 0x2000, 1)
            assert bus.stats().units[0].answers == 1
        assert server.asked == [b"\x00\x06\x20\x00\x00\x01"]


def test_a_device_that_is_silent_at_0_is_told_and_written_to_once() -> None:
    server = ClosingServer(mbap=True, ends=lambda _: 0)
    with closing_server(server), Bus(server.url, timeout=1.0, reserved=True) as bus:
        with pytest.raises(drivebus.PortError, match=r"unit 0, write 1 .*may have taken it"):
            bus.write(0, 0x2000, 1)
        assert len(server.writes()) == 1


@pytest.mark.parametrize("unit", [0, 248, 254, 255])
@pytest.mark.parametrize("kind", ["terminal", "socket"])
def test_on_a_serial_line_nobody_has_them_unasked(unit: int, kind: str) -> None:
    asked: list[bytes] = []

    def plan(request: bytes) -> bytes:
        asked.append(request)
        return good(request)

    def refused(url: str) -> None:
        with Bus(url, parity="N", timeout=5.0) as bus:
            for ask in (
                lambda: bus.read(unit, 5),
                lambda: bus.write(unit, 5, 1),
                lambda: bus.echo(unit),
                lambda: bus.transact(unit, b"\x07"),
                lambda: bus.drive(unit, "gd350"),
                lambda: bus.link(unit),
                lambda: bus.configure(unit, timeout=1.0),
                lambda: bus.identify(unit),
                lambda: list(bus.scan([unit])),
            ):
                with pytest.raises(NotAllowed, match=rf"unit {unit} is .*allowed is 1 to 247"):
                    ask()

    if kind == "terminal":
        with on_a_terminal(plan) as path:
            refused(path)
        assert asked == []
    else:
        with closing_server(kept_open(mbap=False)) as server:
            refused(server.url)
        assert server.asked == []


@pytest.mark.parametrize("share", ["own", "shared"])
def test_on_a_serial_line_they_are_asked_where_somebody_says_so(share: str) -> None:
    writes: list[bytes] = []

    def plan(request: bytes) -> bytes:
        if request[1] == 6:
            writes.append(request)
        return good(request)

    def asks(bus: Bus) -> None:
        for unit in range(248, 255):
            assert bus.read(unit, 5, 2) == [5, 6]
            bus.write(unit, 0x2000, unit)
        assert bus.stats().units[250].answers >= 2
        for unit in (0, 255):
            with pytest.raises(NotAllowed, match=rf"unit {unit} is .*allowed is 1 to 247"):
                bus.read(unit, 5)

    how = {"parity": "N", "timeout": 5.0}
    with on_a_terminal(plan) as path:
        if share == "own":
            with Bus(path, reserved=True, **how) as bus:  # type: ignore[arg-type]  # as Bus has them
                asks(bus)
        else:
            with Bus(path, **how), Bus(path, reserved=True, **how) as bus:  # type: ignore[arg-type]  # as Bus has them
                asks(bus)
    assert writes == [bytes([unit, 6, 0x20, 0, 0, unit]) for unit in range(248, 255)]


def test_what_is_no_number_of_a_unit_is_refused_everywhere() -> None:
    with closing_server(kept_open(mbap=True)) as server, Bus(server.url, reserved=True) as bus:
        for unit in (-1, 256, 1 << 70, True, 1.0, "255", None):
            with pytest.raises(NotAllowed, match=r"unit .*allowed is 1 to 247"):
                bus.read(unit, 5)  # type: ignore[arg-type]  # that is what is tried
    with pytest.raises(NotAllowed, match="reserved 1 is neither True nor False"):
        Bus("tcp://127.0.0.1:1", reserved=1)  # type: ignore[arg-type]  # that is what is tried


def test_an_event_loop_asks_the_same() -> None:
    async def asks(url: str) -> None:
        async with aio.Bus(url, timeout=5.0) as bus:
            assert await bus.read(255, 5) == [5]
            assert await bus.read(0, 5) == [5]
            with pytest.raises(NotAllowed, match="every unit behind it"):
                await bus.write(0, 0x2000, 1)

    with closing_server(kept_open(mbap=True)) as server:
        asyncio.run(asks(server.url))
        assert server.writes() == []
