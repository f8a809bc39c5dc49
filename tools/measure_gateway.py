"""What a gateway of Modbus TCP does over minutes: answers that come too late, motors whose client is gone, open ports.

    python -m tools.measure_gateway late [--requests 100000]
    python -m tools.measure_gateway dead-man [--times 20]
    python -m tools.measure_gateway scan

`late`: requests to a unit whose answers come after `answer_within` or not at all, and to units that are dead. None may
be answered twice, and none after its 0BH. `dead-man`: a client sets a motor in motion and is killed, or its cable is
out, or both; the motor has to be at rest within `dead_man` and its ramp. `scan`: from another network, which ports are
open that were not before. The last two need root, for a network of their own.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from drivebus import Allow, Bus, Gateway, Simulator

FAR, HERE, THERE = "drivebus-far", "10.99.0.1", "10.99.0.2"
WITHIN = 0.1
CLIENTS, AT_ONCE = 4, 4
DEAD_MAN, RAMP, MARGIN = 1.0, 1.0, 0.5
RUN = bytes.fromhex("000100000006010620000001")
CLIENT = f"""
import socket, sys, time
client = socket.create_connection((sys.argv[1], int(sys.argv[2])))
client.sendall(bytes.fromhex({RUN.hex()!r}))
print(client.recv(12).hex(), flush=True)
while True:
    time.sleep(0.2)
    client.sendall(bytes.fromhex("000200000006010321000001"))
    client.recv(11)
"""


def late(requests: int) -> dict[str, object]:
    """Asks units that are late or dead, 16 at a time, and looks at each answer that comes."""
    chance, came = random.Random(1), Counter[str]()
    wrong: list[int] = []
    with ExitStack() as stack:
        simulator = stack.enter_context(
            Simulator({1: "gd350", 2: "vfd500"}, transport="process", baudrate=115200, seed=1)
        )
        bus = stack.enter_context(Bus(simulator, baudrate=115200, timeout=0.05, retries=0))
        drive = bus.drive(1, "gd350")
        allow = [Allow(), Allow(drives=[drive], commands=["setpoint"])]
        gateway = stack.enter_context(Gateway(bus, "127.0.0.1:0", answer_within=WITHIN, allow=allow))
        host, port = gateway.address.rsplit(":", 1)
        simulator.line.set_times(late=0.06, overtaken=(0.055, 0.2))
        simulator.line.set_faults(late=0.1, overtaken=0.1, silence=0.05)
        clients = [
            socket.create_connection((host, int(port)), source_address=(f"127.0.0.{2 + n}", 0)) for n in range(CLIENTS)
        ]
        heard = [Heard(client) for client in clients]
        for number in range(requests // (CLIENTS * AT_ONCE)):
            for client in clients:
                pdus = enumerate((pdu(chance) for _ in range(AT_ONCE)), number % 4096 * AT_ONCE)
                client.sendall(b"".join(struct.pack(">HHHB", n, 0, 6, each[0]) + each[1:] for n, each in pdus))
            for one in heard:
                open_ones = set(range(number % 4096 * AT_ONCE, (number % 4096 + 1) * AT_ONCE))
                while open_ones:
                    transaction, answer = one.next()
                    if transaction in open_ones:
                        open_ones.remove(transaction)
                        came["right" if not answer[0] & 0x80 else f"{answer[1]:02X}H"] += 1
                    else:
                        wrong.append(transaction)
        # What still comes belongs to nothing.
        bus.sleep(1.0)
        for client, one in zip(clients, heard, strict=True):
            client.shutdown(socket.SHUT_WR)
            with suppress(EOFError):
                while True:
                    wrong.append(one.next()[0])
        stats = gateway.stats
    return {"asked": sum(came.values()), "answers": dict(came), "late": stats.late, "answers of nothing": len(wrong)}


def pdu(chance: random.Random) -> bytes:
    """A unit and a read of it, or a setpoint."""
    unit = chance.choice([1, 1, 1, 1, 2, 2, 2, 2, 9])
    if unit == 1 and chance.random() < 0.2:
        return bytes([unit]) + struct.pack(">BHH", 6, 0x2001, chance.randrange(5000))
    return bytes([unit]) + struct.pack(">BHH", 3, 0x2103 if unit == 1 else 0x3000, 1)


class Heard:
    """What comes to one client."""

    def __init__(self, client: socket.socket) -> None:
        self._client = client
        self._came = b""

    def next(self) -> tuple[int, bytes]:
        """The next answer: its transaction and its PDU. EOFError: none comes any more."""
        while len(self._came) < 6 or len(self._came) < 6 + int.from_bytes(self._came[4:6], "big"):
            piece = self._client.recv(65536)
            if not piece:
                raise EOFError
            self._came += piece
        transaction, _, length = struct.unpack(">HHH", self._came[:6])
        pdu, self._came = self._came[7 : 6 + length], self._came[6 + length :]
        return transaction, pdu


@contextmanager
def far_network() -> Iterator[None]:
    """A network that only this machine is in, beside another one that stands for the clients'."""
    commands = [
        f"ip netns add {FAR}",
        "ip link add drivebus0 type veth peer name drivebus1",
        f"ip link set drivebus1 netns {FAR}",
        f"ip addr add {HERE}/24 dev drivebus0",
        "ip link set drivebus0 up",
        f"ip -n {FAR} addr add {THERE}/24 dev drivebus1",
        f"ip -n {FAR} link set drivebus1 up",
    ]
    try:
        for command in commands:
            subprocess.run(command.split(), check=True)
        yield
    finally:
        subprocess.run(["ip", "netns", "del", FAR], check=False)


