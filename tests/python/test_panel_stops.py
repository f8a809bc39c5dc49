"""Space stops, whatever the panel shows, and what the panel started does not outlive it: from the line's own record."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("textual")
if sys.platform == "win32":
    pytest.skip("needs a pseudo-terminal", allow_module_level=True)

import drivebus
from drivebus import Simulator
from drivebus.cli.panel.app import Panel
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.motors import PanelMotor

from .panels import Terminal, on_a_terminal

CONTROL, FORWARD, STOP = 0x2000, 1, 5
RAMP = 2.0
STOPPED = "drivebus.panel unit 1: stop confirmed: "
BETWEEN = 2
"""Requests that may lie between the key and the stop: one that was under way, and one that had its turn."""
TRIES = 3
"""A machine that is busy elsewhere may hold the program up between the key and its order: not each time."""


def prepared(simulator: Simulator) -> None:
    """Drives that obey the bus, and are quick."""
    with drivebus.Bus(simulator) as bus:
        for unit in (1, 2):
            drive = bus.drive(unit)
            drive.prepare_control()
            drive.write({"P00.11": RAMP, "P00.12": RAMP})


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "gd350"}, transport="pty") as simulator:
        prepared(simulator)
        simulator.drive(1).writes()
        yield simulator


def told(simulator: Simulator, unit: int = 1) -> list[int]:
    """What the drive was told."""
    return [value for _, address, value in simulator.drive(unit).writes() if address == CONTROL]


def wait_until(holds: Callable[[], bool]) -> None:
    """The limit is the test's own."""
    while not holds():
        threading.Event().wait(0.005)


def has_tripped(simulator: Simulator) -> bool:
    return simulator.drive(1).fault != 0


def says(terminal: Terminal, since: int, line: str) -> bool:
    """Whether the panel's record has a line that begins as *line* behind the first *since*."""
    return any(each.startswith(line) for each in terminal.record()[since:])


def start(terminal: Terminal, hz: str = "10") -> None:
    """Has the panel start the motor that it shows."""
    terminal.press("r")
    terminal.until("how many Hz")
    terminal.press(f"{hz}\r")
    terminal.until(f"run forward to {hz} Hz", "Is the machine clear?")
    terminal.press("y")
    terminal.until("started by this panel", "forward")


HOME, ONE, PARAMETERS = "2 drives", "1 of 2", "group P00"

# The keys that lead there from the overview, each with what it brings, and what each Escape behind the stop brings.
VIEWS: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "overview": ([], []),
    "one drive": ([("\r", ONE)], [HOME]),
    "help": ([("?", "STOP, in every view")], [HOME]),
    "messages": ([("m", "Messages, the newest first")], [HOME]),
    "a speed is asked for": ([("r", "how many Hz")], []),
    "half a number": ([("\r", ONE), ("f", "how many Hz"), ("12", "> 12")], [HOME]),
    "before a start": ([("r", "how many Hz"), ("5\r", "run forward to 5 Hz")], []),
    "before a reset": ([("x", "reset the fault")], []),
    "parameters": ([("p", PARAMETERS)], [HOME]),
    "search": ([("p", PARAMETERS), ("/", "> "), ("ramp", "> ramp")], ["ramp", HOME]),
    "a value is asked for": ([("p", PARAMETERS), ("\r", "write P00.01")], [HOME]),
    "before a write": ([("p", PARAMETERS), ("\r", "write P00.01"), ("2\r", "to EEPROM")], [HOME]),
    "a backup is asked for": ([("p", PARAMETERS), ("d", "compare with which backup")], [HOME]),
}


def test_space_stops_in_every_view_and_dialog(simulator: Simulator, tmp_path: Path) -> None:
    log = tmp_path / "record"
    with (
        on_a_terminal(["--port", simulator.port, "--unit", "1,2", "panel"], log) as terminal,
        drivebus.Bus(simulator.port) as bus,
    ):
        drive = bus.drive(1)
        terminal.until("2 drives", "stopped")
        requests: dict[str, int] = {}
        for name, (there, back) in VIEWS.items():
            for _ in range(TRIES):
                # Somebody else started it, of whom the panel knows nothing.
                drive.run(hz=5.0)
                for key, shown in there:
                    terminal.press(key)
                    terminal.until(shown)
                known = len(terminal.record())
                terminal.press(" ")
                wait_until(lambda: told(simulator)[-1] == STOP)
                wait_until(partial(says, terminal, known, STOPPED))
                requests[name] = between(terminal.record()[known:])
                for shown in back:
                    terminal.press("\x1b")
                    terminal.until(shown)
                terminal.until(HOME)
                if requests[name] <= BETWEEN:
                    break
        terminal.press("q")
        assert terminal.ends() == 0
    assert told(simulator, 2) == [], "the other drive was let alone"
    assert max(requests.values()) <= BETWEEN, requests


