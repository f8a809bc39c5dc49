"""Runs the benchmarks, side by side with their peers, and writes benches/RESULTS.md.

Each section is a module that prints a table, or with --json its figures; here stands which there are, and the sentence
that says what each measured. A new one is an entry of SECTIONS.

usage: bench_report.py [SECTION …] [--realtime]     (with sections named, they are printed and nothing is written)
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benches/RESULTS.md"
PEERS = [
    *("fastcrc", "minimalmodbus", "modbus-tk", "pylibmodbus", "pymodbus", "pyserial", "tmodbus", "uModbus"),
    *("pytest-benchmark",),
]


class Section(NamedTuple):
    """One table."""

    name: str
    title: str
    about: str
    """What was measured, in a sentence or two."""
    command: list[str]


def module(name: str, *options: str) -> list[str]:
    """`benches/python/NAME.py`, run with this interpreter."""
    return [sys.executable, "-m", f"benches.python.{name}", *options]


SECTIONS = [
    Section(
        "cycle",
        "Share of the shortest possible cycle",
        "One unit that answers as soon as the protocol lets it, on a pseudo-terminal with the pace of the "
        "wire, read again and again by each master in turn: the least time from request to request that the "
        "protocol allows (8 characters, silence, answer, silence), in percent of the median time that it "
        "took; the median of five runs. `c` is a bare master in C without any care for errors "
        "(benches/c/master.c). Above 100 % a master cuts into the silence: the last column counts the "
        "requests that came before it was over.",
        module("cycle", "--seconds", "0.5"),
    ),
    Section(
        "unpaced",
        "Transactions on a line without pace",
        "Reads of one word from a slave in C that answers at once (benches/c/slave.c): what a transaction "
        "costs when the wire costs nothing. `c` and drivebus are told to keep no silence; minimalmodbus, "
        "pymodbus and tmodbus keep one of their own. Medians of five runs in turns; processor time is that of "
        "the master's process.",
        module("unpaced", "--seconds", "0.7"),
    ),
    Section(
        "monitor",
        "Reading a drive by names",
        "All monitor registers of a GD350 from the same slave in C: raw reads of the words, `drive.monitor()`, "
        "and a poll whose samples are decoded. Medians of five runs in turns; processor time of all threads.",
        module("monitor"),
    ),
    Section(
        "calls",
        "Calls from Python that need no line",
        "Medians of pytest-benchmark; encoding and decoding are what each library's own client calls to make "
        "a request and to take an answer apart. `struct + fastcrc` is the least that Python code can do.",
        module("calls"),
    ),
    Section(
        "many-lines",
        "32 lines in one process",
        "28 pseudo-terminals and 4 TCP connections at 19200 bit/s with 8 units each, simulated by another "
        "process; shares of the shortest cycle as above, processor time of the measured process in cores.",
        module("many_lines"),
    ),
    Section(
        "gateway",
        "Modbus TCP through a gateway",
        "One unit as in the first table. The bus itself, one client of Modbus TCP that asks when it has heard, and "
        "four clients with four requests each, in turns: the share of the shortest cycle, and what a read of the one "
        "client takes more than one of the bus.",
        module("gateway"),
    ),
    Section(
        "busy",
        "A busy machine",
        "Two processes for each core that never wait, and reads of one word at 115200 bit/s: a poll of drivebus as "
        "usual and with `realtime=True`, and the C master at its usual priority and in real time, in turns.",
        module("busy"),
    ),
    Section(
        "aio_loop",
        "Many lines in one event loop",
        "The same lines, read by tasks of one asyncio loop. A tick is how much later than asked a task wakes up that "
        "sleeps a millisecond beside them; `idle` is a loop without buses, the machine's own share.",
        module("aio_loop"),
    ),
    Section(
        "drives",
        "10 000 drives in virtual time",
        "On one core: every motor ramps all the time, every line is polled at wire speed (19200 bit/s) for its drives' "
        "state words. How many requests a virtual second holds depends on how many lines the drives are on; processor "
        "time includes the looks.",
        module("drives"),
    ),
    Section(
        "rust",
        "Without Python",
        "Medians of criterion; CRCs in C (`cc -O2`, benches/c/crc_tables.c) from the same minutes. A read on "
        "a line that has the answer is the bus, or the client, alone.",
        module("in_rust"),
    ),
]


def machine() -> str:
    """What it ran on."""
    name = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        models = [
            line.partition(":")[2].strip() for line in information.read_text().splitlines() if "model name" in line
        ]
        name = models[0] if models else name

    def said(*command: str) -> str:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]

    peers = []
    for peer in PEERS:
        try:
            peers.append(f"{peer} {metadata.version(peer)}")
        except metadata.PackageNotFoundError:
            peers.append(f"no {peer}")
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.release()}; drivebus "
        f"{metadata.version('drivebus')}, CPython {platform.python_version()}, {said('rustc', '--version')}, "
        f"{said('cc', '--version')}; {', '.join(peers)}"
    )


def measured(section: Section) -> str:
    """The section as Markdown."""
    print("$", *section.command[1:], file=sys.stderr, flush=True)
    start = time.monotonic()
    done = subprocess.run(section.command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{section.name} failed")
    print(f"  {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    return f"## {section.title}\n\n{section.about}\n\n{done.stdout.strip()}\n"


def main() -> None:
    """Measures, then writes."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(each.name for each in SECTIONS))
    options.add_argument("--realtime", action="store_true", help="on a busy machine: all that is measured goes first")
    given = options.parse_args()
    known = {section.name: section for section in SECTIONS}
    for name in given.sections:
        if name not in known:
            options.error(f"{name} is none of {', '.join(known)}")
    if given.realtime:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(10))  # and so everything that is started from here
    parts = [measured(known[name]) for name in given.sections or known]
    if given.sections:
        print("\n".join(parts))
        return
    busy = (
        " The machine had other work meanwhile; all that was measured ran at real-time priority."
        if given.realtime
        else ""
    )
    head = (
        f"# Results of `make bench`\n\n{datetime.date.today().isoformat()}. {machine()}\n\n"
        "The processor was kept from idling while lines were measured (benches/c/awake.c): waking it takes a virtual "
        "machine longer than a transaction. Read ratios within a table; times of different days differ."
        f"{busy}\n"
    )
    RESULTS.write_text("\n".join([head, *parts]), encoding="utf-8")
    print(f"wrote {RESULTS.relative_to(ROOT)}", file=sys.stderr)


if __name__ == "__main__":
    main()
