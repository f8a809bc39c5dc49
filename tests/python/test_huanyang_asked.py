"""A drive that speaks Huanyang's own protocol alone: found by a scan, and nothing that is sent may be a command to it.

The drive here is written after LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_modbus.c (a frame is unit, function,
length, data, CRC) and hy_comm.c (what the data mean). It is as careless as a drive can be: it looks for frames of its
own at the front of what it hears, and in the whole of it without a look at the length.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from click.testing import CliRunner

from drivebus import Bus, Found, NotAllowed, Profile, Simulator, aio, profiles, tables
from drivebus.cli import cli
from drivebus.doctor import Finding, examine
from drivebus.identify import codes
from drivebus.line import huanyang
from drivebus.line.scan_order import PROTOCOLS
from drivebus.line_search.order import candidates
from drivebus.line_search.settings import Settings

from .odd_slave import framed, good, on_a_socket, on_a_terminal
from .serial_server import crc

COMMANDS = (2, 3, 5)
"""Write a parameter, control, frequency."""


@dataclass
class Drive:
    """A drive of Huanyang at *unit* whose set frequency is *set_to*, in 0.01 Hz."""

    unit: int = 1
    set_to: int = 5000
    heard: list[bytes] = field(default_factory=list)
    took: list[bytes] = field(default_factory=list)

    def answer(self, request: bytes) -> bytes:
        """What it says to *request*, which comes without its CRC."""
        self.heard.append(request)
        whole = request + crc(request)
        length = 5 + whole[2]
        ends = {length} if len(whole) >= length and crc(whole[: length - 2]) == whole[length - 2 : length] else set()
        careless = whole[1] in COMMANDS and whole[2] in (1, 2, 3)
        if whole[0] != self.unit:
            return b""
        if ends or careless:
            self.took.append(whole)
        if len(request) == 6 and request[1:3] == b"\x04\x03" and request[3] == 0:
            return framed(f"{self.unit:02X} 04 03 00 {self.set_to:04X}")
        return b""

    @property
    def commands(self) -> list[bytes]:
        return [each for each in self.took if each[1] in COMMANDS]


def opened(path: str, **options: object) -> Bus:
    return Bus(path, **{"baudrate": 115200, "timeout": 0.3, **options})  # type: ignore[arg-type]


needs_terminals = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")


@needs_terminals
@pytest.mark.parametrize("set_to", [0, 100, 5000])
@pytest.mark.parametrize("unit", [1, 3])
def test_a_scan_finds_it(unit: int, set_to: int) -> None:
    drive = Drive(unit, set_to)
    with on_a_terminal(drive.answer) as path, opened(path, read_only=True) as bus:
        [found] = bus.scan(range(1, 4), 0.3)
    assert (found.unit, found.profile, found.protocol) == (unit, None, "huanyang")
    assert "speaks Huanyang's own protocol, which is no Modbus" in str(found.problem)
    assert found.round_trip > 0
    assert drive.commands == []


@needs_terminals
def test_a_scan_for_event_loops_finds_it() -> None:
    async def scanned(path: str) -> list[Found]:
        async with await aio.Bus.open(path, baudrate=115200, timeout=0.3) as bus:
            return [found async for found in bus.scan([1, 2], 0.3)]

    with on_a_terminal(Drive().answer) as path:
        assert [found.protocol for found in asyncio.run(scanned(path))] == ["huanyang"]


@needs_terminals
def test_a_program_that_shares_the_port_finds_it() -> None:
    drive = Drive()
    with on_a_terminal(drive.answer) as path, opened(path) as owner, opened(path) as guest:
        assert [found.protocol for bus in (guest, owner) for found in bus.scan([1], 0.3)] == ["huanyang"] * 2
    assert drive.commands == []


def test_it_is_found_behind_a_serial_server() -> None:
    drive = Drive()
    with on_a_socket(drive.answer) as url, Bus(url, timeout=0.3) as bus:
        assert [found.protocol for found in bus.scan([1, 2], 0.3)] == ["huanyang"]
    assert drive.commands == []


@needs_terminals
def test_on_a_line_with_others_it_is_asked_for_by_name() -> None:
    drive = Drive(2)
    both = lambda request: good(request) if request[0] == 1 else drive.answer(request)  # noqa: E731
    told: dict[str, list[tuple[int, str]]] = {}
    with on_a_terminal(both) as path:
        for protocol in PROTOCOLS:
            with opened(path) as bus:
                told[protocol] = [(found.unit, found.protocol) for found in bus.scan([1, 2], 0.3, protocol=protocol)]
    assert told == {"auto": [(1, "modbus")], "modbus": [(1, "modbus")], "huanyang": [(2, "huanyang")]}
    assert drive.commands == []


@needs_terminals
@pytest.mark.parametrize("cut", range(8))
def test_an_answer_that_is_cut_or_damaged_is_none(cut: int) -> None:
    whole = framed("01 04 03 00 13 88")
    for said in (whole[:cut], whole[:cut] + bytes([whole[cut] ^ 0x10]) + whole[cut + 1 :]):
        answer = lambda request, said=said: said if request[1] == 4 else b""  # noqa: E731
        with on_a_terminal(answer) as path, opened(path) as bus:
            assert list(bus.scan([1], 0.1)) == []


@needs_terminals
@pytest.mark.parametrize(
    "said", ["01 84 03", "01 04 03 01 13 88", "02 04 03 00 13 88", "01 04 02 13 88", "01 03 02 00 01"]
)
def test_what_answers_otherwise_speaks_not_so(said: str) -> None:
    answer = lambda request: framed(said) if request[1] == 4 else b""  # noqa: E731
    with on_a_terminal(answer) as path, opened(path) as bus:
        assert list(bus.scan([1], 0.1, protocol="huanyang")) == []


@needs_terminals
@pytest.mark.parametrize("as_json", [True, False])
def test_the_command_names_it(as_json: bool) -> None:
    words = ["--json"] * as_json
    with on_a_terminal(Drive().answer) as path:
        line = ["--port", path, "--baud", "115200"]
        told = CliRunner().invoke(cli, [*words, *line, "scan", "--units", "1", "--timeout", "1.0"])
        assert told.exit_code == 0, told.output
        alone = CliRunner().invoke(cli, [*line, "scan", "--units", "1", "--timeout", "1.0", "--protocol", "modbus"])
        assert alone.exit_code == 3
        again = ["scan", "--units", "1", "--timeout", "1.0", "--protocol", "huanyang"]
        assert CliRunner().invoke(cli, [*line, *again]).exit_code == 0
    if as_json:
        assert json.loads(told.stdout)["protocol"] == "huanyang"
    else:
        assert "unit 1: speaks Huanyang's own protocol, which is no Modbus" in told.stdout
        assert "unknown family" not in told.stdout


class TestWhatItCosts:
    """In virtual time: 19200 8E1, and 0.1 s for each."""

    @staticmethod
    def took(units: object, **options: str) -> tuple[float, int]:
        with Simulator({200: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            bus.sleep(2)
            began = bus.now()
            list(bus.scan(units, **options))  # type: ignore[arg-type]
            assert simulator.drive(200).words_written == 0
            return bus.now() - began, bus.stats()["requests"]

    def test_nothing_where_somebody_answers(self) -> None:
        everybody = range(1, 248)
        assert self.took(everybody) == self.took(everybody, protocol="modbus")

    def test_sixteen_time_outs_where_nobody_does(self) -> None:
        silent = range(1, 200)
        seconds, requests = self.took(silent)
        before, asked = self.took(silent, protocol="modbus")
        assert requests - asked == 16
        assert seconds - before < 16 * 0.11

    def test_a_unit_of_modbus_refuses_and_is_not_told(self) -> None:
        with Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as line, Bus(line) as bus:
            assert list(bus.scan([1, 2], protocol="huanyang")) == []
            assert line.drive(1).words_written == line.drive(2).words_written == 0

    @pytest.mark.parametrize("protocol", ["Modbus", "", None, 1])
    def test_a_protocol_that_is_none_is_refused(self, protocol: object) -> None:
        simulator = Simulator({1: "gd350"}, transport="process", clock="virtual")
        with simulator as line, Bus(line) as bus, pytest.raises(NotAllowed, match="protocol"):
            bus.scan(protocol=protocol)  # type: ignore[arg-type]


def test_an_adapters_echo_of_the_question_is_no_answer() -> None:
    """A set frequency of 0 is told by the very bytes of the question."""
    with Simulator({200: "gd350"}, transport="process", clock="virtual", echo=True) as line, Bus(line) as bus:
        assert list(bus.scan([1, 2, 3])) == []
        assert list(bus.scan([1, 2, 3], protocol="huanyang")) == []


@needs_terminals
@pytest.mark.parametrize(("protocol", "echoes"), [("auto", True), ("auto", False), ("huanyang", True)])
@pytest.mark.parametrize("before", ["", "00", "FF 5A", "01 04"])
def test_it_is_found_behind_noise_and_behind_an_adapter_that_echoes(protocol: str, before: str, echoes: bool) -> None:
    drive = Drive()

    def said(request: bytes) -> list[bytes]:
        answer = drive.answer(request)
        return [(request + crc(request)) * echoes, bytes.fromhex(before) * bool(answer) + answer]

    with on_a_terminal(said) as path, opened(path) as bus:
        assert [found.protocol for found in bus.scan([1], 0.6, protocol=protocol)] == ["huanyang"]


class TestTraps:
    """Requests of Modbus that such a drive may take for its own."""

    def test_two_reads_are_frames_of_it_byte_for_byte(self) -> None:
        # A read of discrete inputs writes a parameter, one of coils reads one: what `raw` and `transact` may send.
        write, read = framed("01 02 03 05 00 11"), framed("01 01 03 05 00 11")
        assert huanyang.words(write, True).startswith("unit 1: write PD005 = 17")
        assert huanyang.words(read, True).startswith("unit 1: read PD005")
        drive = Drive()
        assert drive.answer(write[:-2]) == b""
        assert drive.commands == [write]

    def test_a_careless_drive_is_commanded_by_a_read_of_0101(self) -> None:
        drive = Drive()
        drive.answer(framed("01 03 01 01 00 01")[:-2])
        assert len(drive.commands) == 1

    def test_no_word_that_a_scan_asks_for_looks_like_a_command(self) -> None:
        asked = {*codes.registers()}
        for profile in map(Profile.builtin, profiles()):
            if profile.requests().protocol == "huanyang":
                continue  # nobody is asked for its words in Modbus
            signature = profile.signature() or {"answers": [], "refuses": []}
            asked |= {*signature["answers"], *signature["refuses"]}
            state = profile.role("state")
            if profile.identifications() and state is not None:
                place = profile.describe(state).place
                asked |= set() if place is None else {place}
        functions = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
        for place in asked:
            table, address = tables.split(place)
            function = functions[table]
            for unit in range(1, 248):
                drive = Drive(unit)
                for count in (1, 2):
                    drive.answer(bytes([unit, function]) + address.to_bytes(2, "big") + count.to_bytes(2, "big"))
                assert drive.commands == [], f"{tables.shown(place)} of unit {unit}"


@needs_terminals
class TestTheDoctor:
    @staticmethod
    def findings(answer: Callable[[bytes], bytes], unit: int | None) -> list[Finding]:
        with on_a_terminal(answer) as path:
            return list(examine(path, unit, listen=0.01))

    def test_names_it(self) -> None:
        drive = Drive(7)
        [found] = [each for each in self.findings(drive.answer, 7) if each.wrong]
        assert (found.name, found.unit, found.values["protocol"]) == ("other_protocol", 7, "huanyang")
        # On a busy machine its first answer may come too late, and it is met at the settings that are tried next.
        assert re.search(r"unit 7 answers at \d+ 8[NE][12] in Huanyang's own protocol, and not in Modbus", found.text)
        assert drive.commands == []

    def test_names_one_that_answers_modbus_so(self) -> None:
        """With its own frames, whatever it is asked."""
        answer = lambda request: framed(f"{request[0]:02X} 03 01 09")  # noqa: E731
        [found] = [each for each in self.findings(answer, 1) if each.wrong]
        assert (found.name, found.unit) == ("other_protocol", 1)

    def test_the_command_ends_as_with_a_silent_unit(self) -> None:
        with on_a_terminal(Drive().answer) as path:
            told = CliRunner().invoke(cli, ["doctor", path, "--unit", "1", "--listen", "0.01"])
        assert told.exit_code == 3
        assert "Huanyang's own protocol" in told.stdout


@pytest.mark.parametrize("unit", [None, 1, 9])
def test_a_doctor_asks_little_more_of_a_silent_line(unit: int | None) -> None:
    asked: list[str] = []

    def opened(_: object, **options: Any) -> Bus:
        bus = Bus(Simulator({200: "gd350"}, transport="process", clock="virtual"), **options)
        scan = bus.scan

        def scanned(units: Any, *rest: Any, protocol: str = "auto") -> Any:
            asked.append(protocol)
            return scan(units, *rest, protocol=protocol)

        bus.scan = scanned  # type: ignore[method-assign, assignment]
        return bus

    [found] = [each for each in examine("/dev/line", unit, open=opened) if each.wrong]
    assert found.name == "nobody_answers"
    foreign = asked.count("huanyang")
    settings = len(list(candidates(Settings(19200), full=False)))
    assert foreign == settings + (3 if unit is None else 1)
    assert set(asked) == {"modbus", "huanyang"}
