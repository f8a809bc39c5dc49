"""A drive that keeps all in RAM until a word stores it: what is written with `store` outlives the power, and only that.

Altivar 312 communication variables manual (Schneider BBV51701), p. 20: bit 1 of CMI (8504) stores, and goes back to 0.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import Bus, Drive, Simulator, Unconfirmed
from drivebus.cli.app import cli
from drivebus.operations import network_rights
from drivebus.profile.evidence import Evidence

CMI = 8504
RAMPS = {"ACC": 5.0, "dEC": 7.0}
RAMP_WORDS = [(9001, 50), (9002, 70)]
FACTORY = {"ACC": 3.0, "dEC": 3.0}


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv312"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "atv312")


def sent(line: Simulator) -> list[tuple[int, int]]:
    return [(place, word) for _, place, word in line.drive(1).take_writes()]


def test_what_is_only_in_ram_is_lost_with_the_power(line: Simulator, drive: Drive) -> None:
    drive.write(RAMPS)
    assert sent(line) == RAMP_WORDS
    assert drive.read(*RAMPS) == RAMPS
    line.drive(1).power_cycle()
    assert drive.read(*RAMPS) == FACTORY
    assert line.drive(1).eeprom_writes == 0


def test_what_is_stored_outlives_it(line: Simulator, drive: Drive) -> None:
    drive.write(RAMPS, store=True)
    assert sent(line) == [*RAMP_WORDS, (CMI, 2)]
    line.drive(1).power_cycle()
    assert drive.read(*RAMPS) == RAMPS
    drive.write(RAMPS, store=True)
    assert sent(line) == []


def test_what_was_written_to_ram_before_is_stored_by_the_word_alone(line: Simulator, drive: Drive) -> None:
    drive.write(RAMPS)
    line.drive(1).take_writes()
    drive.write(RAMPS, store=True)
    assert sent(line) == [(CMI, 2)]
    line.drive(1).power_cycle()
    assert drive.read(*RAMPS) == RAMPS


def test_another_bit_of_the_word_is_not_taken_back(line: Simulator, drive: Drive) -> None:
    """Bit 14 of CMI ends the watch over the bus: whoever set it would lose it by a store."""
    drive.bus.write(1, CMI, 0x4000)
    line.drive(1).take_writes()
    with pytest.raises(Unconfirmed, match=r"all values, in RAM.*extended_control_word is 4000H.*only at 0000H") as told:
        drive.write(RAMPS, store=True)
    assert sent(line) == RAMP_WORDS
    assert told.value.in_part
    assert drive.read(*RAMPS) == RAMPS


def test_a_refused_store_says_that_the_values_are_in_ram(line: Simulator, drive: Drive) -> None:
    drive.write(RAMPS)
    line.drive(1).refuse(0x04, asked="writes")
    with pytest.raises(Unconfirmed, match=r"all values, in RAM.*the word for extended_control_word: .*04H"):
        drive.write(RAMPS, store=True)
    line.drive(1).refuse_no_more()
    drive.write(RAMPS, store=True)
    line.drive(1).power_cycle()
    assert drive.read(*RAMPS) == RAMPS


def test_nothing_is_stored_by_its_name(line: Simulator, drive: Drive) -> None:
    for store in (False, True):
        with pytest.raises(drivebus.NotAllowed, match=r"stores all that was set.*store=True"):
            drive.write("extended_control_word", 2, store=store)
    assert sent(line) == []


def test_a_restore_stores_what_an_earlier_one_left_in_ram(line: Simulator, drive: Drive) -> None:
    """Cut off between the last value and the word, the second finds all as it should be, and stores it."""
    drive.write(RAMPS, store=True)
    kept = drive.backup()
    line.drive(1).factory_reset()
    drive.write(RAMPS)
    line.drive(1).refuse(0x04, asked="writes")
    with pytest.raises(Unconfirmed, match=r"all values, in RAM"):
        drive.restore(kept)
    line.drive(1).refuse_no_more()
    line.drive(1).take_writes()
    assert drive.restore(kept).ok
    assert sent(line) == [(CMI, 2)]
    line.drive(1).power_cycle()
    assert not drive.diff(kept)


def test_a_dry_run_stores_nothing(line: Simulator, drive: Drive) -> None:
    kept = drive.backup()
    drive.write(RAMPS)
    line.drive(1).take_writes()
    assert drive.restore(kept, dry_run=True).ok
    assert sent(line) == []


def test_the_watchdog_of_the_drive_is_set_in_ram(line: Simulator, drive: Drive) -> None:
    """Parameter ttO (6005) counts 0.1 s, and is 10.0 s from the factory (p. 55)."""
    with drive.watchdog(2.0):
        assert line.drive(1).register(6005) == 20
    assert line.drive(1).register(6005) == 100
    assert line.drive(1).eeprom_writes == 0


def test_the_commands_say_where_it_is(line: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Bus
    monkeypatch.setattr(drivebus, "Bus", lambda _port, **_: opened(line))
    done = run("write", "ACC=5", "--yes")
    assert (done.exit_code, "Kept in RAM" in done.stdout, sent(line)) == (0, True, [(9001, 50)])
    done = run("write", "ACC=6", "--store", "--yes")
    assert (done.exit_code, "Kept in EEPROM" in done.stdout, sent(line)) == (0, True, [(9001, 60), (CMI, 2)])
    with opened(line) as bus:
        bus.write(1, CMI, 0x4000)
    done = run("write", "ACC=7", "--store", "--yes")
    assert done.exit_code == 7
    assert "4000H" in done.stderr


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--port", "line", "--profile", "atv312", *words])


def test_an_acs355_stores_by_1607_for_who_trusts_that() -> None:
    """That what is written stays in RAM until 1607 stores it is printed (p. 313), that 1 does is not."""
    with Simulator({1: "acs355"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.drive(1, "acs355", unverified=True).write("1103", 8)
        assert line.drive(1).eeprom_writes == 0
        with pytest.raises(drivebus.NotAllowed):
            bus.drive(1, "acs355").write("1103", 8, store=True)
        bus.drive(1, "acs355", unverified=True).write("1103", 8, store=True)
        assert line.drive(1).register(0x0646) == 0
        line.drive(1).power_cycle()
        assert line.drive(1).register(0x044E) == 8


def test_whoever_writes_over_the_network_wears_it_by_the_word_alone(drive: Drive) -> None:
    """A gateway lets what wears the memory happen seldom: a parameter does not, CMI does."""
    evidence = Evidence(drive.profile, 1, True)
    told = {
        name: means
        for *_, means, _, name, _ in network_rights.of_drive(
            evidence, ["ACC", "set_frequency", "extended_control_word"], []
        )
    }
    assert told == {"ACC": "sets", "set_frequency": "sets", "extended_control_word": "wears"}
