"""Another program changes the settings of an open port: after a request without answer they are set again, and told."""

from __future__ import annotations

import os
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import serial

import drivebus
from drivebus.doctor.hints import hint_findings
from drivebus.line.terminal import differences

from .odd_slave import good, on_a_terminal

SILENT = b"\x07\xff"
"""The register whose read is never answered."""

IFLAG, OFLAG, CFLAG, LFLAG, ISPEED, OSPEED, CC = range(7)
KINDS = ("native", "serial", "shared", "traced")


class Line:
    """A unit that answers, and another program that has its port open.

    Attributes: *path*, its port; *asked*, the requests that reached it; *other*, the descriptor of the other program.
    """

    def __init__(self) -> None:
        self.asked: list[bytes] = []
        self.path = ""
        self.other = -1

    def plan(self, request: bytes) -> bytes:
        self.asked.append(request)
        return b"" if request[2:4] == SILENT else good(request)

    def change(self, change: Callable[[list[Any]], None]) -> None:
        found = self.found()
        change(found)
        termios.tcsetattr(self.other, termios.TCSANOW, found)

    def found(self) -> list[Any]:
        return termios.tcgetattr(self.other)


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    with on_a_terminal(line.plan) as line.path:
        line.other = os.open(line.path, os.O_RDWR | os.O_NOCTTY)
        try:
            yield line
        finally:
            os.close(line.other)


@contextmanager
def opened(kind: str, line: Line, **how: Any) -> Iterator[drivebus.Bus]:
    how = {"parity": "N", "timeout": 2.0, "retries": 0, **how}
    if kind == "serial":
        with serial.Serial(line.path, 19200) as port, drivebus.Bus(port, **how) as bus:
            yield bus
    elif kind == "shared":
        with drivebus.Bus(line.path, **how), drivebus.Bus(line.path, **how) as bus:
            assert bus.stats().programs or bus.reconnects == 0
            yield bus
    else:
        with drivebus.Bus(line.path, **how) as bus:
            if kind == "traced":
                bus.trace()
            yield bus


def speed(settings: list[Any]) -> None:
    settings[ISPEED] = settings[OSPEED] = termios.B9600


def edited(settings: list[Any]) -> None:
    """Lines, as a shell wants them: a read waits for the end of one."""
    settings[LFLAG] |= termios.ICANON


def stripped(settings: list[Any]) -> None:
    settings[IFLAG] |= termios.ISTRIP


def translated(settings: list[Any]) -> None:
    settings[OFLAG] |= termios.OPOST | termios.ONLCR


def hasty(settings: list[Any]) -> None:
    settings[CC][termios.VMIN] = 200


