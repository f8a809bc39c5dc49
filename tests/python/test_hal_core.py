"""What a spindle's drive is told, rule by rule: pins in, what the drive shows, actions and pins out. No line, no clock.

60 rpm for a hertz and 100 counts for one, as of a motor with two poles and a drive that counts hundredths: 600 rpm are
10 Hz are 1000 counts.
"""

from __future__ import annotations

import math

import pytest

from drivebus import State
from drivebus.hal.core import Action, Coast, Course, Reset, Run, Scale, Shown, Speed, Spindle, Stop
from drivebus.hal.pins import PINS, Asked

OFF = Asked(enable=True)
ON = Asked(spindle_on=True, speed_command=600.0, enable=True)
FORWARD = Course(1000, False)
REVERSE = Course(1000, True)


class Machine:
    """A drive that does at once what it is told, and a clock that goes on by a tenth of a second for each cycle."""

    def __init__(self, **scale: float) -> None:
        self.spindle = Spindle(Scale(60.0, **scale))
        self.now = 0.0
        self.shows = Shown(0.0, State.STOPPED, 0.0, ready=True)
        self.answers = self.heeds = True
        self.cycle(OFF)

    def cycle(self, asked: Asked, fails: str = "", *, final: bool = False, sent: bool = False) -> Action | None:
        self.now += 0.1
        action = self.spindle.decide(self.now, asked)
        if action is not None:
            if fails:
                self.spindle.failed(action, fails, final=final, sent=sent)
            else:
                self._heed(action)
                self.spindle.done(action, self.now)
        if self.answers:
            self.spindle.saw(self.shows._replace(time=self.now))
        else:
            self.spindle.missed()
        return action

    def cycles(self, asked: Asked, count: int) -> list[Action]:
        return [action for action in (self.cycle(asked) for _ in range(count)) if action is not None]

    def shown(self, name: str) -> bool | float:
        return self.spindle.shown(self.now)[name]

    def running(self, asked: Asked = ON) -> Machine:
        assert isinstance(self.cycle(asked), Run)
        return self

    def _heed(self, action: Action) -> None:
        if not self.heeds:
            return
        if isinstance(action, Run):
            state = State.REVERSE if action.course.reverse else State.FORWARD
            self.shows = self.shows._replace(state=state, frequency=action.course.word / 100)
        elif isinstance(action, Speed):
            self.shows = self.shows._replace(frequency=action.word / 100)
        elif isinstance(action, (Stop, Coast)) and not self.shows.tripped:
            self.shows = self.shows._replace(state=State.STOPPED, frequency=0.0)
        elif isinstance(action, Reset):
            self.shows = self.shows._replace(state=State.STOPPED, tripped=False, fault=0)


def test_each_command_goes_out_once_at_its_change() -> None:
    machine = Machine()
    assert machine.cycles(ON, 5) == [Run(FORWARD)]
    assert machine.cycles(ON._replace(speed_command=1200.0), 5) == [Speed(2000)]
    assert machine.cycles(ON._replace(speed_command=-1200.0), 5) == [Run(Course(2000, True))]
    assert machine.cycles(OFF, 5) == [Stop()]


@pytest.mark.parametrize(
    ("asked", "course"),
    [
        pytest.param(Asked(True, False, False, 600.0, True), FORWARD, id="the sign says forward"),
        pytest.param(Asked(True, False, False, -600.0, True), REVERSE, id="the sign says reverse"),
        pytest.param(Asked(False, True, False, 600.0, True), FORWARD, id="a pin says forward"),
        pytest.param(Asked(False, False, True, 600.0, True), REVERSE, id="a pin says reverse"),
        pytest.param(Asked(True, False, True, -600.0, True), REVERSE, id="pin and sign do not cancel out"),
        pytest.param(Asked(True, True, False, -600.0, True), FORWARD, id="the pin goes before the sign"),
        pytest.param(Asked(True, True, True, 600.0, True), None, id="both pins"),
        pytest.param(Asked(True, False, False, 600.0, False), None, id="not enabled"),
        pytest.param(Asked(True, False, False, 0.2, True), None, id="less than half a count"),
        pytest.param(Asked(True, False, False, math.nan, True), None, id="no number"),
        pytest.param(Asked(True, False, False, math.inf, True), None, id="no end"),
    ],
)
def test_what_the_pins_ask_for(asked: Asked, course: Course | None) -> None:
    assert Machine().cycles(asked, 3) == ([] if course is None else [Run(course)])


