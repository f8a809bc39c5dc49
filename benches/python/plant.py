"""A plant under all sinks at once, whose servers and whose gateway die: what is missing, what is double, what it costs.

Many lines with drives that are simulated in a process of their own; `drivebus serve` with a spool, PostgreSQL, MQTT,
Sparkplug and Prometheus, once or several times with a part of the lines each; one real server of each. In the end the
spools are compared with what each of them has. Of several gateways none speaks Sparkplug: there would be as many hosts.

With a backlog, so many samples of each drive wait in the spool before; they are of times long ago.

usage: python -m benches.python.plant [--gateways 1] [--lines 32] [--drives 8] [--minutes 60] [--away 10] [--kills 20]
           [--backlog 0] [--without-sparkplug] [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from benches.python.figures import markdown, show
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from psycopg.errors import UndefinedTable
from tests.python.mqtt_broker import Broker, broker
from tests.python.postgres_server import Server, server
from tests.python.test_sparkplug import Listener

import drivebus
from drivebus.profile import Profile
from drivebus.spool import Layout, Spool, Spooled
from drivebus.values import digits_of

KEPT = "persistence true\nmax_queued_messages 0\nmax_queued_bytes 0\nallow_anonymous true\n"
"""The broker keeps what its one reader has not taken yet, as long as that takes."""
HZ = os.sysconf("SC_CLK_TCK")
NEWEST = """SELECT coalesce(extract(epoch FROM now() - max(time)), 60) FROM drivebus.gd350
    WHERE time > now() - INTERVAL '1 minute'"""
LOOKS = 5.0
"""Seconds between two looks at what the service costs."""


def simulate(lines: int, drives: int) -> None:
    """What the process of the lines does: says their ports, and ends when its input does."""
    with ExitStack() as stack:
        units = dict.fromkeys(range(1, drives + 1), "gd350")
        for _ in range(lines):
            simulator = stack.enter_context(drivebus.Simulator(units, transport="tcp", baudrate=115200))
            print(simulator.port, flush=True)
        sys.stdin.read()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as one:
        return int(one.getsockname()[1])


def file_of(ports: Sequence[str], drives: int, postgres: Server, mosquitto: int, name: str, metrics: int) -> str:
    """The `drivebus.toml` of one gateway; without *metrics* for Sparkplug and Prometheus, too."""
    told: list[str] = []
    for number, port in enumerate(ports):
        told.append(f'[lines.line{number}]\nport = "{port}"\nbaud = 115200')
        told += [
            f'[drives.d{number}-{unit}]\nline = "line{number}"\nunit = {unit}\nprofile = "gd350"'
            for unit in range(1, drives + 1)
        ]
    # Each sample is kept: motors that stand say the same for ever.
    told.append("[[poll]]\ninterval = 1\nheartbeat = 1\n[spool]\nsize_mb = 2000")
    told.append(f'[postgres]\nconninfo = "{postgres.conninfo}"\ngateway = "{name}"')
    told.append(f'[mqtt]\nhost = "127.0.0.1"\nport = {mosquitto}\ngateway = "{name}"')
    if not metrics:
        return "\n".join(told) + "\n"
    told.append(f'[sparkplug]\nhost = "127.0.0.1"\nport = {mosquitto}\ngroup = "plant"\nnode = "hall"')
    told[-1] += '\nprimary_host = "scada"'
    told.append(f'[prometheus]\naddress = "127.0.0.1:{metrics}"')
    return "\n".join(told) + "\n"


class Historian:
    """Who reads the history over MQTT, and misses nothing that the broker has for it."""

    def __init__(self, port: int) -> None:
        self.numbers: set[tuple[str, int]] = set()
        self.times = 0
        self.latest = 0.0
        """How long a state was on its way at most, in seconds."""
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id="historian", protocol=paho.MQTTv5)
        self._client.on_message = self._hears
        self._client.on_connect = self._begins
        self._client.reconnect_delay_set(1, 1)
        lasting: Any = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        lasting.SessionExpiryInterval = 86_400
        self._client.connect("127.0.0.1", port, clean_start=False, properties=lasting)
        self._client.loop_start()

    def _begins(self, *_: Any) -> None:
        self._client.subscribe("drivebus/#", qos=1)

    def _hears(self, _: Any, __: Any, message: paho.MQTTMessage) -> None:
        if message.topic.endswith("/state") and not message.retain:
            told = json.loads(message.payload)
            if "time" in told:
                said = datetime.fromisoformat(told["time"]).timestamp() + told["age"]
                self.latest = max(self.latest, time.time() - said)
        if not message.topic.endswith(("/history", "/event")):
            return
        told = json.loads(message.payload)
        for each in told if isinstance(told, list) else [told]:
            self.numbers.add((each["epoch"], each["seq"]))
            self.times += 1


class Gateway:
    """The service, which is killed and started again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._command = [sys.executable, "-m", "drivebus", "--config", str(folder / "drivebus.toml"), "serve"]
        self._log = (folder / "log").open("w")
        self._environment = {**os.environ, "DRIVEBUS_RUNTIME_DIR": str(folder)}
        self.seconds = 0.0
        self.lived = 0.0
        self.memory: list[int] = []
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(self._command, stderr=self._log, env=self._environment)
        self._began = time.monotonic()

    def look(self) -> None:
        """Notes how much memory it has, in bytes."""
        with suppress(OSError, IndexError):
            pages = Path(f"/proc/{self._process.pid}/statm").read_text().split()[1]
            self.memory.append(int(pages) * os.sysconf("SC_PAGE_SIZE"))

    def end(self, number: int) -> None:
        """Ends it with a signal; what it cost is added up."""
        with suppress(OSError, IndexError):
            told = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(") ")[2].split()
            self.seconds += (int(told[11]) + int(told[12])) / HZ
        self.lived += time.monotonic() - self._began
        self._process.send_signal(number)
        self._process.wait()


