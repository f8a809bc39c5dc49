"""Who set a motor in motion over the network and is gone, or silent, has it halted. By what the simulated drive did."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivebus import Allow, Bus, Gateway, Simulator

from .conftest import NO_PTY
from .tcp_client import HERE, answer, connected, request, seen
from .workshop import Workshop

RUN, STOP, LOOK = b"\x06\x20\x00\x00\x01", b"\x06\x20\x00\x00\x05", b"\x03\x21\x00\x00\x01"
RUNS = (0x2000, 1)

pytestmark = NO_PTY


@contextmanager
def plant(dead_man: float, audit: Path | None = None) -> Iterator[tuple[Simulator, Bus, Gateway]]:
    """A GD350 over a pseudo-terminal, and clients who may run it."""
    with (
        Simulator({1: "gd350"}, transport="pty", baudrate=115200) as simulator,
        Bus(simulator, baudrate=115200, timeout=0.5) as bus,
        Gateway(
            bus,
            HERE,
            answer_within=20.0,
            allow=[Allow(drives=[bus.drive(1, "gd350")], commands=["run"])],
            dead_man=dead_man,
            audit=audit,
        ) as gateway,
    ):
        ready(bus)
        simulator.drive(1).take_writes()
        yield simulator, bus, gateway


def ready(bus: Bus) -> None:
    """The drive follows the bus, to 50 Hz."""
    drive = bus.drive(1, "gd350")
    drive.prepare_control()
    drive.write_setpoint(50.0)


def ask(client: socket.socket, pdu: bytes) -> bytes:
    client.sendall(request(1, 1, pdu))
    return answer(client)[2]


def written(simulator: Simulator) -> list[tuple[int, int]]:
    return [write[1:] for write in simulator.drive(1).take_writes()]


def test_a_client_that_is_killed(tmp_path: Path) -> None:
    program = (
        "import socket, sys; client = socket.create_connection((sys.argv[1], int(sys.argv[2])));"
        "client.sendall(bytes.fromhex('000100000006010620000001')); print(len(client.recv(12)), flush=True); input()"
    )
    audit = tmp_path / "audit.jsonl"
    with plant(60.0, audit) as (simulator, _, gateway):
        words = [sys.executable, "-c", program, *gateway.address.split(":")]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as client:
            assert client.stdout is not None
            assert client.stdout.readline() == "12\n"
            assert simulator.drive(1).state == "forward"
            client.kill()
        seen(lambda: simulator.drive(1).state == "stopped")
        assert written(simulator) == [RUNS, (0x2000, 5)]
        seen(lambda: len(gateway.told()) != 1)
        assert gateway.stats.halted == 1
    told = [json.loads(line) for line in audit.read_text().splitlines()]
    assert [(line.get("outcome"), line.get("halted")) for line in told] == [("done", None), (None, "has hung up")]


def test_a_client_that_is_silent() -> None:
    with plant(0.2) as (simulator, _, gateway), connected(gateway) as client:
        assert ask(client, RUN) == RUN
        seen(lambda: simulator.drive(1).state == "stopped")
        assert written(simulator) == [RUNS, (0x2000, 5)]
        assert "which commanded the motor of unit 1, is silent: the motor is halted" in gateway.told()[0]
        # It may go on.
        assert ask(client, RUN) == RUN


def test_one_that_only_looked_leaves_the_motor_alone() -> None:
    with plant(60.0) as (simulator, bus, gateway), connected(gateway) as commander:
        assert ask(commander, RUN) == RUN
        with connected(gateway) as other:
            ask(other, LOOK)
        seen(lambda: gateway.stats.clients == 1)
        bus.read(1, 0x2100)
        assert written(simulator) == [RUNS]
        assert gateway.stats.halted == 0


def test_who_commands_last_is_who_counts() -> None:
    with plant(60.0) as (simulator, bus, gateway), connected(gateway) as second:
        with connected(gateway) as first:
            assert ask(first, RUN) == RUN
            assert ask(second, RUN) == RUN
        seen(lambda: gateway.stats.clients == 1)
        bus.read(1, 0x2100)
        assert written(simulator) == [RUNS, RUNS]
        second.close()
        seen(lambda: simulator.drive(1).state == "stopped")
        assert written(simulator) == [(0x2000, 5)]


@pytest.mark.parametrize("by_another", [False, True])
def test_after_a_stop_nobody_is_missed(by_another: bool) -> None:
    with plant(60.0) as (simulator, bus, gateway), connected(gateway) as other:
        with connected(gateway) as client:
            assert ask(client, RUN) == RUN
            assert ask(other if by_another else client, STOP) == STOP
        seen(lambda: gateway.stats.clients == 1)
        bus.read(1, 0x2100)
        assert written(simulator) == [RUNS, (0x2000, 5)]
        assert gateway.stats.halted == 0


def test_a_command_whose_answer_is_lost_counts() -> None:
    with plant(60.0) as (simulator, _, gateway):
        with connected(gateway) as client:
            # From here on it is known who the drive is.
            assert ask(client, STOP) == STOP
            written(simulator)
            simulator.line.drop_answers()
            assert ask(client, RUN) == b"\x86\x0b"
            assert simulator.drive(1).state == "forward"
        seen(lambda: simulator.drive(1).state == "stopped")
        # A busy machine may tear three frames that stop; the fourth coasts.
        assert written(simulator) in ([RUNS, (0x2000, 5)], [RUNS, (0x2000, 6)])


def test_a_halt_goes_on_until_the_drive_takes_it() -> None:
    with plant(60.0) as (simulator, _, gateway):
        with connected(gateway) as client:
            assert ask(client, RUN) == RUN
            simulator.line.drop_answers(3)
        seen(lambda: simulator.drive(1).state == "stopped")
        seen(lambda: any("took the halt" in text for text in gateway.told()))
        assert written(simulator)[1:3] == [(0x2000, 5), (0x2000, 6)]


@pytest.mark.parametrize(
    ("is_now", "by", "shown"),
    [
        # What stops a GD350 runs an EDS300 (its manual, p. 44).
        (
            "eds300",
            ["6"],
            "By what it shows it is another drive (ENC EDS300), and was halted as that. Its state proves the halt",
        ),
        ("coast 03", ["5", "6"], "Its state proves the halt"),
        ("stuck", ["5"], "It is not proved: it was taken, and the state does not show it: forward"),
    ],
)
def test_what_shows_of_a_halt_is_told(is_now: str, by: list[str], shown: str) -> None:
    shop = Workshop()
    try:
        with (
            Bus(shop.port, parity="N", timeout=1.0) as bus,
            Gateway(
                bus,
                HERE,
                answer_within=20.0,
                allow=[Allow(drives=[bus.drive(1, "gd350")], commands=["run"])],
                dead_man=60.0,
            ) as gateway,
        ):
            with connected(gateway) as client:
                assert ask(client, RUN) == RUN
                since = shop.tell(is_now)
            told: list[str] = []

            def is_told() -> bool:
                told.extend(gateway.told())
                return any("which was halted for" in text for text in told)

            seen(is_told)
            shop.tell("take")
        assert shown in told[-1]
        assert [said.what[-1] for said in shop.frames(since) if said.is_halt] == by
    finally:
        shop.close()


def test_the_end_of_the_gateway_is_the_end_of_its_clients() -> None:
    with plant(60.0) as (simulator, _, gateway), connected(gateway) as client:
        assert ask(client, RUN) == RUN
        gateway.close()
        assert gateway.stats.halted == 1
        seen(lambda: simulator.drive(1).state == "stopped")


def test_off_is_off() -> None:
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        Bus(simulator) as bus,
        Gateway(bus, HERE, allow=[Allow(drives=[bus.drive(1, "gd350")], commands=["run"])], dead_man="off") as gateway,
    ):
        with connected(gateway) as client:
            assert ask(client, RUN) == RUN
        seen(lambda: gateway.stats.clients == 0)
        bus.read(1, 0x2100)
        assert written(simulator) == [RUNS]


SERVER = """
import sys, drivebus
from drivebus import Allow
with drivebus.Bus(sys.argv[1], baudrate=115200) as bus:
    if len(sys.argv) > 2:
        drive = bus.drive(1, "gd350")
        drive.prepare_control()
        drive.write_setpoint(50.0)
    rules = [Allow(drives=[bus.drive(1, "gd350")], commands=["run"])]
    with drivebus.Gateway(bus, "127.0.0.1:0", allow=rules, dead_man=60, answer_within=20) as gateway:
        print(gateway.address, flush=True)
        gateway.wait()
