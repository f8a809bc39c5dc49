"""Cyclic polling: samples as an iterator, in batches, by a callback, as arrays; what ends it, and what it survives.

In virtual time where figures matter. On a pseudo-terminal everything waits for what it is about, as long as it takes.
"""

from __future__ import annotations

import itertools
import math
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import drivebus
from drivebus import Bus, Choice, Drive, NoAnswer, NotAllowed, PortError, Refused, Sample, Simulator

needs_pty = pytest.mark.skipif(os.name == "nt", reason="no pty")

RESPONSE_DELAY = 0x0E03  # P14.03
CHARACTER = 11 / 19_200  # seconds, at 19200 8E1
READ = 8 + 3.5 + 5 + 3.5  # characters that a read takes beside two for each word


@pytest.fixture
def still(virtual: Simulator) -> Iterator[Bus]:
    """A line in virtual time whose drives answer as soon as they may; opened long enough ago to be trusted."""
    with Bus(virtual) as bus:
        bus.sleep(1.5)
        for unit in (1, 2):
            bus.write(unit, RESPONSE_DELAY, 0)
        yield bus


@pytest.fixture
def pair(still: Bus) -> tuple[Drive, Drive]:
    return still.drive(1), still.drive(2)


@pytest.fixture
def live() -> Iterator[tuple[Simulator, Bus]]:
    with Simulator({1: "gd350", 2: "gd350"}) as simulator, Bus(simulator, timeout=0.25) as bus:
        yield simulator, bus


