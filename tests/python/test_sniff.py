"""Listening to others: what is heard, as exchanges, on a line of one's own, of another program's, and of nobody's."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

import drivebus
from drivebus import Exchange
from drivebus.capture import Captured, Writer, read
from drivebus.cli import cli
from drivebus.cli.capture_file import CaptureFile
from drivebus.cli.present.sniff_table import SniffTable
from drivebus.sim import Simulator
from drivebus.sniffer import Families, Figures, exchanges_in
from drivebus.sniffer.statistics import RegisterFigures, UnitFigures

LINE = drivebus.SerialFormat(parity="N")


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500"}, parity="N", transport="pty") as simulator:
        yield simulator


@contextmanager
def hearing(bus: drivebus.Bus, **keywords: object) -> Iterator[list[Exchange]]:
    """What is heard on *bus* until a request that ends it is heard."""
    heard: list[Exchange] = []
    begun = threading.Event()

    def listen() -> None:
        told = drivebus.sniff(bus, tap=lambda _at, _data: begun.set(), **keywords)  # type: ignore[arg-type]
        for exchange in told:
            heard.append(exchange)
            if exchange.request is not None and exchange.request[1:6] == b"\x03\x21\x01\x00\x02":
                return

    thread = threading.Thread(target=listen)
    thread.start()
    try:
        while not begun.is_set():
            bus.read(1, 0x2102)
        yield heard
        bus.read(1, 0x2101, 2)
    finally:
        thread.join(30)
        assert not thread.is_alive()


def test_a_bus_hears_what_it_asks_itself(simulator: Simulator) -> None:
    with drivebus.Bus(simulator.port, parity="N") as bus:
        drive = bus.drive(1)
        with hearing(bus, profiles="gd350") as heard:
            drive.write("P00.11", 5.0)
            with pytest.raises(drivebus.Refused):
                bus.read(1, 0x9999)
    written = next(exchange for exchange in heard if exchange.function == 6)
    assert dict(written.values) == {"P00.11": 5.0}
    refused = next(exchange for exchange in heard if isinstance(exchange.error, drivebus.Refused))
    assert refused.request is not None
    assert refused.request.hex() == "010399990001" + refused.request[-2:].hex()
    assert refused.turnaround is not None


def test_what_another_program_asks_is_heard(simulator: Simulator) -> None:
    # The other program has the port; this one is its guest.
    other = (
        "import sys, drivebus\n"
        "with drivebus.Bus(sys.argv[1], parity='N') as bus:\n"
        "    print('ready', flush=True)\n"
        "    for line in sys.stdin:\n"
        "        bus.read(2, 0x7000 + int(line), 1)\n"
    )
    with (
        subprocess.Popen(
            [sys.executable, "-c", other, simulator.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process,
        drivebus.Bus(simulator.port, parity="N") as bus,
    ):
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        with hearing(bus, profiles={2: "vfd500"}) as heard:
            process.stdin.write("0\n")
            process.stdin.flush()
            while not any(exchange.unit == 2 for exchange in heard):
                bus.read(1, 0x2102)
        process.stdin.close()
    theirs = [exchange for exchange in heard if exchange.unit == 2]
    assert theirs[0].profile == "vfd500"
    assert theirs[0].answer is not None


def test_nothing_is_sent_by_who_listens(simulator: Simulator) -> None:
    with drivebus.Bus(simulator.port, parity="N", read_only=True) as bus:
        before = len(simulator.line.trace())
        assert list(drivebus.sniff(bus, duration=0.2)) == []
        assert len(simulator.line.trace()) == before


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"duration": -1}, "duration -1 is out of range"),
        ({"profiles": "nobody"}, "nobody"),
        ({"profiles": {0: "gd350"}}, "unit 0"),
        ({"baudrate": 3}, "baud rate 3"),
    ],
)
def test_a_wrong_argument_opens_nothing(arguments: dict[str, object], why: str) -> None:
    with pytest.raises(drivebus.NotAllowed, match=why):
        drivebus.sniff("/dev/nowhere", **arguments)  # type: ignore[arg-type]


def test_a_port_that_is_not_there_is_told() -> None:
    with pytest.raises(drivebus.PortError):
        drivebus.sniff("/dev/nowhere")


def frame(body: str) -> bytes:
    data = bytes.fromhex(body)
    return data + drivebus.crc16(data).to_bytes(2, "little")


def talk(*bodies: str) -> list[Captured]:
    """Requests (`>`) and answers (`<`), a tenth of a second apart."""
    return [Captured(0.1 * at + 1, frame(body[1:]), body[0] == ">") for at, body in enumerate(bodies)]


def test_a_family_is_told_or_guessed_or_left_open() -> None:
    told = Families()
    list(exchanges_in(talk(">01 03 21 03 00 01", "<01 03 02 01 A0"), LINE, told))
    assert (told.of(1), told.is_guess(1)) == (drivebus.Profile.builtin("gd350"), False)
    guessed = Families()
    twice = ">02 03 70 00 00 08", "<02 03 10" + " 00 00" * 8, ">02 03 70 01 00 01", "<02 03 02 00 00"
    list(exchanges_in(talk(*twice), LINE, guessed))
    profile = guessed.of(2)
    assert profile is not None
    assert (profile.name, guessed.is_guess(2)) == ("vfd500", True)
    nobody = Families()
    [exchange] = exchanges_in(talk(">03 03 4E 20 00 04", "<03 03 08 00 01 00 02 00 03 00 04"), LINE, nobody)
    assert nobody.of(3) is None
    assert dict(exchange.values) == {0x4E20: 1, 0x4E21: 2, 0x4E22: 3, 0x4E23: 4}


POLLED = ">01 03 30 00 00 02", "<01 03 04 00 00 00 00"
"""What all Goodrives mean the same by."""
BEFORE = ">01 03 30 03 00 03", "<01 03 06" + " 00 00" * 3
"""Another request: one alone says nothing."""


def test_one_read_of_a_few_words_is_nobody_s() -> None:
    """A thermometer: 24.6 degrees, 63.3 % and a count. No family from one read, however often it comes."""
    thermometer = ">05 03 00 00 00 03", "<05 03 06 00 F6 02 79 00 0C"
    families = Families()
    heard = list(exchanges_in(talk(*thermometer * 3), LINE, families))
    assert [dict(each.values) for each in heard] == [{0: 0xF6, 1: 0x279, 2: 12}] * 3
    assert families.of(5) is None
    # Nor from several: P00.01 of a Goodrive ends at 2, and so on.
    list(exchanges_in(talk(*thermometer, ">05 03 00 01 00 01", "<05 03 02 02 79", *thermometer), LINE, families))
    assert families.of(5) is None


@pytest.mark.parametrize(
    ("said", "family"),
    [
        # 2100H of a Goodrive is 1 to 6; 3007H of it ends at 250.0 %.
        (("<01 03 02 00 03", "<01 03 02 00 00"), "gd350"),
        (("<01 03 02 00 07", "<01 03 02 00 00"), None),
        (("<01 03 02 00 03", "<01 03 02 40 00"), None),
        # What it refuses as no address, the family must not have.
        (("<01 03 02 00 03", "<01 83 02"), None),
        (("<01 03 02 00 03", "<01 83 09"), "gd350"),
    ],
)
def test_a_family_is_guessed_only_where_it_can_say_what_was_said(said: tuple[str, str], family: str | None) -> None:
    asked = ">01 03 21 00 00 01", ">01 03 30 07 00 01"
    pairs = [text for pair in zip(asked, said, strict=True) for text in pair]
    families = Families()
    list(exchanges_in(talk(*BEFORE, *pairs), LINE, families))
    profile = families.of(1)
    assert (None if profile is None else profile.name) == family


def test_a_guess_is_marked_in_text_as_it_is_in_json(tmp_path: Path) -> None:
    path = kept(tmp_path / "polled.pcapng", *BEFORE, *POLLED)
    shown = CliRunner().invoke(cli, ["decode", str(path)]).stdout.splitlines()
    assert ["unit 1 (gd350, guessed): " in line for line in shown] == [False, True]
    told = CliRunner().invoke(cli, ["--profile", "1=gd350", "decode", str(path)]).stdout
    assert "guessed" not in told
    records = CliRunner().invoke(cli, ["--json", "decode", str(path)]).stdout.splitlines()
    assert [json.loads(record)["guessed"] for record in records] == [False, True]


def test_a_guess_stays_where_the_next_register_does_not_tell_which_family_it_is() -> None:
    # 2000H is a command of one of them and a setpoint of another; 9999H is refused, so nobody has it.
    other = ">01 06 20 00 00 07", "<01 06 20 00 00 07", ">01 03 99 99 00 01", "<01 83 02"
    told = ">01 03 20 01 00 01", "<01 03 02 00 00"
    families = Families()
    _, *heard = exchanges_in(talk(*BEFORE, *POLLED, *other, *POLLED, *told, *other, *POLLED), LINE, families)
    assert [next(iter(each.values), None) for each in heard] == [
        "running_frequency", 0x2000, None, "running_frequency", "set_frequency", "control_command", None,
        "running_frequency",
    ]  # fmt: skip
    assert families.withdrawn() == []
    profile = families.of(1)
    assert profile is not None
    assert (profile.name, families.is_guess(1)) == ("gd350", True)


def test_a_guess_that_does_not_hold_is_taken_back_and_that_is_said(tmp_path: Path) -> None:
    foreign = ">01 03 9A 00 00 01", "<01 03 02 00 01"
    families = Families()
    _, *heard = exchanges_in(talk(*BEFORE, *POLLED, *foreign, *POLLED), LINE, families)
    assert [next(iter(each.values)) for each in heard] == ["running_frequency", 0x9A00, 0x3000]
    assert families.withdrawn() == [(1, "gd350", 0x9A00)]
    assert families.withdrawn() == [], "once"
    path = kept(tmp_path / "polled.pcapng", *BEFORE, *POLLED, *foreign, *POLLED)
    done = CliRunner().invoke(cli, ["decode", str(path)])
    assert done.stderr.startswith(
        "unit 1 was taken for gd350 by what it was asked and answered. What came of 9A00H now "
    )
    assert "`--profile 1=FAMILY` names them." in done.stderr
    named = CliRunner().invoke(cli, ["--profile", "1=gd350", "decode", str(path)])
    assert [" running_frequency" in line for line in named.stdout.splitlines()] == [False, True, False, True]
    assert named.stderr == ""


def test_figures_count_and_say_what_is_wrong() -> None:
    figures = Figures(LINE.t35)
    silent = [">05 03 21 00 00 01"] * 30
    answered = [">01 03 21 00 00 01", "<01 03 02 00 03"] * 10
    refused = [">02 03 21 00 00 01", "<02 83 02"] * 30
    for exchange in exchanges_in(talk(*silent, *answered, *refused), LINE):
        figures.take(exchange)
    assert {unit: (each.requests, each.answers) for unit, each in figures.units.items()} == {
        5: (30, 0),
        1: (10, 10),
        2: (30, 30),
    }
    assert (figures.units[5].silent, figures.units[5].repeated, figures.units[2].refusals) == (30, 29, {2: 30})
    register = figures.units[1].registers[0x2100]
    assert (register.reads, register.writes, register.value, register.changes) == (10, 0, 3, 0)
    assert register.period == pytest.approx(0.2)
    assert [hint.split(":")[0] for hint in figures.hints()] == [
        "unit 2 refuses 30 of 30 requests (02H)",
        "unit 5 was asked 30 times and never answered",
    ]


def kept(path: Path, *bodies: str) -> Path:
    """A capture of what `talk` makes of *bodies*."""
    with path.open("wb") as stream:
        writer = Writer(stream, "COM3", "19200 8N1")
        for each in talk(*bodies):
            writer.write(each)
    return path


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return kept(
        tmp_path / "seen.pcapng",
        ">01 03 21 00 00 01", "<01 03 02 00 03", ">01 06 20 01 07 D0", "<01 06 20 01 07 D0",
        ">01 03 21 00 00 01", "<01 03 02 00 01", ">09 03 21 00 00 01", ">01 03 99 99 00 01", "<01 83 02",
    )  # fmt: skip


def test_a_capture_that_breaks_off_does_not_blame_the_unit(tmp_path: Path) -> None:
    path = kept(tmp_path / "cut.pcapng", ">01 03 21 00 00 01", "<01 03 02 00 03", ">01 03 21 00 00 01")
    done = CliRunner().invoke(cli, ["--profile", "1=gd350", "decode", str(path)])
    assert done.stdout.splitlines()[-1].endswith("-> did not answer before the end")


def test_the_commands_show_a_capture(capture: Path) -> None:
    done = CliRunner().invoke(cli, ["--profile", "1=gd350", "decode", str(capture)])
    assert done.exit_code == 0, done.output
    lines = [line[30:] for line in done.stdout.splitlines()]
    assert lines[0].startswith("unit 1: read status_word_1 (2100H) -> status_word_1 = 3 (stopped), after ")
    assert lines[1].startswith("unit 1: write set_frequency = 20.00 Hz -> took set_frequency = 20.00 Hz, after ")
    assert lines[3] == "unit 9: read 2100H -> did not answer"
    assert lines[4].startswith("unit 1: read 9999H -> refused: exception 02H illegal_address, after ")
    as_json = CliRunner().invoke(cli, ["--json", "decode", str(capture)])
    rows = [json.loads(line) for line in as_json.stdout.splitlines()]
    assert rows[0]["values"] == {"0x2100": 3}
    assert [row.get("exit_code") for row in rows] == [None, None, None, 3, 4]


def test_sniff_writes_what_it_hears(simulator: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "heard.pcapng"
    words = ["-f", "8N1", "--json", "sniff", simulator.port, "-n", "4", "-w", str(path)]
    with (
        drivebus.Bus(simulator.port, parity="N") as bus,
        subprocess.Popen([sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, text=True) as process,
    ):
        while process.poll() is None:
            bus.read(1, 0x2100, 2)
            bus.read(1, 0x3000, 4)
        assert process.stdout is not None
        rows = [json.loads(line) for line in process.stdout]
    assert process.returncode == 0
    assert [row["unit"] for row in rows[:4]] == [1, 1, 1, 1]
    named = [row["values"]["status_word_1"] for row in rows[2:4] if "status_word_1" in row["values"]]
    assert named == [{"value": 3, "label": "stopped"}]
    assert {(row["profile"], row["guessed"]) for row in rows[2:4]} == {("gd350", True)}
    assert rows[4]["answered"] == 4
    kept = list(read(path))
    assert [each.asks for each in kept] == [True, False] * 4
    # What is there already is not replaced unasked.
    again = CliRunner().invoke(cli, ["sniff", simulator.port, "-w", str(path), "--for", "0"])
    assert again.exit_code == 2
    assert "is there already; give another name, or --force" in again.stderr
    assert list(read(path)) == kept


def test_a_capture_whose_file_is_removed_says_so(
    tmp_path: Path, capture: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is looked at once a second of the line's time, and in the end; what stands there now is not touched."""
    frames = list(read(capture))[:2]
    path = tmp_path / "heard.pcapng"
    with CaptureFile(str(path), False, "port", "9600 8N1", "upper") as kept:
        kept.write(replace(frames[0], time=100.0))
        path.unlink()
        kept.write(replace(frames[1], time=100.9))
        assert not kept.gone
        kept.write(replace(frames[0], time=101.0))
        assert "it was removed" in kept.gone
        path.write_text("mine")
    assert path.read_text() == "mine"
    assert capsys.readouterr().err.count("heard.pcapng was not there any more: it was removed") == 1
    with CaptureFile(str(tmp_path / "new.pcapng"), False, "port", "9600 8N1", "upper") as kept:
        (tmp_path / "new.pcapng").rename(tmp_path / "old.pcapng")
        (tmp_path / "new.pcapng").write_text("mine")
    assert (tmp_path / "new.pcapng").read_text() == "mine"


