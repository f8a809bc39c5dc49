"""What a drive asks of its bus: which write may be repeated, what goes first, and what is said when nothing is known.

The bus is a stand-in: words in a dict, and a record of what was asked of it and how. A real line would answer before a
test could tell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pytest

import drivebus
from drivebus import Drive, Profile

CONTROL, SETPOINT, STATE, IDENTIFICATION, FREQUENCY = 0x2000, 0x2001, 0x2100, 0x2103, 0x3000
SOURCE, MAXIMUM, FREQUENCY_SOURCE, ACCELERATION, DECELERATION = 0x0001, 0x0003, 0x0006, 0x000B, 0x000C
RAM = 0x8000
FORWARD, STOPPED = 1, 3
STOP = 5
COMMUNICATION = 2 << 5 | 1
"""Status word 2: ready, commands from communication. GD350 manual, chapter 9.4.5."""

MODBUS = 8
"""P00.06: frequency A comes from Modbus. GD350 manual, chapter 9.4.5."""


class StandIn:
    """Answers as a GD350 that obeys the bus and stands, until told otherwise.

    Attributes:
        words: What stands at each address.
        asked: Every call: what it was, and its arguments.
        failures: Errors for the next calls, in order; None lets one through.
        clock: Seconds.
    """

    def __init__(self) -> None:
        self.words = {STATE: STOPPED, STATE + 1: COMMUNICATION, STATE + 2: 0, IDENTIFICATION: 0x01A0}
        self.words |= {MAXIMUM: 5000, FREQUENCY_SOURCE: MODBUS}
        self.asked: list[tuple[str, int, dict[str, Any]]] = []
        self.failures: list[drivebus.DrivebusError | None] = []
        self.reconnects = 0
        self.closed = False
        self.clock = 100.0
        self.window: list[bool] = []

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float, /) -> None:
        self.clock += seconds

    def link(self, _: int, /) -> drivebus.Link:
        last = self.window[-10:]
        return drivebus.Link(sum(last), len(last))

    def read(self, _: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False) -> list[int]:
        self._take("read", address, urgent=urgent, verify=verify)
        return [self.words.get(address + offset, 0) for offset in range(count)]

    def read_stamped(
        self, unit: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False
    ) -> tuple[list[int], float, float]:
        return self.read(unit, address, count, urgent=urgent, verify=verify), self.clock, self.clock

    def write(
        self,
        _: int,
        address: int,
        value: int | Sequence[int],
        /,
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        force: bool = False,
    ) -> None:
        if connection is not None and connection != self.reconnects:
            raise drivebus.PortError("opened again; nothing was sent")
        self._take("write", address, value=value, urgent=urgent, read_back=read_back, force=force)
        words = [value] if isinstance(value, int) else value
        self.words.update(enumerate(words, address & ~RAM))
        if address == CONTROL:
            self.words[STATE] = FORWARD if words[0] in (1, 3) else STOPPED

    def calls(self, what: str) -> list[tuple[int, dict[str, Any]]]:
        """The calls of one kind, in order."""
        return [(address, how) for kind, address, how in self.asked if kind == what]

    def _take(self, what: str, address: int, **how: Any) -> None:
        self.asked.append((what, address, how))
        failure = self.failures.pop(0) if self.failures else None
        self.window.append(failure is None or isinstance(failure, drivebus.Refused))
        if failure is not None:
            raise failure


@pytest.fixture
def bus() -> StandIn:
    return StandIn()


@pytest.fixture
def drive(bus: StandIn) -> Drive:
    return Drive(bus, 1, Profile.builtin("gd350"), 0x01A0)


def read_backs(bus: StandIn) -> list[tuple[int, int | None]]:
    return [(address, how["read_back"]) for address, how in bus.calls("write")]


class TestWhatMayBeRepeated:
    def test_a_value_is_read_back_where_it_can_be_read(self, bus: StandIn, drive: Drive) -> None:
        drive.write({"P00.11": 2.0, "pid_reference": 50.0})
        drive.setpoint = 10.0
        assert read_backs(bus) == [(RAM | ACCELERATION, ACCELERATION), (0x2002, 0x2002), (SETPOINT, SETPOINT)]

    def test_a_command_is_not_even_with_a_setpoint_behind_it(self, bus: StandIn, drive: Drive) -> None:
        drive.run(10.0)
        drive.stop()
        assert read_backs(bus) == [(CONTROL, None), (CONTROL, None)]
        assert bus.calls("write")[0][1]["value"] == [1, 1000]

    def test_what_acts_when_it_is_written_is_not(self, bus: StandIn, drive: Drive) -> None:
        drive.write({"P00.15": 2, "P07.00": 1234}, unverified=True)
        assert [back for _, back in read_backs(bus)] == [None, None]

    def test_what_ram_holds_already_does_not_prove_eeprom(self, bus: StandIn, drive: Drive) -> None:
        drive.write("P00.11", 2.0)
        drive.write("P00.11", 2.0, store=True)
        drive.write("P00.11", 3.0, store=True)
        assert read_backs(bus) == [
            (RAM | ACCELERATION, ACCELERATION),
            (ACCELERATION, None),
            (ACCELERATION, ACCELERATION),
        ]


class TestWhatWentOut:
    @pytest.mark.parametrize(
        ("write", "error"),
        [
            pytest.param(lambda drive: drive.run(10.0), drivebus.Unconfirmed, id="run"),
            pytest.param(lambda drive: drive.write("P00.11", 2.0), drivebus.PortError, id="write"),
        ],
    )
    def test_is_not_sent_again_over_another_connection(
        self,
        bus: StandIn,
        drive: Drive,
        monkeypatch: pytest.MonkeyPatch,
        write: Callable[[Drive], None],
        error: type[drivebus.DrivebusError],
    ) -> None:
        send = bus.write

        def lose(*words: Any, **how: Any) -> None:
            send(*words, **how)
            bus.reconnects += 1  # another thread asked meanwhile, and opened the port again
            raise drivebus.PortError("gone", started=1.0)

        monkeypatch.setattr(bus, "write", lose)
        with pytest.raises(error) as lost:
            write(drive)
        assert lost.value.started == 1.0
        assert len(bus.calls("write")) == 1


class TestWhatGoesFirst:
    @pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
    def test_a_stop_and_the_reads_that_confirm_it(self, bus: StandIn, drive: Drive, command: str) -> None:
        getattr(drive, command)()
        assert [how["urgent"] for _, _, how in bus.asked] == [True, True]

    def test_the_frequency_that_shows_a_ramp(self, bus: StandIn, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        # The state word says forward until the ramp is over: 10 s (P00.12) from 50 Hz (P00.03).
        bus.words |= {SOURCE: 2, DECELERATION: 100, FREQUENCY + 1: 1000}
        take, sent = bus._take, bus.clock

        def slow_down(what: str, address: int, **how: object) -> None:
            take(what, address, **how)
            bus.words |= {STATE: FORWARD, FREQUENCY: 1000 - round(500 * (bus.clock - sent))}

        monkeypatch.setattr(bus, "_take", slow_down)
        drive.stop()
        assert bus.clock < sent + 0.6
        read = [address for address, _ in bus.calls("read")]
        assert set(read) == {STATE, FREQUENCY, SOURCE, FREQUENCY_SOURCE, DECELERATION}
        assert [read.count(once) for once in (SOURCE, FREQUENCY_SOURCE, DECELERATION)] == [1, 1, 1]
        assert all(how["urgent"] for _, _, how in bus.asked)

    def test_looks_beyond_their_time_leave_gaps(
        self, bus: StandIn, drive: Drive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A fall that is looked at for long, because a lower setpoint explains it too, lets others have the line."""
        take = bus._take

        def slow_down(what: str, address: int, **how: object) -> None:
            take(what, address, **how)
            left = max(0, bus.words[FREQUENCY] - 10)
            bus.words |= {STATE: FORWARD if left else STOPPED, FREQUENCY: left, FREQUENCY + 1: 1000}

        bus.words[FREQUENCY] = 5000
        monkeypatch.setattr(bus, "_take", slow_down)
        sent = bus.clock
        drive.stop(confirm=0.5)
        assert bus.clock > sent + 1.0
        reads = bus.calls("read")
        assert all(how["urgent"] for _, how in reads), "whoever else waits must not keep the proof waiting"
        # One look of two reads every 20 ms, and then every 100 ms.
        assert len(reads) == pytest.approx(2 * (0.5 / 0.02 + (bus.clock - sent - 0.5) / 0.1), abs=8)

    def test_what_starts_or_looks_does_not(self, bus: StandIn, drive: Drive) -> None:
        drive.run(10.0)
        drive.status()
        drive.write("P00.11", 2.0)
        assert not any(how["urgent"] for _, _, how in bus.asked)


