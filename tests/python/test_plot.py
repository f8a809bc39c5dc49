"""Pictures of recordings: what is drawn, that no peak is hidden, and files that are what their names say."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus import NotAllowed, Recorder, Simulator
from drivebus.cli import cli
from drivebus.plot import Picture, draw, of_recording, of_samples
from drivebus.plot.downsample import thinned
from drivebus.plot.picture import Curve, from_zero
from drivebus.record import Recording, read
from drivebus.trial.samples import Samples

LABEL = "a<b>$x_1$ & co"
"""What HTML, SVG and matplotlib each have a meaning of their own for."""

VALUES = st.lists(st.one_of(st.none(), st.floats(-1e6, 1e6)), max_size=300)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with a start, a gap, an overload, a fault and its end."""
    path = tmp_path_factory.mktemp("plots") / "run.csv"
    with (
        Simulator({1: "gd350", 2: "gd350"}, clock="virtual", transport="process") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        first, second = bus.drive(1), bus.drive(2)
        first.prepare_control()
        names = {first: ["running_frequency", "output_current", "output_state"], second: ["output_current"]}
        with Recorder(path, names, interval=0.1, labels={first: LABEL, second: "fan"}) as recorder:
            first.run(20.0)
            recorder.wait(5.0)
            simulator.line.drop_answers(6)
            recorder.wait(4.0)
            simulator.drive(1).trip("OL1")
            recorder.wait(1.0)
            first.reset_fault()
            recorder.wait(1.0)
    return path


@pytest.fixture(scope="module")
def recording(file: Path) -> Recording:
    return read(file)


@given(VALUES, st.integers(2, 50))
def test_no_peak_and_no_gap_is_left_out(values: list[float | None], most: int) -> None:
    times = [float(place) for place in range(len(values))]
    kept_times, kept = thinned(times, values, most)
    there = [value for value in values if value is not None]
    assert kept_times == sorted(set(kept_times))
    assert all(values[int(time)] == value for time, value in zip(kept_times, kept, strict=True))
    if there:
        shown = [value for value in kept if value is not None]
        assert (min(shown), max(shown)) == (min(there), max(there))
        assert len(shown) <= max(most, len(times) if len(times) <= most else 0)
    assert (None in kept) == (None in values)


def test_a_picture_has_what_was_recorded(recording: Recording) -> None:
    picture = of_recording(recording, "run")
    assert list(picture.panels) == ["Hz", "A"], "words of bits are no curves"
    assert picture.left_out == ["fan output_current [A]"]
    frequency = picture.panels["Hz"][0]
    assert frequency.label == f"{LABEL} running_frequency"
    assert max(value for value in frequency.values if value is not None) == 20.0
    assert [mark.kind for mark in picture.marks] == ["fault", "fault cleared"]
    assert picture.marks[0].text == f"{LABEL}: OL1 (11): Motor overload"
    gaps = [event for event in recording.events if event.kind in ("gap", "back") and event.drive == LABEL]
    assert (LABEL, gaps[0].time - picture.began, gaps[1].time - picture.began) in picture.gaps


def test_bands_tell_the_state_of_each_sample_and_nothing_of_gaps(recording: Recording) -> None:
    picture = of_recording(recording, "run")
    for drive in recording.drives:
        bands = [band for band in picture.bands if band.drive == drive]
        for time, state in list(zip(recording.times[drive], recording.states[drive], strict=True))[:-1]:
            at = time - picture.began
            assert [band.state for band in bands if band.begin <= at < band.end] == [state]
        for name, begin, end in picture.gaps:
            assert name != drive or not [band for band in bands if band.begin < end and band.end > begin]


def test_a_band_begins_at_the_sample_that_shows_the_state_however_few_there_are(tmp_path: Path) -> None:
    """A busy line leaves out samples around the start: the curve rises before the band, which cannot know."""
    path = tmp_path / "busy.csv"
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        with Recorder(path, {drive: ["running_frequency", "output_state"]}, interval=0.1) as recorder:
            recorder.wait(1.0)
            drive.run(20.0)
            busy = bus.now() + 0.6
            while bus.now() < busy:
                drive.read("output_current")
            recorder.wait(2.0)
    found = read(path)
    picture = of_recording(found, "busy")
    times, states = found.times["unit 1"], found.states["unit 1"]
    place = states.index("forward")
    assert found.values["unit 1"]["running_frequency [Hz]"][place] > 0.0
    assert times[place] - times[place - 1] > 0.6
    forward = times[place] - picture.began
    assert [(band.state, band.begin) for band in picture.bands if band.drive == "unit 1"][1:] == [("forward", forward)]
    assert picture.late == 1
    code, told = plot(str(path), "-o", str(tmp_path / "busy.png"))
    assert code == 0
    assert "The line was busy 1 time, so samples are missing there" in " ".join(told.split())


def test_bits_of_a_word_are_lamps_with_their_names(recording: Recording, tmp_path: Path) -> None:
    picture = of_recording(recording, "run")
    words = recording.values[LABEL]["output_state"]
    times = [time - picture.began for time in recording.times[LABEL]]
    lamps = [band for band in picture.bands if band.lamp]
    assert {band.drive for band in lamps} == {f"{LABEL} output_state RO1"}, "a bit that was never on has none"
    assert {band.state for band in lamps} == {"on"}
    for time, word in list(zip(times, words, strict=True))[:-1]:
        assert any(band.begin <= time < band.end for band in lamps) == bool(int(word) & 0b100)
    alone = of_recording(recording, "run", ["output_state"])
    assert not alone.panels
    for ending in ("png", "html"):
        draw(alone, tmp_path / f"alone.{ending}")


def test_an_axis_begins_at_zero_unless_the_values_are_far_from_it() -> None:
    def curve(*values: float | None) -> Curve:
        return Curve("x", [0.0] * len(values), values)

    assert from_zero([curve(4.4, None, 5.5)])
    assert from_zero([curve(9.0), curve(0.0, None)])
    for kept in ([curve(536.0, 537.0)], [curve(-0.1, 5.0)], [curve(0.0)], [curve(None)], []):
        assert not from_zero(kept)


def test_curves_break_at_gaps(recording: Recording) -> None:
    picture = of_recording(recording, "run")
    for curve in picture.panels["Hz"]:
        for _, begin, end in [gap for gap in picture.gaps if gap[0] == LABEL]:
            inside = [value for time, value in zip(curve.times, curve.values, strict=True) if begin <= time < end]
            assert inside == [None]


def test_a_part_of_it(recording: Recording) -> None:
    picture = of_recording(recording, "run", ["output_current"], begin=1.0, end=2.0)
    assert list(picture.panels) == ["A"]
    assert {curve.label for curve in picture.panels["A"]} == {f"{LABEL} output_current", "fan output_current"}
    assert all(0.0 <= time <= 1.0 for curve in picture.panels["A"] for time in curve.times)
    with pytest.raises(NotAllowed, match=r'no "output_curent".*output_current'):
        of_recording(recording, "run", ["output_curent"])
    with pytest.raises(NotAllowed, match="nothing to draw"):
        of_recording(recording, "run", begin=1e6)


def pictures(recording: Recording) -> list[Picture]:
    samples = Samples([-0.1, 0.0, 0.1], {"running_frequency": [1.0, 2.0, 3.0]}, {"running_frequency": "Hz"}, 1e9)
    return [of_recording(recording, LABEL), of_samples(samples, LABEL)]


def test_files_are_what_their_names_say(recording: Recording, tmp_path: Path) -> None:
    for number, picture in enumerate(pictures(recording)):
        still, drawn, page = (tmp_path / f"{number}.{ending}" for ending in ("png", "svg", "html"))
        for path in (still, drawn, page):
            draw(picture, path)
        assert still.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
        assert xml.etree.ElementTree.parse(drawn).getroot().tag == "{http://www.w3.org/2000/svg}svg"
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text), "it needs a network"
        assert "<b>$x_1$" not in text
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_what_is_missing_is_named(recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = of_recording(recording, "run")
    with pytest.raises(NotAllowed, match=r"\.png, \.svg, \.html"):
        draw(picture, tmp_path / "run.gif")
    with pytest.raises(NotAllowed, match="cannot be written: No such file"):
        draw(picture, tmp_path / "nowhere" / "run.png")
    for module, library, ending in [("plotly_writer", "plotly", "html"), ("matplotlib_writer", "matplotlib", "png")]:
        monkeypatch.delitem(sys.modules, f"drivebus.plot.{module}", raising=False)
        for name in [name for name in sys.modules if name.split(".")[0] == library]:
            monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(NotAllowed, match=rf"need {library}.*pip install 'drivebus\[plot\]'"):
            draw(picture, tmp_path / f"run.{ending}")
    assert not [*tmp_path.iterdir()]


def plot(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, ["plot", *words], prog_name="drivebus")
    return done.exit_code, done.output


def test_the_command(file: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.svg"
    code, told = plot(str(file), "-o", str(target))
    assert (code, target.exists()) == (0, True)
    assert "2 curves and 1 bit in" in told.replace("\n", " ")
    assert "fan output_current [A]. --only" in told.replace("\n", " ")
    assert plot(str(file), "-o", str(target))[0] == 2, "it is there already"
    assert plot(str(file), "-o", str(target), "--force", "--only", "output_current")[0] == 0
    assert plot(str(file), "-o", str(tmp_path / "run.doc"))[0] == 2
    assert plot(str(tmp_path / "nowhere.csv"))[0] == 2
    cut = tmp_path / "cut.csv"
    cut.write_bytes(file.read_bytes()[:-200])
    code, told = plot(str(cut))
    assert (code, (tmp_path / "cut.png").exists()) == (0, True)
    assert "has no end" in told
