"""What the panel shows, in a small window and a large one, and what it says where it cannot."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("textual")
if sys.platform == "win32":
    pytest.skip("needs a pseudo-terminal", allow_module_level=True)

import drivebus
from drivebus import Simulator
from drivebus.cli.panel import render

from .panels import Terminal, on_a_terminal
from .screens import SIZES

KEPT = Path(__file__).resolve().parents[2] / "target" / "screens"
COLOUR = re.compile(r"\b(?:3|4|9|10)[0-8]\b")
"""In a sequence that styles text; 39 and 49 are the terminal's own."""
FAULT = 9
STYLES = re.compile(r"\x1b\[([0-9;:]*)m")


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500", 3: "gd350"}, transport="pty") as simulator:
        with drivebus.Bus(simulator) as bus:
            bus.drive(1).prepare_control()
        yield simulator


def keep(name: str, lines: list[str], size: tuple[int, int]) -> None:
    KEPT.mkdir(parents=True, exist_ok=True)
    frame = "\n".join(f"|{line:<{size[0]}}|" for line in lines)
    (KEPT / f"panel {name} {size[0]}x{size[1]}.txt").write_text(f"{frame}\n", encoding="utf-8")


@pytest.mark.parametrize(("size", "plain"), [(SIZES[0], True), (SIZES[1], False)], ids=str)
def test_each_view_has_what_it_is_for(simulator: Simulator, tmp_path: Path, size: tuple[int, int], plain: bool) -> None:
    backup = tmp_path / "older.toml"
    with drivebus.Bus(simulator) as bus:
        bus.drive(1).backup(backup)
    backup.write_text(
        re.sub(r"(?m)^(P00\.11 = .*value = )[0-9.]+(.*raw = )\d+", r"\g<1>7.5\g<2>75", backup.read_text())
    )
    simulator.drive(1).trip(FAULT)
    words = ["--port", simulator.port, "--unit", "1-3,9", "panel"]
    with on_a_terminal(words, tmp_path / "record", size, environment={"NO_COLOR": "1"} if plain else {}) as terminal:
        # Who is not known for sure, and who is silent, is told from who is in fault.
        terminal.until(
            "4 drives, 1 in fault, 1 silent", "537.0", "fault, OV3 (9)", "not known; Enter: use it as vfd500"
        )
        keep("overview", terminal.lines, size)
        terminal.press("\x1b[F")
        terminal.until("unit 9, read 2103H: no answer within 500 ms", "no answer, trying again")
        terminal.press("\x1b[H", "\x1b[B")
        terminal.until("not known, trying again: unit 2 answers", "give `--profile 2=vfd500`")
        terminal.press("\r")
        terminal.until("answers like a vfd500", "Use it as a vfd500?", "y yes, it is a vfd500")
        terminal.press("n" if plain else "y")
        terminal.until("2 of 4", "exchanges brought an answer; 0 silent")
        if not plain:
            terminal.until("Veikong VFD500 on ", "taken as a vfd500 until this panel ends")
        terminal.press("\x1b")
        terminal.until("4 drives")
        terminal.press("\x1b[H", "\r")
        terminal.until("1 of 4", "fault, OV3", "cause: ", "remedy: ", "○ S1", "up to 50.00")
        terminal.until("of the last 10 exchanges brought an answer; 0 silent, ")
        # A fault with all that is known of it pushes nothing out.
        terminal.until(lambda _: terminal.lines[-1].startswith("Space STOP"))
        keep("drive", terminal.lines, size)
        if plain:
            use(terminal, simulator, backup, size)
        terminal.press("\x03")
        assert terminal.ends() == 0
    coloured = [style for style in STYLES.findall(terminal.raw.decode()) if COLOUR.search(style)]
    assert bool(coloured) != plain


