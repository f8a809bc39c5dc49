"""Modbus TCP, served: what clients get, what they may not, and what keeps them from the line.

Clients are pymodbus, and bytes of a socket of this test's own. The line is the simulator's.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

import drivebus
from drivebus import Bus, Gateway, Simulator

from .conftest import NO_PTY
from .tcp_client import HERE, answer, connected, exactly, is_cut_off, request, seen

IS = 0x01A0
"""What a GD350 answers at 2103H."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture(scope="module")
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.1, retries=0) as bus:
        yield bus


@pytest.fixture
def gateway(bus: Bus) -> Iterator[Gateway]:
    with Gateway(bus, HERE) as gateway:
        yield gateway


def asked(gateway: Gateway, unit: int, pdu: bytes) -> bytes:
    with connected(gateway) as client:
        client.sendall(request(7, unit, pdu))
        transaction, of, pdu = answer(client)
    assert (transaction, of) == (7, unit)
    return pdu


@contextmanager
def pymodbus(gateway: Gateway) -> Iterator[ModbusTcpClient]:
    host, port = gateway.address.rsplit(":", 1)
    client = ModbusTcpClient(host, port=int(port), timeout=20, retries=0)
    assert client.connect()  # type: ignore[no-untyped-call]
    try:
        yield client
    finally:
        client.close()  # type: ignore[no-untyped-call]


def test_pymodbus_reads_what_the_bus_reads(gateway: Gateway, bus: Bus) -> None:
    with pymodbus(gateway) as client:
        assert client.read_holding_registers(0x2103, count=1, device_id=1).registers == [IS]
        assert client.read_holding_registers(0x3000, count=5, device_id=1).registers == bus.read(1, 0x3000, 5)
        refused = client.read_holding_registers(0x6300, count=1, device_id=1)
        assert (refused.isError(), refused.exception_code) == (True, 2)
        silent = client.read_holding_registers(0x2103, count=1, device_id=9)
        assert (silent.isError(), silent.exception_code) == (True, 0x0B)
        [counted] = [program for program in bus.stats().programs if program["name"].startswith("client 127.0.0.1:")]
        assert (counted["process"], counted["here"], counted["calls"], counted["answered"]) == (0, True, 4, 2)
    stats = gateway.stats
    assert (stats.requests, stats.answered, stats.failed, stats.refused) == (4, 2, 2, 0)
    seen(lambda: not bus.stats().programs)


def test_nothing_but_reads_gets_through(gateway: Gateway, simulator: Simulator) -> None:
    """Every function, in the form that it has and in others; the drives hear of none of them."""
    for unit in (1, 2):
        simulator.drive(unit).take_writes()
    before = simulator.line.requests
    with pymodbus(gateway) as client:
        assert client.write_register(0x2000, 1, device_id=1).exception_code == 1
        assert client.write_registers(0x2000, [1, 5000], device_id=1).exception_code == 1
        assert client.write_coil(0, True, device_id=1).exception_code == 1
    for function in [*range(5, 0x80), 0]:
        assert asked(gateway, 1, bytes([function, 0x20, 0, 0, 1])) == bytes([function | 0x80, 1]), function
    # What is a command in Huanyang's own protocol.
    assert asked(gateway, 1, b"\x03\x01\x01") == b"\x83\x01"
    for unit in (0, *range(248, 256)):
        assert asked(gateway, unit, b"\x03\x21\x03\x00\x01") == b"\x83\x01"
    assert asked(gateway, 1, b"\x03\x21\x03\x00\x7e") == b"\x83\x03"
    assert simulator.line.requests == before
    assert not simulator.drive(1).take_writes()
    assert not simulator.drive(2).take_writes()
    told = gateway.told()
    assert "may not write 1 to 2000H of unit 1 by function 06H: refused 06 20 00 00 01" in told[0]
    assert gateway.stats.refused == len(told) == 3 + 124 + 1 + 9


