"""A profile was named, and the unit says that it is something else: nothing is written to it.

A unit that answers strangely (a word where codes stand that is no code, no state of the family) is asked whether it
answers and refuses what another family does: a Delta MS300 has its output frequency at 2103H, and 0 at 2100H (its
manual, p. 799).

What each family says at 2103H: GD350 manual, chapter 9.4.5 (GD350 01A0H, GD35 0108H, GD35-H1 0109H, GD300 010AH); GD10
manual, p. 90 (GD10 010DH, GD100 010BH); GD20 manual, p. 140 (0106H); GD200A manual V2.6, p. 147 (0107H). Of no other
family is a page with a code at hand; their simulated drives refuse 2103H with 02H.

Every pair is judged by the drive. That asyncio and the command line say the same is shown by every seventh;
`DRIVEBUS_MATRIX=all` runs them all.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, Profile, Simulator
from drivebus.cli import cli

from .matrix import ALL

CODE, FAULT_500, SPEED_UNIT_500 = 0x2103, 0x1900, 0x1E0E

SILENT_ON_CODES = [
    "gd600",
    "gd600-rectifier",
    "gd3000",
    "gd3000-rectifier",
    "vfd500",
    "chf100a",
    "chv100",
    "a1000",
    "saj8000m",
    "eds300",
    "sunfar-e300",
    "fc51",
    "vacon10",
    "fc202",
    "atv312",
    "atv12",
    "atv600",
    "atv71",
    "atv320",
    "v20",
    "acs355",
    "acs580",
    "wj200",
    "h100",
    "yl620",
    "md500",
    "fr-d700",
    "j1000",
    "vf-s15",
    "frenic",
    "optidrive-e3",
    "optidrive-p2",
    "dc1",
    "sj200",
    "x200",
    "e510",
    "f510",
    "cfw500",
    "smd",
    "nowforever",
    "starvert",
]
"""The families whose units refuse 2103H."""

SIGNED = [
    *("vfd500", "yl620", "a1000", "eds300", "sunfar-e300", "fc51", "fc202", "atv312", "atv12", "atv600", "v20"),
    *("atv71", "atv320", "acs355", "acs580", "wj200", "h100", "md500", "fr-d700", "j1000", "vf-s15", "frenic", "e510"),
    "optidrive-e3",
    "optidrive-p2",
    "dc1",
    "sj200",
    "x200",
    "cfw500",
    "vacon10",
    "smd",
    "nowforever",
    "f510",
    "starvert",
]
"""Those of them that are told by what they answer and refuse, once something of them is strange."""

NO_SIGNATURE = [family for family in SILENT_ON_CODES if family not in SIGNED]
"""Those that a family with a state or a fault word is taken for; the others refuse that word, or by another code."""

NO_STRANGE_WORD = [family for family in SILENT_ON_CODES if family != "eds300"]
"""Those that refuse 2103H with 02H: an EDS300 says 03H for that (its manual, p. 45)."""

TAKEN_FOR: dict[str, list[str]] = {
    # These have a code: one that says another, or refuses to say one, is none of them.
    "gd350": ["gd350"],
    "gd35": ["gd35"],
    "gd35-h1": ["gd35-h1"],
    "gd300": ["gd300"],
    "gd10": ["gd10"],
    "gd20": ["gd20"],
    "gd100": ["gd100"],
    "gd200a": ["gd200a"],
    # This one answers r25.00 and P30.14, which no other does.
    "vfd500": ["vfd500"],
    # These have coils, which no other has; this one 1200H, that one 000CH and nothing at 1003H, and this one 1028H.
    "wj200": ["wj200"],
    "sj200": ["sj200"],
    "x200": ["x200"],
    # And this one answers 04H, which no other does.
    "h100": ["h100"],
    # And this one 2104H and 2106H, this one 2108H and 2109H, and this one 200BH and 2012H.
    "ms300": ["ms300"],
    "vfd-e": ["vfd-e"],
    # And this one 2105H and 2108H.
    "vfd-b": ["vfd-b"],
    "yl620": ["yl620"],
    # And this one 7000H and 3000H.
    "md500": ["md500"],
    # And this one 045CH, Pr.117, and 00C8H.
    "fr-d700": ["fr-d700"],
    # And this one 004BH and 0034H, this one 2180H, and this one D000H.
    "a1000": ["a1000"],
    # And this one 0020H and 0023H; a real A1000 may answer them, too.
    "j1000": ["j1000"],
    # And this one 0030H and 0031H; an ACS355, whose other words it has, refuses the first.
    "cfw500": ["cfw500"],
    # And this one 0502H and 0037H; INVT drives may have a parameter at the first.
    "nowforever": ["nowforever"],
    # And this one FD00H and FD01H.
    "vf-s15": ["vf-s15"],
    # And this one 080EH and 0809H.
    "frenic": ["frenic"],
    # And this one 0005H, its state, 008BH, P-12, and 07D0H.
    "optidrive-e3": ["optidrive-e3"],
    # And this one the first two of them.
    "dc1": ["dc1"],
    # And this one 0005H and 006FH, P1-12.
    "optidrive-p2": ["optidrive-p2"],
    # And this one 0013H, 001AH and 0032H, and neither 080EH, 0502H nor an input register.
    "smd": ["smd"],
    # And this one input registers 0000H and 000EH.
    "starvert": ["starvert"],
    # And this one 2520H and 2524H, and that one 1700H, too.
    "e510": ["e510"],
    "f510": ["f510"],
    # And this one 091BH and 2104H, and that one 091BH and 091FH.
    "gs2": ["gs2"],
    "gs4": ["gs4"],
    # And this one 083EH and 0834H, its fault and its state.
    "vacon10": ["vacon10"],
    "eds300": ["eds300"],
    "sunfar-e300": ["sunfar-e300"],
    # And these rFr and CMD: 0C82H and 2135H; this one Otr, 0C85H, and that one HMIS, 0CA8H.
    "atv312": ["atv312"],
    "atv12": ["atv12"],
    # And this one both, and 3E80H, a word for pumps.
    "atv600": ["atv600"],
    # And this one both, and 19FAH, the address of a card.
    "atv71": ["atv71"],
    # And this one both, and 0CD1H, a frequency.
    "atv320": ["atv320"],
    # And this one STW, ZSW and the output frequency: 0063H, 006DH and 0017H.
    "v20": ["v20"],
    # And this one the three words of the ABB drives profile, 0000H, 0003H and 0066H, and 9802: 2649H.
    "acs355": ["acs355"],
    # And this one, beside the first two of them, 58.01: 16A8H.
    "acs580": ["acs580"],
    # And these answer C417H, their status word; this one 3F01H, its output frequency, and that one 3F5BH, 16-22.
    "fc51": ["fc51"],
    "fc202": ["fc202"],
    # Of these nothing is known that they must say; a code gives another one away, or strange words and a signature.
    "gd600": NO_SIGNATURE,
    "gd600-rectifier": NO_STRANGE_WORD,
    "gd3000": NO_SIGNATURE,
    "gd3000-rectifier": NO_STRANGE_WORD,
    "chf100a": NO_SIGNATURE,
    "chv100": NO_SIGNATURE,
    "saj8000m": NO_SIGNATURE,
}
"""What each profile may be named for without being contradicted."""

SAYS = {
    "gd350": "01A0H",
    "gd35": "0108H",
    "gd35-h1": "0109H",
    "gd300": "010AH",
    "gd10": "010DH",
    "gd20": "0106H",
    "gd100": "010BH",
    "gd200a": "0107H",
}

ASKED_FOR_NO_CODE = ["gs2", "gs4", "ms300", "vfd-b", "vfd-e", "yl620"]
"""Families that have something else where others have a code: what stands there is not asked for, since it is none.
A YL620 is told by what it answers alone."""

SMALL, LARGE = ["chf100a", "chv100", "saj8000m"], ["gd600", "gd600-rectifier", "gd3000", "gd3000-rectifier"]

HELD_BACK = {"gd600": SMALL, "gd3000": SMALL, "chf100a": LARGE, "saj8000m": LARGE}
"""What nothing speaks against, while the state that comes is one of another family: nothing is written to it either."""

every_name = pytest.mark.parametrize("named", TAKEN_FOR)
"""Each with a unit of each family: a test for each pair would take longer to be told of than to be run."""


def sampled(named: str) -> list[str]:
    """The families of the units that are named so and looked at: every seventh pair, its own family, or all."""
    begin = [*TAKEN_FOR].index(named)
    return [unit for number, unit in enumerate(TAKEN_FOR) if ALL or unit == named or (number + begin) % 7 == 0]


def line_with(family: str) -> Simulator:
    return Simulator({1: family}, transport="process", clock="virtual")


@pytest.fixture
def gd300() -> Iterator[tuple[Simulator, Bus]]:
    """A GD300, after first contact."""
    with line_with("gd300") as simulator, Bus(simulator, timeout=0.25, retries=0) as bus:
        bus.echo(1)
        yield simulator, bus


@pytest.fixture
def vfd500() -> Iterator[tuple[Simulator, Bus]]:
    """A VFD500, after first contact."""
    with line_with("vfd500") as simulator, Bus(simulator, timeout=0.25, retries=0) as bus:
        bus.echo(1)
        yield simulator, bus


def asked(simulator: Simulator) -> list[bytes]:
    """The requests on the line, without the loop-back of first contact."""
    return [frame for _, who, frame in simulator.line.trace() if who == "master" and frame[1] != 0x08]


def written(simulator: Simulator) -> list[bytes]:
    """Without what unlocks an SMD before it takes a word."""
    frames = [frame for frame in asked(simulator) if frame[1] in (0x06, 0x10)]
    unlocks = bytes.fromhex("06 00 30 00 00") if simulator.drive(1).profile == "smd" else b""
    return [frame for frame in frames if frame[1:-2] != unlocks]


def answer(simulator: Simulator, word: int) -> None:
    """The next answer on the line brings *word*."""
    body = bytes([1, 3, 2, *word.to_bytes(2, "big")])
    simulator.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))


def refuse(simulator: Simulator, exception: int) -> None:
    """The next answer on the line is this refusal of a read."""
    body = bytes([1, 0x83, exception])
    simulator.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))


def test_the_table_has_every_family() -> None:
    # A Huanyang HY hears nothing of Modbus, and others nothing of its protocol: see `test_huanyang_hy`.
    assert set(TAKEN_FOR) == set(drivebus.profiles()) - {"huanyang-hy"}
    assert {unit for named in TAKEN_FOR for unit in sampled(named) if unit != named} == set(TAKEN_FOR)


@every_name
def test_what_is_contradicted_gets_nothing(named: str) -> None:
    for unit in TAKEN_FOR:
        with line_with(unit) as simulator, Bus(simulator) as bus:
            gets_nothing(simulator, bus.drive(1, named), named, unit)


def gets_nothing(simulator: Simulator, drive: Drive, named: str, unit: str) -> None:
    """Unless *drive* may be what it was named, no write to it goes out, and it is told why."""
    if unit in HELD_BACK.get(named, ()):
        with pytest.raises(NotAllowed, match=rf"unit 1 was named {named}.*nothing was written.*"):
            drive.write_words(0x0114, 50)
        assert written(simulator) == []
        assert drive.contradiction() is None
        return
    if unit in TAKEN_FOR[named]:
        # Another one may refuse it; that is the drive's own word, and not held back here.
        with suppress(drivebus.Refused):
            drive.write_words(0x0114, 50)
        assert len(written(simulator)) == 1, unit
        assert drive.contradiction() is None, unit
        return
    told = []
    for _ in range(2):  # it is not forgotten by having been said
        with pytest.raises(NotAllowed) as error:
            drive.write_words(0x0114, 50)
        told.append(str(error.value))
        assert error.value.unit == 1
    assert written(simulator) == []
    for said in (f"unit 1 was named {named}", "nothing was written", "trust_profile=True"):
        assert said in told[1]
    if unit in SAYS and named in ASKED_FOR_NO_CODE:
        assert "it refuses " in told[1]
    elif unit in SAYS:
        assert f"it reports {SAYS[unit]}" in told[1]
        assert f'profile="{unit}"' in told[1]
        assert Profile.builtin(unit).title.removeprefix("INVT ") in told[1]
    assert drive.contradiction() is not None, unit


@every_name
def test_both_faces_refuse_the_same(named: str) -> None:
    async def awaited(unit: str) -> str | None:
        with line_with(unit) as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1, named)
                try:
                    await drive.write_words(0x0114, 50)
                except (NotAllowed, drivebus.Refused) as error:
                    return str(error)
                return None

    async def main() -> dict[str, str | None]:
        return {unit: await awaited(unit) for unit in sampled(named)}

    told: dict[str, str | None] = dict.fromkeys(sampled(named))
    for unit in told:
        with line_with(unit) as simulator, Bus(simulator) as bus:
            try:
                bus.drive(1, named).write_words(0x0114, 50)
            except (NotAllowed, drivebus.Refused) as error:
                told[unit] = str(error)
    assert asyncio.run(main()) == told


@every_name
def test_who_knows_better_says_so(named: str) -> None:
    for unit in TAKEN_FOR:
        with line_with(unit) as simulator, Bus(simulator) as bus:
            drive = bus.drive(1, named, trust_profile=True)
            with suppress(drivebus.Refused):
                drive.write_words(0x0114, 50)
            assert len(written(simulator)) == 1, unit
            assert (drive.contradiction() is None) == (unit in TAKEN_FOR[named]), unit


WRITES: list[Callable[[Drive], Any]] = [
    lambda drive: drive.run(),
    lambda drive: drive.run(10.0, reverse=True, force=True),
    lambda drive: drive.jog(),
    lambda drive: drive.write("P00.11", 2.0),
    lambda drive: drive.write({"P00.11": 2.0, "P00.12": 2.0}, store=True),
    lambda drive: drive.write_setpoint(10.0, "analog_output_1"),
    lambda drive: drive.special_control(motor=2),
    lambda drive: drive.prepare_control(setpoint="pid"),
    lambda drive: drive.watchdog(1.0, unverified=True),
    lambda drive: drive.write_words(0x000B, [20, 20]),
    lambda drive: setattr(drive, "setpoint", 10.0),
]


@pytest.mark.parametrize("write", WRITES)
def test_nothing_that_moves_or_changes_anything_goes_out(write: Callable[[Drive], Any]) -> None:
    """A GD300 that obeys the bus, and is named GD350: their commands are the same, and still it is not asked to run."""
    with line_with("gd300") as simulator, Bus(simulator) as bus:
        bus.drive(1, "gd300", unverified=True).prepare_control()
        before = len(written(simulator))
        with pytest.raises(NotAllowed, match="reports 010AH"):
            write(bus.drive(1, "gd350", unverified=True))
        assert len(written(simulator)) == before


def test_what_ends_a_motion_asks_only_what_tells_and_is_not_refused(gd300: tuple[Simulator, Bus]) -> None:
    """5 stops, 6 coasts, 8 ends a jog: GD350 manual, section 9.4.5. Its code tells a GD300, which halts alike."""
    simulator, bus = gd300
    drive = bus.drive(1, "gd350")
    for end, code in ((drive.stop, 5), (drive.coast, 6), (drive.jog_stop, 8)):
        before = len(asked(simulator))
        end(confirm=0)
        *looks, halt = asked(simulator)[before:]
        assert halt[:6].hex(" ") == f"01 06 20 00 00 {code:02x}"
        assert {frame[1] for frame in looks} == {3}
        assert len(looks) <= 3


def test_a_fault_is_reset_all_the_same(gd300: tuple[Simulator, Bus]) -> None:
    simulator, bus = gd300
    bus.drive(1, "gd300", unverified=True).prepare_control()
    simulator.drive(1).trip(4)
    before = len(written(simulator))
    drive = bus.drive(1, "gd350")
    drive.reset_fault()
    assert [frame[:6].hex(" ") for frame in written(simulator)[before:]] == ["01 06 20 00 00 07"]
    # That it was asked for the reset does not count as having been judged.
    with pytest.raises(NotAllowed, match="reports 010AH"):
        drive.write("P00.11", 2.0)


def test_reads_are_not_held_up(gd300: tuple[Simulator, Bus]) -> None:
    simulator, bus = gd300
    drive = bus.drive(1, "gd350")
    drive.status()
    drive.monitor()
    drive.read("P00.11")
    assert not [frame for frame in asked(simulator) if frame[2:4] == b"\x21\x03"]
    assert len(drive.backup()) > 0
    # Once for the head of the file, and once to see whether it stays the same drive.
    assert len([frame for frame in asked(simulator) if frame[2:4] == b"\x21\x03"]) == 2


def test_it_is_asked_once(gd300: tuple[Simulator, Bus]) -> None:
    simulator, bus = gd300
    drive = bus.drive(1, "gd300")
    for seconds in (2.0, 3.0, 4.0):
        drive.write("P00.11", seconds, unverified=True)
    assert len([frame for frame in asked(simulator) if frame[2:4] == b"\x21\x03"]) == 1


class TestWhatTellsNothing:
    """Firmwares differ, drives are locked, lines fail: only what is listed for another family speaks against one."""

    @pytest.mark.parametrize("named", ["gd300", "gd350", "gd600", "gd3000", "chf100a"])
    def test_a_code_that_no_list_names(self, gd300: tuple[Simulator, Bus], named: str) -> None:
        simulator, bus = gd300
        answer(simulator, 0x0199)
        bus.drive(1, named, unverified=True).write_words(0x000B, 20)
        assert len(written(simulator)) == 1

    def test_a_word_where_a_vfd500_has_no_code(
        self, vfd500: tuple[Simulator, Bus], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Whether it has a parameter at 2103H (it would be P33.03) is not printed."""
        simulator, bus = vfd500
        read = bus.read
        monkeypatch.setattr(bus, "read", lambda *what, **how: [3] if what[1] == CODE else read(*what, **how))
        bus.drive(1, "vfd500", unverified=True).write_setpoint(10.0, "torque")
        assert len(written(simulator)) == 1

    @pytest.mark.parametrize("exception", [0x01, 0x03, 0x04, 0x05, 0x06, 0x09])
    def test_an_exception_that_is_not_about_the_address(self, gd300: tuple[Simulator, Bus], exception: int) -> None:
        """09H: a password locks it, and it refuses whatever is asked. GD350 manual, section 9.4.7."""
        simulator, bus = gd300
        refuse(simulator, exception)
        bus.drive(1, "gd350").write("P00.11", 2.0)
        assert len(written(simulator)) == 1

    @pytest.mark.parametrize("exception", [0x06, 0x09, 0x0A, 0x0B])
    def test_a_refusal_that_passes_is_not_the_last_word(self, gd300: tuple[Simulator, Bus], exception: int) -> None:
        """06H: it was busy, or the request came damaged; 0AH and 0BH come from a gateway. Modbus V1.1b3, section 7.

        09H: a password locks it. Where the word would be kept by another family it is asked once more, and says GD300.
        """
        simulator, bus = gd300
        drive = bus.drive(1, "gd350")
        refuse(simulator, exception)
        with pytest.raises(NotAllowed, match="it may be INVT Goodrive300"):
            drive.write_words(0x000B, 20)
        with pytest.raises(NotAllowed, match="reports 010AH"):
            drive.write_words(0x000B, 30)
        assert written(simulator) == []

    def test_a_damaged_request_is_not_the_last_word_of_a_vfd500(self, vfd500: tuple[Simulator, Bus]) -> None:
        """03H is a frame error there. VFD500 manual, p. 133."""
        simulator, bus = vfd500
        drive = bus.drive(1, "vfd500", unverified=True)
        refuse(simulator, 0x03)
        drive.write_setpoint(10.0, "torque")
        before = len(asked(simulator))
        drive.write_setpoint(20.0, "torque")
        assert len(asked(simulator)) == before + 4, "three questions, and the write"

    def test_what_was_said_before_silence_counts(self, gd300: tuple[Simulator, Bus]) -> None:
        """It refuses r25.00, which each VFD500 has, and falls silent on the next question."""
        simulator, bus = gd300
        drive = bus.drive(1, "vfd500", unverified=True)
        simulator.line.script([(2, "silence")])
        with pytest.raises(NotAllowed, match="refuses 1900H"):
            drive.write_setpoint(10.0, "torque")
        assert written(simulator) == []

    @pytest.mark.parametrize("exception", [0x01, 0x03, 0x04, 0x05])
    def test_the_same_of_a_vfd500(self, vfd500: tuple[Simulator, Bus], exception: int) -> None:
        """05H: reading is refused, as a parameter may be. VFD500 manual, p. 133."""
        simulator, bus = vfd500
        refuse(simulator, exception)
        bus.drive(1, "vfd500", unverified=True).write_setpoint(10.0, "torque")
        assert len(written(simulator)) == 1

    def test_silence(self, gd300: tuple[Simulator, Bus]) -> None:
        simulator, bus = gd300
        drive = bus.drive(1, "gd350")
        simulator.line.script([(1, "silence")])
        with pytest.raises(NotAllowed, match="it may be INVT Goodrive300"):
            drive.write_words(0x000B, 20)
        # It did not tell all that it is asked, and is asked the next time.
        with pytest.raises(NotAllowed, match="reports 010AH"):
            drive.write_words(0x000B, 30)
        assert written(simulator) == []


