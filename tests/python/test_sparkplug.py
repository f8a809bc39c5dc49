"""An edge node of Sparkplug at a real Mosquitto: a host misses nothing, and what is told twice is told as the past."""

from __future__ import annotations

import json
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

pytest.importorskip("google.protobuf")


from drivebus.sinks import DrivePicture, LinePicture, Picture, delivery, sparkplug_session
from drivebus.sinks.mqtt_settings import MqttSettings
from drivebus.sinks.sparkplug import Sparkplug
from drivebus.sinks.sparkplug_node import REBIRTH
from drivebus.sinks.sparkplug_payload import Metric, Payload
from drivebus.sinks.sparkplug_settings import SparkplugSettings
from drivebus.spool import Layout, Spool

from .delivering import cut_afterwards
from .mqtt_broker import Way, broker
from .sparkplug_host import Host
from .tcp_client import seen

PUMP = Layout("pump", "gd350", ("running_frequency", "status_word_1"), ("Hz", ""), (2, 0))
STATE = "spBv1.0/STATE/scada"
CHANCE = random.Random(34)


class Listener:
    """A host at the broker, and its state; it comes back by itself, and then wants to hear all anew."""

    def __init__(self, port: int) -> None:
        self.host = Host()
        self.wrong: list[str] = []
        self.deaths = 0
        self.births: list[int] = []
        self._moments = count(1_000)
        self._lock = threading.Lock()
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id="scada", protocol=paho.MQTTv311)
        self._client.reconnect_delay_set(1, 1)
        self._client.will_set(STATE, self._state(False), qos=1, retain=True)
        self._client.on_connect = self._begins
        self._client.on_message = self._hears
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def says(self, is_online: bool, at: int | None = None) -> None:
        """The host tells how it is."""
        self._client.publish(STATE, self._state(is_online, at), qos=1, retain=True)

    def wants_all_anew(self) -> None:
        payload = Payload(0, [Metric(REBIRTH, True, 0)], None).packed()
        self._client.publish("spBv1.0/plant/NCMD/hall", payload, qos=0)

    def sends(self, topic: str, payload: bytes, retain: bool = False) -> None:
        self._client.publish(topic, payload, qos=1, retain=retain)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def _state(self, is_online: bool, at: int | None = None) -> str:
        return json.dumps({"online": is_online, "timestamp": next(self._moments) if at is None else at})

    def _begins(self, *_: Any) -> None:
        self._client.subscribe([("spBv1.0/plant/#", 1)])
        self.says(True)

    def _hears(self, _: Any, __: Any, message: Any) -> None:
        with self._lock:
            self.deaths += "/NDEATH/" in message.topic
            if "/NBIRTH/" in message.topic:
                read = Payload.read(message.payload)
                self.births += [int(each.value or 0) for each in read.metrics if each.name == "bdSeq"]
            try:
                if "/NCMD/" not in message.topic:
                    self.host.takes(message.topic, message.payload)
            except AssertionError as error:
                self.wrong.append(str(error))


class Plant:
    """A spool that is fed, and a node that tells of it."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "spool"
        self.heard: list[str] = []
        self.spool = Spool(self.path, 1 << 30, self.heard.append)
        self.last: dict[str, DrivePicture] = {}
        self._moments = count(1_700_000_000)

    def feed(self, samples: int, missing: str = "") -> None:
        for _ in range(samples):
            at = float(next(self._moments))
            values = () if missing else (at % 50, int(at) % 7)
            self.spool.add(PUMP, at, 0.01, missing, values)
            self.last["pump"] = DrivePicture(1, PUMP, at, missing, values)
        self.spool.commit()

    def look(self) -> Picture:
        return Picture(0.0, (LinePicture("line", True, {}, tuple(self.last.values())),))

    @contextmanager
    def told(self, port: int, primary_host: str = "scada") -> Iterator[Sparkplug]:
        settings = SparkplugSettings(MqttSettings("127.0.0.1", port, "hall", tls=False), "plant", "hall", primary_host)
        node = Sparkplug(self.spool, settings, self.look, self.heard.append)
        node.start()
        try:
            yield node
        finally:
            node.close()

    def opened_again(self) -> None:
        self.spool.close()
        self.spool = Spool(self.path, 1 << 30, self.heard.append)

    def kept(self) -> set[int]:
        """The times of all samples with values that the spool has, in milliseconds."""
        with closing(self.spool.reader("test")) as reader:
            return {int(each.time * 1_000) for each in reader.after(0, 1_000_000) if each.values}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits long in a test for a broker that is silent."""
    monkeypatch.setattr(sparkplug_session, "_PATIENCE", 2.0)
    monkeypatch.setattr(sparkplug_session, "_HOST_FIRST", 0.5)
    monkeypatch.setattr(delivery, "_FIRST_PAUSE", 0.05)


@pytest.fixture
def plant(quick_folder: Path) -> Iterator[Plant]:
    made = Plant(quick_folder)
    yield made
    made.spool.close()


@contextmanager
def listening(port: int) -> Iterator[Listener]:
    listener = Listener(port)
    try:
        yield listener
    finally:
        listener.close()


def is_in(node: Sparkplug) -> bool:
    status = node.status()
    return bool(status["connected"] and not status["behind"])


def complete(plant: Plant, listener: Listener) -> None:
    """Each sample was told."""
    # The broker has it sooner than the host; and a birth tells the last before those that are the past.
    seen(lambda: plant.kept() <= told_to(listener))
    assert not listener.wrong


def told_to(listener: Listener) -> set[int]:
    """The times of what the host was told of the pump, as the present or as the past."""
    host = listener.host
    return {at for device, at, _ in [*host.told, *host.historical] if device == "pump"}


