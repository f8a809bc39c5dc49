"""One session after another of an edge node of Sparkplug at a broker; what a host of it surely has is in.

Values go at most once, as Sparkplug demands (QoS 0). So behind each part of them a subscription is made anew: the
broker answers that behind all that came before, and what it has answered for is not sent again. What was sent, and
never answered for, is sent again as the past. So is what was sent shortly before the end of a session: a broker that
dies takes with it what it had not given to the host, and a host is gone for a while before anybody knows.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import MQTTErrorCode

from drivebus.errors import NotAllowed
from drivebus.sinks.intervals import Intervals
from drivebus.sinks.mqtt_client import Client, cut, in_words, new_client, reason_of
from drivebus.sinks.picture import Picture
from drivebus.sinks.reached import Reached
from drivebus.sinks.sparkplug_node import NAMESPACE, Message, Node, wants_rebirth
from drivebus.sinks.sparkplug_settings import SparkplugSettings
from drivebus.spool import Spool, Spooled

__all__ = ["SINK", "Session"]

SINK, _SESSIONS = "sparkplug", "sparkplug bdSeq"
"""The names under which the spool knows how far this came, and the number of the last session."""
_KEEPALIVE = 10
"""Seconds. A broker that hears nothing for half as long again says that this node is dead."""
_PATIENCE = 20.0
"""Seconds for a connection, and for each answer of the broker."""
_HOST_FIRST, _HOST_LATER = 5.0, 600.0
"""Seconds for which the primary host is waited for: the first time, so that it is soon told, and from then on."""
_IN_DOUBT = 60.0
"""Seconds before the end of a session, of which nobody knows what the host has."""
_LARGEST = 65_536
"""Bytes of a command or a state; what is larger is none."""


class Session:
    """A destination of a `Delivery`.

    Args:
        spool: Where samples wait.
        settings: Where the broker is, and which node of which group this is.
        look: Gives how the plant is now. Any thread.
        clock: Unix time in seconds.
    """

    def __init__(
        self,
        spool: Spool,
        settings: SparkplugSettings,
        look: Callable[[], Picture],
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.name = f"the Sparkplug broker {settings.broker.host}:{settings.broker.port}"
        self._spool = spool
        self._settings = settings
        self._look = look
        self._node = Node(settings.group, settings.node, clock)
        self._reached = Reached(spool, SINK)
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._client: Client | None = None
        self._why = ""
        self._answered: set[int] = set()
        self._is_up = False
        self._is_born = False
        self._host: tuple[int, bool] = (0, False)
        self._patience = _HOST_FIRST
        self._is_over = False
        self._lately: deque[tuple[float, list[tuple[str, int, int]]]] = deque()

    def open(self) -> Mapping[str, Intervals]:
        """Connects, waits for the primary host if there is one, and bears the node and all drives that answer."""
        with closing(self._spool.reader(_SESSIONS)) as reader:
            number = reader.position() + 1
        # Before it is used: after a kill, too, no two sessions have the same.
        self._spool.reached(_SESSIONS, number)
        self._spool.commit()
        client = self._connected(self._node.death(number))
        topics = [self._node.topic("NCMD")]
        if self._settings.primary_host:
            topics.append(self._state_topic())
        self._until_answered(client, topics)
        self._until_host_is_there()
        inside = self._reached.open()
        while self._lately:
            self._reached.give_back(self._lately.popleft()[1])
        with self._lock:
            self._is_born = True
            self._say(self._node.birth(self._look(), self._spool.last))
        return inside

    def put(self, samples: Sequence[Spooled]) -> None:
        """Takes *samples*: when this returns, the broker had them."""
        with self._lock:
            client = self._client
            if client is None:
                raise NotAllowed("the connection ended")
            self._say(self._node.data(samples))
        self._until_answered(client, [self._node.topic("NCMD")])
        self._lately.append((time.monotonic(), self._reached.take(samples)))
        self._forget()

    def check(self) -> None:
        """Raises why the session has ended: a host wants to hear a birth soon, also where no sample waits."""
        with self._lock:
            if self._why:
                raise NotAllowed(self._why)

    def interrupt(self) -> None:
        """Whatever is waited for is over, from now on. Any thread."""
        with self._lock:
            self._is_over = True
            self._changed.notify_all()

    def close(self) -> None:
        """The node is dead: the broker says so."""
        with self._lock:
            client, self._client = self._client, None
            if self._is_born:
                self._forget()
            self._is_born = False
        if client is not None:
            # Without a farewell, so that the broker says what was left with it.
            cut(client)
            client.loop_stop()

    def _forget(self) -> None:
        """What was told so long ago that whoever heard it has it."""
        while self._lately and self._lately[0][0] <= time.monotonic() - _IN_DOUBT:
            self._lately.popleft()

    def _connected(self, will: Message) -> Client:
        broker = self._settings.broker
        with self._lock:
            self._why, self._is_up = "", False
            self._answered.clear()
            self._host = (0, False)
        client = new_client(
            broker, self._ended, f"drivebus-{self._settings.group}-{self._settings.node}", paho.MQTTv311
        )
        client.will_set(will.topic, will.payload, qos=1)
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        with self._lock:
            self._client = client
        try:
            client.connect(broker.host, broker.port, _KEEPALIVE)
        except (OSError, ValueError) as error:
            raise NotAllowed(reason_of(error)) from None
        client.loop_start()
        self._wait(lambda: self._is_up, _PATIENCE, "it does not answer")
        return client

    def _until_host_is_there(self) -> None:
        host = self._settings.primary_host
        if host:
            patience, self._patience = self._patience, _HOST_LATER
            self._wait(lambda: self._host[1], patience, f"its primary host {host} is not online")

    def _until_answered(self, client: Client, topics: Iterable[str]) -> None:
        """Subscribes to *topics*. When this returns, the broker has all that was said before."""
        result, number = client.subscribe([(topic, 1) for topic in topics])
        if result != MQTTErrorCode.MQTT_ERR_SUCCESS or number is None:
            raise NotAllowed("the connection ended")
        self._wait(lambda: number in self._answered, _PATIENCE, "it does not answer")
        with self._lock:
            self._answered.discard(number)

    def _wait(self, holds: Callable[[], bool], patience: float, why: str) -> None:
        with self._changed:
            came = self._changed.wait_for(lambda: bool(self._is_over or self._why or holds()), patience)
            if self._is_over or self._why:
                raise NotAllowed(self._why or "it was given up")
            if not came:
                raise NotAllowed(why)

    def _say(self, messages: Iterable[Message]) -> None:
        """Says *messages* with the lock, so that their numbers come in their order."""
        assert self._client is not None
        for message in messages:
            self._client.publish(message.topic, message.payload, qos=0)

    def _ended(self, why: str) -> None:
        with self._changed:
            self._why = self._why or why or "the connection ended"
            self._changed.notify_all()

    def _on_connect(self, _: Any, __: Any, ___: Any, code: Any, ____: Any) -> None:
        with self._changed:
            if code.is_failure:
                self._why = in_words(code)
            self._is_up = True
            self._changed.notify_all()

    def _on_subscribe(self, _: Any, __: Any, number: int, codes: Sequence[Any], ____: Any) -> None:
        with self._changed:
            refused = [in_words(code) for code in codes if code.is_failure]
            if refused:
                self._why = f"it does not let this node hear commands: {refused[0]}"
            self._answered.add(number)
            self._changed.notify_all()

    def _on_message(self, _: Any, __: Any, message: paho.MQTTMessage) -> None:
        if len(message.payload) > _LARGEST:
            return
        with suppress(UnicodeDecodeError):
            if message.topic == self._state_topic():
                self._hear_state(bytes(message.payload))
            elif wants_rebirth(bytes(message.payload)) and not message.retain:
                with self._lock:
                    if self._is_born and self._client is not None:
                        self._say(self._node.birth(self._look(), self._spool.last))

    def _hear_state(self, payload: bytes) -> None:
        """What the primary host says of itself; what is older than what it said is a death of long ago."""
        with suppress(ValueError, TypeError, AttributeError, KeyError):
            told = json.loads(payload)
            at, is_online = int(told["timestamp"]), told["online"] is True
            with self._changed:
                if at < self._host[0]:
                    return
                self._host = (at, is_online)
                if self._is_born and not is_online:
                    self._why = f"its primary host {self._settings.primary_host} is not online"
                self._changed.notify_all()

    def _state_topic(self) -> str:
        return f"{NAMESPACE}/STATE/{self._settings.primary_host}"