class TestWhatTells:
    @pytest.mark.parametrize(
        ("word", "said"),
        [
            (0x01A0, r"01A0H, the code of Goodrive350 \(gd350\).*profile=\"gd350\""),
            # From its manual: a family without a profile.
            (0x0180, r"0180H, the code of IMO SD1 \(sd1\).*no profile of it"),
            (0x010D, r"010DH, the code of Goodrive10 mini \(gd10\).*profile=\"gd10\""),
            # Shared by three series, one of which has a profile.
            (0x010C, r"010CH, the code of Goodrive200A, older \(gd200a\).*profile=\"gd200a\""),
        ],
    )
    @pytest.mark.parametrize("named", ["gd35", "gd600", "vfd500"])
    def test_a_code_that_is_listed_for_another_family(
        self,
        vfd500: tuple[Simulator, Bus],
        monkeypatch: pytest.MonkeyPatch,
        named: str,
        word: int,
        said: str,
    ) -> None:
        simulator, bus = vfd500
        read = bus.read
        monkeypatch.setattr(bus, "read", lambda *what, **how: [word] if what[1] == CODE else read(*what, **how))
        with pytest.raises(NotAllowed, match=said):
            bus.drive(1, named, unverified=True).write_words(0x000B, 20)
        assert written(simulator) == []

    @pytest.mark.parametrize("word", [0x01A1, 0x01A2])
    def test_a_sister_that_reports_another_code(self, gd300: tuple[Simulator, Bus], word: int) -> None:
        """GD350-UL and GD350A: GD350 manual (manualshive 2085703), p. 329."""
        simulator, bus = gd300
        answer(simulator, word)
        bus.drive(1, "gd350").write("P00.11", 2.0)
        assert len(written(simulator)) == 1

    @pytest.mark.parametrize("address", [FAULT_500, SPEED_UNIT_500])
    def test_a_word_that_the_family_must_have(
        self, vfd500: tuple[Simulator, Bus], monkeypatch: pytest.MonkeyPatch, address: int
    ) -> None:
        simulator, bus = vfd500
        drive = bus.drive(1, "vfd500", unverified=True)
        read = bus.read

        def other(unit: int, place: int, *rest: int, **how: Any) -> list[int]:
            # 6300H is nowhere: the drive itself refuses.
            return read(unit, 0x6300 if place == address else place, *rest, **how)

        monkeypatch.setattr(bus, "read", other)
        with pytest.raises(NotAllowed, match=rf"refuses {address:04X}H \(exception 02H"):
            drive.write_setpoint(10.0, "torque")
        assert written(simulator) == []


