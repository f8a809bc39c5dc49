"""A plant at an MQTT broker: how it is now, all that it ever said, and what its drives are told to do.

One thread says what is now, another one what waited in a spool, and the client's own hears.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from drivebus import checks
from drivebus.sinks import home_assistant
from drivebus.sinks.delivery import Delivery
from drivebus.sinks.mqtt_commands import Command, Commands, Heard, NotTaken
from drivebus.sinks.mqtt_drives import MqttDrive
from drivebus.sinks.mqtt_history import SINK, History
from drivebus.sinks.mqtt_messages import Message, moment, packed
from drivebus.sinks.mqtt_present import OFFLINE, ONLINE, Present
from drivebus.sinks.mqtt_settings import MqttSettings
from drivebus.sinks.mqtt_topics import Topics, why_no_prefix
from drivebus.sinks.needs_paho import module_for
from drivebus.sinks.picture import Picture
from drivebus.spool import Spool

if TYPE_CHECKING:
    from types import ModuleType

    from drivebus.sinks.mqtt_link import Incoming

__all__ = ["Answer", "Commander", "Mqtt"]

_LOOKS = 0.2
"""Seconds between two looks at how the plant is."""
_SETTLES = 2.0
"""Seconds after which Home Assistant has dropped what it was told to drop."""
_WAITING = 10_000
"""Messages that wait for the broker to take them; what comes then is not said."""
_LONGEST = 500
"""Characters of a name in an answer, and of its text."""


class Answer(NamedTuple):
    """What became of a command.

    Attributes:
        result: In a word, or a few.
        text: The reason, in words.
    """

    result: str
    text: str


@dataclass(frozen=True)
class Commander:
    """Who carries commands out, and watches over what they set in motion.

    Attributes:
        give: Takes a command, and what is called once with what became of it. It must not wait.
        not_taken: Hears of each message that was no command: its drive, and why, in words.
        depends: Whether somebody depends on the broker: a motor turns that was told so over it.
        silent: Called again and again with the seconds since the broker gave a sign of life.
    """

    give: Callable[[Command, Callable[[Answer], None]], None]
    not_taken: Callable[[str, str], None]
    depends: Callable[[], bool]
    silent: Callable[[float], None]


class Mqtt:
    """Speaks to a broker for a plant, until it is closed.

    Args:
        settings: Where it is, and who this is.
        drives: What is known of its drives.
        look: Gives how the plant is now. Any thread.
        spool: Where samples and events wait; None: none are said.
        commander: Who carries commands out; None: nobody, so that none is heard.
        tell: Hears in words what people should know.
        clock: Seconds that only go forward, and `wall`: Unix time.

    Raises:
        NotAllowed: The settings cannot be, or paho-mqtt is not installed. Nothing was connected.
    """

    def __init__(
        self,
        settings: MqttSettings,
        drives: Sequence[MqttDrive],
        look: Callable[[], Picture],
        spool: Spool | None,
        commander: Commander | None,
        tell: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self._settings = settings
        self._topics = settings.topics
        self._known = {each.name for each in drives}
        self._look = look
        self._commander = commander
        self._clock = clock
        self._wall = wall
        self._commands = Commands()
        self._tell = tell
        self._told = ""
        self._present = Present(drives, self._topics)
        self._shown = _shown(drives, settings)
        self._waiting: deque[Message] = deque()
        self._announcing: deque[Message] = deque()
        self._ending: deque[Message] = deque()
        self._greeted = clock()
        self._looked = -_LOOKS
        self._is_born = False
        self._number = 0
        self._beaten = clock()
        self._wake = threading.Event()
        self._closing = threading.Event()
        farewell = Message(self._topics.availability, OFFLINE, keeps=True)
        self._link = _paho().Link(settings, farewell, self._hear, tell, self._wake.set, clock)
        self._delivery: Delivery | None = None
        if spool is not None:
            self._delivery = Delivery(spool, SINK, History(spool, self._link, self._topics), tell)
        self._thread = threading.Thread(target=self._run, name="drivebus mqtt", daemon=True)

    @staticmethod
    def check(settings: MqttSettings) -> None:
        """Whether *settings* can be. Nothing is connected.

        Raises:
            NotAllowed: They cannot, or paho-mqtt is not installed.
        """
        _paho()
        from drivebus.sinks.mqtt_client import checked

        checked(settings)

    def start(self) -> None:
        """Begins to connect, and to speak."""
        self._link.start()
        self._thread.start()
        if self._delivery is not None:
            self._delivery.start()

    def close(self) -> None:
        """Ends within a second or two; what the broker has not is in the spool. Closing again does nothing."""
        self._closing.set()
        self._wake.set()
        if self._delivery is not None:
            self._delivery.close()
        self._link.close()
        if self._thread.ident is not None:
            self._thread.join(1.0)

    def status(self) -> dict[str, Any]:
        """How it does: `connected`, `why` it is not, and of samples how many are `behind` and were `delivered`."""
        delivery = {} if self._delivery is None else self._delivery.status()
        samples = {name: delivery.get(name, 0) for name in ("behind", "delivered")}
        return {"connected": not self._link.why, "why": self._link.why, **samples}

    def _run(self) -> None:
        while not self._closing.is_set():
            self._wake.wait(_LOOKS)
            self._wake.clear()
            try:
                if not self._link.why:
                    self._speak()
            except Exception as error:  # whatever it is, a motor that depends on the broker is watched over
                self._fail(str(error) or type(error).__name__)
            if self._commander is not None:
                self._commander.silent(self._clock() - self._link.heard)

    def _fail(self, why: str) -> None:
        if why != self._told:
            self._told = why
            self._tell(f"something could not be said to {self._link.name}: {why}")

    def _speak(self) -> None:
        if self._link.number != self._number:
            self._number = self._link.number
            self._greet()
        if self._is_born:
            self._is_born = False
            self._announcing = deque(self._shown.values())
        self._beat()
        now = self._clock()
        if now - self._greeted > _SETTLES:
            self._drained(self._ending)
        # It is woken by each acknowledgement, and a look at the plant asks all its lines.
        if self._drained(self._waiting) and self._drained(self._announcing) and now - self._looked >= _LOOKS:
            self._looked = now
            for due in self._present.due(self._look(), now):
                if not all(self._link.post(message) for message in due.messages):
                    return
                self._present.was_said(due, now)

    def _drained(self, waiting: deque[Message]) -> bool:
        """Whether all of *waiting* is said."""
        while waiting:
            if not self._link.post(waiting[0]):
                return False
            waiting.popleft()
        return True

    def _greet(self) -> None:
        """Says all anew to a broker that may know nothing, and hears what it kept of what is not there any more."""
        # That it is online is said behind that it wants to hear: who sees the one can rely on the other.
        # Answers to who asked before the connection ended are answers to nobody.
        self._waiting.clear()
        self._waiting.append(Message(self._topics.availability, ONLINE, keeps=True))
        self._announcing = deque(self._shown.values())
        self._ending.clear()
        self._greeted = self._clock()
        self._present.forget()
        topics: list[str] = []
        if prefix := self._settings.home_assistant:
            topics += [home_assistant.born(prefix), home_assistant.filter_of(prefix, self._topics)]
        topics += self._topics.kept
        if self._commander is not None:
            topics.append(self._topics.commands)
        self._link.subscribe(topics)

    def _beat(self) -> None:
        """Asks the broker for a sign of life where somebody depends on it."""
        if self._commander is None or self._clock() - self._beaten < self._settings.beat:
            return
        self._beaten = self._clock()
        if self._commander.depends():
            self._link.post(Message(self._topics.beat, packed({"time": moment(self._wall())})))

    def _hear(self, came: Incoming) -> None:
        prefix = self._settings.home_assistant
        place = self._topics.place(came.topic)
        if place is not None and place.kind == "cmd":
            self._command(Heard(place.drive, place.order, came.payload, came.kept, came.expiry), came)
        elif not came.kept:
            self._is_born = self._is_born or bool(
                prefix and came.topic == home_assistant.born(prefix) and came.payload == ONLINE
            )
        elif came.payload and (
            (place is not None and place.drive not in self._known)
            or (place is None and _is_config(came.topic) and came.topic not in self._shown)
        ):
            # Of a drive, or a value of one, that the file does not have any more.
            # What an entity listens to goes when the entity is gone.
            waiting = self._waiting if place is None else self._ending
            self._say(Message(came.topic, b"", keeps=True), waiting)
        self._wake.set()

    def _command(self, heard: Heard, came: Incoming) -> None:
        if self._commander is None or (heard.kept and not heard.payload):
            # An empty one only ends what the broker kept.
            return
        try:
            command = self._commands.read(heard, self._wall(), self._clock())
        except NotTaken as error:
            self._answer(heard, came, error.id, Answer("not sent", str(error)))
            self._commander.not_taken(heard.drive, f"{checks.shown(heard.order[:_LONGEST])}: {error}")
            return
        self._commander.give(command, lambda answer: self._answer(heard, came, command.id, answer))

    def _answer(self, heard: Heard, came: Incoming, named: str, answer: Answer) -> None:
        told = {
            "id": named,
            "drive": heard.drive[:_LONGEST],
            "order": heard.order[:_LONGEST],
            "result": answer.result,
            "text": answer.text[:_LONGEST],
            "time": moment(self._wall()),
        }
        here = self._topics.of(heard.drive if heard.drive in self._known else "", "result")
        self._say(Message(here, packed(told)))
        if came.answer_to and self._may_answer(came.answer_to):
            self._say(Message(came.answer_to, packed(told), to=came.known_by))

    def _say(self, message: Message, waiting: deque[Message] | None = None) -> None:
        waiting = self._waiting if waiting is None else waiting
        if len(waiting) < _WAITING:
            waiting.append(message)
        self._wake.set()

    def _may_answer(self, topic: str) -> bool:
        """Whether an answer may go there: not where it would be taken for what this says, or orders somebody."""
        ours = (f"{self._topics.base}/", f"{self._settings.home_assistant or '$'}/")
        return not topic.startswith(ours) and not why_no_prefix(topic)


def _is_config(topic: str) -> bool:
    return topic.endswith("/config")


def _shown(drives: Sequence[MqttDrive], settings: MqttSettings) -> dict[str, Message]:
    """What Home Assistant is told, by topic."""
    if not settings.home_assistant:
        return {}
    topics: Topics = settings.topics
    return {
        topic: Message(topic, told, keeps=True)
        for drive in drives
        for topic, told in home_assistant.configs(drive, topics, settings.home_assistant).items()
    }


def _paho() -> ModuleType:
    """What needs paho-mqtt."""
    return module_for("MQTT", "mqtt_link")