@settings(max_examples=60)
@given(
    asked_for=st.lists(
        st.tuples(st.integers(0, 0xFFFF), st.sampled_from([1, 2, 9]), st.integers(0x3000, 0x3010), st.integers(1, 8)),
        min_size=1,
        max_size=16,
    )
)
def test_each_transaction_has_its_own_answer(bus: Bus, asked_for: list[tuple[int, int, int, int]]) -> None:
    """As many as may be on their way at once, in one piece; what the bus reads is the oracle."""
    with Gateway(bus, HERE, answer_within=30.0) as gateway, connected(gateway) as client:
        frames = [request(number, unit, struct.pack(">BHH", 3, at, count)) for number, unit, at, count in asked_for]
        client.sendall(b"".join(frames))
        came = sorted(answer(client) for _ in asked_for)
    assert came == sorted((number, unit, expected(bus, unit, at, count)) for number, unit, at, count in asked_for)


def expected(bus: Bus, unit: int, at: int, count: int) -> bytes:
    try:
        words = bus.read(unit, at, count)
    except drivebus.NoAnswer:
        return b"\x83\x0b"
    except drivebus.Refused as error:
        return bytes([0x83, error.code])
    return bytes([3, 2 * count]) + struct.pack(f">{count}H", *words)


@pytest.mark.parametrize(
    ("bytes_", "said"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "protocol 21536 in the header"),
        (struct.pack(">HHH", 1, 0, 0xFFFF), "length 65535 in the header"),
        (struct.pack(">HHHB", 1, 0, 1, 1), "length 1 in the header"),
        (b"\x16\x03\x01\x02\x00\x01", "protocol 258 in the header"),
    ],
)
def test_what_is_no_modbus_is_cut_off_and_told(
    gateway: Gateway, simulator: Simulator, bytes_: bytes, said: str
) -> None:
    before = simulator.line.requests
    with connected(gateway) as client:
        client.sendall(bytes_)
        assert is_cut_off(client)
    assert [said in text for text in gateway.told()] == [True]
    assert gateway.stats.cut_off == 1
    assert simulator.line.requests == before


def test_half_a_request_is_cut_off_after_a_second(gateway: Gateway) -> None:
    with connected(gateway) as client:
        client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01")[:-1])
        assert is_cut_off(client)
    assert ["not whole within 1 s" in text for text in gateway.told()] == [True]


def test_one_that_asks_too_much_is_told_busy_and_the_rest_is_answered(gateway: Gateway) -> None:
    count = 10_000
    with connected(gateway) as client:
        sender = threading.Thread(
            target=client.sendall,
            args=(b"".join(request(n & 0xFFFF, 1, b"\x03\x21\x03\x00\x01") for n in range(count)),),
        )
        sender.start()
        came = [answer(client) for _ in range(count)]
        sender.join()
    assert sorted(transaction for transaction, _, _ in came) == list(range(count))
    assert {pdu for _, _, pdu in came} <= {b"\x03\x02\x01\xa0", b"\x83\x06", b"\x83\x0b"}
    stats = gateway.stats
    assert stats.requests == count == stats.answered + stats.busy + stats.late + stats.failed


def test_what_is_not_sent_when_its_client_hangs_up_is_never_sent() -> None:
    """One is on the wire, to a unit that does not answer; fifteen wait behind it."""
    with (
        Simulator({1: "gd350"}, transport="process") as simulator,
        Bus(simulator, timeout=1.0, retries=0) as bus,
        Gateway(bus, HERE, answer_within=30.0) as gateway,
        connected(gateway) as client,
    ):
        client.sendall(request(0, 9, b"\x03\x21\x03\x00\x01"))
        seen(lambda: simulator.line.requests == 1)
        client.sendall(b"".join(request(n, 1, bytes([3, 0x30, n, 0, 1])) for n in range(1, 16)))
        seen(lambda: gateway.stats.requests == 16)
        client.close()
        seen(lambda: gateway.stats.clients == 0)
        assert bus.read(1, 0x2103) == [IS]
        # The one to unit 9, and this program's.
        assert simulator.line.requests == 2


