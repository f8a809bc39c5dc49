"""What a unit is taken for, and how sure that is. Codes: GD350 manual, chapter 9.4.5 and p. 329; GD300-LIFT, p. 130."""

from __future__ import annotations

import asyncio
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, DrivebusError, Identification, NotAllowed, Simulator
from drivebus.identify.identify import identify
from drivebus.line.asking import Read

UNITS = {1: "gd350", 2: "gd300", 3: "vfd500", 4: "gd600", 5: "gd35", 6: "gd3000"}
CODE, FAULT_500, SPEED_UNIT_500 = 0x2103, 0x1900, 0x1E0E


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(UNITS, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.25) as bus:
        yield bus


def answer(simulator: Simulator, unit: int, *words: int) -> None:
    """The next answer on the line."""
    body = bytes([unit, 3, 2 * len(words), *b"".join(word.to_bytes(2, "big") for word in words)])
    simulator.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))


def refusal(code: int) -> drivebus.Refused:
    return drivebus.Refused("no", unit=1, code=code, name="", meaning="")


@pytest.mark.parametrize(
    ("unit", "certainty", "family", "candidates", "code"),
    [
        (1, "certain", "gd350", ("gd350",), 0x01A0),
        (2, "shared", None, ("gd300", "Goodrive300L lift drive", "Goodrive310-UL"), 0x010A),
        (3, "by answers", "vfd500", ("vfd500",), None),
        (4, "unknown", None, (), None),
        (5, "certain", "gd35", ("gd35",), 0x0108),
    ],
)
def test_how_sure_it_is(
    simulator: Simulator,
    bus: Bus,
    unit: int,
    certainty: str,
    family: str | None,
    candidates: tuple[str, ...],
    code: int | None,
) -> None:
    found = bus.identify(unit)
    assert (found.unit, found.certainty, found.family) == (unit, certainty, family)
    assert (found.candidates, found.code) == (candidates, code)
    assert f"unit {unit}: " in str(found)
    assert found.reason in str(found)
    assert simulator.drive(unit).writes() == []


class Found:
    """A task of the core that found this out by a code: how sure each is by the rows of a code, its own tests hold."""

    def __init__(self, code: int, candidates: list[str], titles: list[str], certainty: str, source: str) -> None:
        self._told = {
            "candidates": candidates,
            "family": candidates[0] if len(candidates) == 1 else None,
            "code": code,
            "titles": titles,
            "certainty": certainty,
            "reason": ("code", (CODE, certainty, source, None)),
        }

    def step(self, *_: object) -> tuple[str, object]:
        return "done", ("found", self._told)


