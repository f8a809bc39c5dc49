"""The frames on a line as log records: all of them, in order, with their gaps and what they mean."""

from __future__ import annotations

import asyncio
import logging
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
import drivebus.aio
from drivebus.cli import cli
from drivebus.line.meaning import meaning
from drivebus.line.trace import LOGGER

GD350 = drivebus.Profile.builtin("gd350")


@pytest.fixture
def wire(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.DEBUG, LOGGER)
    return caplog


def frames(wire: pytest.LogCaptureFixture) -> list[tuple[bool, bytes]]:
    return [(record.sent, record.frame) for record in wire.records]  # type: ignore[attr-defined]  # its own attributes


def frames_of(simulator: drivebus.Simulator) -> list[tuple[str, bytes]]:
    return [(side, data) for _, side, data in simulator.line.trace()]


def on_the_wire(simulator: drivebus.Simulator) -> list[tuple[bool, bytes]]:
    return [(side == "master", data) for side, data in frames_of(simulator)]


def work(bus: drivebus.Bus) -> None:
    drive = bus.drive(1)
    drive.status()
    drive.write("P00.11", 12.5)
    drive.write_words(0x800B, [100, 100])
    bus.broadcast(0x800B, 110)
    with pytest.raises(drivebus.Refused):
        bus.read(1, 0x7777)


def test_what_is_logged_is_what_the_line_carried(virtual: drivebus.Simulator, wire: pytest.LogCaptureFixture) -> None:
    with drivebus.Bus(virtual) as bus:
        work(bus)
    assert frames(wire) == on_the_wire(virtual)
    assert len(wire.records) > 10


def test_over_every_line(
    simulator: drivebus.Simulator, bus: drivebus.Bus, timeout: float, wire: pytest.LogCaptureFixture
) -> None:
    bus.read(1, 0x2103)  # an adapter's echo is looked for, and what was in doubt is settled
    before = len(simulator.line.trace())
    bus.trace()
    bus.read(1, 0x2100)
    bus.write(2, 0x800B, 120)
    bus.trace(False)
    bus.read(1, 0x2100)
    logged = frames(wire)
    carried = [frame for frame in on_the_wire(simulator)[before:] if frame in logged]
    assert logged[:2] == carried[:2]
    assert (True, drivebus.rtu.encode_write(2, 0x800B, 120)) in logged
    assert logged[-1] == (False, drivebus.rtu.encode_write(2, 0x800B, 120))
    assert bus.timeout == timeout


def test_gaps_are_silences(virtual: drivebus.Simulator, wire: pytest.LogCaptureFixture) -> None:
    with drivebus.Bus(virtual) as bus:
        bus.read(1, 0x2103)
        bus.read(1, 0x2103)
        bus.sleep(1.0)
        bus.read(1, 0x2103)
        silence = 3.5 * 11 / bus.format.baudrate
    sent = [record for record in wire.records if record.sent]  # type: ignore[attr-defined]  # as above
    gaps = [record.gap for record in sent]  # type: ignore[attr-defined]  # as above
    assert gaps[0] is None
    assert all(gap >= silence for gap in gaps[1:])
    assert gaps[-1] >= 1.0
    times = [record.line_time for record in wire.records]  # type: ignore[attr-defined]  # as above
    assert times == sorted(times)


def test_nothing_is_logged_unless_it_is_wanted(virtual: drivebus.Simulator, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, LOGGER)
    with drivebus.Bus(virtual) as bus:
        bus.read(1, 0x2103)
        bus.trace()
        bus.read(1, 0x2103)
    assert not caplog.records


def test_damage_is_shown_as_it_came(virtual: drivebus.Simulator, wire: pytest.LogCaptureFixture) -> None:
    with drivebus.Bus(virtual, retries=0) as bus:
        bus.read(1, 0x2103)
        wire.clear()
        virtual.line.set_faults(flip_bit=1.0)
        with pytest.raises(drivebus.DrivebusError) as raised:
            bus.read(1, 0x2103)
    [damaged] = [record for record in wire.records if not record.sent]  # type: ignore[attr-defined]  # as above
    frame: bytes = damaged.frame  # type: ignore[attr-defined]  # as above
    assert frames_of(virtual)[-1] == ("unit", frame)
    assert frame.endswith(raised.value.raw)  # which leaves out what it takes for noise
    assert damaged.meaning == "7 bytes that are not a frame"  # type: ignore[attr-defined]  # as above


def test_the_event_loop_logs_the_same(virtual: drivebus.Simulator, wire: pytest.LogCaptureFixture) -> None:
    async def read() -> None:
        async with drivebus.aio.Bus(virtual) as bus:
            await bus.read(1, 0x2103)

    asyncio.run(read())
    with drivebus.Bus(virtual) as bus:
        bus.read(1, 0x2103)
    half = len(wire.records) // 2
    # An echo carries a word that none before it had.
    shown = [re.sub(r"(echo|returns) \w+", r"\1", record.meaning) for record in wire.records]  # type: ignore[attr-defined]
    assert half >= 2
    assert shown[:half] == shown[half:]