def test_the_same_reads_that_wait_are_asked_once() -> None:
    """One is on the wire, to a unit that does not answer; behind it three ask the same, and one something else."""
    same, other = b"\x03\x21\x03\x00\x01", b"\x03\x30\x02\x00\x01"
    with contextlib.ExitStack() as stack:
        simulator = stack.enter_context(Simulator({1: "gd350"}, transport="process"))
        bus = stack.enter_context(Bus(simulator, timeout=1.0, retries=0))
        gateway = stack.enter_context(Gateway(bus, HERE, answer_within=30.0))
        first, *clients = [stack.enter_context(connected(gateway)) for _ in range(4)]
        first.sendall(request(0, 9, same))
        seen(lambda: simulator.line.requests == 1)
        for client in clients:
            client.sendall(b"".join(request(number, 1, same) for number in range(4)))
        clients[0].sendall(request(9, 1, other))
        seen(lambda: gateway.stats.requests == 14)
        # One of those who wait for the same hangs up: the others are answered nevertheless.
        clients.pop().close()
        seen(lambda: gateway.stats.clients == 3)
        assert answer(first) == (0, 9, b"\x83\x0b")
        for place, client in enumerate(clients):
            expected = {(number, 1, b"\x03\x02\x01\xa0") for number in range(4)}
            came = {answer(client) for _ in range(4 if place else 5)}
            assert {each for each in came if each[0] != 9} == expected
        read = [frame[1:6] for _, who, frame in simulator.line.trace() if who == "master" and frame[0] == 1]
        assert read == [same, other]
        assert gateway.stats.together == 7


def test_an_answer_that_is_late_never_comes() -> None:
    with (
        Simulator({1: "gd350"}, transport="process") as simulator,
        Bus(simulator, timeout=2.0, retries=0) as bus,
        Gateway(bus, HERE, answer_within=0.05) as gateway,
        connected(gateway) as client,
    ):
        simulator.line.delay_answers(0.3)
        client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
        assert answer(client) == (1, 1, b"\x83\x0b")
        seen(lambda: bus.stats().answers > 0)
        client.sendall(request(2, 1, b"\x03\x63\x00\x00\x7e"))
        assert answer(client) == (2, 1, b"\x83\x03")
    assert gateway.stats.late == 1


def rtu(unit: int, pdu: bytes) -> bytes:
    frame = bytes([unit]) + pdu
    return frame + struct.pack("<H", drivebus.crc16(frame))


def test_rtu_over_tcp(bus: Bus) -> None:
    """A silent unit, one that answers, what is refused, somebody's own function; drivebus itself is a client, too."""
    read = b"\x03\x21\x03\x00\x01"
    with Gateway(bus, HERE, framing="rtu", answer_within=20.0) as gateway:
        with connected(gateway) as client:
            for asked, expected in (
                (rtu(9, read), rtu(9, b"\x83\x0b")),
                (rtu(1, read), rtu(1, b"\x03\x02\x01\xa0")),
                (rtu(1, b"\x06\x20\x00\x00\x01"), rtu(1, b"\x86\x01")),
                (rtu(2, b"\x41\x01"), rtu(2, b"\xc1\x01")),
            ):
                client.sendall(asked)
                assert exactly(client, len(expected)) == expected
            client.sendall(rtu(1, read)[:-1] + b"\0")
            assert is_cut_off(client)
        assert "a CRC that is wrong" in gateway.told()[-1]
        with Bus(f"socket://{gateway.address}") as other:
            assert other.read(1, 0x2103) == [IS]


def test_who_speaks_rtu_and_asks_again_is_answered_for_that_alone() -> None:
    """Nothing in an answer says which register it is of: an earlier one would be taken for that of the last request."""
    waits, says = rtu(9, b"\x03\x21\x04\x00\x01"), rtu(1, b"\x03\x02\x01\xa0")
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="process") as simulator,
        Bus(simulator) as bus,
        Gateway(bus, HERE, framing="rtu", answer_within=20.0) as gateway,
        connected(gateway) as client,
    ):
        for impatient in (waits, waits + waits, waits + rtu(2, b"\x03\x21\x04\x00\x01")):
            client.sendall(impatient + rtu(1, b"\x03\x21\x03\x00\x01"))
            assert exactly(client, len(says)) == says
        client.sendall(waits)
        seen(lambda: gateway.stats.requests == 9)
        client.sendall(rtu(1, b"\x03\x21\x03\x00\x01"))
        assert exactly(client, len(says)) == says
        assert (gateway.stats.given_up, gateway.stats.answered) == (6, 4)


