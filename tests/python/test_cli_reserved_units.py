"""Units that the specification reserves, on the command line and in `drivebus.toml`: who may be asked, and how."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from drivebus import Bus, NotAllowed, aio
from drivebus.cli import cli
from drivebus.doctor import examine
from drivebus.site import FILE, Site

from .odd_slave import framed, good, on_a_socket, on_a_terminal

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals")

RESERVED = "the specification reserves it: give --reserved if a unit has it anyway"
BEHIND = "a gateway hands on what is written to it to every unit behind it: if it is a device, give --reserved"


class Heard:
    """What was asked on a line, address and PDU."""

    def __init__(self) -> None:
        self.asked: list[bytes] = []

    def __call__(self, request: bytes) -> bytes:
        self.asked.append(request)
        return good(request)

    @property
    def units(self) -> set[int]:
        return {request[0] for request in self.asked}

    @property
    def writes(self) -> list[bytes]:
        return [request for request in self.asked if request[1] in (5, 6, 16)]


@contextmanager
def line(kind: str) -> Iterator[tuple[list[str], Heard]]:
    """The options for a line of this *kind*, and what is heard there."""
    heard = Heard()
    if kind == "terminal":
        with on_a_terminal(heard) as path:
            yield ["--port", path, "--format", "8N1"], heard
    else:
        with on_a_socket(heard, mbap=kind == "tcp") as url:
            yield ["--port", url], heard


def run(*words: str) -> Result:
    return CliRunner(env={"DRIVEBUS_PORT": None}).invoke(cli, words, prog_name="drivebus")


def told(result: Result) -> str:
    return " ".join(result.stderr.split())


READ = ["read", "3000H", "--profile", "gd350", "--trust-profile"]
WRITE = ["write", "6300H=1", "--profile", "gd350", "--trust-profile", "--force", "--yes"]


@pytest.mark.parametrize("kind", ["terminal", "socket"])
@pytest.mark.parametrize("unit", ["248", "250", "254", "1,250", "240-250"])
def test_on_a_serial_line_the_switch_is_named_and_nothing_is_sent(kind: str, unit: str) -> None:
    with line(kind) as (port, heard):
        for words in (READ, WRITE, ["scan", "--units", unit]):
            where = [] if words[0] == "scan" else ["--unit", unit]
            done = run(*port, *where, *words)
            assert done.exit_code == 2
            assert "out of range; allowed is 1 to 247; the specification reserves" in told(done)
            assert RESERVED in told(done)
            assert "reserved=True" not in told(done)
        assert heard.asked == []


@pytest.mark.parametrize("kind", ["terminal", "socket"])
def test_on_a_serial_line_they_are_asked_with_it(kind: str) -> None:
    with line(kind) as (port, heard):
        for unit in ("248", "254"):
            done = run(*port, "--reserved", "--unit", unit, *READ)
            assert (done.exit_code, "122.88" in done.stdout) == (0, True), done.output
        done = run(*port, "--unit", "250", *WRITE, "--reserved")
        assert done.exit_code == 0, done.output
        assert heard.units == {248, 250, 254}
        assert {request[0] for request in heard.writes} == {250}


@pytest.mark.parametrize("kind", ["terminal", "socket"])
@pytest.mark.parametrize(("unit", "why"), [("0", "nobody answers"), ("255", "is a gateway itself, over tcp:// only")])
def test_0_and_255_are_of_no_serial_line(kind: str, unit: str, why: str) -> None:
    with line(kind) as (port, heard):
        for words in (["--unit", unit, *READ], ["scan", "--units", unit]):
            done = run(*port, "--reserved", *words)
            assert (done.exit_code, why in told(done)) == (2, True), told(done)
            assert "broadcast()" not in told(done)
        assert heard.asked == []


def test_over_tcp_they_are_read_without_more_and_all_but_0_written_to() -> None:
    with line("tcp") as (port, heard):
        for unit in (0, *range(248, 256)):
            done = run(*port, "--unit", str(unit), *READ)
            assert (done.exit_code, "122.88" in done.stdout) == (0, True), done.output
        assert heard.units == {0, *range(248, 256)}
        assert heard.writes == []
        done = run(*port, "--unit", "255", *WRITE)
        assert done.exit_code == 0, done.output
        assert {request[0] for request in heard.writes} == {255}


@pytest.mark.parametrize(
    "words",
    [WRITE, ["run", "5", "--yes"], ["stop"], ["coast"], ["reset", "--yes"], ["prepare", "--yes"], ["jog", "--yes"]],
    ids=lambda words: words[0],
)
def test_what_writes_to_unit_0_over_tcp_is_asked_for_by_name(words: list[str]) -> None:
    with line("tcp") as (port, heard):
        done = run(*port, "--unit", "0", "--profile", "gd350", *[w for w in words if w not in ("--profile", "gd350")])
        assert done.exit_code == 2
        assert BEHIND in told(done)
        assert "broadcast()" not in told(done)
        assert heard.asked == []


def test_unit_0_over_tcp_is_written_to_with_the_switch() -> None:
    with line("tcp") as (port, heard):
        done = run(*port, "--reserved", "--unit", "0", *WRITE)
        assert done.exit_code == 0, done.output
        assert {request[0] for request in heard.writes} == {0}


@pytest.mark.parametrize("unit", ["0", "255"])
@pytest.mark.parametrize(
    "words",
    [["status"], ["info"], ["monitor", "--count", "1"], ["record", "{0}/a.csv", "--count", "1"], ["faults"]],
    ids=lambda words: words[0],
)
def test_every_command_that_looks_does_without_more_over_tcp(words: list[str], unit: str, tmp_path: Path) -> None:
    with line("tcp") as (port, heard):
        named = ["--profile", "gd350", "--trust-profile", "--unverified"]
        done = run(*port, "--unit", unit, *named, *(word.format(tmp_path) for word in words))
        assert heard.units == {int(unit)}, done.output
        assert heard.writes == []
        assert BEHIND not in told(done)


def test_several_units_go_over_one_bus_each_by_its_own_right() -> None:
    with line("tcp") as (port, heard):
        done = run(*port, "--unit", "0,1,255", *READ)
        assert (done.exit_code, done.stdout.count("122.88")) == (0, 3), done.output
        done = run(*port, "--unit", "0,1", "--profile", "gd350", "--trust-profile", "monitor", "--count", "1", "3000H")
        assert "no answer" not in done.output
        heard.asked.clear()
        done = run(*port, "--unit", "0,1,255", *WRITE)
        assert done.exit_code == 2
        assert BEHIND in told(done)
        assert {request[0] for request in heard.writes} == {1, 255}


def test_a_scan_over_tcp_asks_whom_it_is_given() -> None:
    with line("tcp") as (port, heard):
        done = run("--json", *port, "scan", "--units", "0,248-255", "--protocol", "modbus")
        assert done.exit_code == 0, done.output
        assert [json.loads(each)["unit"] for each in done.stdout.splitlines() if each[0] == "{"] == [
            0,
            *range(248, 256),
        ]
        assert heard.units == {0, *range(248, 256)}
        assert heard.writes == []
        heard.asked.clear()
        assert run(*port, "scan", "--units", "0-256").exit_code == 2
        assert heard.asked == []


@pytest.mark.parametrize("kind", ["terminal", "socket", "tcp"])
def test_requests_by_hand(kind: str, tmp_path: Path) -> None:
    tcp = kind == "tcp"
    script = tmp_path / "requests"
    with line(kind) as (port, heard):
        for unit, plain, named in (
            ("00", tcp, tcp),
            ("F8", tcp, True),
            ("FE", tcp, True),
            ("FF", tcp, tcp),
        ):
            words = f"{unit} 03 00 05 00 01"
            script.write_text(f"{words}\n", encoding="utf-8")
            for switch, allowed in (([], plain), (["--reserved"], named)):
                for how in (words.split(), ["--script", str(script)]):
                    heard.asked.clear()
                    done = run(*port, *switch, "raw", *how)
                    sent = bytes.fromhex(words) in heard.asked
                    assert (done.exit_code, sent) == ((0, True) if allowed else (2, False)), (unit, done.output)
                    if not allowed:
                        assert f"no unit {unit} answers; the first byte is the unit, 01 to F7" in told(done)
                        assert ("--reserved" in told(done)) == (unit in ("F8", "FE"))
        heard.asked.clear()
        done = run(*port, "raw", "--yes", "--force", *WRITE_TO_0)
        assert (done.exit_code, heard.asked) == (2, [])
        assert (BEHIND in told(done)) == tcp
        if tcp:
            assert run(*port, "--reserved", "raw", "--yes", "--force", *WRITE_TO_0).exit_code == 0
            assert heard.writes == [bytes.fromhex("00 06 20 00 00 01")]


WRITE_TO_0 = ["00", "06", "20", "00", "00", "01"]


def site(path: Path, text: str) -> Path:
    file = path / FILE
    file.write_text(text, encoding="utf-8")
    return file


def test_the_file_says_so_of_a_line(tmp_path: Path) -> None:
    with on_a_terminal(heard := Heard()) as path:
        file = site(
            tmp_path,
            f'[lines.hall]\nport = "{path}"\nformat = "8N1"\nreserved = true\n'
            '[drives.pump]\nline = "hall"\nunit = 250\nprofile = "gd350"\n',
        )
        known = Site.load(file)
        assert (known.drives["pump"].unit, known.lines["hall"].reserved) == (250, True)
        done = run("--config", str(file), "--drive", "pump", "--trust-profile", "--profile", "gd350", "read", "3000H")
        assert (done.exit_code, "122.88" in done.stdout) == (0, True), done.output
        assert run("--config", str(file), "--port", "hall", "--unit", "254", *READ).exit_code == 0
        assert heard.units == {250, 254}


@pytest.mark.parametrize(
    ("port", "reserved", "unit", "said"),
    [
        ("/dev/ttyUSB0", "", 0, "not a whole number from 1 to 247; 0 is the broadcast address, which nobody answers"),
        (
            "/dev/ttyUSB0",
            "",
            250,
            "not a whole number from 1 to 247; the specification reserves it: say reserved = true in [lines.hall] if a "
            "unit has it anyway",
        ),
        (
            "socket://h:1",
            "reserved = false",
            248,
            "not a whole number from 1 to 247; the specification reserves it: say reserved = true in [lines.hall] if a "
            "unit has it anyway",
        ),
        (
            "/dev/ttyUSB0",
            "reserved = true",
            255,
            "not a whole number from 1 to 247; 255 is a gateway itself, over tcp:// only",
        ),
        ("/dev/ttyUSB0", "reserved = true", 254, None),
        (
            "/dev/ttyUSB0",
            "reserved = true",
            0,
            "not a whole number from 1 to 247; 0 is the broadcast address, which nobody answers",
        ),
        ("tcp://h:502", "", 0, None),
        ("TCP://h:502", "", 255, None),
        ("tcp://h:502", "", 256, "not a whole number from 1 to 247; no frame can carry 256"),
        ("/dev/ttyUSB0", "reserved = true", -1, "not a whole number from 1 to 247; no frame can carry -1"),
        ("/dev/ttyUSB0", "reserved = true", '"1"', "not a whole number from 1 to 247"),
        ("/dev/ttyUSB0", "reserved = true", 1.5, "not a whole number from 1 to 247"),
    ],
)
def test_a_unit_that_the_line_has_not_is_told_with_its_place(
    tmp_path: Path, port: str, reserved: str, unit: object, said: str | None
) -> None:
    text = f'[lines.hall]\nport = "{port}"\n{reserved}\n[drives.p]\nline = "hall"\nunit = {unit}\n'
    file = site(tmp_path, text)
    if said is None:
        assert Site.load(file).drives["p"].unit == unit
        return
    with pytest.raises(NotAllowed) as error:
        Site.load(file)
    assert str(error.value).splitlines()[1:] == [f"{file}:6: unit = {unit}: {said}"]


def test_what_is_no_switch_is_told(tmp_path: Path) -> None:
    file = site(tmp_path, '[lines.hall]\nport = "a"\nreserved = "yes"\n')
    with pytest.raises(NotAllowed, match='3: reserved = "yes": neither true nor false'):
        Site.load(file)


def test_stop_all_reaches_one_that_is_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was asked for by name when it was kept; 0 over tcp:// may be all units behind a gateway, and is left out."""
    from drivebus.site import families_on, remember

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    for port, kept in (("/dev/ttyX9", {1, 250}), ("tcp://h:502", {1, 250, 255})):
        for unit in (0, 1, 250, 255, 256):
            remember(port, unit, "gd350")
        assert set(families_on(port)) == kept
    asked: list[bytes] = []

    def a_gd350(request: bytes) -> bytes:
        asked.append(request)
        if request[1] != 3:
            return good(request)
        words = [0x01A0 if word == 0x2103 else 3 for word in range(int.from_bytes(request[2:4], "big"), 0x10000)]
        count = int.from_bytes(request[4:6], "big")
        data = b"".join(word.to_bytes(2, "big") for word in words[:count])
        return framed((request[:2] + bytes([2 * count]) + data).hex())

    with on_a_terminal(a_gd350) as path:
        remember(path, 250, "gd350")
        done = run("--port", path, "--format", "8N1", "stop", "--all")
        assert (done.exit_code, {request[0] for request in asked}) == (0, {250}), done.output
        assert bytes.fromhex("FA 06 20 00 00 05") in asked


