"""A recording whose file is removed, renamed or replaced while it is written: told at once, gone on with, counted."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import DrivebusWarning, Recorder, Simulator
from drivebus.capture.standing import Standing
from drivebus.record import read
from drivebus.record.series import Series
from drivebus.record.table import Table

pytestmark = pytest.mark.skipif(os.name == "nt", reason="an open file cannot be removed there")

FORMATS = ["csv", "jsonl", "sqlite", "parquet"]
NAMES = ["output_current", "bus_voltage"]


@pytest.fixture
def drive() -> Iterator[drivebus.Drive]:
    with (
        Simulator({1: "gd350"}, clock="virtual", transport="process") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        yield bus.drive(1)


def removed(path: Path) -> None:
    path.unlink()


def folder_removed(path: Path) -> None:
    shutil.rmtree(path.parent)


def renamed(path: Path) -> None:
    path.rename(path.with_name(f"{path.name}.1"))


def replaced(path: Path) -> None:
    other = path.with_name("other")
    other.write_text("somebody else's")
    other.replace(path)


WAYS: dict[Callable[[Path], None], tuple[str, str]] = {
    # what is said, and where it goes on
    removed: ("it was removed", "run"),
    folder_removed: ("its folder was removed", "run"),
    renamed: ("it was removed", "run"),
    replaced: ("another file stands there", "run-2"),
}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("ending", FORMATS)
def test_it_is_told_and_goes_on_with_every_row(
    ending: str, way: Callable[[Path], None], drive: drivebus.Drive, tmp_path: Path
) -> None:
    path = tmp_path / "runs" / f"run.{ending}"
    path.parent.mkdir()
    said, name = WAYS[way]
    with Recorder(path, {drive: NAMES}, interval=0.1) as recorder:
        recorder.wait(2.0)
        before = recorder.rows
        way(path)
        with pytest.warns(DrivebusWarning, match=f"run.{ending} .*{said}"):
            recorder.wait(1.0)
        assert [said in text for text in recorder.told] == [True]
        following = path.with_name(f"{name}.{ending}")
        assert recorder.files == [following]
        assert following.exists()
        recorder.wait(2.0)
    found = read(following)
    assert found.complete
    assert found.about["drives"]
    assert len(found.times["unit 1"]) == recorder.rows > before > 10
    assert recorder.lost == 0
    [moved] = [event.text for event in found.events if event.kind == "moved"]
    assert said in moved
    if way is replaced:
        assert path.read_text() == "somebody else's"


@pytest.mark.parametrize("ending", FORMATS)
def test_where_it_cannot_go_on_rows_are_kept_until_it_can(ending: str, drive: drivebus.Drive, tmp_path: Path) -> None:
    path = tmp_path / "runs" / f"run.{ending}"
    path.parent.mkdir()
    with Recorder(path, {drive: NAMES}, interval=0.1) as recorder:
        recorder.wait(2.0)
        shutil.rmtree(path.parent)
        path.parent.write_text("a file where the folder was")
        with pytest.warns(DrivebusWarning, match="cannot be begun anew now"):
            recorder.wait(1.5)
        assert recorder.problem
        recorder.wait(1.5)
        path.parent.unlink()
        with pytest.warns(DrivebusWarning, match="goes on in"):
            recorder.wait(1.5)
        assert recorder.problem == ""
    assert len(read(path).times["unit 1"]) == recorder.rows > 50
    assert recorder.lost == 0


@pytest.mark.parametrize("ending", FORMATS)
def test_what_could_not_be_kept_is_counted(ending: str, drive: drivebus.Drive, tmp_path: Path) -> None:
    path = tmp_path / "runs" / f"run.{ending}"
    path.parent.mkdir()
    recorder = Recorder(path, {drive: NAMES}, interval=0.1)
    recorder.wait(2.0)
    rows = recorder.rows
    shutil.rmtree(path.parent)
    path.parent.write_text("a file where the folder was")
    with pytest.warns(DrivebusWarning, match="cannot be begun anew now"), pytest.raises(OSError, match="rows are lost"):
        recorder.close()
    assert (recorder.rows, recorder.lost >= rows > 10) == (0, True)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_file_that_goes_right_before_the_end_is_not_missed(
    ending: str, drive: drivebus.Drive, tmp_path: Path
) -> None:
    path = tmp_path / f"run.{ending}"
    recorder = Recorder(path, {drive: NAMES}, interval=0.1)
    recorder.wait(2.0)
    path.unlink()
    with pytest.warns(DrivebusWarning, match="it was removed"):
        recorder.close()
    assert read(path).complete
    assert len(read(path).times["unit 1"]) == recorder.rows > 10


def test_of_parquet_what_stood_in_a_part_that_is_gone_is_lost_and_counted(
    drive: drivebus.Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the newest part is in memory."""
    monkeypatch.setattr("drivebus.record.parquet._PART", 20)
    path = tmp_path / "run.parquet"
    with Recorder(path, {drive: NAMES}, interval=0.1) as recorder:
        for _ in range(10):
            recorder.wait(0.5)
        parts = sorted(tmp_path.glob("run*.parquet"))
        assert len(parts) > 2
        gone = len(read(path).times["unit 1"])
        path.unlink()
        with pytest.warns(DrivebusWarning, match=f"{gone} rows are lost"):
            recorder.wait(1.0)
        assert recorder.lost == gone
        for _ in range(4):
            recorder.wait(0.5)
    assert [*tmp_path.glob("run*.parquet")] == [path]
    found = read(path)
    assert len(found.times["unit 1"]) == recorder.rows > 30
    assert found.times["unit 1"] == sorted(found.times["unit 1"])