def test_of_seventeen_from_one_host_one_gives_way(gateway: Gateway) -> None:
    clients = [connected(gateway) for _ in range(16)]
    for client in clients[1:]:
        client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
        assert answer(client)[2] == b"\x03\x02\x01\xa0"
    with connected(gateway) as more:
        more.sendall(request(2, 1, b"\x03\x21\x03\x00\x01"))
        assert answer(more)[2] == b"\x03\x02\x01\xa0"
        assert is_cut_off(clients[0])
        assert (gateway.stats.clients, gateway.stats.gave_way) == (16, 1)
    for client in clients:
        client.close()


def test_where_the_bus_is_closed_the_path_is_away() -> None:
    bus = Bus("sim://gd350?clock=virtual")
    with Gateway(bus, HERE) as gateway, connected(gateway) as client:
        bus.close()
        client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
        assert answer(client) == (1, 1, b"\x83\x0a")


def test_closing_ends_all_and_frees_the_address(bus: Bus) -> None:
    with Gateway(bus, HERE) as gateway, connected(gateway) as client:
        address = gateway.address
        gateway.close()
        assert is_cut_off(client)
    with Gateway(bus, address) as again:
        assert again.address == address


@NO_PTY
def test_a_forked_child_keeps_nothing_open(bus: Bus) -> None:
    gateway = Gateway(bus, HERE)
    with connected(gateway) as client:
        client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
        assert answer(client) == (1, 1, b"\x03\x02\x01\xa0")
        until_then, go = os.pipe()
        child = os.fork()
        if not child:
            os.close(go)
            os.read(until_then, 1)
            gateway.close()
            os._exit(0)
        os.close(until_then)
        try:
            gateway.close()
            assert is_cut_off(client)
            with pytest.raises(ConnectionRefusedError):
                connected(gateway)
            with Gateway(bus, gateway.address) as again, connected(again) as other:
                os.close(go)
                os.waitpid(child, 0)
                other.sendall(request(2, 1, b"\x03\x21\x03\x00\x01"))
                assert answer(other) == (2, 1, b"\x03\x02\x01\xa0")
        finally:
            with contextlib.suppress(OSError):
                os.close(go)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse once the last copy is closed")
def test_closing_refuses_clients_though_a_copy_of_the_door_is_open(bus: Bus) -> None:
    gateway = Gateway(bus, HERE)
    # As a forked child has it, before it has run at all.
    with socket.socket(fileno=os.dup(door_of(gateway))) as copy:
        gateway.close()
        with pytest.raises(ConnectionRefusedError):
            connected(gateway)
        with Gateway(bus, gateway.address) as again, connected(again) as client:
            client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
            assert answer(client) == (1, 1, b"\x03\x02\x01\xa0")
        assert copy.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN) == 0


def door_of(gateway: Gateway) -> int:
    """The descriptor at which *gateway* listens."""
    for number in (int(each.name) for each in Path("/proc/self/fd").iterdir()):
        with contextlib.suppress(OSError), socket.socket(fileno=os.dup(number)) as one:
            listens = one.family == socket.AF_INET and one.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
            if listens and "{}:{}".format(*one.getsockname()) == gateway.address:
                return number
    raise AssertionError(gateway.address)


def send_for_ever(client: socket.socket, asks: bytes) -> None:
    while True:
        client.sendall(asks)


