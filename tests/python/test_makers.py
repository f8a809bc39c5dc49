"""Families of other makers, through a whole job: their words typed here by hand, and looked for on the wire.

Where each of them is printed stands in `tests/vectors/families.toml` and in the profiles. The drive is the simulated
one, which is typed from the manuals apart from the profile.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Simulator


@dataclass(frozen=True)
class Maker:
    """What goes over the wire in a job: requests in hex, without unit and CRC."""

    family: str
    forward: tuple[str, ...]
    """Forward at 20 Hz, in one request or two; or as its keypad has it, if no setpoint is known."""
    reverse: str
    stop: str
    reset: str
    fault: int
    shown: str | None = None
    """What the keypad shows for that number; None where no register tells it."""
    coast: str | None = None
    prepare: tuple[str, ...] = ()
    forward_alone: str | None = None
    """Forward, as it was set."""
    hertz: float | None = 20.0
    """What it is set to; None where it turns at the 50 Hz of its keypad."""
    jogs: tuple[str, str] | None = None
    """A jog forward, and its end."""
    variants: dict[str, str] = field(default_factory=dict)
    unverified: bool = True
    """Whether something of the job needs that."""
    sure: bool = False
    """Whether its own manual prints all that starts and stops it."""


MAKERS = [
    Maker(
        "ms300",
        prepare=("06 00 15 00 02", "06 00 14 00 01"),
        forward=("10 20 00 00 02 04 00 12 07 d0",),
        reverse="06 20 00 00 22",
        stop="06 20 00 00 01",
        reset="06 20 02 00 02",
        fault=21,
        shown="oL",
    ),
    Maker(
        "vfd-e",
        prepare=("06 02 01 00 03", "06 02 00 00 03"),
        forward=("10 20 00 00 02 04 00 12 07 d0",),
        reverse="06 20 00 00 22",
        stop="06 20 00 00 01",
        reset="06 20 02 00 02",
        fault=7,
        # No list of its faults is at hand.
        shown="",
    ),
    Maker(
        "yl620",
        # 20.0 Hz are 200 counts.
        prepare=("06 00 01 00 03", "06 07 08 00 05"),
        forward=("06 20 01 00 c8", "06 20 00 00 12"),
        reverse="06 20 00 00 22",
        stop="06 20 00 00 01",
        reset="06 20 00 00 80",
        fault=4,
        shown="Er.02",
        # What makes it obey the bus is copied from programs, and the range of its setpoint is not printed.
        unverified=True,
        sure=True,
        forward_alone="06 20 00 00 12",
    ),
    Maker(
        "md500",
        # 20 Hz are 40 % of 50 Hz: 4000 of 10000.
        prepare=("06 f0 02 00 02", "06 f0 03 00 09"),
        forward=("06 10 00 0f a0", "06 20 00 00 01"),
        reverse="06 20 00 00 02",
        stop="06 20 00 00 06",
        coast="06 20 00 00 05",
        # A jog ends by the stop.
        jogs=("06 20 00 00 03", "06 20 00 00 06"),
        reset="06 20 00 00 07",
        fault=4,
        # No page at hand has what the keypad shows.
        shown="",
        # F0-03, and that F0-10 counts hundredths of a hertz, are from memory.
        unverified=True,
    ),
    Maker(
        "a1000",
        variants={"speed_unit": "Hz"},
        forward=("10 00 01 00 02 04 00 01 07 d0",),
        reverse="10 00 01 00 01 02 00 02",
        stop="10 00 01 00 01 02 00 00",
        reset="10 00 01 00 01 02 00 08",
        fault=7,
        # Its frequency and current are known from memory alone.
        unverified=True,
        sure=True,
        forward_alone="10 00 01 00 01 02 00 01",
    ),
    # The first frame of its manual's example, but for the frequency.
    Maker(
        "j1000",
        variants={"speed_unit": "Hz"},
        forward=("10 00 01 00 02 04 00 01 07 d0",),
        reverse="10 00 01 00 01 02 00 02",
        stop="10 00 01 00 01 02 00 00",
        reset="10 00 01 00 01 02 00 08",
        fault=8,
        unverified=True,
        forward_alone="10 00 01 00 01 02 00 01",
    ),
    # 1770H at FA01H is 60 Hz in its manual.
    Maker(
        "vf-s15",
        forward=("06 fa 01 07 d0", "06 fa 00 c4 00"),
        reverse="06 fa 00 c6 00",
        stop="06 fa 00 c0 00",
        coast="06 fa 00 c8 00",
        reset="06 fa 00 e0 00",
        fault=0x0E,
        shown="",
        unverified=True,
    ),
    # The setpoint at S05, then S06, bits 0 and 1; 1 at S14 resets.
    Maker(
        "frenic",
        forward=("06 07 05 07 d0", "06 07 06 00 01"),
        reverse="06 07 06 00 02",
        stop="06 07 06 00 00",
        reset="06 07 0e 00 01",
        fault=0x0E,
        shown="",
        unverified=True,
    ),
    # The frames of a F510: 01 06 25 01 00 01, 00 03 and 00 00; a run and its frequency in one, as in its own addendum.
    Maker(
        "e510",
        prepare=("06 00 02 00 02", "06 00 05 00 05"),
        forward=("10 25 01 00 02 04 00 01 07 d0",),
        reverse="06 25 01 00 03",
        stop="06 25 01 00 00",
        reset="06 25 01 00 08",
        fault=13,
        shown="OL1",
        sure=True,
        forward_alone="06 25 01 00 01",
    ),
    # The same of its own manual; 00-05 is another.
    Maker(
        "f510",
        prepare=("06 00 02 00 02", "06 00 05 00 03"),
        forward=("10 25 01 00 02 04 00 01 07 d0",),
        reverse="06 25 01 00 03",
        stop="06 25 01 00 00",
        reset="06 25 01 00 08",
        fault=5,
        shown="OL1",
        sure=True,
        forward_alone="06 25 01 00 01",
    ),
    Maker(
        "saj8000m",
        hertz=None,
        forward=("06 10 00 00 01",),
        reverse="06 10 00 00 02",
        stop="06 10 00 00 05",
        coast="06 10 00 00 06",
        jogs=("06 10 00 00 03", "06 10 00 00 08"),
        reset="06 10 00 00 07",
        fault=4,
        shown="",
        # Its frequency and current stand where those of a CHF100A do, which is assumed.
        unverified=True,
        sure=True,
        forward_alone="06 10 00 00 01",
    ),
    Maker(
        "eds300",
        forward=("06 20 01 07 d0", "06 20 00 00 07"),
        reverse="06 20 00 00 08",
        stop="06 20 00 00 06",
        jogs=("06 20 00 00 03", "06 20 00 00 02"),
        reset="06 20 00 00 09",
        fault=8,
        shown="E008",
        # The range of its setpoint is not printed.
        unverified=True,
        sure=True,
        forward_alone="06 20 00 00 07",
    ),
    Maker(
        "sunfar-e300",
        forward=("10 10 01 00 02 04 00 01 00 c8",),
        reverse="06 10 01 00 02",
        stop="06 10 01 00 03",
        jogs=("06 10 01 00 04", "06 10 01 00 06"),
        reset="06 10 01 00 20",
        fault=12,
        shown="",
        # The range of its setpoint is not printed.
        unverified=True,
        sure=True,
        forward_alone="06 10 01 00 01",
    ),
]

each = pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.family)


@pytest.fixture
def line(maker: Maker) -> Iterator[Simulator]:
    with Simulator({1: maker.family}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator, maker: Maker) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, maker.family, unverified=maker.unverified, variants=maker.variants or None)


def written(line: Simulator) -> list[str]:
    """The writes so far, without unit and CRC."""
    frames = [data for _, who, data in line.line.trace() if who == "master" and data[1] in (0x05, 0x06, 0x10)]
    return [data[1:-2].hex(" ") for data in frames]


def words_in(frames: list[str]) -> int:
    """How many words these requests write."""
    return sum(1 if frame.startswith("06") else int(frame[9:14].replace(" ", ""), 16) for frame in frames)


@each
def test_a_whole_job_is_these_bytes(line: Simulator, drive: Drive, maker: Maker) -> None:
    machine = line.drive(1)
    drive.prepare_control(store=drive.profile.memory() is None)
    assert drive.check_control()
    assert written(line) == [*maker.prepare]

    turning = 50.0 if maker.hertz is None else maker.hertz
    drive.run(maker.hertz)
    drive.wait_for_speed(turning, timeout=30.0)
    # A tenth of a hertz below it counts as there.
    line.advance(0.1)
    assert machine.frequency == pytest.approx(turning)
    assert written(line) == [*maker.prepare, *maker.forward]
    status = drive.status()
    assert (status.state, status.fault) == (drivebus.State.FORWARD, None)
    seen = drive.monitor()
    assert seen["running_frequency"] == pytest.approx(turning)
    # Where that of a FRENIC stands, no page at hand has with its unit.
    assert "output_current" not in seen or seen["output_current"] > 0.0
    drive.run(reverse=True)
    line.advance(25.0)
    assert machine.frequency == pytest.approx(-turning)
    assert drive.status().state is drivebus.State.REVERSE
    drive.stop()
    drive.wait_until_stopped(timeout=30.0)
    assert machine.speed == 0.0
    # The line keeps the latest frames.
    assert written(line)[-2:] == [maker.reverse, maker.stop]
    assert [word for *_, word in machine.writes()][-2:] == [
        int(sent[-5:].replace(" ", ""), 16) for sent in written(line)[-2:]
    ]
    assert machine.words_written == 2 + words_in([*maker.prepare, *maker.forward])


@each
def test_a_fault_is_told_kept_from_starting_and_reset(line: Simulator, drive: Drive, maker: Maker) -> None:
    drive.prepare_control(store=drive.profile.memory() is None)
    line.drive(1).trip(maker.fault)
    if maker.shown is None:
        assert drive.status().state is drivebus.State.FAULT
        with pytest.raises(NotAllowed, match="no fault register"):
            drive.fault()
    else:
        fault = drive.fault()
        assert fault is not None
        assert (fault.code, fault.mnemonic) == (maker.fault, maker.shown)
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run()
    drive.reset_fault()
    assert (drive.status().state, line.drive(1).fault) == (drivebus.State.STOPPED, 0)
    # A second time there is nothing to reset, and nothing is sent.
    drive.reset_fault()
    assert written(line) == [*maker.prepare, maker.reset]


@each
def test_it_coasts_where_a_word_for_that_is_known(line: Simulator, drive: Drive, maker: Maker) -> None:
    drive.prepare_control(store=drive.profile.memory() is None)
    drive.run(maker.hertz)
    line.advance(5.0)
    before = written(line)
    if maker.coast is None:
        with pytest.raises(NotAllowed, match="no command coast"):
            drive.coast()
        assert written(line) == before
        return
    drive.coast()
    assert (line.drive(1).frequency, line.drive(1).speed > 0.0) == (0.0, True)
    assert written(line) == [*before, maker.coast]


@each
def test_it_jogs_where_words_for_that_are_known(line: Simulator, drive: Drive, maker: Maker) -> None:
    drive.prepare_control(store=drive.profile.memory() is None)
    before = written(line)
    if maker.jogs is None:
        with pytest.raises(NotAllowed, match="no command jog_forward"):
            drive.jog()
        assert written(line) == before
        return
    drive.jog()
    line.advance(2.0)
    assert line.drive(1).state == "forward"
    assert line.drive(1).frequency == pytest.approx(5.0)
    if maker.jogs[1] == maker.stop:
        drive.stop()
    else:
        drive.jog_stop()
    drive.wait_until_stopped(timeout=30.0)
    assert written(line) == [*before, *maker.jogs]


@each
def test_nothing_goes_out_that_no_document_of_it_prints(line: Simulator, maker: Maker) -> None:
    with Bus(line) as bus:
        plain = bus.drive(1, maker.family)
        if maker.sure:
            if maker.prepare:
                bus.drive(1, maker.family, unverified=True).prepare_control(store=True)
            plain.run()
            plain.stop()
            assert written(line) == [*maker.prepare, maker.forward_alone, maker.stop]
            return
        for write in (Drive.run, Drive.jog):
            with pytest.raises(NotAllowed):
                write(plain)
    assert written(line) == []


class TestDelta:
    """MS300 manual (easymanua.ls delta vfd2a8ms21ansaa), p. 799; the bits of 2000H: CP2000 manual, p. 514."""

    @pytest.fixture
    def line(self) -> Iterator[Simulator]:
        with Simulator({1: "ms300"}, transport="process", clock="virtual") as line:
            yield line

    @staticmethod
    def turning(line: Simulator, bus: Bus, hertz: float) -> None:
        drive = bus.drive(1, "ms300", unverified=True)
        drive.prepare_control(store=True)
        drive.run(hertz)
        line.advance(10.0)

    def test_it_is_known_by_its_answers(self, line: Simulator) -> None:
        with Bus(line) as bus:
            found = bus.identify(1)
        assert (found.family, found.certainty) == ("ms300", "by answers")
        asked = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x03]
        assert list(dict.fromkeys(asked)) == [
            *("2103", "1900", "2104", "2106", "200b", "3000", "091b", "2108"),
            *(
                "7000",
                "004b",
                "0020",
                "0502",
                "0030",
                "2180",
                "d000",
                "045c",
                "0c81",
                "006d",
                "0003",
                "c417",
                "080e",
                "fd00",
                "2520",
                "083e",
                "1003",
            ),
            "1028",
            "008b",
            "006f",
            "0013",
        ]

    @pytest.mark.parametrize(("hertz", "word"), [(4.16, 0x01A0), (2.64, 0x0108), (2.66, 0x010A)])
    def test_at_a_frequency_that_reads_as_a_code_it_is_not_surely_another(
        self, line: Simulator, hertz: float, word: int
    ) -> None:
        with Bus(line) as bus:
            self.turning(line, bus, hertz)
            assert bus.read(1, 0x2103) == [word]
            found = bus.identify(1)
            assert found.certainty == "unverified"
            assert "says 0 at 2100H" in found.reason
            before = written(line)
            with pytest.raises(NotAllowed, match="could not be identified for sure"):
                bus.drive(1)
        assert written(line) == before

    @pytest.mark.parametrize("named", ["gd350", "gd35", "gd300", "gd600", "gd3000", "chf100a", "chv100"])
    def test_named_as_another_it_gets_no_reset(self, line: Simulator, named: str) -> None:
        """7 has the bits of "jog and run". 4 (GFF) at 2100H reads as the state "fault" of an INVT drive."""
        line.drive(1).trip(4)
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            with pytest.raises((NotAllowed, drivebus.Refused)):
                drive.reset_fault()
            told = drive.contradiction()
        assert told is not None
        assert "it answers and refuses what a Delta MS300 (ms300) does" in told
        assert written(line) == []

    def test_what_coasts_a_goodrive_runs_it(self, line: Simulator) -> None:
        """Why the right profile matters: `coast` asks nothing before it is sent."""
        with Bus(line) as bus:
            bus.drive(1, "ms300", unverified=True).prepare_control(store=True)
            bus.write(1, 0x2001, 1000)
            bus.write(1, 0x2000, 6, force=True)
            line.advance(1.0)
            assert line.drive(1).state == "forward"

    @pytest.mark.parametrize(("word", "fault", "warning"), [(0x3500, 0, "53"), (0x3504, 4, "53"), (0x0015, 21, "0")])
    def test_a_warning_is_no_fault(self, word: int, fault: int, warning: str) -> None:
        profile = drivebus.Profile.builtin("ms300")
        assert profile.fault_number(word) == fault
        assert profile.fields("fault_code", word)["warning"] == warning

    def test_a_warning_keeps_nobody_from_starting(self, line: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
        with Bus(line) as bus:
            drive = bus.drive(1, "ms300", unverified=True)
            drive.prepare_control(store=True)
            stamped = bus.read_stamped

            def warned(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
                words, sent, came = stamped(unit, address, count, **how)
                return [word | 0x3500 if address + at == 0x2100 else word for at, word in enumerate(words)], sent, came

            monkeypatch.setattr(bus, "read_stamped", warned)
            drive.run(20.0)
            assert drive.status().fault is None
            assert drive.fault() is None


class TestYaskawa:
    """A1000 Technical Manual SIEP C710616 27G (manualarchiveguide 4780715), pp. 559 and 561."""

    @pytest.fixture
    def line(self) -> Iterator[Simulator]:
        with Simulator({1: "a1000"}, transport="process", clock="virtual") as line:
            yield line

    def test_it_is_known_by_its_answers_and_says_its_name(self, line: Simulator) -> None:
        with Bus(line) as bus:
            found = bus.identify(1)
            assert bytes(bus.read(1, 0x0034)[0].to_bytes(2, "big")) == b"A0"
        assert (found.family, found.certainty) == ("a1000", "by answers")

    def test_its_speed_has_no_unit_until_somebody_says_it(self, line: Simulator) -> None:
        with Bus(line) as bus:
            drive = bus.drive(1, "a1000")
            with pytest.raises(NotAllowed, match="speed_unit"):
                drive.run(20.0)
            in_rpm = bus.drive(1, "a1000", unverified=True, variants={"speed_unit": "rpm"})
            with pytest.raises(NotAllowed, match="rpm"):
                in_rpm.setpoint = 20.0
        assert written(line) == []

    def test_a_parameter_is_not_written(self, line: Simulator) -> None:
        """It would take effect by an Enter command only, which is not given."""
        with Bus(line) as bus:
            drive = bus.drive(1, "a1000", unverified=True)
            with pytest.raises(NotAllowed, match="read-only"):
                drive.write("b1-02", 2, store=True)
        assert written(line) == []

    def test_every_write_goes_by_10h(self, line: Simulator) -> None:
        """A manual of a V1000 option (p. 21): 03H, 08H and 10H, and no others."""
        with Bus(line) as bus:
            with pytest.raises(drivebus.Refused):
                bus.write(1, 0x0001, 0)
            drive = bus.drive(1, "a1000", unverified=True)
            drive.write_words(0x0001, 1)
            drive.stop()
        assert written(line)[1:] == ["10 00 01 00 01 02 00 01", "10 00 01 00 01 02 00 00"]

    @pytest.mark.parametrize("named", ["V1000", "Q2A", "GA700", "GA800", "GA500"])
    def test_its_sisters_are_run_by_the_frame_of_their_manual(self, line: Simulator, named: str) -> None:
        """01 10 00 01 00 02 04 00 01 17 70 6D B7, forward at 60.00 Hz: GA700 manual (yaskawaindia.in, pageid 1146)."""
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True, variants={"speed_unit": "Hz"})
            drive.run(60.0)
            drive.stop()
            sent = [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] == 0x10]
        assert sent[0] == "01 10 00 01 00 02 04 00 01 17 70 6d b7"
        assert written(line)[1:] == ["10 00 01 00 01 02 00 00"]

    @pytest.mark.parametrize(
        ("asked", "code", "means"),
        [
            # 02 83 03 F1 31 and 01 90 02 CD C1 stand on p. 284 of the GA700's (SIEPC71061705H).
            ("03 00 20 00 11", 0x03, "no_such"),
            ("10 0f 00 00 01 02 00 00", 0x02, "no_such"),
            ("10 00 01 00 01 02 00 03", 0x21, "no_such"),
            ("10 00 4b 00 01 02 00 00", 0x22, "not_now"),
        ],
    )
    def test_it_refuses_by_the_codes_of_its_sisters(self, line: Simulator, asked: str, code: int, means: str) -> None:
        """V1000 Option EtherNet/IP Technical Manual, p. 39."""
        with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
            bus.transact(1, bytes.fromhex(asked), force=True)
        assert refused.value.code == code
        assert drivebus.Profile.builtin("a1000").exception_means(code) == means

    @pytest.mark.parametrize("named", ["gd350", "gd600", "gd3000", "chf100a", "chv100", "ms300", "vfd500"])
    def test_named_as_another_it_gets_nothing(self, line: Simulator, named: str) -> None:
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            with pytest.raises(NotAllowed):
                drive.write_words(0x0001, [2])
        assert written(line) == []