def test_stop_all_asks_nothing_of_the_unit_that_the_environment_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drivebus.site import remember

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with line("tcp") as (port, heard):
        remember(port[1], 3, "gd350")
        words = [*port, "stop", "--all", "--within", "0"]
        done = CliRunner(env={"DRIVEBUS_PORT": None, "DRIVEBUS_UNIT": "0"}).invoke(cli, words, prog_name="drivebus")
        assert heard.units == {3}, done.output
        assert BEHIND not in told(done)


class TestThePoll:
    def asked(self, url: str, unit: int, **how: bool) -> list[int]:
        with Bus(url, parity="N", timeout=5.0, retries=0, **how) as bus:  # type: ignore[arg-type]  # flags
            with bus.poll({unit: [(5, 1)]}) as poll:
                [sample] = poll.batch(1)
            assert sample.unit == unit
            return [int(value) for value in sample.values()]

    @pytest.mark.parametrize("unit", [0, 248, 255])
    def test_over_tcp(self, unit: int) -> None:
        with line("tcp") as (port, _):
            assert self.asked(port[1], unit) == [5]

    def test_on_a_serial_line(self) -> None:
        with line("terminal") as (port, heard):
            assert self.asked(port[1], 250, reserved=True) == [5]
            heard.asked.clear()
            for unit, how in ((250, {}), (0, {"reserved": True}), (255, {"reserved": True})):
                with pytest.raises(NotAllowed, match=rf"unit {unit} is .*allowed is 1 to 247"):
                    self.asked(port[1], unit, **how)
            assert heard.asked == []

    def test_for_event_loops(self) -> None:
        async def polled(url: str) -> list[int]:
            async with aio.Bus(url, timeout=5.0) as bus, bus.poll({255: [(5, 1)], 0: [(6, 1)]}) as poll:
                return sorted(int(value) for sample in await poll.batch(2) for value in sample.values())

        with line("tcp") as (port, _):
            assert asyncio.run(polled(port[1])) == [5, 6]