def test_a_code_that_no_document_prints(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    thin = Found(0x0180, ["sd1"], ["IMO SD1"], "unverified", "a program")
    monkeypatch.setattr("drivebus._native.identify", lambda _: thin)
    found = bus.identify(1)
    assert (found.certainty, found.family, found.candidates) == ("unverified", "sd1", ("sd1",))
    assert found.reason == "it reports 0180H, which no document prints for IMO SD1, only a program"


def test_a_family_without_a_profile(simulator: Simulator, bus: Bus) -> None:
    bus.read(1, CODE)  # first contact is over
    answer(simulator, 1, 0x0180)
    found = bus.identify(1)
    assert (found.certainty, found.family, found.candidates) == ("certain", "sd1", ("sd1",))
    answer(simulator, 1, 0x0180)
    with pytest.raises(NotAllowed, match=r"a sd1, a family without a profile yet; it reports 0180H"):
        bus.drive(1, unverified=True)


@pytest.mark.parametrize(
    ("code", "family"), [(0x0106, "gd20"), (0x0107, "gd200a"), (0x010B, "gd100"), (0x010D, "gd10"), (0x0180, "sd1")]
)
def test_a_code_of_a_sister(simulator: Simulator, bus: Bus, code: int, family: str) -> None:
    """GD300-LIFT manual, p. 131; GD310-UL, p. 211; GD20, p. 140; GD200A V2.6, p. 147; IMO SD1, p. 137."""
    bus.read(1, CODE)  # first contact is over
    answer(simulator, 1, code)
    found = bus.identify(1)
    assert (found.certainty, found.family) == ("certain", family)


def test_010ch_is_a_gd200a_or_one_of_two_without_a_profile(simulator: Simulator, bus: Bus) -> None:
    """GD200A manual (manualshive 2085746), p. 134; GD200L manual, p. 158; GD200: GD310-UL manual, p. 211."""
    bus.read(1, CODE)  # first contact is over
    answer(simulator, 1, 0x010C)
    found = bus.identify(1)
    assert (found.certainty, found.family) == ("shared", None)
    assert found.candidates == ("gd200a", "Goodrive200", "Goodrive200L")


def test_a_code_that_nobody_knows_does_not_fall_to_another_family(simulator: Simulator, bus: Bus) -> None:
    bus.read(3, FAULT_500)
    answer(simulator, 3, 0x0199)
    found = bus.identify(3)  # answers the rest as a VFD500, but those refuse this one
    assert (found.certainty, found.candidates, found.code) == ("unknown", (), 0x0199)


def test_a_drive_is_taken_only_if_that_is_sure(bus: Bus) -> None:
    assert bus.drive(1).profile.name == "gd350"
    with pytest.warns(drivebus.SharedCodeWarning):
        assert bus.drive(2).profile.name == "gd300"  # the only one of those that report 010AH which has a profile
    with pytest.raises(NotAllowed, match=r"may be vfd500; .*\(by answers.*profile=….*unverified=True"):
        bus.drive(3)
    assert bus.drive(3, unverified=True).profile.name == "vfd500"
    for unverified in (False, True):
        with pytest.raises(NotAllowed, match=r"could not be identified.*gd600.*profile=…") as refused:
            bus.drive(4, unverified=unverified)
        assert "unverified=True" not in str(refused.value)
    assert bus.drive(4, "gd600").profile.name == "gd600"


class TestTheStateBesideTheCode:
    """A Delta VFD-F has its output frequency at 2103H (manual, p. 5-58), in 0.01 Hz: at 4.16 Hz that is 01A0H."""

    @staticmethod
    def of(code: int, state: int | Exception) -> Identification:
        """What a unit is taken for that has *code* at 2103H and *state* at 2100H, or refuses that."""

        async def ask(read: Read) -> list[int]:
            told = {CODE: code, 0x2100: state}[read.address]
            if isinstance(told, Exception):
                raise told
            return [told]

        return asyncio.run(identify(ask, 1))

    @pytest.mark.parametrize("state", [1, 2, 3, 4, 5, 6])
    def test_in_each_state_of_such_a_drive_it_is_one(self, state: int) -> None:
        assert self.of(0x01A0, state).certainty == "certain"

    @pytest.mark.parametrize(
        ("state", "says"), [(0, "says 0 at 2100H"), (7, "says 7 at 2100H"), (refusal(0x02), "refuses 2100H")]
    )
    @pytest.mark.parametrize(("code", "family"), [(0x01A0, "gd350"), (0x010A, None)])
    def test_in_none_it_is_not_sure(self, state: int | Exception, says: str, code: int, family: str | None) -> None:
        found = self.of(code, state)
        assert (found.certainty, found.family, found.code) == ("unverified", family, code)
        assert says in found.reason

    @pytest.mark.parametrize("state", [refusal(0x09), refusal(0x06), drivebus.NoAnswer("nothing")])
    def test_who_does_not_tell_says_nothing_against_it(self, state: Exception) -> None:
        """09H: a password locks it."""
        assert self.of(0x01A0, state).certainty == "certain"

    def test_nothing_is_commanded_on_such_a_word(self, simulator: Simulator, bus: Bus) -> None:
        bus.read(3, FAULT_500)  # first contact is over
        answer(simulator, 3, 0x01A0)
        with pytest.raises(NotAllowed, match=r"may be gd350; .*refuses 2100H.*\(unverified\)"):
            bus.drive(3)


GD300_OR_ELSE = "gd300, Goodrive300L lift drive and Goodrive310-UL"


def test_a_code_that_three_report_names_all_three(bus: Bus) -> None:
    """GD300L manual, p. 130; GD310-UL manual, p. 211."""
    found = bus.identify(2)
    assert found.reason == f"it reports 010AH, which {GD300_OR_ELSE} share"
    assert found.title == "Goodrive300 vector, Goodrive300L lift drive or Goodrive310-UL"


def test_a_drive_that_is_taken_for_one_of_several_says_so(bus: Bus) -> None:
    taken = rf"unit 2 is taken for a gd300.*010AH, which {GD300_OR_ELSE} share.*profile=\"gd300\""
    with pytest.warns(drivebus.SharedCodeWarning, match=taken) as told:
        bus.drive(2)
    assert [each.filename for each in told] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bus.drive(2, "gd300")
        bus.drive(1)


@pytest.mark.parametrize("names", [("gd300", "gd35"), ("gd300", "gd35", "gd600"), ("gd300", "gd35", "gd600", "gd9000")])
def test_a_code_of_several_families_with_profiles_is_not_enough(
    bus: Bus, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...]
) -> None:
    several = Found(0x010A, list(names), [name.upper() for name in names], "shared", "a manual")
    monkeypatch.setattr("drivebus._native.identify", lambda _: several)
    found = bus.identify(2)
    assert (found.certainty, found.candidates, found.family) == ("shared", names, None)
    all_but_last = ", ".join(names[:-1])
    assert found.reason == f"it reports 010AH, which {all_but_last} and {names[-1]} share"
    for unverified in (False, True):
        with pytest.raises(
            NotAllowed, match=rf"may be {all_but_last} or {names[-1]}; .*\(shared\).*give profile="
        ) as told:
            bus.drive(2, unverified=unverified)
        assert "unverified=True" not in str(told.value)


