"""Recordings: one table in every format, read by us and by others, whatever happens to line, disk or program."""

from __future__ import annotations

import csv
import itertools
import json
import re
import resource
import signal
import sqlite3
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import drivebus
from drivebus import NotAllowed, Recorder, Simulator
from drivebus.capture import read as captured
from drivebus.cli import cli
from drivebus.record import read

FORMATS = ["csv", "jsonl", "sqlite", "parquet"]
NAMES = ["output_current", "bus_voltage", "running_frequency"]


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "gd350"}, clock="virtual", transport="process") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[drivebus.Bus]:
    with drivebus.Bus(simulator) as bus:
        yield bus


def by_pandas(path: Path) -> int:
    import pandas

    readers: dict[str, Callable[[Path], Any]] = {
        "csv": pandas.read_csv,
        "jsonl": lambda path: pandas.read_json(path, lines=True),
        "parquet": pandas.read_parquet,
    }
    if path.suffix == ".sqlite":
        base = sqlite3.connect(path)
        try:
            return len(pandas.read_sql("SELECT * FROM record", base))
        finally:
            base.close()
    return len(readers[path.suffix[1:]](path))


def by_polars(path: Path) -> int:
    import polars

    readers: dict[str, Callable[[Path], Any]] = {
        "csv": polars.read_csv,
        "jsonl": polars.read_ndjson,
        "parquet": polars.read_parquet,
    }
    return len(readers[path.suffix[1:]](path))


def by_duckdb(path: Path) -> int:
    import duckdb

    [(count,)] = duckdb.connect().execute(f"SELECT count(*) FROM '{path}'").fetchall()
    return int(count)