class TestADriveThatMagnetisesTheMotor:
    """State 6, pre-exciting, comes before a start: nothing turns yet, and nothing has stopped. GD350 manual, 9.4.5."""

    PRE_EXCITING = 6

    @pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
    def test_it_has_not_stopped(
        self, bus: StandIn, drive: Drive, monkeypatch: pytest.MonkeyPatch, command: str
    ) -> None:
        read = bus.read
        state = {STATE: self.PRE_EXCITING}

        def shown(unit: int, address: int, count: int = 1, /, **how: bool) -> list[int]:
            bus.words.update(state)
            return read(unit, address, count, **how)

        monkeypatch.setattr(bus, "read", shown)
        with pytest.raises(drivebus.Unconfirmed, match=rf"{command.replace('_', ' ')} was sent.*pre exciting"):
            getattr(drive, command)()
        assert len(bus.calls("write")) == 1
        state[STATE] = STOPPED
        getattr(drive, command)()

    def test_it_is_waited_for(self, bus: StandIn, drive: Drive) -> None:
        bus.words[STATE] = self.PRE_EXCITING
        with pytest.raises(drivebus.Unconfirmed, match="did not stop"):
            drive.wait_until_stopped(timeout=0.5)


class TestReadingTwice:
    def test_each_request_of_the_plan(self, bus: StandIn, drive: Drive) -> None:
        bus.words[FREQUENCY] = 1000
        values = drive.read("running_frequency", "P00.03", verify=True)
        assert values == {"running_frequency": 10.0, "P00.03": 50.0}
        assert drive.read("P00.03", verify=True) == 50.0
        assert [how["verify"] for _, how in bus.calls("read")] == [True] * 3
        assert drive.read("P00.03") == 50.0
        assert not bus.calls("read")[-1][1]["verify"]