def test_who_stays_silent_is_silent(bus: Bus) -> None:
    for ask in (bus.identify, bus.drive):
        with pytest.raises(drivebus.NoAnswer):
            ask(9)
    with pytest.raises(NotAllowed):
        bus.identify(0)


@pytest.mark.parametrize("exception", [0x0A, 0x0B])
def test_who_is_silent_behind_a_gateway_is_silent(simulator: Simulator, exception: int) -> None:
    """A gateway answers for the unit: it has no path to it, or heard nothing. Modbus V1.1b3, section 7."""
    body = bytes([1, 0x83, exception])
    refusal = body + drivebus.crc16(body).to_bytes(2, "little")
    with Bus(simulator, timeout=0.25, retries=0) as bus:
        bus.echo(1)
        simulator.line.answer_with(refusal)
        with pytest.raises(drivebus.NoAnswer, match=rf"no answer, says .*gateway.*exception {exception:02X}H"):
            bus.identify(1)
        simulator.line.answer_with(refusal)
        assert [found.unit for found in bus.scan([1, 2])] == [2]


def test_a_scan_tells_how_sure_it_is(simulator: Simulator, bus: Bus) -> None:
    found = {each.unit: (each.profile, each.certainty) for each in bus.scan(range(1, 8))}
    assert found == {
        1: ("gd350", "certain"),
        2: ("gd300", "shared"),
        3: ("vfd500", "by answers"),
        4: (None, "unknown"),
        5: ("gd35", "certain"),
        6: (None, "unknown"),
    }
    assert all(simulator.drive(unit).writes() == [] for unit in UNITS)


def test_both_faces_ask_and_tell_the_same(bus: Bus) -> None:
    async def main() -> list[Identification]:
        with Simulator(UNITS, transport="process", clock="virtual") as other:
            async with drivebus.aio.Bus(other, timeout=0.25) as awaitable:
                told = [await awaitable.identify(unit) for unit in UNITS]
                with pytest.raises(NotAllowed, match="may be vfd500"):
                    await awaitable.drive(3)
                assert (await awaitable.drive(3, unverified=True)).unverified
                return told

    assert asyncio.run(main()) == [bus.identify(unit) for unit in UNITS]


SPEED_ROW = "0x2103,output_frequency,Output frequency,Hz,100,no,,,,ro,yes,,a manual\n"


