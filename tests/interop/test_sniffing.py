"""Other people's masters talk to other people's units, and drivebus listens: every exchange that went well is paired.

The ear gets the bytes in lumps, as adapters hand them over. How it fares on long and hostile lines,
tools/measure_sniffing.py measures.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

import pytest
from tests.interop.masters import ask_by_libmodbus, ask_by_pymodbus, ask_over_tcp
from tests.interop.tap import Tap, tapped

import drivebus
from drivebus import Exchange
from drivebus.sim import Simulator

COUNT = 40
LUMPS = (0.001, 0.016, 0.062)


@contextmanager
def ear(tap: Tap) -> Iterator[list[Exchange]]:
    """What is heard on *tap* within a block; all of it is there when the block is over."""
    heard: list[Exchange] = []
    with drivebus.Bus(tap.ear, parity="N", read_only=True) as bus:
        thread = threading.Thread(target=lambda: heard.extend(drivebus.sniff(bus)), name="ear")
        thread.start()
        yield heard
        tap.settle()
    # Its end is the end of what is heard.
    thread.join()


@pytest.mark.parametrize("lump", LUMPS)
def test_pymodbus_to_pymodbus(lump: float, serve: Callable[..., str]) -> None:
    with tapped(lump) as tap:
        serve("pymodbus_server", tap.unit)
        with ear(tap) as heard:
            ask_by_pymodbus(tap.master, COUNT)
        intact, paired, wrong = tap.score(heard)
    # On a busy machine it asks some of them again; of these alone may some be left without a pair.
    assert intact >= COUNT
    assert intact - max(tap.repeated, 1) <= paired <= intact
    assert wrong == 0
    read = next(each for each in heard if each.function == 3 and each.unit == 1)
    assert read.values == {address: address for address in read.values}, "register a holds a"


@pytest.mark.parametrize("lump", LUMPS)
def test_libmodbus_to_libmodbus(lump: float, serve: Callable[..., str], libmodbus: str) -> None:
    with tapped(lump) as tap:
        serve("libmodbus_server", tap.unit, libmodbus)
        with ear(tap) as heard:
            ask_by_libmodbus(tap.master, COUNT, libmodbus)
        assert tap.score(heard) == (COUNT, COUNT, 0)


def test_mbpoll_to_a_simulated_drive(mbpoll: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    with Simulator({1: "gd350"}, baudrate=19200, parity="N") as simulator, tapped(0.016) as tap:
        with relayed(tap.unit, simulator.port), ear(tap) as heard:
            done = mbpoll(
                "-m", "rtu", "-b", 19200, "-P", "none", "-a", 1, "-0", "-r", 0x2100, "-c", 4, "-1", "-q", tap.master
            )
            assert done.returncode == 0, done.stdout + done.stderr
        intact, paired, wrong = tap.score(heard)
    assert (intact, paired, wrong) == (1, 1, 0)
    [told] = [each for each in heard if each.answer is not None]
    # It said of itself what it is.
    assert told.profile == "gd350"
    assert told.values["status_word_1"] == 3


@contextmanager
def relayed(one: str, other: str) -> Iterator[None]:
    """Two ports as one wire."""
    import os
    import selectors

    ends = [os.open(name, os.O_RDWR | os.O_NOCTTY) for name in (one, other)]
    over, stop = os.pipe()

    def relay() -> None:
        with selectors.DefaultSelector() as selector:
            for source, target in ((ends[0], ends[1]), (ends[1], ends[0]), (over, None)):
                selector.register(source, selectors.EVENT_READ, target)
            while True:
                for key, _ in selector.select():
                    if key.data is None:
                        return
                    os.write(key.data, os.read(key.fd, 4096))

    thread = threading.Thread(target=relay, name="relay")
    thread.start()
    try:
        yield
    finally:
        os.write(stop, b"!")
        thread.join()
        for descriptor in (*ends, over, stop):
            os.close(descriptor)


def test_on_a_hostile_line_no_pair_is_wrong(serve: Callable[..., str]) -> None:
    with tapped(0.016, rate=0.02, seed=3) as tap:
        serve("pymodbus_server", tap.unit)
        with ear(tap) as heard:
            ask_by_pymodbus(tap.master, 150, timeout=0.4)
        intact, paired, wrong = tap.score(heard)
    assert wrong == 0
    # Where a busy machine lets few through, a single one is more than two in a hundred.
    assert paired >= 0.98 * intact - 1, (intact, paired)


@pytest.mark.parametrize("transport", ["pty", "tcp"])
def test_pymodbus_to_a_simulated_drive_heard_at_its_ear(transport: str) -> None:
    with Simulator({1: "gd350"}, parity="N", transport=transport, ear=True) as simulator:
        assert simulator.ear is not None
        heard: list[Exchange] = []
        with drivebus.Bus(simulator.ear, parity="N", read_only=True) as bus:
            thread = threading.Thread(target=lambda: heard.extend(islice(drivebus.sniff(bus), COUNT)), name="ear")
            thread.start()
            if transport == "pty":
                ask_by_pymodbus(simulator.port, COUNT)
            else:
                ask_over_tcp(simulator.port, COUNT)
            thread.join(60)
            assert not thread.is_alive(), f"only {len(heard)} exchanges were heard"
        said = [(side, data) for _, side, data in simulator.line.trace()]
    told = [frame for each in heard for frame in (("master", each.request), ("unit", each.answer))]
    assert told == said, "every frame, in the order of the wire"
    assert not any(isinstance(each.error, drivebus.NoAnswer | drivebus.BadAnswer) for each in heard)


def test_the_command_hears_pymodbus_at_an_ear(tmp_path: Path) -> None:
    port, ear = tmp_path / "line", tmp_path / "ear"
    command = [sys.executable, "-m", "drivebus", "-f", "8N1"]
    with subprocess.Popen(
        [*command, "sim", "--link", port, "--ear", ear], stdout=subprocess.PIPE, text=True
    ) as simulation:
        assert simulation.stdout is not None
        said = [simulation.stdout.readline().strip() for _ in range(3)]
        assert said == [str(port), f"Leads to: {port.readlink()}", f"Ear: {ear}, leads to {ear.readlink()}"]
        with subprocess.Popen(
            [*command, "--json", "sniff", ear, "-n", "8"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as sniffer:
            # It has begun to listen when it has heard something.
            while sniffer.poll() is None:
                ask_by_pymodbus(str(port), 4)
            assert sniffer.stdout is not None
            rows = [json.loads(line) for line in sniffer.stdout]
        simulation.terminate()
    assert sniffer.returncode == 0
    # It may have come amid an exchange, of which it hears the rest.
    assert (len(rows), rows[-1]["answered"] >= 6) == (9, True), rows
    assert not ear.is_symlink()