class TestWhatIsSaid:
    def test_the_state_seen_before_where_none_can_be_read(self, bus: StandIn, drive: Drive) -> None:
        drive.run(10.0)
        bus.sleep(2.5)
        bus.failures = [drivebus.NoAnswer("silent", started=1.0)] * 2
        with pytest.raises(drivebus.Unconfirmed) as unknown:
            drive.stop(within=0)
        text = str(unknown.value)
        assert "the motor may still turn" in text
        assert "could not be read afterwards either (NoAnswer); state seen last, 2.5 s ago: forward" in text
        assert "stop was sent to unit 1 once" in text

    def test_that_no_state_was_ever_seen(self, bus: StandIn, drive: Drive) -> None:
        bus.failures = [drivebus.NoAnswer("silent", started=1.0)] * 2
        with pytest.raises(drivebus.Unconfirmed, match="no state was ever seen"):
            drive.coast(within=0)

    def test_what_a_lost_start_may_have_done(self, bus: StandIn, drive: Drive) -> None:
        # The maximum, a look, where the speed comes from, the command.
        bus.failures = [None, None, None, drivebus.NoAnswer("silent", started=1.0)]
        with pytest.raises(drivebus.Unconfirmed, match=r"the motor may turn\. State seen afterwards: stopped"):
            drive.run(10.0)

    def test_a_port_that_is_lost_before_the_state_shows_it(self, bus: StandIn, drive: Drive) -> None:
        drive.state()
        bus.failures = [None, drivebus.PortError("gone")]
        with pytest.raises(drivebus.Unconfirmed, match=r"gone.*may still be powered.*0\.0 s ago: stopped"):
            drive.coast()