def test_a_view_that_is_left_while_it_reads_takes_nothing_with_it(simulator: Simulator, tmp_path: Path) -> None:
    """The answer comes when nobody looks any more."""
    with on_a_terminal(["--port", simulator.port, "--unit", "1,2", "panel"], tmp_path / "record") as terminal:
        terminal.until("2 drives", "stopped")
        terminal.press("p")
        terminal.until(PARAMETERS)
        # In the middle of the reads of the group that comes next.
        simulator.line.delay_answers(0.2)
        known = len(terminal.record())
        terminal.press("\x1b[C")
        wait_until(lambda: any(" -> 01 03 01 " in line for line in terminal.record()[known:]))
        terminal.press("\x1b")
        terminal.until(HOME)
        simulator.line.delay_answers(0.0)
        known = len(terminal.record())
        wait_until(lambda: sum(" <- 02 03 " in line for line in terminal.record()[known:]) > 2)
        terminal.press("q")
        assert terminal.ends() == 0, terminal.text


def between(record: list[str]) -> int:
    """How many requests were sent after the key was seen, before the stop."""
    key = next(place for place, line in enumerate(record) if line == "drivebus.panel unit 1: stop")
    sent = [line for line in record[key:] if line.startswith("drivebus.wire") and " -> " in line]
    return next(place for place, line in enumerate(sent) if "01 06 20 00 00 05" in line)


def test_space_stops_all_that_the_panel_started_and_s_only_one(simulator: Simulator, tmp_path: Path) -> None:
    with on_a_terminal(["--port", simulator.port, "--unit", "1,2", "panel"], tmp_path / "record") as terminal:
        terminal.until(HOME, "stopped")
        start(terminal)
        terminal.press("\x1b[B")
        terminal.until("Goodrive350 on", "unit 2 stopped")
        start(terminal)
        terminal.until("2 running", "2 started by this panel")
        terminal.press("s")
        terminal.until("1 started by this panel")
        assert (told(simulator, 1), told(simulator, 2)) == ([FORWARD], [FORWARD, STOP])
        start(terminal)
        # One that is under way yet would be taken back, and not sent.
        wait_until(lambda: told(simulator, 2).count(FORWARD) == 2)
        terminal.press("\x1b[A", " ")
        wait_until(lambda: told(simulator, 1)[-1] == told(simulator, 2)[-1] == STOP)
        terminal.without("started by this panel")
        # What turns is not sent twice, and what is stopped is not started again.
        assert (told(simulator, 1).count(FORWARD), told(simulator, 2).count(FORWARD)) == (1, 2)


def test_a_stop_takes_back_a_start_that_was_just_allowed(simulator: Simulator, tmp_path: Path) -> None:
    """Both keys come at once: the start is not sent any more, or it is and the stop goes out behind it."""
    with on_a_terminal(["--port", simulator.port, "panel"], tmp_path / "record") as terminal:
        terminal.until("stopped")
        for _ in range(3):
            terminal.press("r")
            terminal.until("how many Hz")
            terminal.press("10\r")
            terminal.until("run forward to 10 Hz")
            known = len(terminal.record())
            terminal.press("y ")
            wait_until(partial(says, terminal, known, STOPPED))
            terminal.without("Is the machine clear?")
            assert told(simulator)[-1] == STOP
            assert simulator.drive(1).state == "stopped"
        terminal.press("q")
        # A start that went out has a thread of its own, which proves its stop too: until then the panel asks.
        with suppress(AssertionError):  # it has ended
            terminal.until("and quit?")
            terminal.press("y")
        assert terminal.ends() == 0


def test_stops_leave_a_start_room_to_end() -> None:
    """Space again and again while a start is under way: one thread repeats the stop, and the others send one each."""
    sent: Counter[threading.Thread] = Counter()
    go, plenty = threading.Event(), threading.Event()

    def halt(_: float | None) -> None:
        sent[threading.current_thread()] += 1
        if sum(sent.values()) >= 8:
            plenty.set()

    motor = PanelMotor("unit 1", halt, lambda: "", Journal(), None)
    under_way = threading.Event()

    def order() -> None:
        under_way.set()
        go.wait()

    motor.later("a start", order, motor.stops)
    under_way.wait()
    for _ in range(3):
        motor.stop()
    plenty.wait()
    go.set()
    assert sum(count > 1 for count in sent.values()) == 1, sent


def test_space_stops_all_though_the_cursor_moves_meanwhile() -> None:
    told: list[str] = []
    panel: Panel

    class Moved(PanelMotor):
        started = True

        def stop(self) -> None:
            told.append(self.called)
            panel.current = panel.members[1]

    motors = [Moved(called, lambda _: None, lambda: "", Journal(), None) for called in ("unit 1", "unit 2", "unit 3")]
    panel = Panel([SimpleNamespace(motor=motor) for motor in motors], Journal())  # type: ignore[misc]
    panel.stop_now()
    assert told == ["unit 1", "unit 2", "unit 3"]


