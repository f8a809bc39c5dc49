"""The pictures of the README, drawn from what the commands really show: `make pictures`.

Runs a simulated line behind a pseudo-terminal, and on terminals of our own the panel, the sniffer and a recording. The
screens become SVG by rich, the recording by `drivebus plot`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.text import Text
from tests.python.panels import Terminal, on_a_terminal

import drivebus

HERE = Path(__file__).resolve().parent.parent / "docs/pictures"
SIZE = (100, 30)


@contextmanager
def simulated(folder: Path) -> Iterator[str]:
    """Two drives behind a pseudo-terminal."""
    link = folder / "line"
    words = [sys.executable, "-m", "drivebus", "sim", "--units", "1=gd350,2=gd350", "--link", str(link)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield str(link)
        finally:
            process.terminate()


def keep(terminal: Terminal, name: str, title: str) -> None:
    """Draws what *terminal* shows now."""
    with Path("/dev/null").open("w", encoding="utf-8") as nowhere:
        console = Console(record=True, width=SIZE[0], file=nowhere, force_terminal=True, color_system="truecolor")
        for line in terminal.styled():
            text = Text()
            for letters, style in line:
                text.append(letters, style)
            console.print(text, no_wrap=True, overflow="crop")
        (HERE / name).write_text(console.export_svg(title=title), encoding="utf-8")


def screens(port: str, folder: Path) -> None:
    """The panel while a motor runs."""
    drives = ["--port", port, "--profile", "gd350"]
    with on_a_terminal([*drives, "--unit", "1", "panel"], folder / "log", SIZE, quiet=True) as panel:
        panel.until("stopped")
        panel.press("r")
        panel.until("Hz")
        panel.press("30\r")
        panel.until("Is the machine clear")
        panel.press("y")
        panel.until("forward, 30.00 of 30.00 Hz")
        keep(panel, "panel.svg", "drivebus --port /dev/ttyUSB0 panel")
        panel.press(" ")
        panel.until("stopped")
        panel.press("q")
        panel.ends()


def heard(port: str, folder: Path) -> None:
    """What another program asks, heard beside it."""
    with on_a_terminal(["--port", port, "sniff"], folder / "log", SIZE, quiet=True) as ear:
        ear.until("Ctrl-C ends it")
        for words in (
            ["--unit", "1", "read", "output_current", "P00.11"],
            ["--unit", "2", "write", "P00.11=2.5"],
            ["--unit", "1", "stop"],
            ["scan", "--units", "1-3"],
        ):
            command = [sys.executable, "-m", "drivebus", "--port", port, "--profile", "gd350", *words]
            subprocess.run(command, check=True, capture_output=True)
        ear.until(lambda text: text.count("did not answer") == 1)
        keep(ear, "sniff.svg", "drivebus sniff /dev/ttyUSB0")


def plotted(folder: Path) -> None:
    """A start, a load, a fault and a gap, recorded in virtual time."""
    path = folder / "run.csv"
    with (
        drivebus.Simulator({1: "gd350"}, clock="virtual", transport="process") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        names = ["running_frequency", "set_frequency_actual", "output_current", "bus_voltage", "output_voltage"]
        with drivebus.Recorder(path, {drive: names}, interval=0.1, labels={drive: "pump"}) as recorder:
            recorder.wait(2.0)
            drive.run(30.0)
            recorder.wait(10.0)
            simulator.line.drop_answers(4)
            recorder.wait(6.0)
            simulator.drive(1).load = 1.2
            recorder.wait(5.0)
            simulator.drive(1).trip("OL1")
            recorder.wait(4.0)
            drive.reset_fault()
            recorder.wait(3.0)
    words: Sequence[str] = ["plot", str(path), "-o", str(HERE / "plot.svg"), "--force"]
    subprocess.run([sys.executable, "-m", "drivebus", *words], check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Draws all of them."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plotted(folder)
        with simulated(folder) as port:
            prepare = [sys.executable, "-m", "drivebus", "--port", port, "prepare", "--yes"]
            subprocess.run(prepare, check=True, stdout=subprocess.DEVNULL)
            heard(port, folder)
            screens(port, folder)
    print(f"drawn: {', '.join(sorted(path.name for path in HERE.iterdir()))}")


if __name__ == "__main__":
    main()