def use(terminal: Terminal, simulator: Simulator, backup: Path, size: tuple[int, int]) -> None:
    """Resets a fault, types what is no number, starts what may not start, and changes and compares parameters."""
    terminal.press("x")
    terminal.until("reset the fault. A drive that is still told to run may start. Is the machine clear?")
    terminal.press("y")
    terminal.until("1 of 4", "reset the fault: done", "stopped, 0.00 of")
    assert simulator.drive(1).fault == 0
    terminal.press("\x1b[D", "\x1b[D")
    terminal.until("3 of 4", "commands from keypad: b prepares it", "b prepare p params")
    assert "ready" not in terminal.words
    terminal.press("r")
    terminal.until("how many Hz", "Enter goes on, Escape cancels, q is typed.")
    # Two numbers of which the second takes back the first, in a lump.
    terminal.press("77\x7f\x7f1,5\r")
    terminal.until('"1,5" is not a number of Hz; write 1.5; nothing was sent')
    terminal.press("r")
    terminal.until("how many Hz")
    terminal.press("10\r")
    # What would be written is told, in the words of `prepare`, and nothing is asked of the machine before.
    terminal.until("prepare it? To RAM", "P00.01: 0 -> 2, run commands come from communication")
    terminal.until("This takes its commands and its setpoint from the bus. Is the machine clear?")
    keep("prepare", terminal.lines, size)
    assert "run forward" not in terminal.words
    terminal.press("y")
    # What was wanted is not forgotten, and asks by itself.
    terminal.until("run forward to 10 Hz. Is the machine clear?")
    terminal.press("\x1b")
    terminal.without("Is the machine clear?")
    terminal.until("unit 3: prepare: it obeys the bus now: done", "ready, commands from communication")
    assert simulator.drive(3).eeprom_writes == 0
    terminal.press("b")
    terminal.until("unit 3: it obeys the bus; there is nothing to write")
    terminal.press("\x1b[C", "\x1b[C")
    terminal.until("1 of 4")
    # What does not fit is on further pages, and they come round.
    terminal.until("of 2: PageDown", "1 of 4 ? unverified")
    terminal.press("\x1b[6~")
    terminal.until("page 2 of 2")
    assert "output voltage" not in terminal.words
    terminal.press("\x1b[6~")
    terminal.until("page 1 of 2", "output voltage")
    terminal.press("p")
    terminal.until(
        "parameters, group P00, 1 of 13: unit 1, INVT", "P00.11", "10.0 s Acceleration time 1", "Escape back"
    )
    keep("parameters", terminal.lines, size)
    terminal.press("/")
    terminal.until("> ")
    terminal.press("deceleration")
    terminal.until("P00.12", "10.0 s Deceleration time 1")
    terminal.press("\r")
    terminal.without("> ")
    terminal.press("\r")
    terminal.until("write P00.12 (Deceleration time 1), 0.0 to 3600.0 s")
    terminal.press("4.5\r")
    terminal.until("write P00.12 = 4.5 s", "to EEPROM", "to RAM")
    terminal.press("y")
    terminal.until("4.5 s Deceleration time 1")
    assert simulator.drive(1).eeprom_writes == 0
    terminal.press("d")
    terminal.until("compare with which backup")
    terminal.press(f"{backup}\r")
    terminal.until("parameters differ", "P00.11 Acceleration time 1: 7.5 s -> 10.0 s", "P00.12")
    keep("compared", terminal.lines, size)


BEHIND = """
import os, sys
child = os.fork()
if child:
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
os.setpgid(0, 0)
"""
"""Has the program go on in the background of its terminal, as `timeout` does."""


