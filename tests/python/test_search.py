"""The search of a line of which nothing is known: who is found, by which questions, in what time, and what is said."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Mapping
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import BadAnswer, Bus, NotAllowed, PortError, Settings, Simulator
from drivebus.cli import cli
from drivebus.line_search.order import candidates, factory

READ = bytes.fromhex("01 03 00 04 00 02 85 CA")  # GD350 manual, chapter 9.4.1
PORT = "/dev/line"  # has settings, as far as its name tells; what opens it is a Wire


class Wire:
    """A line in virtual time whose units each have settings of their own: no simulated line has that.

    What comes at others nobody answers, or those of that speed answer with the fault *otherwise*.

    Attributes:
        tried: The settings at which it was opened, in order.
    """

    def __init__(self, units: Mapping[int, tuple[str, Settings]], otherwise: str = "deaf") -> None:
        self._units = units
        self._otherwise = otherwise
        self._lines: list[Simulator] = []
        self.tried: list[Settings] = []

    def open(self, _: object, *, baudrate: int, bytesize: int, parity: str, stopbits: int, **options: Any) -> Bus:
        settings = Settings(baudrate, bytesize, parity, stopbits)
        self.tried.append(settings)
        assert options["read_only"] is True
        here = {unit: family for unit, (family, own) in self._units.items() if own == settings}
        others = {unit: family for unit, (family, own) in self._units.items() if own.baudrate == baudrate}
        line = Simulator(here or others or {247: "gd350"}, transport="process", clock="virtual", **vars(settings))
        if not here:
            line.line.set_faults(**{self._otherwise if others else "deaf": 1.0})
        self._lines.append(line)
        return Bus(line, **options)

    @property
    def seconds(self) -> float:
        """How long the line was used, on its own clock."""
        return sum(line.now() for line in self._lines)

    @property
    def functions(self) -> set[int]:
        """The functions of all that was asked."""
        return {frame[1] for line in self._lines for _, who, frame in line.line.trace() if who == "master"}

    @property
    def written(self) -> int:
        """How many words the drives took."""
        return sum(line.drive(unit).words_written for line in self._lines for unit in line.units)

    @property
    def requests(self) -> int:
        return sum(line.line.requests for line in self._lines)


FAST, SLOW = Settings(38400, 8, "N", 1), Settings(9600, 8, "N", 1)
FOUR = {1: ("gd350", FAST), 3: ("gd600", SLOW), 12: ("vfd500", SLOW), 140: ("chf100a", FAST)}


def places(found: list[drivebus.Located]) -> dict[int, Settings]:
    return {located.unit: located.settings for located in found}


def in_turn() -> float:
    """The same time-out at the same settings, every address of one after the other: how long that takes."""
    wire = Wire(FOUR)
    found = set()
    first = Settings(19200)
    for settings in (first, *candidates(first, full=False)):
        timing = settings.timing
        with wire.open(PORT, **vars(settings), read_only=True) as bus:
            bus.sleep(1.0)
            found |= {each.unit for each in bus.scan(timeout=0.05 + timing.t35 + 7 * timing.char_time)}
    assert found == set(FOUR)
    return wire.seconds


def test_four_families_at_two_settings_in_less_than_a_third_of_the_time() -> None:
    wire = Wire(FOUR)
    left: list[float] = []
    search = drivebus.search(PORT, open=wire.open, progress=lambda at: left.append(at.left))
    found = list(search)
    assert places(found) == {unit: settings for unit, (_, settings) in FOUR.items()}
    assert {located.unit: located.profile for located in found} == {1: "gd350", 3: None, 12: "vfd500", 140: None}
    assert wire.seconds < in_turn() / 3
    assert (wire.functions, wire.written) == ({0x01, 0x03, 0x04}, 0), "reads, and until somebody answers one of nothing"
    # What is left at first is right if nobody answers; the last question is all that is left at the end.
    assert left[0] == pytest.approx(wire.seconds - 12.5, abs=2.5)
    assert left[-1] < 0.1


def test_the_time_that_is_left_is_right_where_nobody_answers() -> None:
    wire = Wire({})
    left: list[float] = []
    search = drivebus.search(PORT, open=wire.open, progress=lambda at: left.append(at.left))
    assert list(search) == []
    # But for the first second of listening, and the silence before each request.
    assert left[0] == pytest.approx(wire.seconds - 1.0, rel=0.1)
    assert left == sorted(left, reverse=True)


def test_factories_come_first_and_each_setting_once_unless_everybody_is_asked_there() -> None:
    wire = Wire({})
    list(drivebus.search(PORT, open=wire.open))
    known = [Settings(19200, 8, "E", 1), Settings(9600, 8, "N", 1), Settings(38400, 8, "E", 1)]
    assert wire.tried[:3] == factory() == known
    assert wire.tried[-3:] == factory()
    assert len(wire.tried) == len(set(wire.tried)) + len(factory())


def test_the_given_settings_come_first() -> None:
    wire = Wire({9: ("gd350", Settings(57600, 8, "O", 2))})
    search = drivebus.search(PORT, baudrate=57600, parity="O", stopbits=2, open=wire.open)
    assert next(search).unit == 9
    search.close()
    assert wire.tried == [Settings(57600, 8, "O", 2)]


def test_an_unlikely_address_at_the_settings_of_a_factory_is_found() -> None:
    wire = Wire({201: ("gd350", Settings(19200))})
    assert places(list(drivebus.search(PORT, open=wire.open))) == {201: Settings(19200)}


def test_what_was_not_tried_is_said_and_full_tries_it() -> None:
    hidden = {77: ("gd350", Settings(1200, 8, "O", 2))}
    search = drivebus.search(PORT, open=Wire(hidden).open)
    assert list(search) == []
    settings, addresses, slow = search.untried
    assert all(text in settings for text in ("1200 bit/s", "2400 bit/s", "8N2"))
    assert addresses == "addresses 17 to 247 at 15 of 18 settings"
    assert "20 ms" in slow
    search = drivebus.search(PORT, open=Wire(hidden).open, full=True)
    assert [located.unit for located in search] == [77]
    assert search.untried == [slow.replace("another address than 1", "an address above 16")]


def test_damage_at_a_speed_brings_its_other_formats_forward_and_is_not_told_where_one_is_right() -> None:
    wire = Wire({5: ("gd350", Settings(115200, 8, "O", 2))}, otherwise="flip_bit")
    found = list(drivebus.search(PORT, open=wire.open))
    assert places(found) == {5: Settings(115200, 8, "O", 2)}, "two stop bits are not tried otherwise"
    speeds = [settings.baudrate for settings in wire.tried]
    assert speeds[speeds.index(115200) :][:6] == [115200] * 6


def test_who_is_damaged_everywhere_is_told_in_the_end() -> None:
    wire = Wire({5: ("gd350", Settings(9600, 7, "E", 1))}, otherwise="flip_bit")
    [located] = drivebus.search(PORT, open=wire.open)
    assert (located.unit, located.settings.baudrate, located.profile) == (5, 9600, None)
    assert located.problem is not None
    assert "CRC" in located.problem


def test_who_answers_at_each_format_is_found_once() -> None:
    """A pseudo-terminal carries no parity, and a second stop bit is silence like any other."""
    lines = []

    def opened(_: object, *, baudrate: int, **options: Any) -> Bus:
        at_its_speed = baudrate == 9600
        lines.append(Simulator({2: "gd350"}, transport="process", clock="virtual", baudrate=baudrate))
        lines[-1].line.set_faults(deaf=0.0 if at_its_speed else 1.0)
        for name in ("bytesize", "parity", "stopbits"):
            del options[name]
        return Bus(lines[-1], **options)

    assert places(list(drivebus.search(PORT, open=opened))) == {2: Settings(9600, 8, "N", 1)}


def test_an_adapter_that_echoes_hides_nobody() -> None:
    with Simulator({1: "gd350", 30: "vfd500"}, transport="process", clock="virtual", echo=True) as simulator:
        assert [located.unit for located in drivebus.search(simulator)] == [1, 30]


def test_a_port_whose_settings_are_not_ours_is_asked_at_those_it_has() -> None:
    with Simulator({1: "gd350", 200: "vfd500"}, transport="process", clock="virtual", baudrate=38400) as simulator:
        search = drivebus.search(simulator, baudrate=38400)
        assert [located.unit for located in search] == [1, 200]
        assert simulator.line.requests < 280, "each address once, and a few more where somebody answered"
        assert simulator.drive(1).words_written == 0
    assert "from elsewhere" in search.untried[0]


class TestAnotherMaster:
    @staticmethod
    def hearing(monkeypatch: pytest.MonkeyPatch, at: Settings, elsewhere: bytes) -> None:
        """Somebody speaks at these settings; at others it is noise."""

        def listen(bus: Bus, seconds: float) -> list[tuple[float, bytes]]:
            bus.sleep(seconds)
            came = READ if Settings.of(bus) == at else elsewhere
            return [(0.0, came)] if came else []

        monkeypatch.setattr(Bus, "listen", listen)

    @pytest.mark.parametrize("at", [Settings(19200), Settings(4800, 8, "N", 1)])
    def test_is_heard_before_anything_is_asked(self, monkeypatch: pytest.MonkeyPatch, at: Settings) -> None:
        self.hearing(monkeypatch, at, b"\x5a\x93\x41")
        wire = Wire(FOUR)
        with pytest.raises(BadAnswer, match=f"{at} while nothing was asked, such as 01 03 00 04 00 02 85 CA"):
            list(drivebus.search(PORT, open=wire.open))
        assert wire.requests == 0

    def test_noise_alone_ends_nothing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.hearing(monkeypatch, Settings(1), b"\x00\xff")
        assert places(list(drivebus.search(PORT, open=Wire(FOUR).open))).keys() == FOUR.keys()


class TestThePort:
    def test_settings_that_it_does_not_make_are_passed_over_and_told(self) -> None:
        wire = Wire(FOUR)

        def opened(port: object, **options: Any) -> Bus:
            if options["baudrate"] == 57600:
                raise PortError("the driver does not make it")
            return wire.open(port, **options)

        search = drivebus.search(PORT, open=opened)
        assert places(list(search)).keys() == FOUR.keys()
        assert sum(text.endswith("the driver does not make it") for text in search.untried) == 3

    def test_lost_on_the_way_it_ends_the_search(self) -> None:
        wire = Wire({})

        def opened(port: object, **options: Any) -> Bus:
            if len(wire.tried) > 3:
                raise PortError("it is gone")
            return wire.open(port, **options)

        with pytest.raises(PortError, match="it is gone"):
            list(drivebus.search(PORT, open=opened))

    @pytest.mark.skipif(os.name == "nt", reason="no pty")
    def test_one_that_another_program_has_is_not_shared(self) -> None:
        with Simulator({1: "gd350"}, transport="pty") as simulator, Bus(simulator):
            with pytest.raises(PortError, match="cannot go through another program"):
                next(drivebus.search(simulator.port))
            assert simulator.line.requests == 0

    @pytest.mark.parametrize(
        ("wrong", "said"),
        [
            ({"baudrate": 0}, "baud rate 0"),
            ({"parity": "X"}, "parity"),
            ({"timeout": 0}, "timeout 0 is out of range"),
            ({"full": 1}, "full 1 is neither"),
            ({"progress": 3}, "progress is 3"),
        ],
    )
    def test_wrong_arguments_are_refused_at_once(self, wrong: dict[str, Any], said: str) -> None:
        with pytest.raises(NotAllowed, match=said):
            drivebus.search(PORT, **wrong)


class TestTheCommand:
    @staticmethod
    def scan(monkeypatch: pytest.MonkeyPatch, wire: Wire, *words: str, before: tuple[str, ...] = ()) -> Result:
        monkeypatch.setattr(drivebus, "search", functools.partial(drivebus.search, open=wire.open))
        return CliRunner().invoke(cli, ["--port", PORT, *before, "scan", "--search", *words], prog_name="drivebus")

    def test_shows_a_table_and_what_was_left_out(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Wire(FOUR))
        assert done.exit_code == 0
        lines = done.stdout.splitlines()
        assert lines[0].split() == ["unit", "settings", "family", "certainty", "problem"]
        assert lines[2].split() == ["12", "9600", "8N1", "vfd500", "by", "answers"]
        told = " ".join(" ".join(lines[5:]).split())
        start = "`drivebus --port /dev/line --baud 9600 --format 8N1"
        assert told.startswith("by answers: it has no code, but answers and refuses the same registers as this family.")
        assert "unverified:" not in told
        assert "shared:" not in told
        assert f"4 units. Talk to the first: {start} --unit 3 info`" in told
        assert told.endswith(f"Unit 12 has to be named: {start} --unit 12 --profile vfd500 info`")
        assert done.stderr.startswith("Not tried: 30 other settings")

    def test_the_first_is_named_too_if_only_its_answers_tell(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Wire({12: ("vfd500", SLOW)}))
        told = " ".join(done.stdout.split())
        assert "--format 8N1 --unit 12 --profile vfd500 info`" in told
        assert "has to be named" not in told

    def test_json_has_an_object_for_each(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Wire(FOUR), before=("--json",))
        found = {each["unit"]: each for each in map(json.loads, done.stdout.splitlines())}
        assert found.keys() == FOUR.keys()
        assert found[1] == {
            "unit": 1,
            "baudrate": 38400,
            "format": "8N1",
            "profile": "gd350",
            "certainty": "certain",
            "candidates": ["gd350"],
            "identification": "0x01a0",
            "problem": None,
            "protocol": "modbus",
        }

    def test_a_dead_line_is_one_line_and_code_3(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Wire({}))
        assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (3, "", 1)
        assert done.stderr.startswith("Error: nobody answered. Not tried: 30 other settings")

    def test_a_port_that_is_not_there_is_one_line_and_code_5(self) -> None:
        done = CliRunner().invoke(cli, ["--port", "/dev/nowhere", "scan", "--search"], prog_name="drivebus")
        assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (5, "", 1)

    def test_what_was_found_is_shown_when_the_search_is_interrupted(self, monkeypatch: pytest.MonkeyPatch) -> None:
        wire = Wire(FOUR)
        opened = wire.open

        def interrupted(port: object, **options: Any) -> Bus:
            if len(wire.tried) > 3:
                raise KeyboardInterrupt
            return opened(port, **options)

        monkeypatch.setattr(wire, "open", interrupted)
        done = self.scan(monkeypatch, wire)
        assert (done.exit_code, done.stderr) == (130, "Interrupted.\n")
        assert "vfd500" in done.stdout

    @pytest.mark.parametrize("words", [["scan", "--search", "--units", "1-4"], ["scan", "--full"]])
    def test_what_does_not_go_together_is_refused(self, words: list[str]) -> None:
        done = CliRunner().invoke(cli, ["--port", "sim://gd350", *words], prog_name="drivebus")
        assert (done.exit_code, done.stdout) == (2, "")
