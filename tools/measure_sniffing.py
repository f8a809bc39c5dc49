"""How much of what others say on a line is paired rightly: `python -m tools.measure_sniffing [--count N]`.

Other people's masters talk to other people's units over a line of which the truth is kept (tests/interop/tap.py); the
ear gets the bytes in lumps. Prints one row for each pair, lump and rate of faults: intact exchanges, how many of them
were paired, and pairs that are none. `--beside PYTHON` measures the package modbus-sniffer instead, which that
Python has (3.12 or later; `pip install --no-deps modbus-sniffer pyserial`).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from tests.interop.conftest import library_folders
from tests.interop.masters import ask_by_libmodbus, ask_by_pymodbus
from tests.interop.tap import Tap, tapped
from tests.interop.test_sniffing import LUMPS, ear

from drivebus import Exchange, crc16

Ask = Callable[[str, int], None]
Ear = Callable[[Tap], AbstractContextManager[list[Exchange]]]
SERVERS = Path(__file__).resolve().parent.parent / "tests/interop/servers"


def measure(name: str, ask: Ask, server: list[str], count: int, rate: float, lump: float, listen: Ear) -> None:
    """Prints one row."""
    with tapped(lump, rate) as tap:
        command = [sys.executable, str(SERVERS / server[0]), tap.unit, *server[1:]]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            with listen(tap) as heard:
                ask(tap.master, count)
            process.terminate()
        intact, paired, wrong = tap.score(heard)
    share = 100.0 * paired / intact
    print(
        f"{name:<10} {lump * 1e3:>3.0f} ms {100 * rate:>3.0f} % {intact:>6} {paired:>6} {share:>7.2f} % {wrong:>3}",
        flush=True,
    )


def other_ear(python: str) -> Ear:
    """The ear of somebody else's sniffer, run by *python*. A request and the answer that it tells next are a pair."""

    @contextmanager
    def listen(tap: Tap) -> Iterator[list[Exchange]]:
        heard: list[Exchange] = []
        command = [python, str(Path(__file__).with_name("other_sniffer.py")), tap.ear]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield heard
            tap.settle()
            process.terminate()
            asked: bytes | None = None
            for line in process.stdout:
                kind, _, text = line.rstrip("\n").partition(" ")
                frame = bytes.fromhex(text)
                frame += crc16(frame).to_bytes(2, "little")
                if kind == "request":
                    asked = frame
                elif asked is not None:
                    heard.append(Exchange(asked[0], asked, frame, 0.0, None, None, None))
                    asked = None

    return listen


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2_000, help="requests of each row")
    parser.add_argument("--beside", metavar="PYTHON", help="measure modbus-sniffer by this Python instead")
    given = parser.parse_args()
    count, listen = given.count, ear if given.beside is None else other_ear(given.beside)
    library = str(next(folder / "libmodbus.so.5" for folder in library_folders()))
    pairs: list[tuple[str, Ask, list[str]]] = [
        ("pymodbus", ask_by_pymodbus, ["pymodbus_server.py"]),
        ("libmodbus", lambda port, number: ask_by_libmodbus(port, number, library), ["libmodbus_server.py", library]),
    ]
    print(f"{'pair':<10} {'lump':>6} {'faults':>5} {'intact':>6} {'paired':>6} {'share':>9} {'wrong':>3}")
    for rate in (0.0, 0.02):
        for name, ask, server in pairs:
            for lump in LUMPS:
                measure(name, ask, server, count, rate, lump, listen)


if __name__ == "__main__":
    main()