def test_a_drive_on_a_read_only_bus_is_read_at_0() -> None:
    with line("tcp") as (port, heard):
        with Bus(port[1], timeout=5.0, read_only=True) as bus:
            drive = bus.drive(0, "gd350", trust_profile=True)
            assert drive.read_words(0x3000) == [0x3000]
            with pytest.raises(NotAllowed):
                drive.write("P00.11", 5.0)
            with pytest.raises(NotAllowed):
                drive.stop()
        assert heard.writes == []


@pytest.mark.parametrize(
    ("kind", "unit", "how"), [("tcp", 255, {}), ("tcp", 0, {}), ("terminal", 250, {"reserved": True})]
)
def test_the_doctor_examines_them(kind: str, unit: int, how: dict[str, bool]) -> None:
    with line(kind) as (port, heard):
        found = list(examine(port[1], unit, parity="N", listen=0.01, echoes=2, **how))  # type: ignore[arg-type]  # flags
        assert not [each for each in found if each.name == "nobody_answers"], found
        assert heard.units == {unit}
        assert heard.writes == []
        words = ["doctor", port[1], "--unit", str(unit), "--listen", "0.01", "--format", "8N1"]
        done = run(*words, *(["--reserved"] if how else []))
        assert done.exit_code in (0, 4), done.output


