"""A service's drives as a SCADA of somebody else's making sees them: mqtt-spb-wrapper's, in an environment of its own.

It is told by pip what it needs, an older client of MQTT and older protocol buffers, so it lives in `.venv-scada`.
Its state has a topic of an older edition of Sparkplug: of waiting for a primary host it shows nothing.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from tests.python.mqtt_broker import broker
from tests.python.plant_text import HALL, drive
from tests.python.tcp_client import seen

from drivebus import Simulator
from drivebus.spool import Spool

from .conftest import ROOT, SERVERS

PYTHON = ROOT / ".venv-scada/bin/python"
PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2, "vfd500")
    + """[[poll]]
interval = 0.1
heartbeat = 1
[spool]
[sparkplug]
host = "127.0.0.1"
port = {at}
group = "plant"
node = "hall"
"""
)


class Scada:
    """The program, and what it said so far."""

    def __init__(self, port: int) -> None:
        self.told: list[dict[str, Any]] = []
        self._program = subprocess.Popen(
            [PYTHON, SERVERS / "sparkplug_scada.py", str(port), "plant"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._program.stdout is not None
        assert self._program.stdout.readline() == "connected\n"
        self._hearing = threading.Thread(target=self._hear)
        self._hearing.start()

    def _hear(self) -> None:
        assert self._program.stdout is not None
        for line in self._program.stdout:
            self.told.append(json.loads(line))

    @contextmanager
    def hearing(self, kind: str, device: str, more: int = 1) -> Iterator[None]:
        """A block that is left when it has heard that so many times *more* than before."""
        wanted = self._heard(kind, device) + more
        yield
        seen(lambda: self._heard(kind, device) >= wanted)

    def _heard(self, kind: str, device: str) -> int:
        return sum(each["kind"] == kind and each["device"] == device for each in list(self.told))

    def lives(self, name: str) -> bool:
        """Whether it takes a node or a device for alive. One of a node that is dead is not asked for."""
        return bool(self.told and self.told[-1]["lives"].get(name))

    def wants_anew(self, node: str) -> None:
        """It asks the node for its births."""
        assert self._program.stdin is not None
        self._program.stdin.write(f"{node}\n")
        self._program.stdin.flush()

    def close(self) -> None:
        """It ends, and has said all."""
        assert self._program.stdin is not None
        assert self._program.stdout is not None
        self._program.stdin.close()
        try:
            self._program.wait(20)
        finally:
            self._program.kill()
            self._hearing.join()
            self._program.stdout.close()


@contextmanager
def serving(file: Path) -> Iterator[subprocess.Popen[bytes]]:
    """`drivebus serve` in a process of its own; what it says is seen where the test fails."""
    line = [sys.executable, "-m", "drivebus", "--config", str(file), "serve"]
    with subprocess.Popen(line) as program:
        try:
            yield program
        finally:
            program.kill()


GONE = "broker gone"
"""Stands among the messages where the broker went: whoever is back first tells what the other does not hear."""


def judged(told: list[dict[str, Any]]) -> tuple[list[str], dict[str, list[int]]]:
    """What is wrong with the messages, and the moments that are told of each device, in milliseconds.

    By the Sparkplug specification 3.0.0, sections 5 and 6; and each sample comes once, unless it is one of the past.
    """
    wrong: list[str] = []
    present: dict[str, list[int]] = defaultdict(list)
    moments: dict[str, set[int]] = defaultdict(set)
    expected, born, deaths_number = None, set[str](), None
    is_behind = False
    for each in told:
        if each["kind"] == GONE:
            is_behind = True
            continue
        kind, device, payload = each["kind"], each["device"], each["payload"]
        metrics = payload.get("metrics", [])
        number = next((metric.get("value") for metric in metrics if metric.get("name") == "bdSeq"), None)
        if kind == "NDEATH":
            if number != deaths_number and not is_behind:
                wrong.append(f"NDEATH {number}, where the birth had {deaths_number}")
            expected, born = None, set()
            continue
        seq = int(payload["seq"])
        if kind == "NBIRTH":
            expected, born, deaths_number, is_behind = 0, set(), number, False
        if seq != expected and not is_behind:
            wrong.append(f"{kind} {seq}, where {expected} was due")
        expected = (seq + 1) % 256
        if kind == "DBIRTH":
            born.add(device)
        elif device is not None and device not in born and not is_behind:
            wrong.append(f"{kind} of {device}, which was not born")
        if kind == "DDEATH":
            born.discard(device)
        elif device is not None:
            past = {int(metric["timestamp"]) for metric in metrics if metric.get("isHistorical")}
            now = {int(metric["timestamp"]) for metric in metrics if not metric.get("isHistorical")}
            moments[device] |= past | now
            present[device] += [max(now)] if now and kind == "DDATA" else []
    for device, times in present.items():
        wrong += [f"{device}: {late} after {early}" for early, late in pairwise(times) if late <= early]
    return wrong, {device: sorted(times) for device, times in moments.items()}


def kept(spool: Path) -> dict[str, set[int]]:
    """The moments of all samples with values, by device."""
    found: dict[str, set[int]] = defaultdict(set)
    with closing(Spool(spool, 1 << 30, lambda _: None)) as opened, closing(opened.reader("test")) as reader:
        for each in reader.after(0, 1_000_000):
            if each.values and not each.layout.event:
                found[each.layout.drive].add(int(each.time * 1_000))
    return found


@pytest.mark.skipif(not PYTHON.exists() and os.environ.get("CI") != "true", reason="run `make .venv-scada/.installed`")
def test_a_scada_of_others_is_told_all_and_nothing_wrong(tmp_path: Path) -> None:
    """The gateway is killed twice and the broker once, a drive falls silent, and the SCADA asks for births."""
    file = tmp_path / "drivebus.toml"
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        broker(tmp_path, "allow_anonymous true\n") as at,
        closing(Scada(at.port)) as scada,
    ):
        file.write_text(PLANT.format(port=simulator.port, at=at.port))
        for _ in range(2):
            with serving(file):
                with scada.hearing("DDATA", "pump", 3):
                    pass
                assert scada.lives("hall/pump")
            seen(lambda: not scada.lives("hall"))
        with serving(file) as program:
            with scada.hearing("DDATA", "fan"):
                pass
            with scada.hearing("DBIRTH", "fan"):
                scada.wants_anew("hall")
            away = time.time()
            with scada.hearing("DBIRTH", "fan"):
                at.kill()
                scada.told.append({"kind": GONE, "device": None, "lives": {}})
                at.start()
            # It may have come back behind the births, as a SCADA that misses them asks for them.
            with scada.hearing("DBIRTH", "fan"):
                scada.wants_anew("hall")
            back = time.time()
            simulator.drive(1).refuse(asked="reads")
            seen(lambda: not scada.lives("hall/pump") and scada.lives("hall/fan"))
            with scada.hearing("DDATA", "pump", 3):
                simulator.drive(1).refuse_no_more()
            assert scada.lives("hall/pump")
            program.terminate()
            assert program.wait(20) == 0
            seen(lambda: not scada.lives("hall"))
    wrong, told = judged(scada.told)
    assert not wrong
    for device, times in kept(tmp_path / "drivebus-spool").items():
        # What was measured last may have found no time to be told, and what was told without the SCADA was not heard.
        heard = {each for each in times if each <= told[device][-1] and not away <= each / 1_000 <= back}
        assert heard <= set(told[device])