def test_a_speed_goes_out_when_it_changed_by_a_count_and_no_sooner() -> None:
    machine = Machine().running()
    # A count is 0.6 rpm.
    assert machine.cycles(ON._replace(speed_command=600.2), 3) == []
    assert machine.cycles(ON._replace(speed_command=600.6), 3) == [Speed(1001)]


def test_a_speed_beyond_the_highest_is_cut_to_it() -> None:
    assert Machine(max_rpm=3000.0).cycles(ON._replace(speed_command=24000.0), 3) == [Run(Course(5000, False))]


def test_speed_zero_stops_and_a_speed_after_it_starts() -> None:
    machine = Machine().running()
    assert machine.cycles(ON._replace(speed_command=0.0), 3) == [Stop()]
    assert machine.cycles(ON, 3) == [Run(FORWARD)]


def test_a_spindle_that_is_on_when_the_component_comes_is_not_started() -> None:
    spindle = Spindle(Scale(60.0))
    # Not seen off: somebody switched it on before this program lived.
    assert [spindle.decide(0.1 * moment, ON) for moment in range(5)] == [None] * 5


def test_switched_off_the_machine_stops_and_switched_on_again_it_does_not_start() -> None:
    machine = Machine().running()
    assert machine.cycles(ON._replace(enable=False), 3) == [Stop()]
    assert machine.cycles(ON, 3) == []
    assert machine.cycles(OFF, 1) == []
    assert machine.cycles(ON, 3) == [Run(FORWARD)]


def test_a_fault_ends_the_run_and_only_a_new_start_begins_another() -> None:
    machine = Machine().running()
    machine.shows = machine.shows._replace(state=State.FAULT, frequency=0.0, tripped=True, fault=11)
    machine.cycle(ON)
    # Told to stop as well: a drive that is still told to run may start when it is reset.
    assert machine.cycles(ON, 3) == [Stop()]
    assert (machine.shown("fault"), machine.shown("fault-code"), machine.shown("ready")) == (True, 11, False)
    assert machine.cycles(ON._replace(reset=True), 3) == [Reset()]
    assert (machine.shown("fault"), machine.shown("fault-code"), machine.shown("ready")) == (False, 0, False)
    assert machine.cycles(ON, 3) == []
    assert machine.cycles(OFF, 1) == []
    assert machine.shown("ready") is True
    assert machine.cycles(ON, 3) == [Run(FORWARD)]


def test_reset_is_a_change_and_resets_nothing_without_a_fault() -> None:
    machine = Machine()
    assert machine.cycles(OFF._replace(reset=True), 3) == []
    machine.shows = machine.shows._replace(state=State.FAULT, tripped=True, fault=11)
    assert machine.cycles(OFF._replace(reset=True), 3) == []
    assert machine.cycles(OFF, 1) + machine.cycles(OFF._replace(reset=True), 3) == [Reset()]


def test_nothing_starts_in_a_fault() -> None:
    machine = Machine()
    machine.shows = machine.shows._replace(state=State.FAULT, tripped=True, fault=11)
    machine.cycle(OFF)
    assert machine.cycles(ON, 3) == []
    assert "in fault" in machine.spindle.trouble


def test_a_refused_start_is_a_fault_and_is_not_tried_again() -> None:
    machine = Machine()
    assert machine.cycle(ON, fails="the drive takes its commands from the keypad", final=True) == Run(FORWARD)
    assert machine.cycles(ON, 5) == []
    assert (machine.shown("fault"), machine.shown("fault-code"), machine.shown("error-count")) == (True, 0, 1)
    machine.cycle(OFF)
    # The next that goes well clears it.
    assert machine.cycles(ON, 2) == [Run(FORWARD)]
    assert machine.shown("fault") is False