def test_an_own_mistake_costs_no_screen(simulator: Simulator, tmp_path: Path) -> None:
    """Each is one line and an exit code, and no screen was opened."""
    port = ["--port", simulator.port]
    missing = "import sys; sys.modules['textual'] = None"
    for words, size, kind, before, code, said in (
        ([*port, "panel"], SIZES[0], "dumb", "", 2, 'TERM is "dumb"'),
        ([*port, "panel"], (79, 24), "xterm", "", 2, "a window of 80 by 24, and this one has 79 by 24"),
        ([*port, "--json", "panel"], SIZES[0], "xterm", "", 2, "--json is for others"),
        ([*port, "panel"], SIZES[0], "xterm", missing, 2, "pip install 'drivebus[panel]'"),
        ([*port, "panel"], SIZES[0], "xterm", BEHIND, 2, "the panel needs to be in the foreground"),
        (["panel"], SIZES[0], "xterm", "", 2, "no port"),
        (["--port", "/dev/nowhere", "panel"], SIZES[0], "xterm", "", 5, "/dev/nowhere"),
    ):
        with on_a_terminal(words, tmp_path / "record", size, before, environment={"TERM": kind}) as terminal:
            assert (terminal.ends(), said in terminal.words) == (code, True), terminal.text
        assert b"\x1b[?1049h" not in terminal.raw


def test_nobody_to_show_is_an_error(tmp_path: Path) -> None:
    with on_a_terminal(["--port", "sim://vfd500", "panel"], tmp_path / "record") as terminal:
        assert terminal.ends() == 2
        assert "could not be identified for sure" in terminal.words


def test_a_drive_that_comes_later_is_shown(tmp_path: Path) -> None:
    with Simulator({1: "gd350"}, transport="pty") as simulator:
        simulator.line.drop_answers(1_000)
        with on_a_terminal(["--port", simulator.port, "panel"], tmp_path / "record") as terminal:
            terminal.until("no answer, trying again: unit 1, read 2103H: no answer within 500 ms")
            simulator.line.clear()
            terminal.until("stopped, 0.00 of 50.00 Hz")
            terminal.press("q")
            assert terminal.ends() == 0


def test_each_unit_has_the_family_that_is_named(simulator: Simulator, tmp_path: Path) -> None:
    words = ["--port", simulator.port, "--unit", "1-3", "panel", "--profile"]
    with on_a_terminal([*words, "2=vfd500"], tmp_path / "record") as terminal:
        terminal.until("3 drives", "unit 2 state not told", "unit 3 0.00", "? unverified")
        terminal.press("q")
        assert terminal.ends() == 0
    for given, code, said in (
        ("4=gd350", 2, "--profile names unit 4, and --unit does not"),
        ("2=gd35x", 2, "gd35x"),
        ("2=", 2, "write 3=gd350"),
    ):
        with on_a_terminal([*words, given], tmp_path / "record") as terminal:
            assert (terminal.ends(), said in terminal.words) == (code, True), terminal.text


class Seen:
    """A member of the panel, as far as a trend looks at it."""

    def __init__(self, values: list[float]) -> None:
        self.trends = {"bus_voltage": values}
        self.highest = None
        self.watched = SimpleNamespace(rows={"bus_voltage": SimpleNamespace(text=lambda value: f"{value:.1f}")})

    def role(self, role: str) -> str:
        return role


@pytest.mark.parametrize(
    ("values", "drawn"),
    [
        # 4 V of 537 V are a wobble, of 40 V a trend.
        ([533.0, 537.0, 535.0], "▄▅▅     533.0…537.0"),
        ([0.0, 40.0, 20.0], "▁█▅        0.0…40.0"),
        ([0.0, 0.0], "▁▁              0.0"),
        ([-5.0, -5.0], "▅▅             -5.0"),
        # The last nine have longer ends than the last ten have.
        ([9.4, *[20.0] * 3, *[21.4] * 6, *[30.0] * 3], "▁▁▁▁▁▁███ 21.4…30.0"),
    ],
    ids=str,
)
def test_a_trend_has_a_scale(values: list[float], drawn: str) -> None:
    assert render.scaled(Seen(values), "bus_voltage", 19).plain == drawn  # type: ignore[arg-type]