def test_a_next_file_never_takes_the_place_of_one_of_this_recording(drive: drivebus.Drive, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with Recorder(path, {drive: NAMES}, interval=0.1, rotate_bytes=4000, replace=True) as recorder:
        recorder.wait(1.0)
        replaced(path)
        with pytest.warns(DrivebusWarning, match="another file stands there"):
            recorder.wait(1.0)
        for _ in range(20):
            recorder.wait(0.5)
    assert len({*recorder.files}) == len(recorder.files) > 2
    assert len(read(*recorder.files).times["unit 1"]) == recorder.rows


def test_another_working_folder_is_no_other_place(
    drive: drivebus.Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    with Recorder("run.csv", {drive: NAMES}, interval=0.1) as recorder:
        recorder.wait(1.0)
        os.chdir(tmp_path / "elsewhere")
        recorder.wait(2.0)
        (tmp_path / "run.csv").unlink()
        recorder.wait(2.0)
    assert len(recwarn) == 1
    assert [*(tmp_path / "elsewhere").iterdir()] == []
    assert len(read(tmp_path / "run.csv").times["unit 1"]) == recorder.rows


def test_it_is_looked_at_once_a_second(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """Time is an argument."""
    path = tmp_path / "run.csv"
    series = Series(path, Table([], None, "0"), 100.0, replace=False, most=None, longest=None, counted=lambda: "0 rows")
    path.unlink()
    for now, told in [(100.5, 0), (100.9, 0), (101.0, 1), (101.5, 1), (102.5, 1)]:
        series.write(now)
        assert (len(series.told), len(recwarn)) == (told, told)
    path.unlink()
    series.write(103.4)
    assert len(series.told) == 1
    series.write(103.5)
    assert len(series.told) == 2
    series.close(103.6)
    assert [event.kind for event in read(path).events] == ["recording", "moved", "moved", "about", "end"]


@pytest.mark.parametrize("as_json", [False, True])
def test_the_command_says_so_at_once_and_in_its_exit_code(as_json: bool, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    words = ["--port", "sim://gd350", *["--json"][: int(as_json)], "record", str(path), "output_current"]
    with subprocess.Popen(
        [sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as it:
        assert it.stderr is not None
        assert it.stdout is not None
        while not path.exists() or path.stat().st_size < 3000:
            assert it.poll() is None
        path.unlink()
        while "it was removed" not in (line := it.stderr.readline()):
            assert line, "it ended without a word"
        assert path.exists()
        it.send_signal(signal.SIGINT)
        out, err = it.stdout.read(), it.stderr.read()
    assert it.returncode == 1
    assert "Error: " in err
    rows = len(read(path).times["unit 1"])
    if as_json:
        assert json.loads(out)["rows"] == rows
        assert json.loads(out)["told"]
    else:
        assert f"{rows} rows in {path}" in out
        assert "no gap" in out


@pytest.mark.parametrize("ending", FORMATS)
def test_a_new_file_that_has_the_number_of_the_old_one_is_kept(
    ending: str, drive: drivebus.Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """File systems give a number again as soon as it is free: then both are taken for one."""
    path = tmp_path / f"run.{ending}"
    gone = Standing.gone
    monkeypatch.setattr(Standing, "gone", lambda standing: "" if path.exists() else gone(standing))
    with Recorder(path, {drive: NAMES}, interval=0.1) as recorder:
        recorder.wait(2.0)
        path.unlink()
        with pytest.warns(DrivebusWarning, match="it was removed"):
            recorder.wait(1.5)
        assert path.exists()
        recorder.wait(3.0)
    assert len(recorder.told) == 1