class TestAfterThePortWasOpenedAgain:
    """Another drive may answer there; a family without a code is known by what it answers and refuses."""

    @staticmethod
    def reopen(simulator: Simulator, bus: Bus) -> None:
        simulator.line.unplug()
        with pytest.raises(drivebus.PortError):
            bus.read(3, FAULT_500)
        simulator.line.replug()

    def test_the_same_one_is_written_to(self, simulator: Simulator, bus: Bus) -> None:
        drive = bus.drive(3, "vfd500", unverified=True)
        drive.write_setpoint(10.0, "torque")
        self.reopen(simulator, bus)
        drive.write_setpoint(20.0, "torque")
        assert [value for _, _, value in simulator.drive(3).writes()] == [1000, 2000]

    @pytest.mark.parametrize(("word", "says"), [(0x01A0, "01A0H"), (0, "answered")])
    def test_another_one_is_not(
        self, simulator: Simulator, bus: Bus, monkeypatch: pytest.MonkeyPatch, word: int, says: str
    ) -> None:
        drive = bus.drive(3, "vfd500", unverified=True)
        drive.write_setpoint(10.0, "torque")
        self.reopen(simulator, bus)
        read = bus.read
        monkeypatch.setattr(bus, "read", lambda *what, **how: [word] if what[1] == CODE else read(*what, **how))
        with pytest.raises(NotAllowed, match=rf"another drive answers as unit 3.*2103H refused.*2103H {says} now"):
            drive.write_setpoint(20.0, "torque")
        assert [value for _, _, value in simulator.drive(3).writes()] == [1000]

    def test_one_without_a_signature_is_known_by_its_state_word(
        self, simulator: Simulator, bus: Bus, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        drive = bus.drive(4, "gd600")
        drive.write("P01.20", 5.0, store=True, unverified=True)
        self.reopen(simulator, bus)
        read = bus.read

        def other(unit: int, address: int, *rest: int, **how: Any) -> list[int]:
            if address == 0x2100:
                raise drivebus.Refused("no such address", code=2)
            return read(unit, address, *rest, **how)

        monkeypatch.setattr(bus, "read", other)
        with pytest.raises(NotAllowed, match="another drive answers as unit 4"):
            drive.write("P01.20", 6.0, store=True, unverified=True)

    @pytest.mark.parametrize(("row", "turning"), [("", 5_000), (SPEED_ROW, 5_000), (SPEED_ROW, 0x01A0)])
    def test_what_a_drive_of_ones_own_has_where_others_have_a_code_may_change(
        self, simulator: Simulator, bus: Bus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, row: str, turning: int
    ) -> None:
        """A Delta VFD-F has its output frequency at 2103H: manual, p. 5-58."""
        own(tmp_path, row)
        frequency = [0]
        read = bus.read
        monkeypatch.setattr(bus, "read", lambda *what, **how: frequency if what[1] == CODE else read(*what, **how))
        drive = bus.drive(4, tmp_path)
        drive.write("setting", 1, unverified=True)
        self.reopen(simulator, bus)
        frequency[0] = turning
        drive.write("setting", 2, unverified=True)
        assert [value for _, _, value in simulator.drive(4).writes()] == [1, 2]


def own(folder: Path, row: str) -> None:
    """A profile of one's own that does not say how its units are known."""
    (folder / "profile.toml").write_text(
        """
name = "own"
title = "Our drive"
kind = "inverter"
version = 1
source = "a manual"
[requests]
functions = [3, 6]
max_words = 1
source = "a manual"
[parameters]
address = "group.index"
source = "a manual"
""",
        encoding="utf-8",
    )
    head = "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n"
    setting = "0x2001,setting,Setting,,1,no,,,,rw,yes,,a manual\n"
    (folder / "registers.csv").write_text(head + setting + row, encoding="utf-8")
    (folder / "parameters.csv").write_text(
        "code,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n",
        "utf-8",
    )
    (folder / "faults.csv").write_text("code,mnemonic,label,cause,remedy,verified,note,source\n", encoding="utf-8")


def test_one_that_a_password_locks_says_what_to_do(bus: Bus) -> None:
    """Exception 09H: GD350 manual, chapter 9.4.7."""
    bus.drive(1).write("P07.00", 12, store=True, unverified=True)
    with pytest.raises(NotAllowed, match=r"refuses 2103H \(exception 09H.*user password.*at the keypad"):
        bus.drive(1)


@pytest.mark.parametrize("family", ["gd350", "vfd500", "ms300", "a1000", "eds300", "sunfar-e300", "atv312", "acs355"])
def test_one_that_was_identified_is_halted_by_the_first_frame(family: str) -> None:
    """Also where no code says what it is, and its answers did: they are not asked for twice."""
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, unverified=True)
        seen = len(simulator.line.trace())
        with suppress(DrivebusError):
            drive.stop()
        first = next(frame for _, who, frame in simulator.line.trace()[seen:] if who == "master")
        assert first[1] in (0x05, 0x06, 0x10), first.hex()
