"""The examination of a line: whatever is wrong with it leads to the finding that names it, a sound line to none."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

import pytest

import drivebus
from drivebus import Bus, NotAllowed, PortError, Simulator
from drivebus.doctor import Finding, Severity, examine
from drivebus.line import port_facts
from drivebus.line.frames import frames_in
from drivebus.line_search.order import candidates
from drivebus.line_search.settings import Settings

READ = bytes.fromhex("01 03 00 04 00 02 85 CA")  # GD350 manual, chapter 9.4.1, request and answer
ANSWER = bytes.fromhex("01 03 04 13 88 00 00 7E 9D")


def line(**options: Any) -> Simulator:
    """Two drives in virtual time: nothing here waits."""
    return Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual", **options)


def wrong(findings: list[Finding]) -> set[str]:
    return {finding.name for finding in findings if finding.wrong}


def named(findings: list[Finding], name: str) -> Finding:
    [finding] = [finding for finding in findings if finding.name == name]
    return finding


def test_a_severity_equals_its_name() -> None:
    names: list[str] = list(Severity)
    assert names == ["ok", "note", "warning", "fault"]
    assert (str(Severity.OK), f"{Severity.OK:>4}") == ("ok", "  ok")
    assert sorted(Severity, key=lambda one: one.rank) == list(Severity)


class TestASoundLine:
    def test_nothing_is_wrong_and_everybody_is_found(self) -> None:
        with line() as simulator:
            findings = list(examine(simulator))
            assert wrong(findings) == set()
            assert {finding.unit for finding in findings} == {None, 1, 2}
            assert [finding.step for finding in findings][:2] == ["adapter", "line"]
            assert simulator.drive(1).words_written == simulator.drive(2).words_written == 0
            assert simulator.line.silence_violations == 0

    def test_the_turnaround_is_the_drives(self) -> None:
        # P14.03 is 5 ms from the factory, and counts from the end of the silence that ends the request.
        with line() as simulator:
            found = named(list(examine(simulator, 1)), "turnaround")
            expected = pytest.approx(0.005 + simulator.format.t35, abs=1e-6)
        assert found.values == {f"turnaround_{which}": expected for which in ("min", "median", "max")}

    def test_a_drive_that_obeys_is_said_to(self) -> None:
        with line() as simulator:
            assert named(list(examine(simulator, 1)), "control").severity is Severity.NOTE
            with Bus(simulator) as bus:
                bus.drive(1).prepare_control()
            assert named(list(examine(simulator, 1)), "control").severity is Severity.OK

    @pytest.mark.parametrize(
        ("family", "settings", "said"),
        [
            ("gd350", {"P14.04": 0.0}, "does not notice when the bus falls silent (P14.04 is 0)"),
            (
                "gd350",
                {"P14.05": 0, "P14.04": 2.0},
                "and coasts when the bus is silent for 2 s (P14.04): P14.05 is alarm and coast",
            ),
            # Of the other three the keypad shows nothing, and with 1 the motor runs on.
            (
                "gd350",
                {"P14.05": 1, "P14.04": 2.0},
                "what it does when the bus is silent for 2 s (P14.04), this alone tells: P14.05 is keep running",
            ),
            (
                "gd350",
                {"P14.05": 3, "P14.04": 2.0},
                "it stops, and trips nothing, when the bus is silent for 2 s (P14.04): P14.05 is stop silently",
            ),
            (
                "gd3000-rectifier",
                {"P11.05": 1, "P11.04": 2.0},
                "what it does when the bus is silent for 2 s (P11.04), this alone tells",
            ),
            (
                "vfd500",
                {"P30.05": 2.0},
                "when the bus is silent for 2 s (P30.05); what that does to the motor is set else",
            ),
        ],
    )
    def test_what_a_silent_bus_does_is_told_as_it_is_set(
        self, family: str, settings: dict[str, float], said: str
    ) -> None:
        with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            bus.drive(1, family, unverified=True).write(settings, store=True)
            told = named(list(examine(simulator, 1, profile=family)), "watchdog")
            assert said in told.text
            assert ("CE" in told.text) == ("alarm and coast" in said)
            assert ("Er.485" in told.text) == (family == "vfd500")

    def test_each_family_has_its_own_fault_of_a_silent_bus(self) -> None:
        # 34 is dEu in a GD350, and 18 an earth fault in a VFD500.
        for family, fault, severity in [
            ("gd350", 18, Severity.WARNING),
            ("gd350", 34, Severity.NOTE),
            ("vfd500", 34, Severity.WARNING),
            ("vfd500", 18, Severity.NOTE),
        ]:
            with Simulator({1: family}, transport="process", clock="virtual") as simulator:
                simulator.drive(1).trip(fault)
                assert named(list(examine(simulator, 1, profile=family)), "fault").severity is severity

    def test_a_fault_of_the_bus_is_told(self) -> None:
        with line() as simulator:
            simulator.drive(1).trip("CE")
            assert named(list(examine(simulator, 1)), "fault").severity is Severity.WARNING
            simulator.drive(2).trip("OL1")
            assert named(list(examine(simulator, 2)), "fault").severity is Severity.NOTE


@pytest.mark.parametrize(
    ("faults", "expected"),
    [
        ({"flip_bit": 0.3}, "damaged"),
        ({"lose_byte": 0.3}, "damaged"),
        ({"collision": 0.3}, "damaged"),
        ({"silence": 0.3}, "lost_answers"),
        ({"deaf": 0.3}, "lost_answers"),
        ({"late": 0.3}, "late_answers"),
        ({"delay": 0.3}, "turnaround"),
        ({"short": 0.5}, "bad_answers"),
        ({"long": 0.5}, "damaged"),
        ({"foreign": 0.5}, "other_master"),
        ({"noise_before": 0.5}, "no_bias"),
        ({"collision": 1.0}, "two_units"),
        ({"flip_bit": 1.0}, "two_units"),
        ({"silence": 1.0}, "nobody_answers"),
        ({"deaf": 1.0}, "nobody_answers"),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_each_fault_of_the_line_is_named(faults: dict[str, float], expected: str, seed: int) -> None:
    with line(faults=faults, seed=seed) as simulator:
        findings = list(examine(simulator, 1))
        assert expected in wrong(findings)
        assert not wrong(findings) & {"wrong_baud", "wrong_parity", "seven_bits"}, "a bad line is no wrong setting"
        assert simulator.drive(1).words_written == 0
        assert all(finding.error is not None for finding in findings if finding.wrong)


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_whose_first_answers_are_lost_is_found_where_no_other_settings_can_be_tried(lost: int) -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        simulator.line.drop_answers(lost)
        findings = list(examine("socket://server:1", open=lambda _, **options: Bus(simulator, **options)))
    assert wrong(findings) == set()
    assert {finding.unit for finding in findings} == {None, 1}


def test_an_adapter_that_echoes_is_no_fault() -> None:
    with line(echo=True) as simulator:
        findings = list(examine(simulator, 1))
    assert named(findings, "adapter_echo").severity is Severity.NOTE
    assert wrong(findings) == set()


def test_a_time_out_that_the_drives_own_delay_fills_is_named() -> None:
    with line() as simulator:
        with Bus(simulator) as bus:
            bus.drive(1).write("P14.03", 200, unverified=True)
        findings = list(examine(simulator, 1, open=lambda port, **options: Bus(port, timeout=0.3, **options)))
    assert wrong(findings) == {"timeout"}
    assert named(findings, "timeout").values["response_delay"] == 0.2


class TestOtherSettings:
    """Neither a pseudo-terminal nor virtual time carries parity, so what opens the bus stands for the wire here."""

    @staticmethod
    def unit_at(right: Settings, otherwise: dict[str, float]) -> tuple[Callable[..., Bus], list[Settings]]:
        """What opens a line whose units speak at *right*, and give *otherwise* at others; and what was tried."""
        tried: list[Settings] = []

        def opened(_: object, **options: Any) -> Bus:
            asked = Settings(options["baudrate"], options["bytesize"], options["parity"], options["stopbits"])
            tried.append(asked)
            assert options["read_only"] is True
            return Bus(line(faults={} if asked == right else otherwise), read_only=True)

        return opened, tried

    def test_a_wrong_baud_rate_is_named(self) -> None:
        opened, tried = self.unit_at(Settings(38400, 8, "E", 1), {"deaf": 1.0})
        findings = list(examine("/dev/line", 1, open=opened))
        found = named(findings, "wrong_baud")
        assert (found.severity, found.values) == (Severity.FAULT, {"baudrate": 38400, "format": "8E1"})
        assert "38400 8E1, not at 19200 8E1" in found.text
        assert named(findings, "answers").unit == 1, "the unit is looked at where it answers"
        assert tried[1] == Settings(9600, 8, "N", 1), "factory settings come first"

    @pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
    def test_a_wrong_baud_rate_is_met_without_hardware(self) -> None:
        with Simulator({1: "gd350"}, baudrate=38400, transport="pty") as simulator:
            opened = lambda port, **options: Bus(port, **{**options, "timeout": 0.3})  # noqa: E731
            findings = list(examine(simulator.port, 1, open=opened, listen=0.01))
        assert named(findings, "wrong_baud").values["baudrate"] == 38400
        assert named(findings, "answers").unit == 1

    def test_a_wrong_parity_is_named(self) -> None:
        opened, _ = self.unit_at(Settings(19200, 8, "N", 1), {"flip_bit": 1.0})
        findings = list(examine("/dev/line", open=opened))
        assert "wrong_parity" in wrong(findings)
        assert "two_units" not in wrong(findings)

    def test_who_is_nowhere_is_looked_for_everywhere_once(self) -> None:
        opened, tried = self.unit_at(Settings(1), {"silence": 1.0})
        assert wrong(list(examine("/dev/line", 5, open=opened))) == {"nobody_answers"}
        assert len(set(tried)) == len(tried) == 1 + len(list(candidates(Settings(19200), full=False)))

    def test_a_speed_that_the_adapter_does_not_make_is_passed_over(self) -> None:
        opened, _ = self.unit_at(Settings(19200, 8, "O", 1), {"deaf": 1.0})

        def only_one_speed(port: object, **options: Any) -> Bus:
            if options["baudrate"] != 19200:
                raise PortError("the driver does not make it")
            return opened(port, **options)

        assert "wrong_parity" in wrong(list(examine("/dev/line", 1, open=only_one_speed)))

    @pytest.mark.parametrize("transport", ["tcp", "wire"])
    def test_nothing_else_is_tried_where_no_speed_can_be_set(self, transport: str) -> None:
        with Simulator({1: "gd350"}, transport="tcp") as simulator:
            port: object = simulator.port if transport == "tcp" else Wire(b"")
            found = named(list(examine(port, 9, listen=0.01)), "nobody_answers")
        assert "other settings" not in found.text

    def test_candidates_are_all_that_drives_can_be_set_to(self) -> None:
        given = Settings(19200)
        short, full = list(candidates(given, full=False)), list(candidates(given, full=True))
        assert given not in short
        assert len(set(full)) == len(full) == 8 * 6 - 1
        assert set(short) <= set(full)


class Wire:
    """Looks like an open `serial.Serial` with something on its line that nobody asked for."""

    baudrate, bytesize, parity, stopbits = 19200, 8, "E", 1
    timeout: float | None = None

    def __init__(self, heard: bytes) -> None:
        self.heard = heard
        self.sent = b""

    @property
    def in_waiting(self) -> int:
        return len(self.heard)

    def read(self, size: int = 1) -> bytes:
        came, self.heard = self.heard[:size], self.heard[size:]
        return came

    def write(self, data: bytes) -> int:
        self.sent += data
        return len(data)


# Seconds in which a busy machine reads what is there.
LISTENS = 0.3


class TestListening:
    @pytest.mark.parametrize(
        ("heard", "expected"),
        [
            (b"", "quiet"),
            (b"\x00\xff\x00\x00", "no_bias"),
            (READ + ANSWER, "other_master"),
            (b"\x00" + READ, "other_master"),
            (bytes.fromhex("5A 93 41 E6 7C"), "unknown_traffic"),
        ],
    )
    def test_what_is_heard_before_asking_is_named(self, heard: bytes, expected: str) -> None:
        found = examine(Wire(heard), 1, listen=LISTENS)
        assert next(found).name == "port"
        assert next(found).name == expected
        found.close()

    def test_frames_of_another_master_are_taken_apart(self) -> None:
        found = examine(Wire(READ), 1, listen=LISTENS)
        next(found)
        text = next(found).text
        found.close()
        assert "01 03 00 04 00 02 85 CA" in text
        assert "address 4" in text
        assert "count 2" in text

    def test_another_master_is_not_disturbed(self) -> None:
        wire = Wire(READ + ANSWER)
        assert [finding.name for finding in examine(wire, listen=LISTENS)] == ["port", "other_master"]
        assert wire.sent == b""

    def test_another_master_is_found_at_its_own_speed_before_anything_is_asked(self) -> None:
        wires = []

        def opened(_: object, **options: Any) -> Bus:
            at_its_speed = (options["baudrate"], options["parity"]) == (38400, "E")
            wires.append(Wire(READ + ANSWER if at_its_speed else bytes.fromhex("5A 93 41 E6 7C")))
            return Bus(wires[-1], read_only=True)

        findings = list(examine("/dev/ttyX", listen=LISTENS, open=opened))
        assert [finding.name for finding in findings] == ["port", "unknown_traffic", "other_master"]
        assert findings[-1].values["frames"] == ["01 03 00 04 00 02 85 CA", "01 03 04 13 88 00 00 7E 9D"]
        assert {wire.sent for wire in wires} == {b""}

    @pytest.mark.parametrize("before", [b"", b"\x00", b"\x01\x03", b"\x01\x10\x02"])
    @pytest.mark.parametrize("after", [b"", b"\x00", b"\x01\x03\x00"])
    def test_frames_are_found_between_anything(self, before: bytes, after: bytes) -> None:
        exception = bytes.fromhex("01 83 02 C0 F1")
        assert frames_in(before + READ + ANSWER + exception + after) == [READ, ANSWER, exception]
        spoilt = READ[:-1] + b"\xcb"
        assert frames_in(before + spoilt + after) == []

    def test_listening_hears_pieces_with_their_moments(self) -> None:
        with Bus(Wire(READ)) as bus:
            start = bus.now()
            pieces = bus.listen(LISTENS)
            assert b"".join(piece for _, piece in pieces) == READ
            assert all(start <= moment <= bus.now() for moment, _ in pieces)
            assert bus.stats()["requests"] == 0
        with pytest.raises(PortError):
            bus.listen(LISTENS)

    def test_what_was_heard_is_counted_as_noise(self) -> None:
        with Bus(Wire(b"\x00\xff\x5a")) as bus:
            bus.listen(LISTENS)
            stats = bus.stats()
        assert (stats["noise_bytes"], stats["noise_idle"], stats["requests"]) == (3, 2, 0)

    def test_a_simulated_line_is_quiet(self) -> None:
        with line() as simulator, Bus(simulator) as bus:
            start = bus.now()
            assert bus.listen(2.5) == []
            assert bus.now() - start == pytest.approx(2.5)
            with pytest.raises(NotAllowed):
                bus.listen(-1)


@pytest.mark.skipif(os.name == "nt", reason="no pty")
class TestTheAdapter:
    def test_a_port_that_is_taken_is_named_with_its_holder(self) -> None:
        with Simulator({1: "gd350"}) as simulator, Bus(simulator.port):
            [finding] = list(examine(simulator.port))
            assert (finding.name, finding.severity, finding.error) == ("port", Severity.FAULT, PortError)
            assert "this program has it open already" in finding.text

    def test_one_that_is_not_there(self) -> None:
        [finding] = list(examine("/dev/ttyNoSuchPort"))
        assert "no such port" in finding.text

    def test_ending_early_leaves_the_port_free(self) -> None:
        with Simulator({1: "gd350"}) as simulator:
            findings = examine(simulator.port, 1, listen=0.01)
            next(findings)
            findings.close()
            with Bus(simulator.port) as bus:
                assert bus.echo(1) > 0

    def test_a_latency_timer_is_a_warning_with_the_rule_that_shortens_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        rule = 'ATTR{latency_timer}="1"'
        facts = port_facts.PortFacts("ftdi_sio", "USB 0403:6001", 16, rule, [])
        monkeypatch.setattr(port_facts, "facts", lambda _: facts)
        with Simulator({1: "gd350"}) as simulator:
            findings = examine(simulator.port, 1, listen=0.01)
            opened, timer = next(findings), next(findings)
            findings.close()
        assert "driver ftdi_sio" in opened.text
        assert (timer.name, timer.severity, timer.values) == (
            "latency_timer",
            Severity.WARNING,
            {"latency_timer": 0.016},
        )
        assert rule in timer.advice

    def test_the_system_knows_a_port(self) -> None:
        with Simulator({1: "gd350"}) as simulator, Bus(simulator.port):
            facts = port_facts.facts(simulator.port)
            assert facts.latency_timer_ms is None
            if sys.platform == "linux":
                assert len(facts.holders) == 1


class TestDirection:
    @pytest.mark.parametrize(
        "rs485",
        [{"mode": "other"}, {"mode": 1}, {"delay": 1}, {"rts_on_send": "x"}, {"delay_after_ms": 101}, {1: 1}, 5],
    )
    def test_what_is_no_setting_is_refused(self, rs485: Any) -> None:
        with pytest.raises(NotAllowed, match="rs485"):
            Bus("/dev/null", rs485=rs485)

    @pytest.mark.skipif(os.name == "nt", reason="no pty")
    @pytest.mark.parametrize(("mode", "word"), [("kernel", "RS-485"), ("rts", "RTS"), ("auto", "RTS")])
    def test_a_pseudo_terminal_has_no_direction(self, mode: str, word: str) -> None:
        with Simulator({1: "gd350"}) as simulator:
            with pytest.raises(PortError, match=word):
                Bus(simulator.port, rs485={"mode": mode})
            [finding] = list(examine(simulator.port, rs485={"mode": mode}))
            assert word in finding.text


def test_arguments_are_checked_before_anything_is_opened() -> None:
    for arguments in ({"unit": 0}, {"unit": 248}, {"listen": -1.0}, {"echoes": 0}):
        with pytest.raises(NotAllowed):
            examine("/dev/null", **arguments)
    assert drivebus.doctor.examine is examine


def test_who_may_not_obey_is_told_a_command_that_works() -> None:
    """P00.02 of a VFD500 is on no page at hand, and it says nowhere what it is."""
    with Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as simulator:
        findings = [finding for finding in examine(simulator) if finding.name == "control"]
    assert [(finding.unit, "may not obey" in finding.text) for finding in findings] == [(1, False), (2, True)]
    assert [finding.advice.split("`")[1] for finding in findings] == [
        "drivebus prepare",
        "drivebus --unit 2 --profile vfd500 --unverified prepare",
    ]