@pytest.mark.parametrize("ending", FORMATS)
def test_every_format_has_the_same_table(ending: str, bus: drivebus.Bus, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    first, second = bus.drive(1), bus.drive(2)
    first.prepare_control()
    with Recorder(path, {first: NAMES, second: NAMES[:1]}, interval=0.1, labels={first: "pump"}) as recorder:
        first.run(10.0)
        began, at_most = bus.now(), 3.0
        recorder.wait(at_most)
        first.stop()
        took = bus.now() - began
    found = read(path)
    assert found.complete
    assert found.drives == ["pump", "unit 2"]
    assert [drive["profile"] for drive in found.about["drives"]] == ["gd350", "gd350"]
    assert found.units("pump")["output_current [A]"] == "A"
    assert [event.kind for event in found.events] == ["recording", *["about"][: ending == "csv"], "end"]
    times = found.times["pump"]
    # Commands and their confirmation let the line's time pass too: a start of a cycle may be missed, none made up for.
    assert 20 <= len(times) <= took / 0.1 + 20
    assert all(round((after - before) / 0.1, 2) >= 0.5 for before, after in itertools.pairwise(times))
    shown = found.values["pump"]["running_frequency [Hz]"]
    assert shown[0] < max(shown) == pytest.approx(10.0, abs=0.1)
    assert set(found.states["pump"]) >= {"forward"}
    assert set(found.states["unit 2"]) == {"stopped"}
    assert set(found.values["unit 2"]) == {"output_current [A]"}
    assert (recorder.rows, recorder.gaps, recorder.lost) == (len(times) + len(found.times["unit 2"]), 0, 0)


def test_values_are_those_of_the_samples(bus: drivebus.Bus, tmp_path: Path) -> None:
    """Every format against the poll itself, which two of its kind see at the same moments of a virtual line."""
    drive = bus.drive(1)
    recorded: dict[str, list[Any]] = {}
    for ending in FORMATS:
        path = tmp_path / f"run.{ending}"
        with Recorder(path, {drive: NAMES}, interval=0.5, state=False) as recorder:
            recorder.wait(3.0)
        found = read(path)
        recorded[ending] = list(found.values["unit 1"].values())
    asked = drive.read(*NAMES)
    assert isinstance(asked, dict)
    for columns in recorded.values():
        assert [set(column) for column in columns] == [{asked[name]} for name in NAMES]


OTHERS = [(reader, ending) for reader in (by_pandas, by_polars, by_duckdb) for ending in FORMATS]


# Of SQLite, polars and DuckDB take only what they can download a part for.
@pytest.mark.parametrize(("reader", "ending"), [each for each in OTHERS if each[0] is by_pandas or each[1] != "sqlite"])
def test_others_read_it(ending: str, reader: Callable[[Path], int], bus: drivebus.Bus, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    with Recorder(path, {bus.drive(1): None}, interval=0.1) as recorder:
        recorder.wait(1.0)
    assert reader(path) == recorder.rows + 2 + (ending == "csv")


def test_gaps_and_faults_are_rows_of_their_own(simulator: Simulator, bus: drivebus.Bus, tmp_path: Path) -> None:
    drive = bus.drive(1)
    drive.prepare_control()
    with Recorder(tmp_path / "run.csv", {drive: NAMES}, interval=0.1) as recorder:
        drive.run(10.0)
        recorder.wait(1.0)
        simulator.line.drop_answers(3)
        recorder.wait(3.0)
        simulator.drive(1).trip("OL1")
        recorder.wait(1.0)
        drive.reset_fault()
        recorder.wait(1.0)
    found = read(tmp_path / "run.csv")
    # Commands and time-outs let beats pass, which have rows of their own.
    events = [event for event in found.events if event.kind != "late"]
    assert [event.kind for event in events] == ["recording", "gap", "back", "fault", "fault cleared", "about", "end"]
    gap, back, fault = events[1:4]
    assert "no answer" in gap.text
    assert f"{recorder.missing} samples were missing" in back.text
    assert recorder.missing
    assert recorder.gaps == 1
    assert fault.text.startswith("OL1 (11)")
    assert not [time for time in found.times["unit 1"] if gap.time <= time < back.time]


@pytest.mark.parametrize("ending", FORMATS)
def test_samples_that_a_busy_line_leaves_out_are_counted_and_marked(
    ending: str, bus: drivebus.Bus, tmp_path: Path
) -> None:
    """Somebody else keeps the line for 0.7 s, three times: the samples due meanwhile are not taken."""
    path = tmp_path / f"run.{ending}"
    first, second = bus.drive(1), bus.drive(2)
    with Recorder(path, {first: NAMES, second: NAMES}, interval=0.1) as recorder:
        for _ in range(3):
            recorder.wait(1.0)
            kept = bus.now() + 0.7
            while bus.now() < kept:
                second.read("output_current")
        recorder.wait(1.0)
    found = read(path)
    times = found.times["unit 1"]
    due = round((times[-1] - times[0]) / 0.1) + 1
    marks = [event for event in found.events if (event.kind, event.drive) == ("late", "unit 1")]
    assert len(marks) == 3
    for mark in marks:
        before = max(time for time in times if time < mark.time)
        assert mark.time in times, "the mark stands at the sample that came after"
        assert f"samples were due in the {mark.time - before:.3f} s before, and not taken" in mark.text
    left_out = [int(mark.text.split()[0]) for mark in marks]
    assert all(6 <= count <= 7 for count in left_out)
    assert len(times) + sum(left_out) == due
    assert (recorder.late, recorder.missing, recorder.gaps) == (2 * sum(left_out), 0, 0)
    assert found.events[-1].text == f"{recorder.rows} rows, 0 samples missing, {recorder.late} too late"


def test_a_summary_tells_what_was_asked_for_and_what_came(tmp_path: Path) -> None:
    """A dead drive on the line: each time-out takes samples from the other one."""
    path = tmp_path / "run.csv"
    words = ["--port", "sim://gd350?clock=virtual", "--unit", "1,9", "--profile", "gd350", "record", str(path)]
    done = CliRunner().invoke(cli, [*words, "output_current", "--interval", "0.1", "--for", "5"], prog_name="drivebus")
    assert done.exit_code == 0, done.output
    found = read(path)
    rows, late = len(found.times["unit 1"]), sum(event.kind == "late" for event in found.events)
    assert late
    told = " ".join(done.stderr.split())
    assert f"samples asked for, {rows} taken, " in told
    assert "came too late, the line was busy. A longer --interval" in told
    asked, missing, too_late = map(int, re.findall(r"(\d+) (?:samples asked|without|came)", told))
    assert asked == rows + missing + too_late
    seldom = ["--json", *words, "--force", "--interval", "2", "--for", "5"]
    assert "no gap" not in done.stdout
    assert json.loads(CliRunner().invoke(cli, seldom, prog_name="drivebus").stdout)["late"] == 0


@pytest.mark.parametrize("ending", FORMATS)
def test_a_recording_goes_on_in_the_next_file(ending: str, bus: drivebus.Bus, tmp_path: Path) -> None:
    drive = bus.drive(1)
    with Recorder(tmp_path / f"run.{ending}", {drive: NAMES}, interval=0.1, rotate_bytes=5000) as recorder:
        for _ in range(30):
            recorder.wait(0.5)
    assert [path.name for path in recorder.files][:2] == [f"run.{ending}", f"run-2.{ending}"]
    times: list[float] = []
    for path in recorder.files:
        one = read(path)
        assert one.complete
        assert one.about
        times += one.times.get("unit 1", [])
    assert times == read(*recorder.files).times["unit 1"] == sorted(times)
    assert len(times) == recorder.rows


@pytest.mark.parametrize("ending", FORMATS)
def test_a_full_disk_is_told_and_survived(ending: str, bus: drivebus.Bus, tmp_path: Path) -> None:
    """The system itself refuses to make the file any longer, and later does not."""
    drive = bus.drive(1)
    path = tmp_path / f"run.{ending}"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    with Recorder(path, {drive: None}, interval=0.1) as recorder:
        recorder.wait(1.0)
        assert recorder.problem == ""
        whole = recorder.rows
        resource.setrlimit(resource.RLIMIT_FSIZE, (recorder.size + 100, before[1]))
        try:
            with pytest.warns(drivebus.DrivebusWarning, match="cannot be written now"):
                recorder.wait(3.0)
            assert recorder.problem
            assert recorder.rows == whole
            assert len(read(path).times["unit 1"]) == whole, "a row is there in part"
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    found = read(path)
    assert found.complete
    assert len(found.times["unit 1"]) == recorder.rows > whole
    assert recorder.lost == 0


@pytest.mark.parametrize("ending", FORMATS)
def test_a_kill_costs_a_second_at_most(ending: str, tmp_path: Path) -> None:
    """Beside the recording, every frame is written to a capture at once: that has what the program had seen."""
    path, wire = tmp_path / f"run.{ending}", tmp_path / "wire.pcapng"
    words = ["--port", "sim://gd350", "--capture", str(wire), "record", str(path), *NAMES]
    with subprocess.Popen(
        [sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as it:
        assert it.stderr is not None
        while not wire.exists() or wire.stat().st_size < 20_000:
            assert it.poll() is None
        it.kill()
    answers = [frame.time or 0.0 for frame in captured(wire) if frame.asks is False]
    found = read(path)
    assert not found.complete
    assert found.times["unit 1"][-1] >= answers[-1] - 1.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_the_file_properly(number: int, tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    words = ["--port", "sim://gd350", "--json", "record", str(path), "output_current"]
    with subprocess.Popen([sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, text=True) as it:
        while not path.exists() or path.stat().st_size < 3000:
            assert it.poll() is None
        it.send_signal(number)
        assert it.stdout is not None
        told = json.loads(it.stdout.read())
    assert it.returncode == 0
    assert read(path).complete
    assert told["rows"] == len(read(path).times["unit 1"])


def test_what_was_cut_off_is_left_out(bus: drivebus.Bus, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with Recorder(path, {bus.drive(1): NAMES}, interval=0.1) as recorder:
        recorder.wait(1.0)
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    found = read(path)
    assert not found.complete
    assert len(found.times["unit 1"]) == recorder.rows


def test_numbers_have_the_digits_of_the_drive(bus: drivebus.Bus, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with Recorder(path, {bus.drive(1): ["running_frequency", "status_word_1"]}, interval=0.1) as recorder:
        recorder.wait(0.5)
    with path.open(newline="") as text:
        rows = list(csv.DictReader(text))
    assert (rows[1]["running_frequency [Hz]"], rows[1]["status_word_1"], rows[1]["state"]) == (
        "0.00",
        "stopped",
        "stopped",
    )


def test_bad_input_leaves_nothing_behind(bus: drivebus.Bus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = bus.drive(1)
    there = tmp_path / "there.csv"
    there.write_text("mine")
    for path, options, words in [
        (tmp_path / "run.txt", {}, r"does not say which format.*\.csv, \.jsonl, \.parquet"),
        (there, {}, "is there already"),
        (tmp_path / "nowhere" / "run.csv", {}, "cannot be written: No such file"),
        (tmp_path / "run.csv", {"rotate_bytes": 0}, "rotate_bytes"),
        (tmp_path / "run.csv", {"interval": 1e-9}, "interval"),
    ]:
        with pytest.raises(NotAllowed, match=words):
            Recorder(path, {drive: None}, **options)  # type: ignore[arg-type]
    for drives in ({}, None, {1: None}):
        with pytest.raises(NotAllowed, match="drives is"):
            Recorder(tmp_path / "run.csv", drives)  # type: ignore[arg-type]
    monkeypatch.delitem(sys.modules, "drivebus.record.parquet", raising=False)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(NotAllowed, match=r"pip install 'drivebus\[parquet\]'"):
        Recorder(tmp_path / "run.parquet", {drive: None})
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]
    assert there.read_text() == "mine"


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "\x00\x01", '{"a": 1}\n', "PAR1"])
@pytest.mark.parametrize("ending", FORMATS)
def test_a_file_that_is_no_recording(ending: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    path.write_text(text)
    with pytest.raises(NotAllowed, match="recording"):
        read(path)
    with pytest.raises(NotAllowed, match=r"nowhere\.\w+ cannot be read: there is no such file"):
        read(tmp_path / f"nowhere.{ending}")


def test_nobody_answers(tmp_path: Path) -> None:
    words = ["--port", "sim://gd350?clock=virtual", "--unit", "9", "--profile", "gd350", "record"]
    done = CliRunner().invoke(cli, [*words, str(tmp_path / "run.csv"), "--for", "3"], prog_name="drivebus")
    assert done.exit_code == 3, done.output
    assert "no drive answered" in done.stderr
    assert [event.kind for event in read(tmp_path / "run.csv").events] == ["recording", "gap", "about", "end"]


def test_two_drives_of_one_name_are_refused(bus: drivebus.Bus, tmp_path: Path) -> None:
    first, second = bus.drive(1), bus.drive(2)
    with pytest.raises(NotAllowed, match="called"):
        Recorder(tmp_path / "run.csv", {first: None, second: None}, labels={first: "a", second: "a"})
    assert not [*tmp_path.iterdir()]


def test_no_gap_is_said_only_if_no_sample_was_too_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["--port", "sim://gd350?clock=virtual", "record", "output_current", "--interval", "0.1", "--for", "2"]
    path = str(tmp_path / "whole.csv")
    done = CliRunner().invoke(cli, [*words[:3], path, *words[3:]], prog_name="drivebus")
    assert (done.exit_code, ", no gap." in done.stdout) == (0, True), done.output
    monkeypatch.setattr(Recorder, "late", 3)
    path = str(tmp_path / "late.csv")
    done = CliRunner().invoke(cli, [*words[:3], path, *words[3:]], prog_name="drivebus")
    assert (done.exit_code, "no gap" in done.stdout) == (0, False), done.output
    assert "3 came too late" in " ".join(done.stderr.split())


def test_what_was_due_in_virtual_time_and_never_ran_is_told(tmp_path: Path) -> None:
    """Time moves there by other calls, and nobody waits for the recorder."""
    path = tmp_path / "run.csv"
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        recorder = drivebus.Recorder(path, {bus.drive(1): ["output_current"]}, interval=0.1)
        assert bus.simulator is not None
        bus.simulator.advance(1.05)
        with pytest.warns(
            drivebus.DrivebusWarning, match="only while somebody waits: 11 cycles were due and never run"
        ):
            recorder.close()
        assert "0 rows, 0 samples missing, 0 too late, 11 cycles were due and never run" in path.read_text()


def test_what_was_due_after_the_last_wait_stands_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        recorder = drivebus.Recorder(path, {bus.drive(1): ["output_current"]}, interval=0.1)
        recorder.wait(1.0)
        assert bus.simulator is not None
        bus.simulator.advance(0.35)
        recorder.close()
        assert recorder.rows > 0
        assert ", 3 cycles were due and never run" in path.read_text()


def test_a_poll_in_virtual_time_that_never_ran_says_so() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        wanted = {bus.drive(1): ["output_current"]}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            bus.poll(wanted, 0.1).close()
            with bus.poll(wanted, 0.1) as poll:
                poll.batch(3)
                bus.read(1, 0x2100)
        poll = bus.poll(wanted)
        bus.read(1, 0x2100)
        with pytest.warns(drivebus.DrivebusWarning, match="its cycles were due and never run; call `wait`"):
            poll.close()
        poll.close()


def test_a_csv_file_begins_with_words(bus: drivebus.Bus, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with Recorder(path, {bus.drive(1): NAMES[:1]}, interval=0.5, labels={bus.drive(1): "pump"}) as recorder:
        recorder.wait(1.0)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert rows[0]["text"] == f"drivebus {drivebus.__version__}, every 0.5 s: pump (gd350)"
    assert [row["event"] for row in rows[-2:]] == ["about", "end"]
    assert not any(row["text"] for row in rows[1:-2])
