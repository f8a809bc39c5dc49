"""Codes that no row lists: read as raw words, written only on request, to the memory that the family's rule means."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from drivebus import Bus, Drive, NotAllowed, Profile, Refused, Simulator
from drivebus.cli import cli


@contextmanager
def of(family: str) -> Iterator[tuple[Simulator, Drive]]:
    """A simulated drive in virtual time, and its handle."""
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        yield simulator, bus.drive(1, profile=family)


def test_it_is_read_as_the_word_it_is() -> None:
    with of("gd350") as (_, drive):
        # What the simulated drive has there was typed apart from the profile: P12.00 is 500, and each next is one more.
        assert drive.read("P12.01") == 501
        assert drive.read("p12-01") == 501
        assert drive.read("P12.00", "P00.11", "P12.02") == {"P12.00": 500, "P00.11": 10.0, "P12.02": 502}
        assert drive.snapshot("P12.03").units == {"P12.03": "raw"}
        with pytest.raises(Refused) as refused:
            drive.read("P12.60")
        assert refused.value.code == 0x02


@pytest.mark.parametrize(
    ("family", "ram", "stored"),
    # Opposite rules, and a family without a write to RAM. The bytes on the wire are their addresses.
    [("gd350", 0x8C01, 0x0C01), ("vfd500", 0x0C01, 0x8C01), ("gd600", None, 0x0C01), ("gd3000", None, 0x0C01)],
)
def test_it_is_written_to_the_memory_that_the_rule_of_its_family_means(
    family: str, ram: int | None, stored: int
) -> None:
    with of(family) as (simulator, drive):
        with pytest.raises(NotAllowed, match=r"not verified.*unverified=True"):
            drive.write("P12.01", 7)
        assert simulator.drive(1).words_written == 0
        if ram is None:
            with pytest.raises(NotAllowed, match="store=True"):
                drive.write("P12.01", 7, unverified=True)
        else:
            drive.write("P12.01", 7, unverified=True)
            assert [write[1:] for write in simulator.drive(1).take_writes()] == [(ram, 7)]
            assert simulator.drive(1).eeprom_writes == 0
        drive.write("P12.01", 8, store=True, unverified=True)
        assert [write[1:] for write in simulator.drive(1).take_writes()] == [(stored, 8)]
        assert simulator.drive(1).eeprom_writes == 1
        assert drive.read("P12.01") == 8


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("P99.01", "the maker's own"),
        ("P32.00", 'gd350 has no "P32.00"'),
        ("F0-12", 'gd350 has no "F0-12"'),
        ("P05.100", "gd350 has no"),
        ("0x0C01", "knows nothing at 0C01H"),
    ],
)
def test_what_is_no_code_of_the_family_is_refused_before_anything_is_sent(name: str, said: str) -> None:
    with of("gd350") as (simulator, drive):
        for ask in (lambda: drive.read(name), lambda: drive.write(name, 1, unverified=True)):
            with pytest.raises(NotAllowed, match=said):
                ask()
        assert simulator.line.requests == 0


@pytest.mark.parametrize("value", [-1, 65_536, 1.5, "one", None], ids=str)
def test_only_a_word_is_written(value: object) -> None:
    with of("gd350") as (simulator, drive):
        with pytest.raises(NotAllowed, match=r"P12\.01"):
            drive.write("P12.01", value, unverified=True)
        assert simulator.drive(1).words_written == 0


def test_what_is_known_of_it_is_said_plainly() -> None:
    known = Profile.builtin("gd350").describe("p12.01")
    assert (known.name, known.code, known.address, known.unit, known.listed) == (
        "P12.01",
        "P12.01",
        0x0C01,
        "raw",
        False,
    )
    assert (known.evidence, known.access, known.bounded) == ("unverified", "unknown", False)
    assert "not listed" in known.label
    assert Profile.builtin("gd350").describe("P00.11").listed


def test_it_is_polled_as_any_other() -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, profile="gd350")
        with bus.poll({drive: ["P12.01", "output_current"]}, interval=0.1) as poll:
            assert next(iter(poll))["P12.01"] == 501


def test_a_code_without_a_row_is_named_in_a_backup(tmp_path: Path) -> None:
    with of("gd350") as (simulator, drive):
        drive.backup(tmp_path / "kept.toml")
        text = (tmp_path / "kept.toml").read_text()
        (tmp_path / "kept.toml").write_text(text.replace("[parameters]\n", "[parameters]\nP12.01 = { value = 9 }\n"))
        with pytest.raises(NotAllowed, match=r"gd350 does not list P12\.01"):
            drive.restore(tmp_path / "kept.toml")
        assert simulator.drive(1).words_written == 0


def test_it_is_read_by_itself() -> None:
    # The drive would refuse the listed neighbours with it, if it has no such parameter.
    assert Profile.builtin("gd350").compile(["P00.11", "P00.13", "P00.12"]).reads == ((0x000B, 2), (0x000D, 1))


def test_what_a_profile_dropped_is_no_raw_word_either(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "profile.toml").write_text(
        'name = "mine"\ntitle = "Mine"\nversion = 1\nsource = "by hand"\ndrop = ["P00.11"]\n'
        '[overlay]\nprofile = "gd350"\n'
    )
    with pytest.raises(NotAllowed, match=r"P00\.11"):
        Profile.load(tmp_path / "mine").describe("P00.11")


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, ["--port", "sim://gd350?clock=virtual", *words], prog_name="drivebus")
    return done.exit_code, done.output


def test_the_command_line_takes_it() -> None:
    assert run("read", "P12.01")[1].splitlines()[1].split()[:3] == ["P12.01", "501", "raw"]
    code, said = run("write", "P12.01=7", "--yes")
    assert (code, "--unverified" in said) == (2, True)
    assert run("--unverified", "write", "P12.01=7", "--yes")[0] == 0
    code, said = run("describe", "P12.01")
    assert (code, "not listed" in said, "0C01H" in said) == (0, True, True)
    code, said = run("list", "P12")
    assert (code, "0 rows" in said, "P12.00" in said, "raw word" in said) == (0, True, True, True)
    assert run("list", "P99")[0] == 2