class TestSamples:
    def test_each_drive_in_turn_with_its_values_and_times(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        first, second = pair
        with still.poll({first: ["status_word_1", "output_current"], second: None}) as poll:
            samples = [sample for sample, _ in zip(poll, range(4), strict=False)]
        assert [sample.unit for sample in samples] == [1, 2, 1, 2]
        assert [sample.drive for sample in samples] == [first, second] * 2
        assert dict(samples[0]) == {"status_word_1": 3, "output_current": 0.0}
        assert isinstance(samples[0]["status_word_1"], Choice)
        assert (samples[0].key, samples[0].output_current, samples[1].bus_voltage) == (
            first,
            0.0,
            samples[1]["bus_voltage"],
        )
        assert {"output_current", "time"} <= set(dir(samples[0]))
        with pytest.raises(AttributeError, match='does not hold "bus_voltage", only status_word_1, output_c'):
            samples[0].bus_voltage  # noqa: B018
        assert list(samples[1]) == second.profile.monitor_names()
        assert dict(samples[1]) == dict(second.monitor())
        assert all(sample and sample.missing is None for sample in samples)
        assert samples == sorted(samples, key=lambda sample: sample.time)
        # Two reads of one word each, without the silence before the first and the last.
        took = (2 * (READ + 2) - 3.5) * CHARACTER
        assert samples[0].answered - samples[0].time == pytest.approx(took, abs=2e-6)

    def test_as_fast_as_the_wire(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        first, second = pair
        with still.poll({first: "output_current", second: "bus_voltage"}) as poll:
            times = [sample.time for sample in poll.batch(20) if sample.drive is first]
            cycle = 2 * (READ + 2) * CHARACTER
            assert poll.shortest == pytest.approx(cycle, abs=1e-6)
            assert poll.batch(1)[0].drive is first
        steps = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert steps == pytest.approx([cycle] * 9, abs=2e-6)

    def test_at_a_rate(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        still.sleep(0.1)  # or the first beat waits for the silence after what was asked before
        with still.poll({pair[0]: None}, interval=0.1) as poll:
            times = [sample.time for sample in poll.batch(50)]
        assert [time - times[0] for time in times] == pytest.approx([0.1 * beat for beat in range(50)], abs=2e-6)

    def test_a_unit_without_a_profile_by_its_addresses(self, still: Bus) -> None:
        with still.poll({2: [(0x2100, 2), (0x2103, 1)]}) as poll:
            [sample] = poll.batch(1)
        assert (sample.unit, sample.key, sample.drive) == (2, 2, None)
        with pytest.raises(AttributeError, match='does not hold "output_current", only 8448, 8449, 8451'):
            sample.output_current  # noqa: B018
        assert (sample[0x2100], sample[0x2103]) == (3, 0x01A0)
        assert list(sample) == [0x2100, 0x2101, 0x2103]

    def test_a_dead_unit_is_missing_and_the_others_are_not(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({pair[0]: None, 9: [(0x2100, 1)]}, interval=0.2) as poll:
            samples = poll.batch(60)
        assert {sample.unit for sample in samples if sample.missing} == {9}
        missing = [sample for sample in samples if sample.unit == 9]
        assert all(isinstance(sample.missing, NoAnswer) and not sample for sample in missing)
        assert poll.missing == len(missing) == 30
        with pytest.raises(KeyError, match="this sample is missing: unit 9, read 2100H: no answer within 500 ms"):
            missing[0][0x2100]
        with pytest.raises(AttributeError, match="sample is missing, and has no output_current: unit 9, read 2100H"):
            missing[0].output_current  # noqa: B018
        assert missing[0].get(0x2100) is None

    def test_a_refusal_says_what_the_family_means_by_it(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({1: [(0x6300, 1)], pair[1]: None}) as poll:
            refused, other = poll.batch(2)
        assert isinstance(refused.missing, Refused)
        assert refused.missing.code == 2
        assert other

    def test_what_nobody_takes_gives_way(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({pair[0]: "output_current"}, interval=0.1, size=3) as poll:
            assert not poll.wait(0.95)
            assert (poll.cycles, poll.dropped, poll.late, poll.missing) == (10, 7, 0, 0)
            times = [sample.time for sample in poll.take()]
            assert len(poll.take()) == 0
        assert times[-1] - times[0] == pytest.approx(0.2, abs=2e-6)

    def test_a_batch_ends_with_its_time(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({pair[0]: None}, interval=1.0) as poll:
            assert len(poll.batch(5, timeout=2.5)) == 3
            before = still.now()
            assert len(poll.batch(timeout=0.1)) == 0
            assert still.now() - before == pytest.approx(0.1)

    def test_who_leaves_the_loop_leaves_the_rest(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({pair[0]: None, pair[1]: None}) as poll:
            poll.wait(1.0)
            first, second = next(iter(poll)), next(iter(poll))
        assert (first.unit, second.unit) == (1, 2)


class TestArrays:
    def test_one_structured_array_for_each_drive(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        numpy = pytest.importorskip("numpy")
        drive, _ = pair
        with still.poll({drive: ["bus_voltage", "status_word_1"], 9: [(0x2100, 2)]}, interval=0.2) as poll:
            batch = poll.batch(8)
        arrays = batch.to_numpy()
        assert list(arrays) == [drive, 9]
        assert arrays[drive].dtype.names == ("time", "answered", "bus_voltage", "status_word_1")
        assert arrays[9].dtype.names == ("time", "answered", "0x2100", "0x2101")
        assert {kind.str[1:] for kind, *_ in (arrays[drive].dtype.fields or {}).values()} == {"f8"}
        samples = [sample for sample in batch if sample.drive is drive]
        for name in ("bus_voltage", "status_word_1"):
            assert arrays[drive][name].tolist() == [sample[name] for sample in samples]
        assert arrays[drive]["time"].tolist() == [sample.time for sample in samples]
        assert arrays[drive]["answered"].tolist() == [sample.answered for sample in samples]
        assert numpy.isnan(arrays[9]["0x2100"]).tolist() == [True] * 4
        assert not numpy.isnan(arrays[9]["time"]).any()
        arrays[drive]["bus_voltage"] *= 2  # they are the caller's own

    def test_none_from_nothing(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        pytest.importorskip("numpy")
        with still.poll({pair[0]: None}) as poll:
            assert poll.take().to_numpy()[pair[0]].shape == (0,)

    def test_without_numpy_it_says_what_to_install(
        self, still: Bus, pair: tuple[Drive, Drive], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "numpy", None)
        with still.poll({pair[0]: None}) as poll, pytest.raises(ImportError, match=r"drivebus\[numpy\]"):
            poll.batch(1).to_numpy()


class TestFrames:
    def test_one_frame_for_each_drive_with_its_units(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        pandas = pytest.importorskip("pandas")
        drive, _ = pair
        with still.poll({drive: ["output_current", "status_word_1"], 9: [(0x2100, 2)]}, interval=0.2) as poll:
            batch = poll.batch(8)
        frames = batch.to_pandas()
        assert list(frames) == [drive, 9]
        assert list(frames[drive].columns) == ["output_current", "status_word_1"]
        assert list(frames[9].columns) == ["0x2100", "0x2101"]
        assert (frames[drive].attrs, frames[9].attrs) == ({"units": {"output_current": "A"}}, {"units": {}})
        samples = [sample for sample in batch if sample.drive is drive]
        for name in ("output_current", "status_word_1"):
            assert frames[drive][name].tolist() == [sample[name] for sample in samples]
        index = frames[drive].index
        assert (str(index.tz), index.name, index.is_monotonic_increasing) == ("UTC", "time", True)
        assert [moment.timestamp() for moment in index] == pytest.approx([sample.time for sample in samples], abs=1e-6)
        assert frames[9].isna().all().all()
        assert not pandas.isna(frames[9].index).any()

    def test_none_from_nothing(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        pytest.importorskip("pandas")
        with still.poll({pair[0]: None}) as poll:
            frame = poll.take().to_pandas()[pair[0]]
        assert (len(frame), str(frame.index.tz)) == (0, "UTC")
        assert "output_current" in frame.columns

    def test_without_pandas_it_says_what_to_install(
        self, still: Bus, pair: tuple[Drive, Drive], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "pandas", None)
        with still.poll({pair[0]: None}) as poll, pytest.raises(ImportError, match=r"pip install 'drivebus\[pandas\]'"):
            poll.batch(1).to_pandas()

    def test_polars_has_the_same_numbers(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        pytest.importorskip("polars")
        pytest.importorskip("pandas")
        drive, _ = pair
        with still.poll({drive: ["output_current", "status_word_1"], 9: [(0x2100, 2)]}, interval=0.2) as poll:
            batch = poll.batch(8)
        for key, frame in batch.to_pandas().items():
            found = batch.to_polars()[key]
            assert found.columns == ["time", *frame.columns]
            # pandas keeps nanoseconds, and polars is asked for microseconds.
            moments = [moment.timestamp() for moment in frame.index]
            assert [each.timestamp() for each in found["time"]] == pytest.approx(moments, abs=2e-6)
            for name in frame.columns:
                assert found[name].to_list() == [None if value != value else value for value in frame[name]]

    def test_without_polars_it_says_what_to_install(
        self, still: Bus, pair: tuple[Drive, Drive], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "polars", None)
        with still.poll({pair[0]: None}) as poll, pytest.raises(ImportError, match=r"pip install 'drivebus\[polars\]'"):
            poll.batch(1).to_polars()

    def test_a_sample_is_a_table_in_a_notebook(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        with still.poll({pair[0]: ["output_current"]}) as poll:
            [sample] = poll.batch(1)
        shown = f"<table><tr><th>output_current</th><td>{sample['output_current']}</td></tr></table>"
        assert sample._repr_html_() == shown


class TestCallback:
    def test_in_virtual_time_it_is_called_by_whoever_waits(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        seen: list[Sample] = []
        with still.poll({pair[0]: None}, interval=0.1, callback=seen.append) as poll:
            assert not seen
            assert not poll.wait(0.95)
            assert len(seen) == 10
            with pytest.raises(NotAllowed, match="callback"):
                next(iter(poll))
            with pytest.raises(NotAllowed, match="callback"):
                poll.batch()

    @needs_pty
    def test_on_a_real_line_it_is_called_by_a_thread(self, live: tuple[Simulator, Bus]) -> None:
        threads: list[threading.Thread] = []
        enough = threading.Event()

        def note(_: Sample) -> None:
            threads.append(threading.current_thread())
            if len(threads) == 5:
                enough.set()

        with live[1].poll({1: [(0x2100, 1)]}, callback=note):
            assert enough.wait(60)
        assert len(set(threads)) == 1
        assert threads[0] is not threading.main_thread()
        assert not threads[0].is_alive()

    @pytest.mark.parametrize("clock", ["virtual", pytest.param("real", marks=needs_pty)])
    def test_what_it_raises_ends_the_poll_and_is_raised(self, clock: str, request: pytest.FixtureRequest) -> None:
        bus = request.getfixturevalue("still") if clock == "virtual" else request.getfixturevalue("live")[1]

        def fail(_: Sample) -> None:
            raise ZeroDivisionError("in the callback")

        poll = bus.poll({1: [(0x2100, 1)]}, callback=fail)
        with pytest.raises(ZeroDivisionError, match="in the callback"):
            poll.wait(60)
        assert poll.closed
        assert poll.wait(60), "it is raised once"

        def in_a_block() -> None:
            with bus.poll({1: [(0x2100, 1)]}, callback=fail) as poll:
                while not poll.closed:
                    poll._native.wait(1, 0.01)
                    if clock == "virtual":
                        poll._deliver()

        with pytest.raises(ZeroDivisionError):
            in_a_block()
        assert bus.read(1, 0x2100) == [3]

    @needs_pty
    def test_it_may_close_its_poll(self, live: tuple[Simulator, Bus]) -> None:
        polls: list[drivebus.Poll] = []
        begun = threading.Event()

        def close(_: Sample) -> None:
            begun.wait(60)
            polls[0].close()

        polls.append(live[1].poll({1: [(0x2100, 1)]}, callback=close))
        begun.set()
        assert polls[0].wait(60)


class TestEnd:
    @needs_pty
    def test_closing_from_another_thread_ends_who_waits(self, live: tuple[Simulator, Bus]) -> None:
        _, bus = live
        for close in (lambda poll: poll.close(), lambda _: bus.close()):
            poll = bus.poll({1: [(0x2100, 1)]}, interval=3600.0)
            seen: list[Sample] = []
            reader = threading.Thread(target=lambda poll=poll, seen=seen: seen.extend(poll))
            reader.start()
            while not poll.cycles:
                reader.join(0.001)
            close(poll)
            reader.join(60)
            assert not reader.is_alive()
            assert (len(seen), poll.closed) == (1, True)

    def test_what_is_there_can_still_be_taken(self, still: Bus, pair: tuple[Drive, Drive]) -> None:
        poll = still.poll({pair[0]: None})
        poll.wait(1.0)
        poll.close()
        poll.close()
        there = len(list(poll))
        assert there > 10
        assert len(poll.batch()) == 0
        still.close()
        with pytest.raises(PortError, match="closed"):
            still.poll({pair[0]: None})

    @needs_pty
    @pytest.mark.parametrize("wait", ["next(samples)", "poll.batch(2)", "poll.wait()"])
    def test_ctrl_c_ends_the_wait(self, wait: str) -> None:
        program = f"""
import os, signal, threading, drivebus
with drivebus.Simulator({{1: "gd350"}}) as simulator, drivebus.Bus(simulator) as bus:
    with bus.poll({{1: [(0x2100, 1)]}}, interval=3600) as poll:
        samples = iter(poll)
        assert next(samples)[0x2100] == 3
        try:
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
            {wait}
        except KeyboardInterrupt:
            print("interrupted", poll.closed)
    print(bus.read(1, 0x2103))
"""
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
        assert done.stdout.splitlines() == ["interrupted False", "[416]"], done.stderr

    @needs_pty
    def test_a_forked_child_leaves_the_poll_to_its_parent(self) -> None:
        program = """
import os, sys, warnings, drivebus
warnings.simplefilter("ignore", DeprecationWarning)  # CPython 3.12 warns of any fork beside threads
with drivebus.Simulator({1: "gd350"}) as simulator, drivebus.Bus(simulator) as bus:
    with bus.poll({1: [(0x2100, 1)]}) as poll:
        poll.batch(3)
        child = os.fork()
        if not child:
            try:
                poll.batch()
            except drivebus.PortError as error:
                print("forked child" in str(error), poll.closed, len(poll.take()), poll.cycles, flush=True)
            poll.close()
            sys.exit(0)
        print(os.waitpid(child, 0)[1], len(poll.batch(50)), poll.closed)
"""
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
        assert done.stdout.splitlines() == ["True True 0 0", "0 50 False"], done.stderr
        assert done.stderr == ""

    @needs_pty
    def test_a_program_that_closes_nothing_ends(self) -> None:
        program = """
import drivebus
bus = drivebus.Bus("sim://gd350")
polls = [bus.poll({1: [(0x2100, 1)]}), bus.poll({1: [(0x2100, 1)]}, callback=lambda sample: None)]
polls[0].batch(3)
print("done")
"""
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
        assert (done.stdout, done.stderr, done.returncode) == ("done\n", "", 0)


@needs_pty
class TestOnARealLine:
    def test_a_motor_is_run_and_stopped_meanwhile(self, live: tuple[Simulator, Bus]) -> None:
        simulator, bus = live
        drive, other = bus.drive(1), bus.drive(2)
        drive.prepare_control()
        with bus.poll({drive: None, other: None}) as poll:
            drive.run(10.0)
            drive.stop()
            assert any(poll.batch(10))
        assert [value for _, address, value in simulator.drive(1).writes() if address == 0x2000][-1] == 5

    def test_unplugged_and_back(self, tmp_path: Path) -> None:
        link = tmp_path / "drive"
        simulator = Simulator({1: "gd350", 2: "gd350"}, link=link)
        bus = Bus(str(link))
        with simulator, bus, bus.poll({1: [(0x2100, 1)], 2: [(0x2100, 1)]}) as poll:
            samples = iter(poll)
            next(sample for sample in samples if sample)
            simulator.line.unplug()
            next(sample for sample in samples if isinstance(sample.missing, PortError))
            simulator.line.replug()
            back: set[int] = set()
            for sample in samples:
                if sample:
                    back.add(sample.unit)
                    assert sample[0x2100] == 3
                if back == {1, 2} and bus.reconnects == 1:
                    break

    def test_two_polls_and_a_reader_share_the_line(self, live: tuple[Simulator, Bus]) -> None:
        _, bus = live
        with bus.poll({1: [(0x2100, 1)]}) as first, bus.poll({2: [(0x2103, 1)]}, interval=0.05) as second:
            for _ in range(5):
                assert bus.read(1, 0x2103) == [0x01A0]
            # On a busy machine an answer may come after the time-out that is learned.
            assert {sample[0x2100] for sample in first.batch(10) if sample} == {3}
            assert {sample[0x2103] for sample in second.batch(10) if sample} == {0x01A0}


class TestBadInput:
    @pytest.mark.parametrize(
        ("targets", "keywords", "message"),
        [
            ({}, {}, "nothing to poll"),
            (None, {}, "poll\\(\\) takes {drive: names"),
            ({"drive": ["output_curent"]}, {}, "output_current"),
            ({"drive": []}, {}, "nothing is asked of unit 1"),
            ({"drive": 5}, {}, "5 is not a list of names"),
            ({"drive": [["output_current"]]}, {}, "a name is a text"),
            ({"drive": None, 1: [(0x2100, 1)]}, {}, "unit 1 is there twice"),
            ({"foreign": None}, {}, "another bus"),
            ({0: [(0x2100, 1)]}, {}, "unit 0"),
            ({"nothing": None}, {}, "unit"),
            ({2: None}, {}, "unit 2 has no profile here"),
            ({2: [0x2100]}, {}, "unit 2 has no profile here"),
            ({2: [(0x2100, 126)]}, {}, "count 126 is out of range"),
            ({2: [(0xFFFF, 2)]}, {}, "FFFFH"),
            ({2: [(0x2100, 2), (0x2101, 1)]}, {}, "one address is asked for twice"),
            ({2: []}, {}, "nothing is asked of unit 2"),
            ({"drive": None}, {"interval": 0}, "interval 0 is out of range"),
            ({"drive": None}, {"interval": -1.0}, "interval -1.0 is out of range"),
            ({"drive": None}, {"interval": math.nan}, "interval nan is out of range"),
            ({"drive": None}, {"interval": "1"}, 'interval "1" is not a number'),
            ({"drive": None}, {"interval": 0.03}, "at 19200 8E1 one cycle of this poll .* at least 0.0492.. s"),
            ({"drive": None}, {"size": 0}, "size 0 is out of range"),
            ({"drive": None}, {"callback": 3}, "callback is 3, which cannot be called"),
        ],
    )
    def test_it_is_refused_before_anything_is_sent(
        self, targets: Any, keywords: dict[str, Any], message: str, still: Bus, virtual: Simulator
    ) -> None:
        drive = still.drive(1)
        with Bus("sim://gd350?clock=virtual") as elsewhere:
            known = {"drive": drive, "foreign": elsewhere.drive(1)}
            if targets:
                targets = {known.get(key, key): names for key, names in targets.items()}
            before = virtual.line.requests
            with pytest.raises(NotAllowed, match=message):
                still.poll(targets, **keywords)
        assert virtual.line.requests == before

    @pytest.mark.parametrize(("count", "timeout"), [(0, None), (11, None), (1, -1.0), (1.5, None), (1, "x")])
    def test_what_cannot_be_waited_for(self, count: Any, timeout: Any, still: Bus) -> None:
        with still.poll({1: [(0x2100, 1)]}, size=10) as poll, pytest.raises(NotAllowed):
            poll.batch(count, timeout)


@pytest.mark.parametrize("family", drivebus.profiles())
def test_no_register_is_called_as_what_a_sample_or_a_snapshot_has_beside_its_values(family: str) -> None:
    names = {name for kind in (drivebus.Sample, drivebus.Snapshot) for name in dir(kind)}
    assert names & set(drivebus.Profile.builtin(family).names()) == set()
