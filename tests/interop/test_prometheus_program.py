"""Debian's Prometheus at a service: it takes what it is told, and its own checker finds nothing wrong in it."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import threading
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.python.plant_text import HALL, drive, served

from drivebus import Simulator

from .conftest import ROOT, TOOLS, lacking

PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2, "vfd500")
    + drive("ghost", 3)
    + """[[poll]]
interval = 0.2
[[share.tcp]]
address = "127.0.0.1:0"
[prometheus]
address = "127.0.0.1:{metrics}"
"""
)

SCRAPES = """
global: {{scrape_interval: 1s}}
scrape_configs:
  - job_name: drivebus
    static_configs: [{{targets: ["127.0.0.1:{metrics}"]}}]
"""


def program(name: str) -> str:
    found = shutil.which(name, path=os.pathsep.join([str(TOOLS / "usr/bin"), os.environ.get("PATH", "")]))
    if found is None:
        lacking(name, "prometheus")
    return found


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def fetched(address: str) -> str:
    with urllib.request.urlopen(address, timeout=20) as answer:
        return str(answer.read().decode())


def until(look: Callable[[], bool]) -> None:
    while True:
        try:
            if look():
                return
        except OSError:
            pass
        threading.Event().wait(0.1)


@pytest.fixture
def metrics(tmp_path: Path) -> Iterator[int]:
    """Where a service tells of a GD350, a VFD500 and a unit that is not there."""
    port = free_port()
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator:
        file = tmp_path / "drivebus.toml"
        file.write_text(PLANT.format(port=simulator.port, metrics=port))
        heard: list[str] = []
        with served(file, heard):
            until(lambda: "drivebus_running_frequency_hertz" in fetched(f"http://127.0.0.1:{port}/metrics"))
            yield port


def test_its_checker_finds_nothing_wrong(metrics: int) -> None:
    told = fetched(f"http://127.0.0.1:{metrics}/metrics")
    done = subprocess.run([program("promtool"), "check", "metrics"], input=told, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert "drivebus_gateway_clients" in told


@contextmanager
def prometheus(metrics: int, folder: Path) -> Iterator[Callable[[str], dict[str, float]]]:
    """Prometheus, which scrapes each second; a question gives the value of each drive."""
    port = free_port()
    (folder / "prometheus.yml").write_text(SCRAPES.format(metrics=metrics))
    words = [
        program("prometheus"),
        f"--config.file={folder / 'prometheus.yml'}",
        f"--storage.tsdb.path={folder / 'data'}",
        f"--web.listen-address=127.0.0.1:{port}",
    ]

    def ask(question: str) -> dict[str, float]:
        given = urllib.parse.urlencode({"query": question})
        answer = json.loads(fetched(f"http://127.0.0.1:{port}/api/v1/query?{given}"))
        return {each["metric"].get("drive", ""): float(each["value"][1]) for each in answer["data"]["result"]}

    with subprocess.Popen(words, stderr=subprocess.DEVNULL) as running:
        try:
            yield ask
        finally:
            running.kill()


def test_it_knows_who_is_up_and_at_which_voltage(metrics: int, tmp_path: Path) -> None:
    with prometheus(metrics, tmp_path) as ask:
        until(lambda: ask("drivebus_drive_up") == {"pump": 1, "fan": 1, "ghost": 0})
        assert ask("drivebus_bus_voltage_volts") == {"pump": 537}
        assert ask("up") == {"": 1}
        assert all(age < 30 for age in ask("drivebus_sample_age_seconds").values())


def questions() -> list[str]:
    """What the dashboard for Grafana asks Prometheus, of all drives."""
    board = json.loads((ROOT / "examples/grafana/prometheus.json").read_text())
    asked = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    return [each.replace("$drive", ".*") for each in asked]


def test_the_dashboard_shows_all_that_it_asks_for(metrics: int, tmp_path: Path) -> None:
    with prometheus(metrics, tmp_path) as ask:
        asked = questions()
        assert len(asked) == 9
        # A rate needs two scrapes. Of a VFD500 neither state nor current is proved, so neither is asked for.
        until(lambda: all(ask(each) for each in asked))
        assert ask(asked[0]) == {"pump": 1, "fan": 1, "ghost": 0}
        assert ask(asked[1]) == {"pump": 0}