@contextmanager
def lines(count: int, drives: int) -> Iterator[list[str]]:
    """The ports of simulated lines."""
    words = [sys.executable, "-m", "benches.python.plant", "--simulate", "--lines", str(count), "--drives", str(drives)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield [process.stdout.readline().strip() for _ in range(count)]
        finally:
            process.stdin.close()


def befall(
    gateways: list[Gateway], postgres: Server, mosquitto: Broker, metrics: int, given: argparse.Namespace
) -> dict[str, float]:
    """Time goes by, and what dies dies. Returns what one look at its metrics took, in seconds, at most."""
    begun = time.monotonic()
    ends = begun + given.minutes * 60
    # The servers are away in the middle third, one after the other and for a time both.
    gone, away = begun + given.minutes * 20, given.away
    plan = [(gone, postgres.stop_at_once), (gone + away * 30, mosquitto.kill)]
    plan += [(gone + away * 60, postgres.start), (gone + away * 90, mosquitto.start)] if away else []
    plan = plan if away else []
    deaths = sorted(random.uniform(begun, ends) for _ in range(given.kills))
    slowest = 0.0
    while (now := time.monotonic()) < ends:
        while plan and now >= plan[0][0]:
            plan.pop(0)[1]()
        while deaths and now >= deaths[0]:
            deaths.pop(0)
            dead = random.choice(gateways)
            dead.end(signal.SIGKILL)
            dead.start()
        for gateway in gateways:
            gateway.look()
        with suppress(OSError):
            urllib.request.urlopen(f"http://127.0.0.1:{metrics}/metrics", timeout=20).read()
            slowest = max(slowest, time.monotonic() - now)
        time.sleep(min(LOOKS, max(ends - time.monotonic(), 0.0)))
    for _, rest in plan:
        rest()
    return {"slowest_scrape_s": slowest}


def status(folder: Path) -> dict[str, Any]:
    for path in folder.rglob("serve-*.json"):
        with suppress(OSError, ValueError):
            found: dict[str, Any] = json.loads(path.read_text())
            return found
    return {}


def all_is_in(gateways: Sequence[Gateway]) -> bool:
    """Whether no sink is behind by more than what comes in a few seconds."""
    outlets = [each for of in gateways for each in status(of.folder).get("outlets", {}).values()]
    sinks = [each for each in outlets if "behind" in each]
    return len(sinks) >= 2 * len(gateways) and all(each["connected"] and each["behind"] < 2_000 for each in sinks)


def present(
    postgres: Server, historian: Historian, name: str, most: float, is_over: Callable[[], bool] = lambda: False
) -> dict[str, float]:
    """How long it took until *is_over*, or *most* seconds; and how old meanwhile the present was, all in seconds.

    That is the newest sample in PostgreSQL, whose spool commits once a second, and how long a state over MQTT took.
    """
    begun, ages = time.monotonic(), list[float]()
    while time.monotonic() < begun + most and not is_over():
        # It has made no table yet, or has not told a sample of now.
        with suppress(UndefinedTable):
            [(age,)] = postgres.ask(NEWEST)
            if ages or age < 60:
                historian.latest = historian.latest if ages else 0.0
                ages.append(float(age))
        time.sleep(0.1)
    ages.sort()
    return {
        f"{name}_s": time.monotonic() - begun,
        f"{name}_newest_median_s": ages[len(ages) // 2],
        f"{name}_newest_99_s": ages[len(ages) * 99 // 100],
        f"{name}_newest_at_most_s": ages[-1],
        f"{name}_state_late_at_most_s": historian.latest,
    }


def fill(folder: Path, drives: Sequence[str], samples: int) -> None:
    """*samples* of each drive, that wait: one every ten seconds, until an hour ago."""
    profile = Profile.find("gd350")
    names = profile.monitor_names()
    rows = [profile.describe(name) for name in names]
    digits = tuple(digits_of(row.scale) for row in rows)
    layouts = [Layout(name, "gd350", tuple(names), tuple(row.unit for row in rows), digits) for name in drives]
    with Spool(folder / "drivebus-spool", 2_000_000_000, print) as spool:
        for number in range(samples):
            at = time.time() - 3_600.0 - 10.0 * (samples - number)
            for layout in layouts:
                spool.add(layout, at, 0.02, "", [number % 50] * len(names))
            if number % 100 == 0:
                spool.commit()


def kept_by(folder: Path) -> Iterator[Spooled]:
    """All that a spool has."""
    with Spool(folder / "drivebus-spool", 2_000_000_000, print) as spool, closing(spool.reader("bench")) as reader:
        seq = 0
        while some := reader.after(seq, 50_000):
            seq = some[-1].seq
            yield from some


def compared(
    gateways: Sequence[Gateway], postgres: Server, historian: Historian, listener: Listener, until: float
) -> dict[str, float]:
    """What the spools have of the time *until* then and they have not, and what they have twice."""
    kept: set[tuple[str, int]] = set()
    values: list[tuple[str, int]] = []
    for gateway in gateways:
        for each in kept_by(gateway.folder):
            if each.time > until:
                continue
            kept.add((each.epoch, each.seq))
            if each.values and len(gateways) == 1:
                values.append((each.layout.drive, int(each.time * 1_000)))
    rows = postgres.ask("SELECT epoch, seq FROM drivebus.gd350 UNION ALL SELECT epoch, seq FROM drivebus.event")
    told = {(device, at) for device, at, _ in listener.host.told}
    past = {(device, at) for device, at, _ in listener.host.historical}
    return {
        "spooled": len(kept),
        "postgres_missing": len(kept - set(rows)),
        "postgres_double": len(rows) - len(set(rows)),
        "mqtt_missing": len(kept - historian.numbers),
        "mqtt_again": historian.times - len(historian.numbers),
        "sparkplug_missing": sum(each not in told and each not in past for each in values),
        "sparkplug_wrong": len(listener.wrong),
    }


def measure(given: argparse.Namespace) -> dict[str, float]:
    """One run; what came of it."""
    number, drives = given.gateways, given.drives
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="drivebus-plant-")))
        ports = stack.enter_context(lines(given.lines, drives))
        postgres = stack.enter_context(server())
        mosquitto = stack.enter_context(broker(folder, KEPT))
        listener = stack.enter_context(closing(Listener(mosquitto.port)))
        historian = Historian(mosquitto.port)
        metrics = 0 if given.without_sparkplug or number > 1 else free_port()
        gateways: list[Gateway] = []
        for which in range(number):
            place = folder / str(which)
            place.mkdir()
            told = file_of(ports[which::number], drives, postgres, mosquitto.port, f"gateway{which}", metrics)
            (place / "drivebus.toml").write_text(told)
            if given.backlog:
                mine = [f"d{line}-{unit}" for line in range(len(ports[which::number])) for unit in range(1, drives + 1)]
                fill(place, mine, given.backlog)
            gateways.append(Gateway(place))
            # One that has ended already is not told again.
            stack.callback(gateways[-1].end, signal.SIGKILL)
        figures = befall(gateways, postgres, mosquitto, metrics, given)
        figures |= present(postgres, historian, "caught_up", 1_800.0, partial(all_is_in, gateways))
        historian.latest = 0.0
        figures |= present(postgres, historian, "then", 60.0)
        figures["lost"] = sum(status(each.folder)["spool"]["lost"] for each in gateways)
        figures["memory_mb"] = max(max(each.memory) for each in gateways) / 1e6
        for each in gateways:
            each.end(signal.SIGTERM)
        figures["cores"] = sum(each.seconds for each in gateways) / max(each.lived for each in gateways)
        # What was kept in the last second is delivered by whoever has the spool next.
        for each in gateways:
            each.start()
        time.sleep(20.0)
        # What is kept from here on may not be delivered before the end.
        until = time.time() - 5.0
        for each in gateways:
            each.end(signal.SIGTERM)
        time.sleep(5.0)
        figures |= compared(gateways, postgres, historian, listener, until)
    return figures


def main() -> None:
    """Measures, and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gateways", type=int, default=1, help="each with a part of the lines")
    parser.add_argument("--lines", type=int, default=32)
    parser.add_argument("--drives", type=int, default=8, help="on each line")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--away", type=float, default=10.0, help="minutes for which each server is away")
    parser.add_argument("--kills", type=int, default=20, help="of the gateway, with -9, at random moments")
    parser.add_argument("--backlog", type=int, default=0, help="samples of each drive that wait before")
    parser.add_argument("--without-sparkplug", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--simulate", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.simulate:
        simulate(given.lines, given.drives)
        return
    figures = measure(given)
    table = markdown(["figure", "value"], [[name, f"{value:,.4g}"] for name, value in figures.items()])
    show(given.json, figures, table)


if __name__ == "__main__":
    main()
