"""What a host of Sparkplug knows is right at every moment, whatever drives do and however often a session begins."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("google.protobuf")

from drivebus.sinks import DrivePicture, LinePicture, Picture
from drivebus.sinks.sparkplug_node import Node
from drivebus.spool import Layout, Spooled

from .sparkplug_host import Host

LAYOUTS = {
    (drive, poll): Layout(drive, "gd350", names, ("Hz", "")[: len(names)], (2, 0)[: len(names)])
    for drive in ("pump", "fan")
    for poll, names in ((1, ("running_frequency", "status_word_1")), (2, ("output_current",)))
}


@dataclass
class Story:
    """A plant, its spool, and sessions of a node over it. Time goes on by a second with each thing that happens."""

    now: float = 1_000.0
    samples: list[Spooled] = field(default_factory=list)
    last: dict[tuple[str, int], DrivePicture] = field(default_factory=dict)
    host: Host = field(default_factory=Host)
    bd_seq: int = 0
    delivered: set[int] = field(default_factory=set)
    head: int = 0

    def __post_init__(self) -> None:
        self.node = Node("plant", "hall", lambda: self.now)

    def measure(self, drive: str, poll: int, number: int | None) -> None:
        """A drive is asked, and gives a number, or nothing."""
        self.now += 1.0
        layout = LAYOUTS[drive, poll]
        missing = "no answer" if number is None else ""
        values = () if number is None else (number / 100, number)[: len(layout.names)]
        self.last[drive, poll] = DrivePicture(poll, layout, self.now, missing, values)
        self.samples.append(Spooled(len(self.samples) + 1, "e", layout, self.now, 0.01, missing, values))

    def happens(self) -> None:
        self.now += 1.0
        layout = Layout.of_events("pump", "fault")
        self.samples.append(Spooled(len(self.samples) + 1, "e", layout, self.now, 0.0, f"fault at {self.now}", ()))

    def begins(self, lag: int = 0) -> None:
        """A session: what was delivered before stays delivered. The last *lag* samples are not spooled yet."""
        self.now += 1.0
        self.bd_seq += 1
        will = self.node.death(self.bd_seq)
        self.host.takes(*will)
        self.born(lag)

    def born(self, lag: int = 0) -> None:
        self.head = max(self.head, len(self.samples) - lag)
        picture = Picture(self.now, (LinePicture("line", True, {}, tuple(self.last.values())),))
        self.takes(self.node.birth(picture, self.head))

    def delivers(self, is_present: bool, count: int) -> None:
        """One lane: the present from the head on, or what had to wait, the oldest first."""
        waiting = [each for each in self.samples if each.seq not in self.delivered]
        some = [each for each in waiting if (each.seq > self.head) == is_present][:count]
        self.takes(self.node.data(some))
        self.delivered |= {each.seq for each in some}
        if is_present and some:
            self.head = max(self.head, some[-1].seq)

    def takes(self, messages: object) -> None:
        for message in messages:  # type: ignore[attr-defined]
            self.host.takes(*message)


STEPS = st.lists(
    st.one_of(
        st.tuples(
            st.just("measure"),
            st.sampled_from(["pump", "fan"]),
            st.sampled_from([1, 2]),
            st.none() | st.integers(0, 5_000),
        ),
        st.tuples(st.just("happens")),
        st.tuples(st.just("begins"), st.integers(0, 3)),
        st.tuples(st.just("born"), st.integers(0, 3)),
        st.tuples(st.just("delivers"), st.booleans(), st.integers(1, 5)),
    ),
    max_size=60,
)


@given(STEPS)
def test_a_host_is_right_at_every_moment(steps: list[tuple[object, ...]]) -> None:
    story = Story()
    story.begins()
    for what, *more in steps:
        getattr(story, str(what))(*more)
    while len(story.delivered) < len(story.samples):
        story.delivers(True, 3)
        story.delivers(False, 3)
    host = story.host
    # Each sample is told: as it came, by a birth, or as the past.
    told = Counter(
        (device, at, name, value)
        for device, at, values in host.told + host.historical
        for name, value in values.items()
    )
    for sample in story.samples:
        at = int(sample.time * 1_000)
        for name, value in zip(sample.layout.names, sample.values, strict=False):
            assert told[sample.layout.drive, at, name, value], sample
        if sample.layout.event:
            assert told["", at, "event", f"pump: {sample.missing}"] == 1
    # What is present is what was measured last, and who gave nothing last is not there.
    for drive in ("pump", "fan"):
        of = [each for each in story.samples if each.layout.drive == drive and not each.layout.event]
        if of and of[-1].missing:
            assert drive not in host.values
        elif of:
            for name, value in zip(of[-1].layout.names, of[-1].values, strict=True):
                assert host.values[drive][name] == value
    # No value that is shown as present was measured before one that was shown.
    newest: dict[tuple[str, str], int] = {}
    for device, at, values in host.told:
        for name, value in values.items():
            if device and value is not None:
                assert at >= newest.get((device, name), 0)
                newest[device, name] = at


def test_numbers_begin_again_and_a_clock_that_was_set_back_stops_nothing() -> None:
    story = Story()
    story.begins()
    for number in range(700):
        if number == 300:
            story.now -= 86_400.0
        story.measure("pump", 1, number)
        story.delivers(True, 1)
    assert story.host.values["pump"]["status_word_1"] == 699
    assert not story.host.historical


def test_an_old_death_ends_no_new_session() -> None:
    story = Story()
    story.begins()
    story.measure("pump", 1, 1)
    story.delivers(True, 1)
    old = story.node.death(story.bd_seq)
    story.begins()
    story.host.takes(*old)
    assert story.host.values["pump"]


def test_what_a_birth_has_told_already_is_not_told_as_new() -> None:
    """The plant is known sooner than the spool has it."""
    story = Story()
    for number in (1, 2, 3):
        story.measure("pump", 1, number)
    story.begins(lag=2)
    assert story.host.values["pump"]["status_word_1"] == 3
    story.delivers(True, 2)
    assert story.host.values["pump"]["status_word_1"] == 3
    assert [at for _, at, _ in story.host.historical] == [1_002_000, 1_003_000]
    story.measure("pump", 1, 4)
    story.delivers(True, 1)
    assert story.host.values["pump"]["status_word_1"] == 4
