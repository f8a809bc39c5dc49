"""The way to an MQTT broker: connected again and again, each time as if for the first time.

Nothing is queued while it is away, here or there: what waits for the broker waits in a spool, what drives say is said
anew, and the session is a clean one. At most a window of messages is under way.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import paho.mqtt.client as paho
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode
from paho.mqtt.subscribeoptions import SubscribeOptions

from drivebus.errors import NotAllowed
from drivebus.sinks.mqtt_client import CONNECTS, checked, cut, in_words, new_client, properties_of, reason_of
from drivebus.sinks.mqtt_messages import Message
from drivebus.sinks.mqtt_settings import MqttSettings

__all__ = ["Incoming", "Link"]

_WINDOW = 100
"""Messages under way that the broker has not acknowledged."""
_KEEPALIVE = 10
"""Seconds. A broker that hears nothing for half as long again says that this gateway is gone."""
_SILENCE = 30.0
"""Seconds that a broker may take to acknowledge the next message."""
_FIRST_PAUSE, _LONGEST_PAUSE = 1.0, 15.0
"""Seconds between two attempts."""
_LARGEST = 65_536
"""Bytes that a broker may send in one piece: a larger one it drops itself."""
_FAILED = 0x80
"""Where the codes begin by which a broker refuses something."""
_GRACE = 0.4
"""Seconds for a farewell."""


class Incoming(NamedTuple):
    """A message that came.

    Attributes:
        topic: By which topic.
        payload: What it says.
        kept: Whether it was given to the broker to keep.
        expiry: Seconds for which it would still be delivered; None: it did not say.
        answer_to: The topic by which an answer is wanted; empty: none is.
        known_by: What that answer is known by.
    """

    topic: str
    payload: bytes
    kept: bool
    expiry: float | None
    answer_to: str
    known_by: bytes | None


class Link:
    """The connections to one broker, one after the other.

    Args:
        settings: Where it is, and who this is.
        last_will: What the broker says when this is gone.
        hear: Takes each message that comes; it must not wait.
        tell: Hears in words what people should know.
        changed: Called when a connection stands, or ended, or there is room in the window.
        clock: Seconds of a clock that only goes forward.
    """

    def __init__(
        self,
        settings: MqttSettings,
        last_will: Message,
        hear: Callable[[Incoming], None],
        tell: Callable[[str], None],
        changed: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = f"the MQTT broker {settings.host}:{settings.port}"
        self.why = "it was not tried yet"
        """Why there is no connection; empty: there is one."""
        self.number = 0
        """How many connections there were."""
        self.heard = clock()
        """When the broker gave a sign of life last."""
        self.largest = _LARGEST
        """Bytes that the broker takes in one piece."""
        self._settings = settings
        self._will = last_will
        self._hear = hear
        self._tell = tell
        self._changed = changed
        self._clock = clock
        self._window = _WINDOW
        self._lock = threading.Condition()
        self._client: paho.Client | None = None
        self._under_way: dict[int, str] = {}
        self._early: dict[int, str] = {}
        self._refused = ""
        self._ending = ""
        self._closing = threading.Event()
        self._ended = threading.Event()
        self._is_given_up = False
        self._told: set[str] = set()
        self._thread = threading.Thread(target=self._run, name="drivebus mqtt link", daemon=True)
        checked(settings)

    def start(self) -> None:
        """Begins to connect."""
        self._thread.start()

    def close(self) -> None:
        """Ends within a second; the broker says that this is gone. Closing again does nothing."""
        self._closing.set()
        self._ended.set()
        self.give_up()
        if self._thread.ident is not None:
            self._thread.join(2 * _GRACE)

    def give_up(self) -> None:
        """Nobody waits for the broker any longer."""
        with self._lock:
            self._is_given_up = True
            self._lock.notify_all()

    def wait(self) -> None:
        """Waits until there is a connection.

        Raises:
            NotAllowed: It was given up.
        """
        with self._lock:
            self._lock.wait_for(lambda: self._is_given_up or not self.why)
            if self._is_given_up:
                raise NotAllowed("it was given up")

    def subscribe(self, topics: Sequence[str]) -> None:
        """Hears what is said at *topics*, but for what this says itself, and what was kept there, as such."""
        options = SubscribeOptions(qos=1, noLocal=True, retainAsPublished=True)
        with self._lock:
            client = self._client
        if client is not None and topics:
            client.subscribe([(topic, options) for topic in topics])

    def post(self, message: Message) -> bool:
        """Says *message*, unless nobody is there or the window is full; whether it did. It waits for nothing."""
        with self._lock:
            client = self._client
            if self.why or client is None or len(self._under_way) >= self._window:
                return False
        return self._publish(client, message)

    def put(self, messages: Sequence[Message]) -> None:
        """Says *messages*, in their order. When this returns, the broker has them all.

        Raises:
            NotAllowed: It has not, as far as is known.
        """
        with self._lock:
            client, number, self._refused = self._client, self.number, ""
        # What is said of now has room beside it.
        room = max(self._window * 3 // 4, 1)
        for message in messages:
            self._until(number, lambda: len(self._under_way) < room)
            if client is None or not self._publish(client, message):
                raise NotAllowed("the connection ended")
        self._until(number, lambda: not self._under_way)

    def _until(self, number: int, holds: Callable[[], bool]) -> None:
        """Waits until it *holds*, or raises what keeps the broker from it."""
        with self._lock:
            heard = self.heard
            while not holds():
                if self._is_given_up or self.why or self.number != number:
                    raise NotAllowed("the connection ended")
                if not self._lock.wait(_SILENCE) and self.heard == heard:
                    raise NotAllowed(f"it acknowledged nothing for {_SILENCE:g} s")
                heard = self.heard
            if self._refused:
                raise NotAllowed(self._refused)

    def _publish(self, client: paho.Client, message: Message) -> bool:
        properties = None
        if message.to is not None:
            properties = properties_of(PacketTypes.PUBLISH)
            properties.CorrelationData = message.to
        # Not with the lock: the client calls back with a lock of its own.
        sent = client.publish(message.topic, message.payload, qos=1, retain=message.keeps, properties=properties)
        if sent.rc != paho.MQTT_ERR_SUCCESS:
            return False
        with self._lock:
            if sent.mid not in self._early:
                self._under_way[sent.mid] = message.topic
            else:
                self._take(message.topic, self._early.pop(sent.mid))
        return True

    def _take(self, topic: str, refusal: str) -> None:
        if refusal:
            self._refused = f"it refuses {topic}: {refusal}"
            self._complain(f"{self.name} refuses {topic}: {refusal}")

    def _complain(self, told: str) -> None:
        if told not in self._told:
            self._told.add(told)
            self._tell(told)

    def _run(self) -> None:
        pause = _FIRST_PAUSE
        while not self._closing.is_set():
            began = self._clock()
            self._ended.clear()
            why = self._connection()
            if self._closing.is_set():
                return
            with self._lock:
                self._is_over(why)
            self._changed()
            self._complain(f"{self.name} cannot be used: {why}; it is tried again")
            if self._clock() - began > _LONGEST_PAUSE:
                pause = _FIRST_PAUSE
            self._closing.wait(pause)
            pause = min(pause * 2, _LONGEST_PAUSE)

    def _is_over(self, why: str) -> None:
        self.why = why or "the connection ended"
        self._client = None
        self._under_way.clear()
        self._early.clear()
        self._lock.notify_all()

    def _connection(self) -> str:
        """One connection, until it ends; why it did."""
        settings = self._settings
        try:
            client = self._new_client()
            told = properties_of(PacketTypes.CONNECT)
            told.SessionExpiryInterval = 0
            told.MaximumPacketSize = _LARGEST
            client.connect(settings.host, settings.port, _KEEPALIVE, clean_start=True, properties=told)
        except NotAllowed as error:
            return str(error)
        except (OSError, ValueError) as error:
            return reason_of(error)
        with self._lock:
            self._client = client
            self._ending = ""
        client.loop_start()
        if not self._ended.wait(CONNECTS) and self.why:
            self._ending = f"it does not answer for {CONNECTS:g} s"
        else:
            self._ended.wait()
        if self._closing.is_set():
            # The broker says the last will then, as if this was gone without a word.
            self._ended.clear()
            client.disconnect(reasoncode=ReasonCode(PacketTypes.DISCONNECT, identifier=4))
            self._ended.wait(_GRACE)
        cut(client)
        client.loop_stop()
        return self._ending

    def _new_client(self) -> paho.Client:
        """A new one each time: the one before still has messages of its own that it would send again."""
        settings = self._settings
        client = new_client(settings, self._loop_ended, f"drivebus-{settings.topics.node}", paho.MQTTv5)
        client.max_inflight_messages_set(_WINDOW)
        client.will_set(self._will.topic, self._will.payload, qos=1, retain=self._will.keeps)
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_publish = self._on_publish
        client.on_message = self._on_message
        client.on_subscribe = self._on_subscribe
        return client

    def _loop_ended(self, why: str) -> None:
        self._ending = self._ending or why
        self._ended.set()

    def _on_connect(self, _: Any, __: Any, ___: Any, code: ReasonCode, told: Properties | None) -> None:
        if code.is_failure:
            self._ending = in_words(code)
            self._ended.set()
            return
        with self._lock:
            # The client itself does not keep to what the broker can take.
            self._window = min(_WINDOW, getattr(told, "ReceiveMaximum", _WINDOW))
            self.largest = getattr(told, "MaximumPacketSize", 1 << 28) - 1_000
            self.number += 1
            self.heard = self._clock()
            was, self.why = self.why, ""
            self._lock.notify_all()
        if self._told:
            self._told.clear()
            self._tell(f"{self.name} can be used again")
        elif was:
            self._tell(f"{self.name} is connected")
        self._changed()

    def _on_disconnect(self, _: Any, __: Any, ___: Any, code: ReasonCode, ____: Any) -> None:
        self._ending = self._ending or in_words(code)
        with self._lock:
            if not self.why:
                self._is_over(self._ending)
        self._ended.set()
        self._changed()

    def _on_publish(self, _: Any, __: Any, mid: int, code: ReasonCode, ___: Any) -> None:
        refusal = in_words(code) if code.value >= _FAILED else ""
        with self._lock:
            self.heard = self._clock()
            if mid in self._under_way:
                self._take(self._under_way.pop(mid), refusal)
            else:
                self._early[mid] = refusal
            self._lock.notify_all()
        self._changed()

    def _on_subscribe(self, _: Any, __: Any, ___: Any, codes: Sequence[ReasonCode], ____: Any) -> None:
        for code in codes:
            if code.value >= _FAILED:
                self._complain(f"{self.name} does not let this hear something: {in_words(code)}")

    def _on_message(self, _: Any, __: Any, message: paho.MQTTMessage) -> None:
        self.heard = self._clock()
        told = message.properties
        # A topic may be no text; such a one means nothing here.
        with suppress(UnicodeDecodeError):
            self._hear(
                Incoming(
                    message.topic,
                    bytes(message.payload),
                    message.retain,
                    getattr(told, "MessageExpiryInterval", None),
                    getattr(told, "ResponseTopic", ""),
                    getattr(told, "CorrelationData", None),
                )
            )