def dead_man(times: int) -> dict[str, object]:
    """How long a motor goes on whose client is gone, in each way that one can go."""
    took: dict[str, list[float]] = {"killed": [], "cable out": [], "killed with its cable out": []}
    with ExitStack() as stack:
        stack.enter_context(far_network())
        simulator = stack.enter_context(Simulator({1: "gd350"}, transport="pty", baudrate=115200))
        bus = stack.enter_context(Bus(simulator, baudrate=115200))
        drive = bus.drive(1, "gd350")
        drive.prepare_control()
        drive.write_setpoint(50.0)
        drive.write("P00.12", RAMP)
        allow = [Allow(drives=[drive], commands=["run"])]
        gateway = stack.enter_context(Gateway(bus, f"{HERE}:0", allow=allow, dead_man=DEAD_MAN))
        cable = ["ip", "link", "set", "drivebus0"]
        for turn in range(3 * times):
            way = list(took)[turn % 3]
            words = ["ip", "netns", "exec", FAR, sys.executable, "-c", CLIENT, *gateway.address.rsplit(":", 1)]
            with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as client:
                assert client.stdout is not None
                assert bytes.fromhex(client.stdout.readline().strip()) == RUN
                while simulator.drive(1).frequency < 50:
                    time.sleep(0.01)
                if way != "killed":
                    subprocess.run([*cable, "down"], check=True)
                start = time.monotonic()
                if way != "cable out":
                    client.kill()
                while simulator.drive(1).state != "stopped":
                    time.sleep(0.005)
                took[way].append(time.monotonic() - start)
                client.kill()
            subprocess.run([*cable, "up"], check=True)
        looked = simulator.drive(1).take_writes()
        with socket.create_connection((HERE, int(gateway.address.rsplit(":", 1)[1]))) as client:
            client.sendall(bytes.fromhex("000200000006010321000001"))
            client.recv(11)
        time.sleep(2 * DEAD_MAN)
        quiet = not simulator.drive(1).take_writes()
    most = DEAD_MAN + RAMP + MARGIN
    return {
        "longest": {way: round(max(all_of), 2) for way, all_of in took.items()},
        "within": sum(each <= most for all_of in took.values() for each in all_of),
        "of": 3 * times,
        "writes": len(looked),
        "one that only read was left alone": quiet,
    }


SCAN = """
import errno, json, select, socket, sys
open_ports = []
for first in range(1, 65536, 400):
    waiting = {}
    for port in range(first, min(first + 400, 65536)):
        one = socket.socket()
        one.setblocking(False)
        one.connect_ex((sys.argv[1], port))
        waiting[one.fileno()] = (one, port)
    poll = select.poll()
    for number in waiting:
        poll.register(number, select.POLLOUT)
    while waiting:
        ready = poll.poll(1000)
        if not ready:
            break
        for number, _ in ready:
            one, port = waiting.pop(number)
            poll.unregister(number)
            if not one.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                open_ports.append(port)
            one.close()
    for one, _ in waiting.values():
        one.close()
print(json.dumps(open_ports))
"""


def scan() -> dict[str, object]:
    """The ports that a client in another network finds open, before a service runs at 127.0.0.1 and while it does."""

    def seen() -> list[int]:
        words = ["ip", "netns", "exec", FAR, sys.executable, "-c", SCAN, HERE]
        return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)  # type: ignore[no-any-return]

    with far_network(), tempfile.TemporaryDirectory() as folder:
        before = seen()
        file = Path(folder) / "drivebus.toml"
        file.write_text('[lines.hall]\nport = "sim://gd350"\n[[share.tcp]]\naddress = "127.0.0.1:1502"\n')
        words = [sys.executable, "-m", "drivebus", "--config", str(file), "serve"]
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=dict(os.environ)) as service:
            assert service.stderr is not None
            assert "is served at 127.0.0.1:1502" in service.stderr.readline()
            after = seen()
            service.terminate()
    return {"open before": before, "open with a service at 127.0.0.1": sorted(set(after) - set(before))}


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("what", choices=["late", "dead-man", "scan"])
    options.add_argument("--requests", type=int, default=100_000)
    options.add_argument("--times", type=int, default=20, help="of each way to be gone")
    given = options.parse_args()
    work = {"late": lambda: late(given.requests), "dead-man": lambda: dead_man(given.times), "scan": scan}
    print(json.dumps(work[given.what](), indent=1))


if __name__ == "__main__":
    main()
