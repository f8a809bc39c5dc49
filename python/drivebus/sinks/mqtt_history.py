"""Samples and events of a spool on their way to a broker, each at least once: what it acknowledged is in.

A broker cannot be asked what it has. So this remembers it, and after a start the spool says how far it came.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from itertools import groupby
from typing import TYPE_CHECKING

from drivebus.sinks.intervals import Intervals, runs
from drivebus.sinks.mqtt_messages import Message, batches, event, packed
from drivebus.sinks.mqtt_topics import Topics
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
        self._spool = spool
        self._link = link
        self._topics = topics
        # A spool that lost its end gives numbers again, and these are not those that were delivered.
        self._newest = spool.last
        self._inside: dict[str, Intervals] | None = None

    def open(self) -> Mapping[str, Intervals]:
        """Waits for the connection, and tells what was delivered."""
        self._link.wait()
        if self._inside is None:
            with closing(self._spool.reader(SINK)) as reader:
                reached = min(reader.position(), self._newest)
                self._inside = {
                    each.epoch: Intervals([(each.first, min(each.last, reached))])
                    for each in reader.stretches()
                    if each.first <= reached
                }
        return self._inside

    def put(self, samples: Sequence[Spooled]) -> None:
        """Takes *samples*: when this returns, the broker has them."""
        assert self._inside is not None
        self._link.put(list(self._messages(samples)))
        for epoch, first, last in runs(samples):
            self._inside.setdefault(epoch, Intervals()).add(first, last)

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