@pytest.mark.parametrize("unit", [0, 250, 255])
def test_the_doctor_refuses_what_a_serial_line_has_not(unit: int) -> None:
    with line("terminal") as (port, heard):
        with pytest.raises(NotAllowed, match=f"unit {unit} is .*allowed is 1 to 247"):
            examine(port[1], unit)
        done = run("doctor", port[1], "--unit", str(unit))
        assert done.exit_code == 2
        assert "1 to 247" in told(done)
        assert heard.asked == []
    with pytest.raises(NotAllowed, match="reserved 1 is neither True nor False"):
        examine("/dev/null", reserved=1)  # type: ignore[arg-type]  # that is what is tried


@pytest.mark.parametrize("unit", [247, 248, 254, 255])
def test_a_log_in_which_they_answer_is_told_as_one_of_others(unit: int, tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    read, answer = (framed(f"{unit:02X} {pdu}").hex(" ") for pdu in ("03 21 00 00 02", "03 04 00 03 00 00"))
    log.write_text(f"{read}\n{answer}\n", encoding="utf-8")
    done = run("decode", str(log))
    told = " ".join(done.stdout.split())
    assert (done.exit_code, told) == (0, f"unit {unit}: read 2 words at 2100H -> 2100H = 3, 2101H = 0"), done.output
    named = run("decode", "--profile", f"{unit}=gd350", str(log))
    assert f"unit {unit}: read status_word_1" in " ".join(named.stdout.split()), named.output
    other = framed(f"{unit - 1:02X} 03 04 00 03 00 00").hex(" ")
    log.write_text(f"{read}\n{other}\n", encoding="utf-8")
    assert "2100H = 3" not in run("decode", str(log)).stdout


def test_what_is_advised_has_the_switch() -> None:
    with line("terminal") as (port, _):
        silent: Callable[[bytes], bytes] = lambda _: b""  # noqa: E731
        with on_a_terminal(silent) as path:
            done = run("--port", path, "--format", "8N1", "--unit", "250", "--reserved", *READ)
            assert done.exit_code == 3
            assert f"`drivebus doctor {path} --unit 250 --format 8N1 --reserved`" in told(done)
        assert run(*port, "--unit", "250", "--reserved", "info").exit_code in (0, 2)