"""


def test_where_the_gateway_itself_is_killed_the_next_one_halts_the_motor(tmp_path: Path) -> None:
    folder = {**os.environ, "DRIVEBUS_RUNTIME_DIR": str(tmp_path)}
    tmp_path.chmod(0o700)
    with Simulator({1: "gd350"}, transport="pty", baudrate=115200) as simulator:
        words = [sys.executable, "-c", SERVER, simulator.port]
        with subprocess.Popen([*words, "ready"], stdout=subprocess.PIPE, text=True, env=folder) as server:
            assert server.stdout is not None
            host, port = server.stdout.readline().strip().rsplit(":", 1)
            with socket.create_connection((host, int(port)), timeout=20) as client:
                assert ask(client, RUN) == RUN
                server.send_signal(signal.SIGKILL)
                server.wait()
        assert simulator.drive(1).state == "forward"
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=folder) as again:
            seen(lambda: simulator.drive(1).state == "stopped")
            again.kill()
        assert (0x2000, 5) in written(simulator)


def test_who_waits_for_an_answer_is_not_silent() -> None:
    """A drive that does not answer keeps the client waiting for longer than it may be silent."""
    with plant(0.2) as (simulator, _, gateway), connected(gateway) as client:
        assert ask(client, RUN) == RUN
        simulator.line.drop_answers(3)
        assert ask(client, LOOK) == b"\x83\x0b"
        assert written(simulator) == [RUNS]
        assert gateway.stats.halted == 0
