"""A Mosquitto of our own, the way to it, and somebody there who hears all and says what a test says."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from .tcp_client import free_port, seen

ROOT = Path(__file__).resolve().parent.parent.parent
ANYBODY = "allow_anonymous true\n"


def lacking() -> NoReturn:
    """Skips the test, or fails it where nothing may be skipped."""
    reason = "Mosquitto is missing: run `make interop-parts`, or on Debian `apt-get install mosquitto`"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


def program(name: str = "mosquitto") -> Path:
    """The broker, or another program of it: the system's, or the one that was unpacked."""
    for root in (Path("/"), ROOT / ".tools"):
        for folder in ("usr/sbin", "usr/bin"):
            if (root / folder / name).exists():
                return root / folder / name
    if found := shutil.which(name):
        return Path(found)
    lacking()


def environment() -> dict[str, str]:
    """With the libraries that were unpacked."""
    libraries = [str(each) for each in (ROOT / ".tools/usr/lib").glob("*-linux-*")]
    path = os.pathsep.join([*libraries, os.environ.get("LD_LIBRARY_PATH", "")])
    return {"PATH": os.environ["PATH"], "LD_LIBRARY_PATH": path, "LC_ALL": "C"}


class Broker:
    """A broker, which forgets all when it ends unless its rules say otherwise.

    Args:
        folder: Where its files are.
        rules: Lines of its configuration.
    """

    def __init__(self, folder: Path, rules: str = ANYBODY) -> None:
        self.port = free_port()
        self.folder = folder
        self._file = folder / "mosquitto.conf"
        own = "user root\n" if hasattr(os, "geteuid") and os.geteuid() == 0 else ""
        self._file.write_text(f"listener {self.port} 127.0.0.1\n{own}set_tcp_nodelay true\n{rules}")
        self.start()

    def start(self) -> None:
        """Starts it; returns when it takes connections."""
        self._process = subprocess.Popen(
            [program(), "-c", self._file],
            cwd=self.folder,
            env=environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        seen(self._takes)

    def kill(self) -> None:
        """It is gone without a word."""
        self._process.kill()
        self._process.wait(60)

    def reload(self) -> None:
        """Has it read anew who may say what. It has to have served somebody: before that it would end."""
        self._process.send_signal(signal.SIGHUP)

    def _takes(self) -> bool:
        assert self._process.poll() is None, "the broker did not start"
        with suppress(OSError):
            socket.create_connection(("127.0.0.1", self.port)).close()
            return True
        return False


@contextmanager
def broker(folder: Path, rules: str = ANYBODY) -> Iterator[Broker]:
    """A broker, until the test has ended."""
    made = Broker(folder, rules)
    try:
        yield made
    finally:
        made.kill()


class Way:
    """A way to a broker, that breaks where it is told to."""

    def __init__(self, to: int) -> None:
        self._to = to
        self._both: list[socket.socket] = []
        self._is_cut = False
        self._is_silent = False
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """Nobody gets through from now on."""
        self._is_cut = True
        self._shut()

    def silence(self) -> None:
        """All is taken, and nothing gets through, from now on."""
        self._is_silent = True

    def mend(self) -> None:
        """Who comes now gets through."""
        self._shut()
        self._is_cut = self._is_silent = False

    def close(self) -> None:
        # The thread that waits there would keep it open.
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.cut()

    def _shut(self) -> None:
        for each in self._both:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        self._both = []

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listening.accept()
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            if self._is_cut:
                return
            with socket.create_connection(("127.0.0.1", self._to)) as there:
                self._both += [client, there]
                back = threading.Thread(target=self._forward, args=(there, client), daemon=True)
                back.start()
                self._forward(client, there)
                back.join()

    def _forward(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(1 << 16):
                if not self._is_silent:
                    other.sendall(data)
        for each in (one, other):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)


class Somebody:
    """A client of the broker that hears all.

    Args:
        at: The broker.
        ready: Changes the client before it connects.
        topics: What it hears.
    """

    def __init__(
        self, at: Broker, ready: Callable[[paho.Client], object] = bool, topics: tuple[str, ...] = ("#",)
    ) -> None:
        self.heard: list[paho.MQTTMessage] = []
        self.codes: list[int] = []
        self._topics = topics
        self._subscribed = threading.Event()
        self.client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self.client.on_connect = self._on_connect
        self.client.on_disconnect = lambda *_: self._subscribed.clear()
        self.client.on_message = lambda _, __, message: self.heard.append(message)
        self.client.on_subscribe = self._on_subscribe
        self.client.reconnect_delay_set(1, 1)
        ready(self.client)
        self.client.connect("127.0.0.1", at.port, clean_start=True)
        self.client.loop_start()
        seen(self._subscribed.is_set)

    @property
    def hears(self) -> bool:
        """Whether the broker knows what it shall be told."""
        return self._subscribed.is_set()

    def _on_connect(self, client: paho.Client, *_: Any) -> None:
        # Once more after each end of the broker.
        client.subscribe([(topic, SubscribeOptions(qos=1, noLocal=True)) for topic in self._topics])

    def _on_subscribe(self, _: Any, __: Any, ___: Any, codes: list[Any], ____: Any) -> None:
        self.codes = [code.value for code in codes]
        self._subscribed.set()

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()

    def say(self, topic: str, payload: object = b"", *, keep: bool = False, **told: Any) -> None:
        """Says *payload*, a text or what becomes JSON; *told* are properties of MQTT 5."""
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        for name, value in told.items():
            setattr(properties, name, value)
        if not isinstance(payload, str | bytes):
            payload = json.dumps(payload)
        self.client.publish(topic, payload, qos=1, retain=keep, properties=properties).wait_for_publish(60)

    def at(self, topic: str) -> list[Any]:
        """What was said at *topic*, the oldest first: JSON, or a text where it is none."""
        return [_told(message) for message in list(self.heard) if message.topic == topic]

    def last(self, topic: str) -> Any:
        """What was said there last; None: nothing."""
        found = self.at(topic)
        return found[-1] if found else None


def _told(message: paho.MQTTMessage) -> Any:
    try:
        return json.loads(message.payload)
    except ValueError:
        return message.payload.decode()


@contextmanager
def somebody(at: Broker, ready: Callable[[paho.Client], object] = bool) -> Iterator[Somebody]:
    """Somebody at the broker, until the test has ended."""
    made = Somebody(at, ready)
    try:
        yield made
    finally:
        made.close()