def test_one_that_takes_no_answers_is_cut_off(gateway: Gateway) -> None:
    host, port = gateway.address.rsplit(":", 1)
    asks = b"".join(request(number, 1, b"\x03\x30\x00\x00\x10") for number in range(1000))
    with socket.socket() as client:
        # So that little stands between the two.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect((host, int(port)))
        with pytest.raises((ConnectionResetError, BrokenPipeError)):
            send_for_ever(client, asks)
    assert "an answer that was not taken within 1 s" in gateway.told()[-1]


def test_hundreds_of_connections_leave_the_last_ones_and_the_line(gateway: Gateway, bus: Bus) -> None:
    clients = [connected(gateway, f"127.0.0.{2 + number % 8}") for number in range(300)]
    last = clients[-1]
    last.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
    assert answer(last) == (1, 1, b"\x03\x02\x01\xa0")
    assert bus.read(1, 0x2103) == [IS]
    seen(lambda: gateway.stats.let_in == 300)
    seen(lambda: gateway.stats.clients == 64)
    assert gateway.stats.gave_way == 236
    for client in clients:
        client.close()


@NO_PTY
def test_the_command_shares_a_line_and_tells_what_it_refused() -> None:
    words = [sys.executable, "-m", "drivebus", "--json", "share", "sim://gd350", "--tcp", HERE]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stderr is not None
        host, port = json.loads(program.stdout.readline())["address"].rsplit(":", 1)
        with socket.create_connection((host, int(port)), timeout=20) as client:
            client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01") + request(2, 1, b"\x06\x20\x00\x00\x01"))
            assert {answer(client), answer(client)} == {(1, 1, b"\x03\x02\x01\xa0"), (2, 1, b"\x86\x01")}
            assert (
                "may not write 1 to 2000H of unit 1 by function 06H: refused 06 20 00 00 01"
                in program.stderr.readline()
            )
        program.send_signal(signal.SIGINT)
        counts = json.loads(program.stdout.readline())
        assert program.wait() == 0
    assert (counts["requests"], counts["answered"], counts["refused"]) == (2, 1, 1)


@pytest.mark.parametrize(
    ("open_wrong", "kind", "said"),
    [
        (lambda bus: Gateway(bus, "1502"), drivebus.BadArgument, "has to be host:port"),
        (lambda bus: Gateway(bus, "localhost:70000"), drivebus.BadArgument, "has to be host:port"),
        (lambda bus: Gateway(bus, cast(str, 5)), drivebus.BadArgument, "has to be host:port"),
        (lambda bus: Gateway(bus, HERE, answer_within=0.0), drivebus.BadArgument, "answer_within"),
        (lambda _: Gateway(cast(Bus, "COM3"), HERE), drivebus.BadArgument, "drivebus.Bus"),
        (lambda bus: Gateway(bus, "192.0.2.1:1502"), drivebus.PortError, "nothing can listen there"),
    ],
)
def test_what_cannot_be_listens_nowhere(
    bus: Bus, open_wrong: Callable[[Any], object], kind: type[Exception], said: str
) -> None:
    with pytest.raises(kind, match=said):
        open_wrong(bus)


def test_an_address_that_is_taken(gateway: Gateway, bus: Bus) -> None:
    with pytest.raises(drivebus.PortError, match=gateway.address):
        Gateway(bus, gateway.address)


@NO_PTY
def test_through_a_program_that_has_the_port_it_is_the_same() -> None:
    """The bus of the gateway is a guest of another one; when that ends, it has the port itself."""
    with Simulator({1: "gd350"}, transport="pty") as simulator, Bus(simulator.port) as owner:
        assert owner.read(1, 0x2103) == [IS]
        with Bus(simulator.port) as bus, Gateway(bus, HERE, answer_within=10.0) as gateway:
            frames = b"".join(request(number, 1, b"\x03\x21\x03\x00\x01") for number in range(16))
            with connected(gateway) as client:
                client.sendall(frames)
                came = {answer(client) for _ in range(16)}
                assert came == {(number, 1, b"\x03\x02\x01\xa0") for number in range(16)}
                owner.close()
                client.sendall(request(99, 1, b"\x03\x21\x03\x00\x01"))
                assert answer(client) == (99, 1, b"\x03\x02\x01\xa0")