class TestABadLink:
    def test_a_clean_line_pays_nothing(self, bus: StandIn, drive: Drive) -> None:
        bus.window = [True] * 9 + [False]
        drive.run()
        assert [(what, address) for what, address, _ in bus.asked] == [
            ("read", STATE),
            ("write", CONTROL),
            ("read", STATE),
        ]

    def test_one_that_recovered_proves_itself(self, bus: StandIn, drive: Drive) -> None:
        bus.window = [True] * 8 + [False] * 2
        drive.run()
        looks = [address for what, address, _ in bus.asked if what == "read"]
        assert looks == [STATE] * 12  # ten to prove it, one before the start, one after
        assert bus.words[CONTROL] == 1

    def test_one_answer_in_ten_may_be_lost(self, bus: StandIn, drive: Drive) -> None:
        bus.window = [False] * 3
        bus.failures = [None, None, drivebus.BadAnswer("noise"), None, None, drivebus.Refused("busy", code=6)]
        drive.jog()
        assert bus.words[CONTROL] == 3

    @pytest.mark.parametrize("start", ["run", "jog"])
    def test_a_start_is_refused_as_soon_as_two_are_lost(self, bus: StandIn, drive: Drive, start: str) -> None:
        bus.window = [True] * 6 + [False] * 4
        bus.failures = [None, drivebus.NoAnswer("silent"), None, drivebus.CrcError("noise"), *[None] * 10]
        with pytest.raises(drivebus.NotAllowed, match=r"4 of the last 10 .* 2 of 4 looks .*force=True"):
            getattr(drive, start)()
        assert bus.calls("write") == []

    def test_what_retries_hide_counts_too(self, bus: StandIn, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        # Every look is answered in the end, at the second attempt: the bus repeats reads.
        monkeypatch.setattr(bus, "link", lambda _: drivebus.Link(5, 10))
        with pytest.raises(drivebus.NotAllowed, match=r"5 of the last 10 .* 0 of 10 looks"):
            drive.run()
        assert bus.calls("write") == []

    def test_who_forces_it_starts_all_the_same(self, bus: StandIn, drive: Drive) -> None:
        bus.window = [False] * 10
        with drive.running(10.0, force=True):
            pass
        bus.window = [False] * 10
        drive.jog(force=True)
        assert [how["value"] for _, how in bus.calls("write")] == [[1, 1000], STOP, 3]

    def test_a_stop_asks_nothing(self, bus: StandIn, drive: Drive) -> None:
        bus.window = [False] * 10
        drive.stop()
        assert [what for what, _, _ in bus.asked] == ["write", "read"]


class TestWhoAnswers:
    @pytest.mark.parametrize(
        "act",
        [
            pytest.param(lambda drive: drive.run(), id="run"),
            pytest.param(lambda drive: drive.jog(), id="jog"),
            pytest.param(lambda drive: drive.write("P00.11", 2.0), id="write"),
            pytest.param(lambda drive: setattr(drive, "setpoint", 5.0), id="setpoint"),
        ],
    )
    def test_another_drive_gets_nothing(self, bus: StandIn, drive: Drive, act: Callable[[Drive], None]) -> None:
        bus.reconnects += 1
        bus.words[IDENTIFICATION] = 0x010A
        with pytest.raises(drivebus.NotAllowed, match=r"another drive answers as unit 1.*01A0H.*010AH"):
            act(drive)
        with pytest.raises(drivebus.NotAllowed):
            act(drive)
        assert bus.calls("write") == []

    def test_a_reset_is_not_sent_to_another_drive(self, bus: StandIn, drive: Drive) -> None:
        bus.words.update({STATE: 4, IDENTIFICATION: 0x010A})
        bus.reconnects += 1
        with pytest.raises(drivebus.NotAllowed, match="another drive"):
            drive.reset_fault()
        assert bus.calls("write") == []

    @pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
    def test_a_stop_asks_first_behind_another_connection(self, bus: StandIn, drive: Drive, command: str) -> None:
        """010AH is a GD300's (GD350 manual, section 9.4.5), which is halted by the same words."""
        bus.reconnects += 1
        bus.words[IDENTIFICATION] = 0x010A
        getattr(drive, command)()
        assert bus.asked[0][1] == IDENTIFICATION
        assert len(bus.calls("write")) == 1

    @pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
    def test_a_stop_does_not_ask_one_that_was_identified(self, bus: StandIn, drive: Drive, command: str) -> None:
        getattr(drive, command)()
        assert IDENTIFICATION not in [address for _, address, _ in bus.asked]
        assert len(bus.calls("write")) == 1

    def test_the_same_drive_is_asked_once_each_time(self, bus: StandIn, drive: Drive) -> None:
        asked = []
        for reopened in (False, True, False, True):
            bus.reconnects += reopened
            drive.write("P00.11", 2.0)
            asked.append([address for _, address, _ in bus.asked].count(IDENTIFICATION))
        assert asked == [0, 1, 1, 2]

    def test_one_that_was_never_asked_is_before_the_first_write(self, bus: StandIn) -> None:
        drive = Drive(bus, 1, Profile.builtin("gd350"))
        drive.write("P00.11", 2.0)
        drive.write("P00.11", 3.0)
        assert [address for _, address, _ in bus.asked] == [IDENTIFICATION, RAM | ACCELERATION, RAM | ACCELERATION]
        bus.reconnects += 1
        bus.words[IDENTIFICATION] = 0x01A1
        with pytest.raises(drivebus.NotAllowed, match="another drive"):
            drive.write("P00.11", 2.0)

    def test_one_that_refuses_to_tell_is_known_by_that(self, bus: StandIn) -> None:
        # Every GD350 tells; that this one is one, somebody knows better.
        drive = Drive(bus, 1, Profile.builtin("gd350"), trust_profile=True)
        refusal = drivebus.Refused("no", code=2)
        bus.failures = [refusal]
        drive.write("P00.11", 2.0)
        bus.reconnects += 1
        bus.failures = [refusal]
        drive.write("P00.11", 2.0)
        bus.reconnects += 1
        with pytest.raises(drivebus.NotAllowed, match=r"refused with exception 02H, and is 01A0H now"):
            drive.write("P00.11", 2.0)

    def test_one_that_is_silent_is_asked_the_next_time(self, bus: StandIn) -> None:
        drive = Drive(bus, 1, Profile.builtin("gd350"))
        bus.failures = [drivebus.NoAnswer("silent")]
        drive.write("P00.11", 2.0)
        drive.write("P00.11", 2.0)
        # Once in vain, once because a VFD500 would keep that word, and once by the second write.
        assert [address for _, address, _ in bus.asked].count(IDENTIFICATION) == 3

    def test_one_that_does_not_tell_again_gets_nothing(self, bus: StandIn, drive: Drive) -> None:
        bus.reconnects += 1
        # The maximum, a look, where the speed comes from, who it is.
        bus.failures = [None, None, None, drivebus.NoAnswer("silent", started=1.0)]
        with pytest.raises(drivebus.NoAnswer, match="nothing was written") as unsent:
            drive.run(5.0)
        assert unsent.value.started is None
        assert bus.calls("write") == []
        drive.run(5.0)
        assert len(bus.calls("write")) == 1