def test_a_refused_start_is_cleared_by_reset_too() -> None:
    machine = Machine()
    machine.cycle(ON, fails="refused", final=True)
    assert machine.cycles(OFF._replace(reset=True), 2) == []
    assert machine.shown("fault") is False


def test_a_refused_turn_round_stops() -> None:
    machine = Machine().running()
    back = ON._replace(speed_command=-600.0)
    assert machine.cycle(back, fails="refused", final=True) == Run(REVERSE)
    assert machine.cycles(back, 5) == [Stop()]
    assert machine.shown("fault") is True


def test_a_refused_speed_leaves_the_old_one_and_is_not_asked_again() -> None:
    machine = Machine().running()
    fast = ON._replace(speed_command=60000.0)
    assert machine.cycle(fast, fails="above its maximum", final=True) == Speed(100000)
    assert machine.cycles(fast, 5) == []
    assert (machine.shown("at-speed"), machine.shown("fault")) == (False, False)
    assert machine.cycles(ON._replace(speed_command=1200.0), 5) == [Speed(2000)]


def test_a_speed_that_was_lost_is_given_again() -> None:
    machine = Machine().running()
    faster = ON._replace(speed_command=1200.0)
    assert machine.cycle(faster, fails="no answer") == Speed(2000)
    assert machine.cycles(faster, 5) == [Speed(2000)]


def test_a_drive_that_is_silent_for_longer_than_the_patience_is_told_to_stop() -> None:
    machine = Machine().running()
    machine.answers = False
    before, after = machine.cycles(ON, 9), machine.cycles(ON, 9)
    assert (before, after) == ([], [Stop()])
    assert not any(machine.shown(name) for name in ("link-ok", "at-speed", "stopped", "brake", "ready"))
    assert machine.shown("fault") is True
    machine.answers = True
    assert machine.cycles(ON, 5) == []


def test_nothing_starts_without_a_link_nor_later_by_itself() -> None:
    machine = Machine()
    machine.answers = False
    machine.cycles(OFF, 15)
    assert machine.cycles(ON, 3) == []
    assert "does not answer" in machine.spindle.trouble
    machine.answers = True
    assert machine.cycles(ON, 5) == []


def test_a_motor_that_somebody_else_stopped_is_not_started_again() -> None:
    machine = Machine().running()
    machine.shows = machine.shows._replace(state=State.STOPPED, frequency=0.0)
    # For a second it may be turning round.
    before, after = machine.cycles(ON, 9), machine.cycles(ON, 9)
    assert (before, after) == ([], [Stop()])
    assert "nobody here told it to" in machine.spindle.trouble


def test_a_moment_of_rest_on_the_way_round_ends_nothing() -> None:
    machine = Machine().running()
    turning = machine.shows
    for _ in range(4):
        machine.shows = turning._replace(state=State.STOPPED, frequency=0.0)
        assert machine.cycles(ON, 5) == []
        machine.shows = turning
        assert machine.cycles(ON, 5) == []


def test_a_stop_that_failed_is_sent_again_when_the_drive_is_seen_to_run() -> None:
    machine = Machine().running()
    assert machine.cycle(OFF, fails="no answer") == Stop()
    assert machine.shown("fault") is True
    assert machine.cycles(OFF, 5) == [Stop()]


def test_a_stop_that_failed_is_not_sent_to_a_drive_at_rest() -> None:
    machine = Machine().running()
    machine.shows = machine.shows._replace(state=State.STOPPED, frequency=0.0)
    machine.cycle(ON)
    assert machine.cycle(OFF, fails="no answer") == Stop()
    assert machine.cycles(OFF, 5) == []


def test_a_start_of_which_nothing_is_known_is_stopped_where_it_shows() -> None:
    machine = Machine()
    assert machine.cycle(ON, fails="not confirmed", sent=True) == Run(FORWARD)
    machine.shows = machine.shows._replace(state=State.FORWARD, frequency=10.0)
    assert machine.cycles(ON, 5) == [Stop()]