def test_sniff_says_by_its_exit_code_that_its_file_was_removed(simulator: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "heard.pcapng"
    words = ["-f", "8N1", "--json", "sniff", simulator.port, "-w", str(path)]
    with (
        drivebus.Bus(simulator.port, parity="N") as bus,
        subprocess.Popen(
            [sys.executable, "-m", "drivebus", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process,
    ):
        assert process.stdout is not None
        heard = threading.Thread(target=process.stdout.readline)
        heard.start()
        while heard.is_alive():
            bus.read(1, 0x2100, 3)
        path.unlink()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert (process.returncode, "was not there any more" in err) == (1, True)


def sniffed(port: str, *words: str) -> Result:
    return CliRunner().invoke(cli, ["--format", "8N1", "sniff", port, *words])


def test_who_hears_nothing_is_shown_what_looks_at_that_line(simulator: Simulator) -> None:
    done = sniffed(simulator.port, "--for", "0")
    assert done.exit_code == 0
    assert done.stderr.splitlines()[1] == "0 requests to 0 units, 0 answered."
    assert f"`drivebus doctor {simulator.port} --format 8N1` looks at the line." in done.stderr


def test_a_capture_without_a_frame_leaves_no_file(simulator: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "new.pcapng"
    for port, code in (("/dev/nowhere", 5), (simulator.port, 0), (simulator.port, 0)):
        done = sniffed(port, "-w", str(path), "--for", "0")
        assert (done.exit_code, path.exists()) == (code, False), done.stderr
    assert f"{path} was not written: there was nothing to write." in done.stderr


def test_a_capture_without_a_frame_leaves_an_older_one_as_it_is(simulator: Simulator, capture: Path) -> None:
    before = capture.read_bytes()
    for port, code in (("/dev/nowhere", 5), (simulator.port, 0)):
        assert sniffed(port, "-w", str(capture), "--force", "--for", "0").exit_code == code
        assert capture.read_bytes() == before


def test_a_capture_replaces_an_older_one_and_what_is_empty(simulator: Simulator, capture: Path, tmp_path: Path) -> None:
    capture.write_bytes(capture.read_bytes() * 9)
    empty = tmp_path / "empty.pcapng"
    empty.touch()
    for words in (["-w", str(capture), "--force"], ["-w", str(empty)]):
        command = [sys.executable, "-m", "drivebus", "-f", "8N1", "sniff", simulator.port, "-n", "1", *words]
        with (
            drivebus.Bus(simulator.port, parity="N") as bus,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process,
        ):
            while process.poll() is None:
                bus.read(1, 0x2100)
            assert process.stderr is not None
            assert "1 request to 1 unit, 1 answered." in process.stderr.read()
        assert [each.asks for each in read(Path(words[1]))] == [True, False]


@pytest.mark.parametrize(
    ("words", "code", "why"),
    [
        (["sniff"], 2, "no port: give it"),
        (["sniff", "/dev/nowhere"], 5, "/dev/nowhere"),
        (["sniff", "sim://gd350", "--function", "GG", "--for", "0"], 2, '"GG" is not a function'),
        (["--profile", "3=", "sniff", "sim://gd350", "--for", "0"], 2, "is not a unit and its family"),
        (["sniff", "sim://gd350", "-w", "/nowhere/x.pcapng", "--for", "0"], 2, "/nowhere/x.pcapng cannot be written"),
        (["decode", "/nowhere/x.pcapng"], 2, "cannot be read: there is no such file"),
        (["replay", "/nowhere/x.pcapng"], 2, "cannot be read: there is no such file"),
    ],
)
def test_a_wrong_word_is_told_in_one_line(words: list[str], code: int, why: str) -> None:
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == code, done.output
    assert why in done.stderr
    assert "Traceback" not in done.output


def test_a_reader_that_goes_ends_it_quietly(simulator: Simulator) -> None:
    read_end, write_end = os.pipe()
    words = [sys.executable, "-m", "drivebus", "-f", "8N1", "sniff", simulator.port, "-w", "-"]
    with (
        drivebus.Bus(simulator.port, parity="N") as bus,
        subprocess.Popen(words, stdout=write_end, stderr=subprocess.PIPE, text=True) as process,
    ):
        os.close(write_end)
        os.close(read_end)
        while process.poll() is None:
            bus.read(1, 0x2100)
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()


def test_the_table_shows_what_was_heard_before_under_the_names_that_were_learned() -> None:
    figures = Figures(0.002)
    figures.units[1] = UnitFigures(
        registers={
            0x3000: RegisterFigures(reads=2, value=1000, first=1.0, last=2.0),
            0x2101: RegisterFigures(reads=1, value=1, first=1.0, last=1.0),
            "running_frequency": RegisterFigures(reads=1, value=12.5, first=3.0, last=3.0),
        }
    )
    screen = io.StringIO()
    Console(file=screen, width=120, height=20).print(SniffTable("line", Families("gd350"), figures))
    rows = [line.split() for line in screen.getvalue().splitlines() if line.strip()]
    assert ["1", "running_frequency", "12.50", "Hz", "3", "1.00", "s"] in rows
    [bits] = [" ".join(row) for row in rows if "status_word_2" in row]
    assert bits.startswith("1 status_word_2 1 ready")
