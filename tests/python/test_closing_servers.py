"""Servers that close the connection: behind each answer, inside one, instead of one, or while nobody asks."""

from __future__ import annotations

import sys

import pytest

import drivebus
from drivebus import Bus, Simulator

from .closing_server import ClosingServer, closing_before, closing_server

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what a closed connection tells is the system's")

KINDS = pytest.mark.parametrize("mbap", [False, True], ids=["socket", "tcp"])
WRITE = b"\x01\x06\x20\x00\x00\x01"


@KINDS
@pytest.mark.parametrize("reset", [False, True], ids=["closed", "reset"])
def test_one_that_closes_behind_each_answer_works(mbap: bool, reset: bool) -> None:
    with closing_server(ClosingServer(mbap, reset=reset)) as server, Bus(server.url, timeout=5.0, retries=0) as bus:
        for place in range(20):
            assert bus.read(1, place, 1 + place % 3) == list(range(place, place + 1 + place % 3))
            bus.write(1, 0x2000 + place, place)
            assert bus.echo(1) > 0.0
            assert bus.transact(1, b"\x03\x00\x07\x00\x01", 4) == b"\x03\x02\x00\x07"
        sent = [b"\x01\x06" + (0x2000 + place).to_bytes(2, "big") + place.to_bytes(2, "big") for place in range(20)]
        assert server.writes() == sent
        assert server.clients == len(server.asked)
        stats = bus.stats()
        assert (stats.reconnects, stats.timeouts, stats.hints) == (0, 0, [])
        [note] = stats.notes
        assert f"{server.url} closes the connection behind each answer" in note


@KINDS
def test_one_that_keeps_it_open_keeps_one(mbap: bool) -> None:
    with closing_server(ClosingServer(mbap, ends=lambda _: None)) as server, Bus(server.url, timeout=5.0) as bus:
        for place in range(20):
            assert bus.read(1, place) == [place]
        assert (server.clients, bus.stats().notes) == (1, [])


@KINDS
def test_a_connection_that_ended_meanwhile_costs_no_request(mbap: bool) -> None:
    with (
        closing_server(ClosingServer(mbap, ends=lambda _: None)) as server,
        Bus(server.url, timeout=5.0, retries=0) as bus,
    ):
        bus.write(1, 0x2000, 1)
        assert bus.read(1, 5) == [5]
        for value in (2, 3):
            server.hang_up()
            bus.write(1, 0x2000, value)
            assert bus.read(1, 5) == [5]
        assert [request[-1] for request in server.writes()] == [1, 2, 3]


@KINDS
@pytest.mark.parametrize("retries", [0, 1])
def test_an_answer_that_is_cut_off_is_told_and_a_read_asked_again(mbap: bool, retries: int) -> None:
    whole = 11 if mbap else 7
    for cut in range(whole):
        server = ClosingServer(mbap, ends=lambda _: None)
        with closing_server(server), Bus(server.url, timeout=5.0, retries=retries) as bus:
            assert bus.read(1, 9, 2) == [9, 10]
            first = len(server.asked)
            server.ends = lambda number, first=first, cut=cut: cut if number == first else None  # type: ignore[misc]
            if retries:
                assert bus.read(1, 5) == [5]
                continue
            with pytest.raises(drivebus.PortError) as failed:
                bus.read(1, 5)
            said = (
                f"closed it behind {cut} bytes that were not all of the answer" if cut else "the other side closed it"
            )
            assert said in str(failed.value)
            assert failed.value.started is not None
            assert bus.read(1, 5) == [5]


@KINDS
def test_a_write_whose_answer_is_cut_off_is_sent_once_and_not_known(mbap: bool) -> None:
    for cut in range(12 if mbap else 8):
        server = ClosingServer(mbap, ends=lambda _: None)
        with closing_server(server), Bus(server.url, timeout=5.0, retries=3) as bus:
            assert bus.read(1, 9, 2) == [9, 10]
            bus.write(1, 0x2000, 7)
            first = len(server.asked)
            server.ends = lambda number, first=first, cut=cut: cut if number == first else None  # type: ignore[misc]
            with pytest.raises(drivebus.PortError, match="sent once, and the unit may have taken it") as failed:
                bus.write(1, 0x2000, 1)
            assert failed.value.started is not None
            assert server.writes().count(WRITE) == 1
            assert bus.read(1, 5) == [5]
            assert server.writes().count(WRITE) == 1


@KINDS
def test_a_server_that_hears_and_never_answers_is_lost_each_time(mbap: bool) -> None:
    with (
        closing_server(ClosingServer(mbap, ends=lambda _: 0)) as server,
        Bus(server.url, timeout=5.0, retries=1) as bus,
    ):
        for _ in range(2):
            with pytest.raises(drivebus.PortError, match="the other side closed it"):
                bus.read(1, 5)
        with pytest.raises(drivebus.PortError):
            bus.write(1, 0x2000, 1, urgent=True)
        assert server.writes() == [WRITE]


def test_a_drive_behind_one_runs_and_stops() -> None:
    with Simulator({1: "gd350"}, transport="tcp") as simulator:
        host, _, port = simulator.port.removeprefix("socket://").rpartition(":")
        with closing_before(host, int(port)) as ours, Bus(f"socket://127.0.0.1:{ours}", timeout=5.0) as bus:
            drive = bus.drive(1, "gd350")
            drive.prepare_control()
            drive.run(10)
            assert drive.state().name == "FORWARD"
            drive.stop()
            assert bus.reconnects == 0
            commands = [value for _, address, value in simulator.drive(1).writes() if address == 0x2000]
            assert commands[0] == 1
            assert commands.count(1) == 1