def test_through_another_program_what_was_asked_and_what_came(wire: pytest.LogCaptureFixture) -> None:
    if sys.platform == "win32":
        pytest.skip("no pty")
    with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator, drivebus.Bus(simulator) as owner:
        owner.trace(False)
        with drivebus.Bus(simulator) as guest:
            wire.clear()
            assert guest.read(1, 0x2103) == [0x01A0]
            with pytest.raises(drivebus.Refused) as refused:
                guest.read(1, 0x7777)
    assert frames(wire) == [
        (True, drivebus.rtu.encode_read(1, 0x2103, 1)),
        (False, bytes.fromhex("01 03 02 01 A0 B9 AC")),
        (True, drivebus.rtu.encode_read(1, 0x7777, 1)),
        (False, refused.value.raw),
    ]
    assert all(record.elsewhere for record in wire.records)  # type: ignore[attr-defined]  # as above
    assert "by the program that has the port" in wire.text


@pytest.mark.parametrize(
    ("frame", "asked", "means"),
    [
        ("01 03 21 00 00 01 8E 36", None, "unit 1: read status_word_1 (2100H)"),
        ("01 03 02 00 03 F8 45", "01 03 21 00 00 01 8E 36", "unit 1 answers status_word_1 = 3 (stopped)"),
        ("01 03 02 00 03 F8 45", None, "unit 1 answers 0003H"),
        ("01 06 20 00 00 01 43 CA", None, "unit 1: write control_command = 1 (run forward)"),
        ("01 06 20 00 00 01 43 CA", "01 06 20 00 00 01 43 CA", "unit 1 took control_command = 1 (run forward)"),
        ("01 08 00 00 12 AB AD 14", None, "unit 1: echo 12ABH"),
        ("01 03 21 00 00 01 8E 36", "01 03 21 00 00 01 8E 36", "the request itself, sent back"),
        ("01 03 02 00 03 F8 44", "01 03 21 00 00 01 8E 36", "7 bytes that are not a frame"),
        ("00", None, "1 byte that is not a frame"),
    ],
)
def test_meanings(frame: str, asked: str | None, means: str) -> None:
    sent = asked is None and "answers" not in means and "byte" not in means
    assert meaning(bytes.fromhex(frame), sent, None if asked is None else bytes.fromhex(asked), GD350) == means


def test_a_parameter_is_named_in_either_memory() -> None:
    for address in (0x000B, 0x800B):
        frame = drivebus.rtu.encode_write(1, address, 125)
        assert meaning(frame, True, None, GD350) == "unit 1: write P00.11 acceleration_time_1 = 12.5 s"
        assert meaning(frame, True) == f"unit 1: write {address:04X}H = 125"


@pytest.mark.usefixtures("wire")
def test_a_handler_that_fails_loses_nothing(virtual: drivebus.Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(logging.Handler):
        def emit(self, _: logging.LogRecord) -> None:
            raise RuntimeError("a disk that is full")

    failing = Failing()
    unraised: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", unraised.append)
    logging.getLogger(LOGGER).addHandler(failing)
    try:
        with drivebus.Bus(virtual) as bus:
            assert bus.read(1, 0x2103) == [0x01A0]
    finally:
        logging.getLogger(LOGGER).removeHandler(failing)
    assert unraised


@pytest.mark.usefixtures("wire")
def test_a_signal_while_a_frame_is_shown_ends_the_call(virtual: drivebus.Simulator) -> None:
    class Pressed(logging.Handler):
        def emit(self, _: logging.LogRecord) -> None:
            signal.raise_signal(signal.SIGINT)

    pressed = Pressed()
    with drivebus.Bus(virtual) as bus:
        bus.read(1, 0x2103)
        logging.getLogger(LOGGER).addHandler(pressed)
        try:
            with pytest.raises(KeyboardInterrupt):
                bus.read(1, 0x2103)
        finally:
            logging.getLogger(LOGGER).removeHandler(pressed)
        assert bus.read(1, 0x2103) == [0x01A0]


def test_the_command_line_shows_frames_on_standard_error() -> None:
    words = ["--port", "sim://gd350?clock=virtual", "read", "running_frequency"]
    plain = CliRunner().invoke(cli, words)
    for traced in (CliRunner().invoke(cli, [*words, "-v"]), CliRunner().invoke(cli, ["--trace", *words])):
        assert traced.exit_code == 0
        assert traced.stdout == plain.stdout
        lines = traced.stderr.splitlines()
        assert all(re.match(r"\d\d:\d\d:\d\d\.\d{6} +(\+[\d.]+ ms)? +(->|<-) 01 ", line) for line in lines), lines
        assert "unit 1: read running_frequency (3000H)" in lines[-2]
        assert "unit 1 answers running_frequency = 0.00 Hz" in lines[-1]
    assert not plain.stderr


def test_a_program_that_logs_everything_has_the_frames(tmp_path: Path) -> None:
    script = tmp_path / "logs.py"
    script.write_text(
        "import logging, drivebus\n"
        "logging.basicConfig(level=logging.DEBUG, format='%(name)s %(message)s')\n"
        "with drivebus.Bus('sim://gd350?clock=virtual') as bus:\n"
        "    bus.read(1, 0x2103)\n"
    )
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, timeout=60)
    assert "drivebus.wire" in ended.stderr
    assert "unit 1: read 2103H" in ended.stderr