def test_somebody_elses_motor_is_left_alone() -> None:
    machine = Machine()
    assert machine.cycle(ON, fails="commands come from the keypad", final=True) == Run(FORWARD)
    machine.shows = machine.shows._replace(state=State.FORWARD, frequency=10.0)
    assert machine.cycles(ON, 5) + machine.cycles(OFF, 5) == []


def test_a_motor_that_does_not_slow_down_loses_its_voltage() -> None:
    machine = Machine().running()
    machine.heeds = False
    assert machine.cycle(OFF) == Stop()
    before, after = machine.cycles(OFF, 30), machine.cycles(OFF, 9)
    assert (before, after) == ([], [Coast()])
    assert machine.shown("fault") is True


def test_a_motor_on_a_long_ramp_keeps_it() -> None:
    machine = Machine().running()
    running = machine.shows
    machine.heeds = False
    assert machine.cycle(OFF) == Stop()
    for tick in range(100):
        machine.shows = running._replace(frequency=10.0 - tick * 0.05)
        assert machine.cycle(OFF) is None


@pytest.mark.parametrize(
    ("frequency", "at_speed"),
    [(10.0, True), (9.8, True), (10.2, True), (9.79, False), (10.21, False), (None, False)],
)
def test_at_speed_is_within_two_percent(frequency: float | None, at_speed: bool) -> None:
    machine = Machine().running()
    machine.shows = machine.shows._replace(frequency=frequency)
    machine.cycle(ON)
    assert machine.shown("at-speed") is at_speed


def test_at_speed_needs_the_right_way_round() -> None:
    machine = Machine().running()
    machine.shows = machine.shows._replace(state=State.REVERSE)
    machine.cycle(ON)
    assert machine.shown("at-speed") is False


def test_the_pins_of_a_spindle_in_reverse() -> None:
    machine = Machine().running(ON._replace(speed_command=-600.0))
    machine.shows = machine.shows._replace(current=4.4, quality=0.9)
    machine.cycle(ON._replace(speed_command=-600.0))
    shown = machine.spindle.shown(machine.now)
    assert shown.pop("hours") == pytest.approx(0.1 / 3600)
    assert shown == {
        "speed-feedback": -600.0,
        "speed-feedback-rps": -10.0,
        "frequency-out": 10.0,
        "at-speed": True,
        "stopped": False,
        "forward": False,
        "reverse": True,
        "brake": False,
        "fault": False,
        "fault-code": 0,
        "current": 4.4,
        "ready": True,
        "link-ok": True,
        "link-quality": 0.9,
        "error-count": 0,
        "initialized": True,
    }


def test_each_pin_that_goes_out_is_shown_and_no_other() -> None:
    assert set(Machine().spindle.shown(0.0)) == {name for name, (_, direction) in PINS.items() if direction == "OUT"}


def test_the_brake_holds_what_is_off_and_stands_and_nothing_else() -> None:
    machine = Machine()
    assert machine.shown("brake") is True
    machine.running()
    assert machine.shown("brake") is False
    machine.cycle(OFF)
    machine.shows = machine.shows._replace(state=State.FORWARD, frequency=3.0)
    machine.cycle(OFF)
    assert (machine.shown("brake"), machine.shown("stopped")) == (False, False)


def test_hours_count_while_the_motor_turns() -> None:
    machine = Machine().running()
    machine.cycles(ON, 36)
    machine.cycle(OFF)
    assert machine.spindle.hours == pytest.approx(3.6 / 3600, rel=0.03)


def test_a_family_without_a_state_stands_when_its_frequency_does() -> None:
    machine = Machine()
    machine.shows = Shown(0.0, State.UNKNOWN, 0.0)
    machine.cycle(OFF)
    assert machine.shown("stopped") is True
    machine.shows = Shown(0.0, State.UNKNOWN, None)
    machine.cycle(OFF)
    assert machine.shown("stopped") is False