class TestProfilesOfOnesOwn:
    @staticmethod
    def new(folder: Path, *options: str) -> Path:
        result = CliRunner().invoke(cli, ["profiles", "new", str(folder), *options])
        assert result.exit_code == 0, result.output
        return folder

    @staticmethod
    def contradiction(family: str, profile: Path) -> str | None:
        with line_with(family) as simulator, Bus(simulator) as bus:
            return bus.drive(1, profile).contradiction()

    def test_an_overlay_is_its_base(self, tmp_path: Path) -> None:
        folder = self.new(tmp_path / "ours", "--overlay", "gd300")
        assert self.contradiction("gd300", folder) is None
        assert "010AH" not in str(self.contradiction("gd350", folder))
        assert "reports 01A0H" in str(self.contradiction("gd350", folder))
        assert "refuses 2103H" in str(self.contradiction("gd600", folder))

    def test_one_that_extends_another_counts_as_that(self, tmp_path: Path) -> None:
        """It lists no code of its own: that its units refuse 2103H is no wonder, as the row is only assumed."""
        folder = self.new(tmp_path / "ours", "--like", "gd300")
        assert Profile.load(folder).family == "ours"
        assert self.contradiction("gd300", folder) is None
        assert "reports 01A0H" in str(self.contradiction("gd350", folder))
        assert self.contradiction("gd600", folder) is None

    def test_one_that_extends_another_and_has_a_code_is_known_by_that(self, tmp_path: Path) -> None:
        folder = self.new(tmp_path / "ours", "--like", "gd300")
        with (folder / "profile.toml").open("a", encoding="utf-8") as file:
            file.write(
                '\n[[identification.codes]]\ncode = 0x0199\nfamily = "ours"\ntitle = "Ours"\nverified = true\n'
                'source = "Our manual"\n'
            )
        assert "reports 010AH" in str(self.contradiction("gd300", folder))
        assert "refuses 2103H" in str(self.contradiction("gd600", folder))

    @pytest.mark.parametrize("options", [("--like", "gd350"), ("--overlay", "gd350")])
    def test_one_for_units_of_which_none_is_shipped_says_how_they_are_let_in(
        self, tmp_path: Path, gd300: tuple[Simulator, Bus], options: tuple[str, str]
    ) -> None:
        """0180H is an IMO SD1, whose manual nobody has made a profile from yet."""
        simulator, bus = gd300
        folder = self.new(tmp_path / "ours", *options)
        answer(simulator, 0x0180)
        told = str(bus.drive(1, folder).contradiction())
        assert "there is no profile of it yet. If ours is meant for such units, list that code under" in told
        with (folder / "profile.toml").open("a", encoding="utf-8") as file:
            file.write(
                f'\n[[identification.codes]]\ncode = 0x0180\nfamily = "{Profile.load(folder).family}"\n'
                'title = "Ours"\nverified = true\nsource = "Our manual"\n'
            )
        answer(simulator, 0x0180)
        assert bus.drive(1, folder).contradiction() is None

    def test_an_overlay_on_one_without_a_code_has_its_signature(self, tmp_path: Path) -> None:
        folder = self.new(tmp_path / "ours", "--overlay", "vfd500")
        assert self.contradiction("vfd500", folder) is None
        assert "refuses 1900H" in str(self.contradiction("gd600", folder))
        assert "reports 01A0H" in str(self.contradiction("gd350", folder))

    def test_one_with_codes_of_its_own_is_judged_by_them(self) -> None:
        """The EX-9 of the test vectors says 0900H or 0901H at 2103H."""
        ex9 = Path(__file__).resolve().parent.parent / "vectors/profiles/ex9"
        assert "reports 01A0H" in str(self.contradiction("gd350", ex9))
        assert "refuses 2103H" in str(self.contradiction("gd600", ex9))
        with line_with("gd350") as simulator, Bus(simulator) as bus:
            bus.echo(1)
            answer(simulator, 0x0901)
            assert bus.drive(1, ex9).contradiction() is None

    @pytest.mark.parametrize("unit", ["gd350", "gd600", "vfd500"])
    def test_one_that_says_nothing_of_how_its_units_are_known_is_not_judged(self, tmp_path: Path, unit: str) -> None:
        assert self.contradiction(unit, self.new(tmp_path / "ours")) is None


