"""What the interop tests share: where the other programs are, and lines to put them on.

A program that is not there is a skipped test that says how to get it. In continuous integration (CI=true) it is a
failure: a check that nobody runs is no check.
"""

from __future__ import annotations

import os
import selectors
import shutil
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pytest

from drivebus.sim import Simulator

ROOT = Path(__file__).resolve().parent.parent.parent
TOOLS = ROOT / ".tools"
SERVERS = Path(__file__).resolve().parent / "servers"

Server = Callable[..., str]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder talks to somebody else's program."""
    here = f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(here):
            item.add_marker(pytest.mark.interop)


def lacking(what: str, package: str) -> NoReturn:
    """Skips the test, or fails it where nothing may be skipped."""
    reason = f"{what} is missing: run `make interop-parts`, or on Debian `apt-get install {package}`"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


def library_folders() -> list[Path]:
    """Where `.tools` keeps shared libraries, one folder for each architecture."""
    return sorted(TOOLS.glob("usr/lib/*"))


@pytest.fixture(scope="session")
def mbpoll() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs mbpoll with the given arguments."""
    program = shutil.which("mbpoll", path=os.pathsep.join([str(TOOLS / "usr/bin"), os.environ.get("PATH", "")]))
    if program is None:
        lacking("mbpoll", "mbpoll")
    folders = [*map(str, library_folders()), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
    env = {**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(folders)}

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [program, *map(str, arguments)]
        return subprocess.run(command, env=env, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30)

    return run


@pytest.fixture(scope="session")
def libmodbus() -> str:
    """What the dynamic loader takes for libmodbus."""
    for folder in library_folders():
        if (library := folder / "libmodbus.so.5").exists():
            return str(library)
    listed = shutil.which("ldconfig", path=os.pathsep.join([os.environ.get("PATH", ""), "/sbin", "/usr/sbin"]))
    if listed and "libmodbus.so.5" in subprocess.run([listed, "-p"], capture_output=True, text=True).stdout:
        return "libmodbus.so.5"
    lacking("libmodbus.so.5", "libmodbus5")


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    """A GD350 as unit 1 behind a pseudo-terminal.

    8N1, because a pseudo-terminal drops parity and some masters then call their own settings invalid.
    """
    with Simulator({1: "gd350"}, baudrate=19200, parity="N") as simulator:
        yield simulator


@pytest.fixture
def wire() -> Iterator[tuple[str, str]]:
    """Two ports of one line: what is written to one is read from the other."""
    pairs = [os.openpty() for _ in range(2)]
    for _, port in pairs:
        tty.setraw(port)
    stop_reading, stop = os.pipe()
    (first, _), (second, _) = pairs

    def relay() -> None:
        with selectors.DefaultSelector() as selector:
            for source, target in ((first, second), (second, first), (stop_reading, None)):
                selector.register(source, selectors.EVENT_READ, target)
            while True:
                for key, _ in selector.select():
                    if key.data is None:
                        return
                    os.write(key.data, os.read(key.fd, 4096))

    thread = threading.Thread(target=relay, name="wire")
    thread.start()
    yield os.ttyname(pairs[0][1]), os.ttyname(pairs[1][1])
    os.write(stop, b"!")
    thread.join()
    for descriptor in (*pairs[0], *pairs[1], stop_reading, stop):
        os.close(descriptor)


@pytest.fixture
def serve() -> Iterator[Server]:
    """Starts a program of `servers/`, waits until it says `ready`, and ends it after the test."""
    started: list[subprocess.Popen[str]] = []

    def start(name: str, *arguments: str) -> str:
        process = subprocess.Popen(
            [sys.executable, str(SERVERS / f"{name}.py"), *arguments], stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        assert process.stdout is not None
        said = process.stdout.readline()
        assert said == "ready\n", f"{name} said {said!r} and ended with {process.poll()}"
        return name

    yield start
    for process in started:
        process.terminate()
        process.communicate(timeout=10)
