"""A family that was once surely known: a stop need not ask for it, and another drive there is noticed all the same."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli
from drivebus.site import forget, known_family, remember

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pty")


@pytest.fixture
def simulator() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350", 2: "vfd500"}, transport="pty") as simulator:
        yield simulator


def run(simulator: drivebus.Simulator, *words: str) -> Result:
    return CliRunner().invoke(cli, ["--port", simulator.port, *words])


def sent(simulator: drivebus.Simulator, before: int) -> list[bytes]:
    return [data for _, side, data in simulator.line.trace()[before:] if side == "master"]


def test_what_is_kept_is_kept_for_the_adapter_and_the_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    port, link = tmp_path / "ttyUSB0", tmp_path / "by-id" / "usb-FTDI_A1"
    link.parent.mkdir()
    port.touch()
    link.symlink_to(port)
    monkeypatch.setenv("DRIVEBUS_SERIAL_BY_ID", str(link.parent))
    remember(str(port), 1, "gd350")
    assert known_family(str(link), 1) == "gd350"
    assert known_family(str(port), 2) is None
    # Plugged in elsewhere: the adapter has its name, and its port another one.
    moved = tmp_path / "ttyUSB1"
    moved.touch()
    link.unlink()
    link.symlink_to(moved)
    assert known_family(str(moved), 1) == "gd350"
    assert known_family(str(port), 1) is None
    forget(str(moved), 1)
    assert known_family(str(moved), 1) is None


def test_lines_that_stay_are_told_apart_and_simulations_are_not_kept() -> None:
    for port, family in (("socket://A:1", "gd350"), ("tcp://a:1", "gd600"), ("sim://gd350", "gd350")):
        remember(port, 7, family)
    assert known_family("socket://a:1", 7) == "gd350"
    assert known_family("tcp://a:1", 7) == "gd600"
    assert known_family("sim://gd350", 7) is None


@pytest.mark.parametrize("kept", [b"", b"\xff\xfe", b"gd350", b"\t\n\t\tx\n", b"gd350\t" + b"x" * 2_000_000])
def test_a_file_that_is_anything_else_is_nothing(kept: bytes) -> None:
    remember("tcp://a:1", 1, "gd350")
    file = Path(os.environ["XDG_STATE_HOME"]) / "drivebus" / "families"
    file.write_bytes(kept)
    assert known_family("tcp://a:1", 1) is None
    remember("tcp://a:1", 1, "gd600")
    assert known_family("tcp://a:1", 1) == "gd600"


def test_where_nothing_can_be_kept_nothing_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    remember("tcp://a:1", 1, "gd350")
    assert known_family("tcp://a:1", 1) is None


def first_write(frames: list[bytes]) -> bytes:
    """The first frame that writes, behind at most three that ask: what is kept is a hint that the unit has to show."""
    asked = [frame for frame in frames if frame[1] != 0x08]
    number = next(number for number, frame in enumerate(asked) if frame[1] == 0x06)
    assert number <= 3
    assert {frame[1] for frame in asked[:number]} == {0x03}
    return asked[number]


def test_a_stop_looks_where_the_family_was_known_and_goes_out(simulator: drivebus.Simulator) -> None:
    assert run(simulator, "status").exit_code == 0
    assert known_family(simulator.port, 1) == "gd350"
    before = len(simulator.line.trace())
    assert run(simulator, "stop").exit_code == 0
    assert first_write(sent(simulator, before)) == drivebus.rtu.encode_write(1, 0x2000, 5)


@pytest.mark.parametrize("family", ["gd10", "gd20", "gd100"])
def test_an_older_goodrive_is_kept_by_its_code(family: str) -> None:
    """010DH, 0106H and 010BH are each one family's, which the next stop finds at once. 5 stops: GD10 manual, p. 88."""
    with drivebus.Simulator({1: family}, transport="pty") as simulator:
        assert run(simulator, "scan", "--units", "1", "--timeout", "2").exit_code == 0
        assert known_family(simulator.port, 1) == family
        before = len(simulator.line.trace())
        run(simulator, "stop")
        assert first_write(sent(simulator, before)) == drivebus.rtu.encode_write(1, 0x2000, 5)


def test_a_family_with_a_code_that_others_report_too_is_asked_each_time() -> None:
    """010CH is a GD200's and a GD200L's as well: GD200L manual, p. 158."""
    with drivebus.Simulator({1: "gd200a"}, transport="pty") as simulator:
        assert run(simulator, "status").exit_code == 0
        assert known_family(simulator.port, 1) is None
        assert run(simulator, "stop").exit_code == 0
        assert drivebus.rtu.encode_write(1, 0x2000, 5) in sent(simulator, 0)


def test_a_stop_over_a_line_on_which_nothing_is_understood_is_sent(simulator: drivebus.Simulator) -> None:
    remember(simulator.port, 1, "gd350")
    simulator.line.drop_answers(1000)
    before = len(simulator.line.trace())
    run(simulator, "stop")
    assert drivebus.rtu.encode_write(1, 0x2000, 5) in sent(simulator, before)


def test_another_drive_there_is_noticed_and_halted_by_its_own_code(simulator: drivebus.Simulator) -> None:
    remember(simulator.port, 2, "gd350")
    before = len(simulator.line.trace())
    ended = run(simulator, "-u", "2", "stop")
    codes = [data for data in sent(simulator, before) if data[1] == 0x06]
    # A VFD500, which stops by 6 at 7000H (its manual, p. 102), and gets nothing else.
    assert codes == [drivebus.rtu.encode_write(2, 0x7000, 6)] * len(codes)
    assert codes
    assert "unit 2 was a gd350 when it was asked last, and is not one now" in ended.stderr
    assert known_family(simulator.port, 2) is None


def test_another_drive_there_gets_no_other_write(simulator: drivebus.Simulator) -> None:
    remember(simulator.port, 2, "gd350")
    simulator.drive(2).take_writes()
    ended = run(simulator, "-u", "2", "write", "P00.11=5")
    assert ended.exit_code == 2
    assert not simulator.drive(2).take_writes()


def test_a_family_that_is_named_is_not_kept(simulator: drivebus.Simulator) -> None:
    assert run(simulator, "--profile", "gd350", "status").exit_code == 0
    assert known_family(simulator.port, 1) is None


def test_what_to_type_has_port_and_unit(simulator: drivebus.Simulator) -> None:
    simulator.line.drop_answers(1000)
    ended = run(simulator, "-u", "2", "stop")
    assert ended.exit_code == 3
    assert f"`drivebus --port {simulator.port} --unit 2 --profile FAMILY stop`" in ended.stderr