def at(port: str, *words: str, env: dict[str, str] | None = None) -> Result:
    """A command to a simulated drive, in virtual time."""
    result = CliRunner().invoke(cli, ["--port", f"sim://{port}?clock=virtual", *words], prog_name="drivebus", env=env)
    assert "Traceback" not in result.output
    return result


class TestCommandLine:
    @every_name
    def test_a_write_ends_with_2_and_says_why(self, named: str) -> None:
        """`raw` sends what it is told; `write` of a word that has no name is what every family can be told."""
        words = ["--profile", named, "write", "--force", "0x0FFE=1", "--yes"]
        for unit in sampled(named):
            result = at(unit, *words)
            if unit in TAKEN_FOR[named] and unit not in HELD_BACK.get(named, ()):
                assert result.exit_code == 4, result.output  # there is nothing at that address
                continue
            assert result.exit_code == 2, result.output
            assert f"unit 1 was named {named}" in result.stderr
            assert "--trust-profile" in result.stderr
            assert at(unit, "--trust-profile", *words).exit_code == 4

    def test_a_start(self) -> None:
        result = at("gd300", "--profile", "gd350", "prepare", "--yes")
        assert (result.exit_code, "--profile gd300" in result.stderr) == (2, True)
        assert at("gd300", "--profile", "gd350", "--trust-profile", "prepare", "--yes").exit_code == 0

    def test_a_stop_goes_out(self) -> None:
        for command in ("stop", "coast"):
            assert at("gd300", "--profile", "gd350", command).exit_code == 0

    def test_the_environment_does_not_say_it(self) -> None:
        """A variable that was set for one drive would be believed of the next."""
        env = {"DRIVEBUS_TRUST_PROFILE": "1", "DRIVEBUS_PROFILE": "gd350"}
        assert at("gd300", "prepare", "--yes", env=env).exit_code == 2

    def test_info_says_it(self) -> None:
        result = at("gd300", "--profile", "gd350", "info")
        assert result.exit_code == 0
        assert re.search(r"named gd350.*reports 010AH", result.stderr)
        said = at("gd300", "--profile", "gd350", "--json", "info").stdout.splitlines()[0]
        assert "reports 010AH" in json.loads(said)["contradiction"]
        said = at("gd300", "--json", "info").stdout.splitlines()[0]
        assert json.loads(said)["contradiction"] is None
