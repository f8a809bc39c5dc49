"""Many clients of Modbus TCP at once: none gets another's value, and a stop goes before them all."""

from __future__ import annotations

import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from drivebus import Bus, Gateway, Simulator

from .tcp_client import HERE, answer, connected, request

FAMILIES = {1: "gd350", 2: "gd350", 3: "vfd500", 4: "gd600"}
ADDRESS = 0x0E00
STOP = b"\x01\x06\x20\x00\x00\x05"


@pytest.mark.parametrize("seed", range(2))
def test_no_client_gets_a_wrong_value_on_a_hostile_line(seed: int) -> None:
    """Twenty clients, four families, every fault of the line, and answers that are late and overtake each other."""
    faults = {"all": 0.02, "late": 0.05, "overtaken": 0.05}
    with (
        Simulator(FAMILIES, transport="process", clock="virtual", seed=seed, faults=faults) as simulator,
        Bus(simulator, timeout=0.05) as bus,
        Gateway(bus, HERE, answer_within=20.0) as gateway,
    ):
        simulator.line.set_times(late=0.06, overtaken=(0.055, 0.2))

        def ask(client: int) -> Counter[str]:
            with connected(gateway, f"127.0.0.{2 + client % 4}") as line:
                return Counter(one(line, client, turn) for turn in range(40))

        def one(line: socket.socket, client: int, turn: int) -> str:
            unit, at, count = 1 + (client + turn) % 2, ADDRESS + turn % 2, 1 + client % 2
            number = client << 8 | turn
            line.sendall(request(number, unit, struct.pack(">BHH", 3, at, count)))
            transaction, of, pdu = answer(line)
            assert (transaction, of) == (number, unit)
            if pdu[0] & 0x80:
                return f"exception {pdu[1]:02X}H"
            words = [simulator.drive(unit).register(at + place) for place in range(count)]
            return "right" if pdu == struct.pack(f">BB{count}H", 3, 2 * count, *words) else f"wrong: {pdu.hex()}"

        with ThreadPoolExecutor(20) as clients:
            came = sum(clients.map(ask, range(20)), Counter[str]())
    assert not [what for what in came if what.startswith("wrong")], came
    assert came["right"] > 400, came


def test_a_stop_is_the_next_frame_with_64_clients_pushing() -> None:
    with (
        Simulator({1: "gd350"}, transport="process", baudrate=115200) as simulator,
        Bus(simulator, baudrate=115200) as bus,
        Gateway(bus, HERE, answer_within=30.0) as gateway,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        drive.run(5.0)
        over = threading.Event()

        def ask(line: socket.socket, client: int, number: int) -> None:
            # Each asks something else: what is the same is asked once. Most of it the drive refuses.
            line.sendall(request(number, 1, struct.pack(">BHH", 3, client << 4 | number, 1)))

        def push(client: int) -> None:
            with connected(gateway, f"127.0.0.{2 + client % 4}") as line:
                for number in range(16):
                    ask(line, client, number)
                while not over.is_set():
                    number, _, _ = answer(line)
                    ask(line, client, number)

        with ThreadPoolExecutor(64) as clients:
            pushing = [clients.submit(push, client) for client in range(64)]
            until(lambda: gateway.stats.clients == 64 and gateway.stats.requests > 1024)
            called = bus.now()
            bus.write(1, 0x2000, 5, urgent=True)
            over.set()
            for each in pushing:
                each.result()
        assert gateway.stats.together == 0
        sent = [(at, frame) for at, who, frame in simulator.line.trace() if who == "master"]
        [stopped] = [at for at, frame in sent if frame.startswith(STOP)]
        # Of 1024 that wait, those go before it that had the line until this thread came to the queue: one, on a quiet
        # machine. In its turn as a write of one program among 65 it would come behind 32.
        assert len([at for at, _ in sent if called < at < stopped]) < 16


def until(condition: Callable[[], bool]) -> None:
    while not condition():
        threading.Event().wait(0.001)
