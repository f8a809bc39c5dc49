"""Samples and events of a spool on their way to a broker, each at least once: what it acknowledged is in.

A broker cannot be asked what it has. So this remembers it, and after a start the spool says how far it came.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from drivebus.errors import NotAllowed
from drivebus.sinks.intervals import Intervals
from drivebus.sinks.mqtt_messages import Message, batches, event, packed
from drivebus.sinks.mqtt_topics import Topics
from drivebus.sinks.reached import Reached
from drivebus.spool import Spool, Spooled

if TYPE_CHECKING:
    from drivebus.sinks.mqtt_link import Link

__all__ = ["SINK", "History"]

SINK = "mqtt"
"""The name under which the spool knows how far it came."""
_LARGEST = 100_000
"""Bytes of one message."""


class History:
    """A destination of a `Delivery`.

    Args:
        spool: Where samples wait.
        link: The way to the broker.
        topics: Where samples and events are told.
    """

    def __init__(self, spool: Spool, link: Link, topics: Topics) -> None:
        self.name = link.name
        self._link = link
        self._topics = topics
        self._reached = Reached(spool, SINK)

    def open(self) -> Mapping[str, Intervals]:
        """Waits for the connection, and tells what was delivered."""
        self._link.wait()
        return self._reached.open()

    def put(self, samples: Sequence[Spooled]) -> None:
        """Takes *samples*: when this returns, the broker has them."""
        self._link.put(list(self._messages(samples)))
        self._reached.take(samples)

    def check(self) -> None:
        """Raises why there is no connection."""
        if self._link.why:
            raise NotAllowed(self._link.why)

    def interrupt(self) -> None:
        """Whatever is waited for is over, from now on."""
        self._link.give_up()

    def close(self) -> None:
        """The connection is not this one's to end."""

    def _messages(self, samples: Sequence[Spooled]) -> Iterator[Message]:
        for is_event, some in groupby(samples, key=lambda sample: bool(sample.layout.event)):
            if is_event:
                yield from (Message(self._topics.event, packed(event(each))) for each in some)
            else:
                largest = min(_LARGEST, self._link.largest)
                yield from (Message(self._topics.history, each) for each in batches(list(some), largest))
