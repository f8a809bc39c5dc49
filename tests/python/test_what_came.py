"""What came instead of an answer is told, and the hints follow from it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import serial

import drivebus

from .odd_slave import Plan, framed, good, on_a_socket, on_a_terminal

ODD = b"\x07\xff"
"""The register whose read is answered by something else."""

CASES = {
    "two bytes": (b"\x83\x02", "2 bytes that are no frame", "other_answers"),
    "other function": (
        framed("01A300"),
        "a refusal of function 23H (exception 00H) where 03H was asked",
        "other_answers",
    ),
    "04H": (framed("0104020001"), "a whole frame of function 04H where 03H was asked", "other_answers"),
    "unit 0": (framed("0003020001"), "a whole frame of function 03H of unit 0", "other_master"),
    "thirty bytes": (bytes(range(7, 37)), "30 bytes that are no frame", "other_answers"),
    "text": (b"ERROR 12\r\n", 'the text "ERROR 12", no frame', "other_answers"),
}


def odd(answer: bytes) -> Plan:
    """Answers the read of `ODD` by *answer*, and everything else rightly."""
    return lambda request: answer if request[2:4] == ODD else good(request)


@contextmanager
def opened(kind: str, plan: Plan) -> Iterator[drivebus.Bus]:
    """A bus to the slave of *plan*, over *kind* of port."""
    options: dict[str, Any] = {"parity": "N", "timeout": 0.5}
    if kind == "socket":
        with on_a_socket(plan) as url, drivebus.Bus(url, **options) as bus:
            yield bus
        return
    with on_a_terminal(plan) as path:
        if kind == "serial":
            with serial.Serial(path, 19200) as port, drivebus.Bus(port, **options) as bus:
                yield bus
        elif kind == "shared":
            with drivebus.Bus(path, **options), drivebus.Bus(path, **options) as bus:
                yield bus
        else:
            with drivebus.Bus(path, **options) as bus:
                yield bus


@pytest.mark.parametrize("kind", ["terminal", "serial", "socket"])
@pytest.mark.parametrize("case", CASES)
def test_what_came_is_in_the_error_and_in_the_hint(case: str, kind: str) -> None:
    answer, words, hint = CASES[case]
    with opened(kind, odd(answer)) as bus:
        assert bus.read(1, 5) == [5]
        with pytest.raises(drivebus.BadAnswer) as error:
            bus.read(1, 0x07FF)
        assert error.value.raw == answer
        assert words in str(error.value)
        assert "no answer" not in str(error.value)
        hints = bus.stats()["hint_names"]
        assert hints == [hint], bus.stats()["hints"]


def test_a_program_that_shares_the_port_is_told_the_same() -> None:
    answer, words, hint = CASES["04H"]
    ask = (
        "import drivebus, sys\n"
        "with drivebus.Bus(sys.argv[1], parity='N', timeout=0.2) as bus:\n"
        "    try: bus.read(1, 0x07FF)\n"
        "    except drivebus.BadAnswer as error: print(error.raw.hex(), error)\n"
        "    print(bus.stats()['hint_names'])\n"
    )
    with on_a_terminal(odd(answer)) as path, drivebus.Bus(path, parity="N", timeout=0.2) as bus:
        assert bus.read(1, 5) == [5]
        done = subprocess.run([sys.executable, "-c", ask, path], capture_output=True, text=True, timeout=60, check=True)
    assert answer.hex() in done.stdout
    assert words in done.stdout
    assert f"[{hint!r}]" in done.stdout


@pytest.mark.parametrize("number", [lambda _: 0, lambda number: number + 100, lambda number: number ^ 0x8000])
def test_another_transaction_number_is_told(number: Callable[[int], int]) -> None:
    with (
        on_a_socket(good, mbap=True, number=number) as url,
        drivebus.Bus(url, timeout=0.5) as bus,
    ):
        with pytest.raises(drivebus.BadAnswer, match="under another transaction number") as error:
            bus.read(1, 5)
        assert error.value.raw == good(bytes.fromhex("010300050001"))
        assert bus.stats()["hint_names"] == ["other_answers"]
        assert "transaction" in bus.stats()["hints"][0]


def test_a_write_answered_by_the_whole_request_is_no_echoing_adapter() -> None:
    with opened("terminal", lambda request: framed(request.hex()) if request[1] == 0x10 else good(request)) as bus:
        assert bus.read(1, 5) == [5]
        for _ in range(3):
            with pytest.raises(drivebus.BadAnswer, match="the request itself, sent back") as error:
                bus.write(1, 0x10, [1, 2, 3])
            assert error.value.raw == error.value.request
            assert bus.read(1, 5) == [5]
        stats = bus.stats()
        assert (stats["own_echoes"], stats["hint_names"]) == (0, [])


@pytest.mark.parametrize("reads", [0, 3])
def test_a_greeting_is_no_noise_of_the_line(reads: int) -> None:
    greeting = b"Welcome to the serial server of hall 4\r\nport 1, 19200 8N1\r\n"
    with on_a_socket(good, greeting=greeting) as url, drivebus.Bus(url, timeout=5.0) as bus:
        for place in range(reads + 1):
            assert bus.read(1, place) == [place]
        assert bus.stats()["hints"] == []
