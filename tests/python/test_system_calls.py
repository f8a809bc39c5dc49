"""What a read asks of the system: few calls, and none that only says how the thread wants to be woken.

`strace` writes down what a program asks for while it reads. Held to a number is what does not depend on when the system
lets whom run: a request goes out by one `write`, and its answer comes in by one `read` for each piece in which the
system hands it over.
"""

from __future__ import annotations

import os
import pty
import re
import shutil
import statistics
import subprocess
import sys
import threading
import tty
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import pytest

from .serial_server import READ, UNIT, frame

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="strace is Linux's")

TOOLS = Path(__file__).resolve().parent.parent.parent / ".tools/usr"

READS = 100
MOST = 10
"""System calls of one read. What comes in more pieces than one takes two more for each: it is waited for, and read."""

PROGRAM = f"""
import os, sys, drivebus
port, share = sys.argv[1:]
with drivebus.Bus(port, baudrate=115200, parity="N", stopbits=1, timeout=60, share=share) as bus:
    for _ in range(10):
        bus.read({UNIT}, 0, 4)
    for _ in range({READS}):
        os.getsid(0)
        assert bus.read({UNIT}, 0, 4) == [7, 7, 7, 7]
    os.getsid(0)
"""
"""Each read that is counted stands between two calls that nobody else makes, behind some that do what is done once."""


def lacking(why: str) -> NoReturn:
    """Skips the test, or fails it where nothing may be skipped."""
    reason = f"{why}: run `make interop-parts`, or on Debian `apt-get install strace`"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="module")
def strace() -> list[str]:
    """How to run it: installed, or unpacked by tools/debian_parts.sh."""
    command = [installed] if (installed := shutil.which("strace")) else unpacked()
    tried = subprocess.run([*command, "-f", "-o", os.devnull, "true"], capture_output=True, text=True)
    if tried.returncode != 0:
        pytest.skip(f"strace may not trace here: {tried.stderr.strip()}")
    return command


def unpacked() -> list[str]:
    program, libraries = TOOLS / "bin/strace", os.pathsep.join(map(str, TOOLS.glob("lib/*")))
    if not program.exists():
        lacking("strace is missing")
    # Its libraries are its own, and not those of the program that it traces.
    return ["env", f"LD_LIBRARY_PATH={libraries}", str(program), "-E", "LD_LIBRARY_PATH"]


@contextmanager
def unit() -> Iterator[str]:
    """A unit behind a pseudo-terminal that says 7 to whatever is read, at once and in one piece; its port."""
    leader, follower = pty.openpty()
    tty.setraw(follower)

    def answer() -> None:
        held = b""
        with suppress(OSError):
            while came := os.read(leader, 256):
                held += came
                while len(held) >= 8:
                    asked, held = held[:8], held[8:]
                    count = int.from_bytes(asked[4:6], "big")
                    is_read = asked[1] == READ
                    words = b"\0\7" * count
                    os.write(leader, frame(UNIT, bytes([READ, 2 * count]) + words) if is_read else asked)

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        yield os.ttyname(follower)
    finally:
        # Who reads the other end of what is closed hears so.
        os.close(follower)
        thread.join()
        os.close(leader)


@dataclass
class Asked:
    """What one read asked of the system."""

    calls: Counter[str] = field(default_factory=Counter)
    pieces: int = 0
    """In which its answer came."""

    @property
    def beside_pieces(self) -> int:
        """Calls, as if the answer had come whole."""
        return self.calls.total() - 2 * max(self.pieces - 1, 0)


def reads_of(trace: str) -> list[Asked]:
    """What was asked for between each two marks."""
    _, *reads, _ = re.split(r"^\d+ +getsid\(0.*\n", trace, flags=re.MULTILINE)
    return [asked_in(read) for read in reads]


def asked_in(trace: str) -> Asked:
    asked = Asked()
    for line in trace.splitlines():
        call = re.match(r"\d+ +(?P<ends><\.\.\. )?(?P<name>\w+)(?P<rest>.*)", line)
        if call is None:
            continue  # a signal, or the end of a thread
        if not call["ends"]:
            asked.calls[call["name"]] += 1
        if call["name"] == "read" and re.search(r" = [1-9]\d*$", call["rest"]):
            asked.pieces += 1
    return asked


@pytest.fixture(scope="module", params=["auto", "never"])
def reads(request: pytest.FixtureRequest, strace: list[str], tmp_path_factory: pytest.TempPathFactory) -> list[Asked]:
    """Reads over a port that other programs may use too, and over one that is this program's alone."""
    file = tmp_path_factory.mktemp("traced") / "trace"
    with unit() as port:
        traced = [*strace, "-f", "-q", "-o", str(file), sys.executable, "-c", PROGRAM, port, request.param]
        subprocess.run(traced, check=True, timeout=300)
    return reads_of(file.read_text())


def test_each_request_goes_out_by_one_call(reads: list[Asked]) -> None:
    assert len(reads) == READS
    assert all(read.calls["write"] == 1 for read in reads)


def test_a_read_says_nothing_of_how_its_thread_wants_to_be_woken(reads: list[Asked]) -> None:
    assert not [read for read in reads if read.calls["prctl"]]


def test_what_comes_is_read_as_often_as_it_comes(reads: list[Asked]) -> None:
    # And once before it asks, where the line has been silent for so long that the silence need not be waited for.
    assert all(1 <= read.pieces <= read.calls["read"] <= read.pieces + 1 for read in reads)


def test_a_read_takes_few_calls(reads: list[Asked]) -> None:
    # Half of them: who waits longer than 50 ms, because the machine is busy, looks up meanwhile.
    assert statistics.median(read.beside_pieces for read in reads) <= MOST, reads[:3]


def test_a_trace_is_cut_at_its_marks_and_a_call_that_ends_later_counts_once() -> None:
    trace = """\
11 write(5, "before", 6) = 6
11 getsid(0) = 1
11 write(5, "1", 1) = 1
11 ppoll([{fd=5, events=POLLIN}], 1, {tv_sec=0, tv_nsec=49916711}, NULL, 8 <unfinished ...>
12 prctl(PR_GET_NAME, "x") = 0
11 <... ppoll resumed>) = 1
11 read(5, <unfinished ...>
12 --- SIGCHLD {si_signo=SIGCHLD} ---
11 <... read resumed>"a = 0", 256) = 7
11 read(5, "b", 256) = 1
11 getsid(0 <unfinished ...>
12 write(5, "2", 1) = 1
11 <... getsid resumed>) = 1
11 read(5, 0x7ffe, 256) = -1 EAGAIN (Resource temporarily unavailable)
11 read(5, "", 256) = 0
11 getsid(0) = 1
12 write(1, "behind", 6) = 6
"""
    first, second = reads_of(trace)
    assert first == Asked(Counter(write=1, ppoll=1, prctl=1, read=2), pieces=2)
    assert second == Asked(Counter(write=1, read=2), pieces=0)
    assert (first.beside_pieces, second.beside_pieces) == (3, 3)
