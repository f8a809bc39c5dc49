"""A search of a line of which nothing is known finds a drive that speaks Huanyang's own protocol, at little cost."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Iterator
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import Bus, Found, Settings
from drivebus.cli import cli
from drivebus.line_search.order import candidates

from .odd_slave import framed, good, on_a_terminal
from .test_huanyang_asked import Drive
from .test_search import FOUR, PORT, Wire, places

needs_terminals = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
SAID = "it speaks Huanyang's own protocol, which is no Modbus: name it huanyang-hy"
ALL = [Settings(19200), *candidates(Settings(19200), full=False)]


class Enough(Exception):
    """The first settings are done."""


class Foreign(Wire):
    """A wire with a drive that answers in that protocol alone, at its own settings; *asked* is who was asked in it."""

    def __init__(self, unit: int = 1, own: Settings | None = None, units: Any = None) -> None:
        super().__init__(units or {})
        self.place = None if own is None else (own, unit)
        self.asked: list[tuple[Settings, int]] = []

    def open(self, port: object, **options: Any) -> Bus:  # type: ignore[override]  # as it is called
        bus = super().open(port, **options)
        settings, scan = self.tried[-1], bus.scan

        def scanned(units: Any, timeout: float | None = None, *, protocol: str = "auto") -> Iterator[Found]:
            assert protocol == "huanyang", "a search asks in Modbus by itself"
            for unit in units:
                self.asked.append((settings, unit))
                yield from scan([unit], timeout, protocol=protocol)
                if (settings, unit) == self.place:
                    yield Found(unit, None, None, 0.01, SAID, protocol="huanyang")

        bus.scan = scanned  # type: ignore[method-assign, assignment]  # it is one for the test
        return bus


def search(wire: Wire, **options: Any) -> list[drivebus.Located]:
    return list(drivebus.search(PORT, open=wire.open, **options))


@needs_terminals
@pytest.mark.parametrize("echoes", [False, True])
def test_it_is_found_and_nothing_that_it_hears_is_a_command(echoes: bool) -> None:
    drive = Drive()

    def said(request: bytes) -> list[bytes]:
        own = framed(request.hex())
        return [own * echoes, drive.answer(request)]

    with on_a_terminal(said) as path, drivebus.search(path, timeout=0.3, baudrate=115200) as searching:
        located = next(searching)
    assert (located.unit, located.protocol, located.profile, located.problem) == (1, "huanyang", None, SAID)
    assert located.settings == Settings(115200)
    assert str(located) == f"unit 1 at 115200 8E1: {SAID}"
    assert drive.commands == []


@needs_terminals
def test_one_that_answers_modbus_with_its_own_frames_is_named() -> None:
    answer = lambda request: framed(f"{request[0]:02X} 03 01 09") if request[0] == 2 else b""  # noqa: E731
    with on_a_terminal(answer) as path, drivebus.search(path, timeout=0.3, baudrate=115200) as searching:
        located = next(searching)
    assert (located.unit, located.protocol, located.problem) == (2, "huanyang", SAID)


@needs_terminals
def test_it_is_told_once_for_each_speed() -> None:
    """A pseudo-terminal carries no parity: it answers at each format, and in both ways of asking."""
    answer = lambda request: framed("01 03 01 09") if request[0] == 1 else b""  # noqa: E731
    tried: list[Settings] = []

    def enough(at: drivebus.Progress) -> None:
        tried.extend([at.settings] if at.settings not in tried else [])
        if len(tried) == 4:
            raise Enough

    found: list[drivebus.Located] = []
    with on_a_terminal(answer) as path, pytest.raises(Enough):
        found.extend(drivebus.search(path, timeout=0.02, baudrate=115200, progress=enough))
    keys = [(located.settings.baudrate, located.unit) for located in found]
    assert keys
    assert len(keys) == len(set(keys))


@needs_terminals
@pytest.mark.parametrize("cut", [0, 1, 5, 7])
def test_an_answer_that_is_cut_or_damaged_is_none(cut: int) -> None:
    whole = framed("01 04 03 00 13 88")
    for said in (whole[:cut], whole[:cut] + bytes([whole[cut] ^ 0x10]) + whole[cut + 1 :]):
        asked: list[bytes] = []
        found: list[drivebus.Located] = []

        def answer(request: bytes, said: bytes = said, asked: list[bytes] = asked) -> bytes:
            if request[1] != 4:
                return b""
            asked.append(request)
            return said

        def enough(at: drivebus.Progress, asked: list[bytes] = asked) -> None:
            # A busy machine may hear the question of one format only while the next is tried.
            if asked and at.unit is None:
                raise Enough

        with on_a_terminal(answer) as path, pytest.raises(Enough):
            found.extend(drivebus.search(path, timeout=0.05, baudrate=115200, progress=enough))
        assert found == []


@pytest.mark.parametrize("own", ALL, ids=str)
def test_it_is_found_at_each_setting(own: Settings) -> None:
    [located] = search(Foreign(1, own))
    assert (located.unit, located.settings, located.protocol, located.identification) == (1, own, "huanyang", None)


def test_each_setting_is_asked_once() -> None:
    wire = Foreign()
    assert search(wire) == []
    assert [unit for _, unit in wire.asked] == [1] * len(ALL)
    assert {settings for settings, _ in wire.asked} == set(ALL)


def test_where_it_answers_the_likely_addresses_are_asked_and_no_other_setting() -> None:
    own = ALL[2]
    wire = Foreign(1, own)
    search(wire)
    assert wire.asked == [(ALL[0], 1), (ALL[1], 1), *((own, unit) for unit in range(1, 17))]


def test_full_asks_the_likely_addresses_everywhere() -> None:
    [located] = search(Foreign(9, Settings(2400, 8, "N", 1)), full=True)
    assert (located.unit, located.settings) == (9, Settings(2400, 8, "N", 1))


def test_nobody_is_asked_so_where_somebody_answered_before() -> None:
    wire = Foreign(1, Settings(4800), {1: ("gd350", ALL[0])})
    assert places(search(wire)) == {1: ALL[0]}
    assert wire.asked == []


def test_what_was_found_before_is_found_all_the_same() -> None:
    wire = Foreign(2, ALL[0], FOUR)
    assert places(search(wire)) == {unit: settings for unit, (_, settings) in FOUR.items()}


class TestWhatItCosts:
    """In virtual time; a time-out is that of the slowest family."""

    def test_a_silent_line(self) -> None:
        wire, before = Foreign(), 82.45
        left: list[float] = []
        search(wire, progress=lambda at: left.append(at.left))
        assert 1.0 < wire.seconds - before < 1.6, "18 questions"
        assert left[0] == pytest.approx(wire.seconds - 1.0, rel=0.1)
        assert left == sorted(left, reverse=True)
        assert left[-1] < 0.1

    def test_a_line_on_which_somebody_answers_at_the_first_settings(self) -> None:
        wire = Foreign(1, None, {1: ("gd350", ALL[0])})
        search(wire)
        assert wire.functions == {3}


class TestTheCommand:
    @staticmethod
    def scan(monkeypatch: pytest.MonkeyPatch, wire: Wire, *before: str) -> Result:
        monkeypatch.setattr(drivebus, "search", functools.partial(drivebus.search, open=wire.open))
        return CliRunner().invoke(cli, ["--port", PORT, *before, "scan", "--search"], prog_name="drivebus")

    def test_says_so(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Foreign(1, ALL[1]))
        told = " ".join(done.stdout.split())
        assert done.exit_code == 0
        assert "unit 1 at 9600 8N1" in told or "1 9600 8N1" in told
        assert "speaks Huanyang's own protocol, which is no Modbus: name it huanyang-hy" in told
        assert "info`" not in told, "nobody can talk to it"
        assert "unknown family" not in told

    def test_says_so_in_json(self, monkeypatch: pytest.MonkeyPatch) -> None:
        done = self.scan(monkeypatch, Foreign(1, ALL[1]), "--json")
        [found] = [json.loads(line) for line in done.stdout.splitlines()]
        assert (found["unit"], found["protocol"], found["profile"], found["problem"]) == (1, "huanyang", None, SAID)
        assert (found["baudrate"], found["format"]) == (ALL[1].baudrate, ALL[1].format)

    def test_what_was_left_out_is_told(self) -> None:
        searching = drivebus.search(PORT, open=Foreign().open)
        list(searching)
        assert "Huanyang's own protocol" in searching.untried[-1]
        assert "other address than 1" in searching.untried[-1]


def test_a_unit_of_modbus_is_not_told_as_one() -> None:
    with on_a_terminal(good) as path, drivebus.search(path, timeout=0.3, baudrate=115200) as searching:
        assert next(searching).protocol == "modbus"