def test_a_host_hears_all_and_what_it_asks_for(tmp_path: Path, plant: Plant) -> None:
    with broker(tmp_path) as served, listening(served.port) as listener, plant.told(served.port) as node:
        seen(lambda: len(listener.births) == 1)
        for number in range(30):
            plant.feed(1)
            if number % 10 == 5:
                listener.wants_all_anew()
        seen(lambda: is_in(node) and len(listener.births) == 4)
        plant.feed(1, "no answer")
        seen(lambda: "pump" not in listener.host.values)
        plant.feed(5)
        seen(lambda: listener.host.values.get("pump", {}).get("running_frequency") == plant.last["pump"].values[0])
        complete(plant, listener)
        plant.spool.note("pump", "fault", 1_700_000_100.0, "in fault: OL1")
        plant.spool.commit()
        seen(lambda: listener.host.values[""]["event"] == "pump: in fault: OL1")
    assert set(listener.births) == {1}


def test_the_death_of_the_node_is_told_and_each_session_has_a_number(tmp_path: Path, plant: Plant) -> None:
    with broker(tmp_path) as served, listening(served.port) as listener:
        for number in range(1, 4):
            with plant.told(served.port):
                plant.feed(3)
                seen(lambda n=number: listener.births[-1:] == [n])  # type: ignore[misc]
            seen(lambda n=number: listener.deaths == n)  # type: ignore[misc]
            assert not listener.host.values
            # Also where the service is started again.
            plant.opened_again()


def test_without_its_primary_host_nothing_is_told(tmp_path: Path, plant: Plant) -> None:
    with broker(tmp_path) as served, listening(served.port) as listener, plant.told(served.port) as node:
        plant.feed(10)
        seen(lambda: is_in(node))
        listener.says(False)
        seen(lambda: listener.deaths == 1 and not node.status()["connected"])
        plant.feed(10)
        assert len(listener.births) == 1
        assert "scada is not online" in node.status()["why"]
        listener.says(True)
        seen(lambda: is_in(node) and len(listener.births) == 2)
        # A death that was on its way for long ends nothing.
        listener.says(False, at=5)
        plant.feed(10)
        seen(lambda: is_in(node))
        complete(plant, listener)
        assert listener.deaths == 1
    # While the host was away, and so as the past, or by the birth.
    assert len(listener.host.historical) >= 9


@pytest.mark.parametrize("befalls", ["killed", "cut", "silent"])
def test_nothing_is_missing_whatever_befalls_the_broker(tmp_path: Path, plant: Plant, befalls: str) -> None:
    with broker(tmp_path) as served, closing(Way(served.port)) as way, listening(served.port) as listener:
        breaks: dict[str, Callable[[], None]] = {"killed": served.kill, "cut": way.cut, "silent": way.silence}
        mends: dict[str, Callable[[], None]] = {"killed": served.start, "cut": way.mend, "silent": way.mend}
        with plant.told(way.port) as node:
            for _ in range(1 if befalls == "silent" else 3):
                plant.feed(CHANCE.randrange(1, 40))
                seen(lambda: node.status()["delivered"] > 0)
                plant.feed(CHANCE.randrange(1, 40))
                breaks[befalls]()
                plant.feed(CHANCE.randrange(1, 40))
                seen(lambda: not node.status()["connected"])
                mends[befalls]()
                seen(lambda: is_in(node))
        complete(plant, listener)


def test_a_spool_that_is_cut_anywhere(tmp_path: Path, plant: Plant) -> None:
    """What it has is told."""
    times: set[int] = set()
    with broker(tmp_path) as served, listening(served.port) as listener:
        for _ in range(100):
            with plant.told(served.port) as node:
                plant.feed(10)
                times |= plant.kept()
                seen(lambda: is_in(node) and not lacks(plant, listener))
                # Some of these are told, and all of them may be gone when it was cut.
                plant.feed(10)
                with cut_afterwards(plant.path, CHANCE):
                    node.close()
                    plant.spool.close()
            plant.opened_again()
    assert times <= told_to(listener)
    assert not listener.wrong


def test_what_was_told_shortly_before_the_end_is_told_again_as_the_past(tmp_path: Path, plant: Plant) -> None:
    """Where a broker dies, nobody knows what the host has of it."""
    with broker(tmp_path) as served, closing(Way(served.port)) as way, listening(served.port) as listener:
        with plant.told(way.port) as node:
            seen(lambda: len(listener.births) == 1)
            plant.feed(30)
            seen(lambda: is_in(node) and not lacks(plant, listener))
            assert listener.host.historical == []
            way.cut()
            seen(lambda: not node.status()["connected"])
            way.mend()
            seen(lambda: is_in(node))
            seen(lambda: plant.kept() <= {at for _, at, _ in listener.host.historical})
        assert not listener.wrong


def lacks(plant: Plant, listener: Listener) -> bool:
    last = int(plant.last["pump"].time * 1_000)
    return not any(at == last for _, at, _ in listener.host.told + listener.host.historical)


def test_what_is_no_command_does_nothing(tmp_path: Path, plant: Plant) -> None:
    with broker(tmp_path) as served, listening(served.port) as listener, plant.told(served.port) as node:
        seen(lambda: len(listener.births) == 1)
        rebirth = Payload(0, [Metric(REBIRTH, True, 0)], None).packed()
        for payload in (b"", b"\xff" * 100, b"{}", rebirth[:-1], rebirth * 2_000, bytes(1_000_000)):
            listener.sends("spBv1.0/plant/NCMD/hall", payload)
        for state in (b"", b"[]", b"null", b'{"online":true}', b'{"timestamp":"x","online":false}', b"\xff"):
            listener.sends(STATE, state)
        plant.feed(20)
        seen(lambda: is_in(node))
        complete(plant, listener)
        assert listener.deaths == 0