CHANGES: dict[str, tuple[Callable[[list[Any]], None], str, bool]] = {
    "speed": (speed, "9600 bit/s instead of 19200", False),
    "edited": (edited, "ICANON on", True),
    "stripped": (stripped, "ISTRIP on", True),
    "translated": (translated, "OPOST on", True),
    "hasty": (hasty, "VMIN 200 instead of 1", False),
}
"""Each with what is said of it, and whether it spoils a read of 0x8A0A to 0x8A0D on a pseudo-terminal."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CHANGES)
def test_what_was_changed_is_told_and_set_again(kind: str, name: str, line: Line) -> None:
    change, words, spoils = CHANGES[name]
    with opened(kind, line) as bus:
        right = list(range(0x8A0A, 0x8A0E))
        assert bus.read(1, 0x8A0A, 4) == right
        ours = line.found()
        if kind == "serial" and name == "hasty":
            ours[CC][termios.VMIN], words = 0, "VMIN 200 instead of 0"  # pyserial waits otherwise
            assert line.found() == ours
        line.change(change)
        place = 0x8A0A if spoils else int.from_bytes(SILENT, "big")
        with pytest.raises((drivebus.NoAnswer, drivebus.BadAnswer)) as failed:
            bus.read(1, place, 4)
        told = f"; another program had changed the settings of the open port ({words}): they are set again"
        assert str(failed.value).endswith(told)
        assert line.found() == ours
        assert bus.read(1, 0x8A0A, 4) == right
        stats = bus.stats()
        assert stats.settings_changed == 1
        assert "settings_changed" in stats.hint_names
        with pytest.raises(drivebus.NoAnswer) as failed:
            bus.read(1, int.from_bytes(SILENT, "big"), 4)
        assert "another program" not in str(failed.value)
        assert bus.stats().settings_changed == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_read_that_is_asked_again_is_answered(kind: str, line: Line) -> None:
    with opened(kind, line, retries=1) as bus:
        assert bus.read(1, 5) == [5]
        line.change(edited)
        assert bus.read(1, 0x8A0A, 4) == list(range(0x8A0A, 0x8A0E))
        stats = bus.stats()
        assert stats.settings_changed == 1
        [hint] = [text for name, text in zip(stats.hint_names, stats.hints, strict=True) if name == "settings_changed"]
        assert "fuser" in hint
        if kind != "shared":
            assert any("ICANON on" in note for note in stats.notes)
        assert [finding.name for finding in hint_findings(bus)].count("settings_changed") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_write_is_sent_once(kind: str, line: Line) -> None:
    with opened(kind, line, retries=2) as bus:
        bus.write(1, 5, 0x55)
        line.change(edited)
        with pytest.raises(drivebus.DrivebusError, match="may have taken it; another program had changed") as failed:
            bus.write(1, 0x2000, 1)
        assert failed.value.started is not None
        assert [request for request in line.asked if request[1:4] == b"\x06\x20\x00"] == [b"\x01\x06\x20\x00\x00\x01"]
        assert bus.stats().settings_changed == 1


@pytest.mark.parametrize("parity", ["N", "E"])
def test_what_a_pseudo_terminal_never_took_is_no_change(parity: str, line: Line) -> None:
    with opened("native", line, parity=parity, bytesize=7 if parity == "E" else 8) as bus:
        for _ in range(2):
            with pytest.raises(drivebus.NoAnswer) as failed:
                bus.read(1, int.from_bytes(SILENT, "big"))
            assert "another program" not in str(failed.value)
        assert bus.stats().settings_changed == 0


def test_who_changes_it_again_is_told_again(line: Line) -> None:
    with opened("native", line) as bus:
        for times in (1, 2, 3):
            line.change(speed)
            with pytest.raises(drivebus.NoAnswer, match="9600 bit/s instead of 19200"):
                bus.read(1, int.from_bytes(SILENT, "big"))
            assert bus.stats().settings_changed == times
        assert any(f"{times} times" in note for note in bus.stats().notes)


def test_the_owner_of_a_port_object_may_change_it(line: Line) -> None:
    with serial.Serial(line.path, 19200) as port, drivebus.Bus(port, timeout=0.2, retries=0) as bus:
        port.baudrate = 9600
        with pytest.raises(drivebus.NoAnswer) as failed:
            bus.read(1, int.from_bytes(SILENT, "big"))
        assert "another program" not in str(failed.value)
        assert line.found()[OSPEED] == termios.B9600


def test_a_speed_without_a_name_is_set_again_by_its_object(line: Line) -> None:
    with serial.Serial(line.path, 187_500) as port, drivebus.Bus(port, timeout=0.2, retries=0) as bus:
        ours = line.found()
        line.change(speed)
        with pytest.raises(drivebus.NoAnswer, match=r"9600 bit/s instead of "):
            bus.read(1, int.from_bytes(SILENT, "big"))
        assert line.found() == ours
        with pytest.raises(drivebus.NoAnswer) as failed:
            bus.read(1, int.from_bytes(SILENT, "big"))
        assert "another program" not in str(failed.value)


def test_an_object_without_a_terminal_has_nothing_to_look_at() -> None:
    with serial.serial_for_url("loop://", timeout=0.1) as port, drivebus.Bus(port, timeout=0.1, retries=0) as bus:
        with pytest.raises(drivebus.DrivebusError) as failed:
            bus.read(1, 5)
        assert "another program had" not in str(failed.value)


def test_what_a_pseudo_terminal_does_not_take_has_words_too(line: Line) -> None:
    def told(opened: int, found: int) -> str:
        return ", ".join(differences(*([*line.found()[:2], modes, *line.found()[3:]] for modes in (opened, found))))

    none, even = termios.CS8, termios.CS8 | termios.PARENB
    assert told(even, even) == ""
    assert told(even, none) == "parity none instead of even"
    assert told(none, even | termios.PARODD) == "parity odd instead of none"
    assert told(none, none | termios.PARODD) == ""
    seven = termios.CS7 | termios.PARENB | termios.CSTOPB
    assert told(even, seven) == "7 data bits instead of 8 data bits, 2 stop bits instead of 1 stop bit"
    assert told(none, none | termios.CRTSCTS) == "CRTSCTS on"