BREAKS = """
import os, sys
mark, sampled = sys.argv[1] + ".broken", sys.argv[1] + ".sampled"
def broken(self):
    if os.path.exists(mark):
        raise RuntimeError("a mistake in the panel")
    return shown(self)
def put(self, sample):
    if os.path.exists(sampled):
        raise RuntimeError("a mistake in the panel")
    return kept(self, sample)
import drivebus.cli.panel.members as fleet
import drivebus.cli.panel.view as view
shown, view.DriveView.show = view.DriveView.show, broken
kept, fleet.Member.put = fleet.Member.put, put
"""
"""Has the panel fail once a file is there, as a mistake in it would."""


MISTAKE = (
    "the panel ended by a mistake of its own: RuntimeError: a mistake in the panel. What it had started it has stopped"
)


def leave(terminal: Terminal) -> None:
    terminal.press("q")
    terminal.until("and quit?")
    terminal.press("y")


ENDINGS: dict[str, tuple[Callable[[Terminal], None], int]] = {
    "q": (leave, 0),
    "Ctrl-C": (lambda terminal: terminal.press("\x03"), 0),
    "SIGINT": (lambda terminal: terminal.send(signal.SIGINT), 130),
    "SIGTERM": (lambda terminal: terminal.send(signal.SIGTERM), 143),
    "the window is closed": (Terminal.hang_up, 129),
    "an exception": (lambda terminal: Path(f"{terminal.log}.broken").touch(), 1),
    "an exception in a thread": (lambda terminal: Path(f"{terminal.log}.sampled").touch(), 1),
    "kill -9": (lambda terminal: terminal.send(signal.SIGKILL), -9),
}


def test_what_it_started_ends_with_it(tmp_path: Path) -> None:
    """Each ending has a line and a panel of its own; they run side by side, because a panel takes its time to open."""
    with contextlib.ExitStack() as stack:
        running = []
        for place, (name, (end, code)) in enumerate(ENDINGS.items()):
            simulator = stack.enter_context(Simulator({1: "gd350", 2: "gd350"}, transport="pty"))
            prepared(simulator)
            words = ["--port", simulator.port, "panel"]
            if name == "kill -9":
                words = ["--unverified", *words, "--watchdog", "1"]
            terminal = stack.enter_context(on_a_terminal(words, tmp_path / str(place), before=BREAKS))
            running.append((name, end, code, simulator, terminal))
        for *_, terminal in running:
            terminal.until("stopped")
            start(terminal)
        for name, end, *_, simulator, terminal in running:
            assert told(simulator) == [FORWARD], name
            end(terminal)
        for name, _, code, simulator, terminal in running:
            assert terminal.ends() == code, name
            if name == "kill -9":
                wait_until(partial(has_tripped, simulator))
            else:
                assert set(told(simulator)[1:]) == {STOP}, name
                failed = name.startswith("an exception")
                assert (MISTAKE in terminal.words) == failed, terminal.text
                assert "Traceback" not in terminal.text
                assert not failed or any("Traceback" in line for line in terminal.record())


HANGS = BREAKS.replace(
    'raise RuntimeError("a mistake in the panel")', "open(mark + '.so', 'w'); threading.Event().wait()"
).replace("import os, sys", "import os, sys, threading")
"""Has the screen hang once a file is there."""


def test_space_stops_and_a_signal_ends_what_hangs(simulator: Simulator, tmp_path: Path) -> None:
    with on_a_terminal(["--port", simulator.port, "panel"], tmp_path / "record", before=HANGS) as terminal:
        terminal.until("stopped")
        start(terminal)
        Path(f"{terminal.log}.broken").touch()
        wait_until(Path(f"{terminal.log}.broken.so").exists)
        terminal.press(" ")
        wait_until(partial(says, terminal, 0, STOPPED))
        assert told(simulator) == [FORWARD, STOP]
        terminal.send(signal.SIGTERM)
        assert terminal.ends() == 143


def test_a_motor_on_the_ramp_is_stopping(tmp_path: Path) -> None:
    """A stop is confirmed long before standstill: the record and the screen say what is true by then."""
    with Simulator({1: "gd350"}, transport="pty") as simulator:
        with drivebus.Bus(simulator) as bus:
            drive = bus.drive(1)
            drive.prepare_control()
            drive.write({"P00.11": 0.5, "P00.12": 150.0})
        with on_a_terminal(["--port", simulator.port, "panel"], tmp_path / "record") as terminal:
            terminal.until("stopped")
            start(terminal)
            terminal.until("forward, 10.00 of 10.00 Hz")
            terminal.press(" ")
            terminal.until("unit 1: stop confirmed: stopping, ", "unverified stopping, ")
            terminal.without("unverified forward")
            # Somebody else starts it on the ramp.
            with drivebus.Bus(simulator.port) as bus:
                bus.drive(1).run(hz=20.0)
            terminal.until("unverified forward, ")
            terminal.press("q")
            assert terminal.ends() == 0
