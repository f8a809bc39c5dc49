"""Twenty clients at once, of six makes, before a line of four families of simulated drives.

What is true is what each simulated drive says of its own parameters, which nobody changes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from drivebus.sim import Simulator

from .. import faults
from ..child import ROOT
from . import crowd_clients
from .crowd_clients import Question
from .programs import HOST, TIMEOUT, Gateway

FAMILIES = {1: "gd350", 2: "vfd500", 3: "gd20", 4: "gd600"}
CROWD = {"strict": 4, "pymodbus": 4, "pymodbus, asyncio": 4, "libmodbus": 3, "mbpoll": 2, "tokio-modbus": 3}
SECONDS = 20.0
QUIET, HOSTILE = "nothing disturbs it", "2 % of every fault"
LINES = (QUIET, HOSTILE)
MARGIN = 90.0  # seconds that the processes may take beyond what they were told


@dataclass(frozen=True)
class Crowd:
    """How the reads of each make ended, and for how many seconds all of them asked."""

    ends: dict[str, Counter[str]]
    seconds: float

    @property
    def total(self) -> Counter[str]:
        return sum(self.ends.values(), Counter())


def questions(simulator: Simulator) -> list[Question]:
    """Pairs of parameters side by side. What two units hold is asked of one: no two questions have the same answer."""
    holders: dict[tuple[int, ...], list[Question]] = {}
    for unit in FAMILIES:
        for address, words in faults.different_pairs(simulator, unit).items():
            holders.setdefault(tuple(words), []).append(Question(unit, address, words))
    asked: list[Question] = []
    of_unit: Counter[int] = Counter()
    for same in sorted(holders.values(), key=len):
        chosen = min(same, key=lambda question: of_unit[question.unit])
        of_unit[chosen.unit] += 1
        asked.append(chosen)
    return asked


def crowd() -> dict[str, int]:
    """How many clients there are of each make; where one is not on this machine, strict ones take their place."""
    there = crowd_clients.here()
    clients = {make: count for make, count in CROWD.items() if make in there}
    clients["strict"] += sum(CROWD.values()) - sum(clients.values())
    return clients


def run(gateway: Gateway, line: str, seconds: float = SECONDS) -> Crowd:
    """All of them before one gateway, for so long."""
    with tempfile.TemporaryDirectory() as folder:
        port = Path(folder) / "port"
        with Simulator(FAMILIES, baudrate=faults.BAUD, parity="N", seed=faults.SEED, link=str(port)) as simulator:
            asked = questions(simulator)
            with gateway.before(port, faults.BAUD) as address:
                if line == HOSTILE:
                    faults.spoil(simulator, faults.ALL, TIMEOUT)
                return _all_at_once(address, seconds, asked)


def _all_at_once(address: str, seconds: float, asked: Sequence[Question]) -> Crowd:
    host, _, port = address.rpartition(":")
    # The makes that can say so come from an address each, as from machines of their own.
    sources = iter(f"127.0.0.{number}" for number in range(2, 250))
    running = {}
    for make, count in crowd().items():
        order = {
            "host": host,
            "port": int(port),
            "seconds": seconds,
            "sources": [HOST if make in ("libmodbus", "mbpoll") else next(sources) for _ in range(count)],
            "questions": asked,
            "seed": faults.SEED,
        }
        words = [sys.executable, "-m", f"{__package__}.crowd_clients", make]
        process = subprocess.Popen(
            words, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert process.stdin is not None
        process.stdin.write(json.dumps(order))
        process.stdin.close()
        process.stdin = None
        running[make] = process
    ends, took = {}, []
    for make, process in running.items():
        said, complained = process.communicate(timeout=seconds + MARGIN)
        if not said:
            raise RuntimeError(f"{make}: {complained}")
        answer = json.loads(said)
        ends[make] = Counter(answer["ends"])
        took.append(answer["seconds"])
    return Crowd(ends, min(took))
