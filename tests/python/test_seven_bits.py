"""A unit that sends seven data bits is told as that: never as noise, nor as two units with one address.

What is heard of it is worked out bit by bit in `uart`; a pseudo-terminal carries no parity bits.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from typing import Any

import pytest
from click.testing import CliRunner

from drivebus import Bus, Simulator
from drivebus.cli import cli
from drivebus.doctor import Finding, Severity, examine
from drivebus.doctor.bus_noise import heard
from drivebus.doctor.echo_test import Echoes
from drivebus.line.seven_bits import SevenBits, agreed, ascii_in, seen_in

from .odd_slave import framed, good, on_a_socket, on_a_terminal
from .test_doctor import Wire, named, wrong
from .uart import Format, received, sent

SEVEN = {"7E1": "7E1", "7O1": "7O1", "7N2": "7N2", "7E2": "7E1", "7O2": "7O1"}
"""How a unit is set, and what is told of it: a second stop bit beside a parity bit is rest."""

EIGHT = ("8N1", "8E1", "8O1", "8N2")
"""How a master is set. At 8E1 and 8O1 the stop bit of 7E1 is its parity bit, and the next start bit its stop bit."""

READ = framed("01 03 02 13 88")
ECHO = framed("01 08 00 00 A5 37")
REFUSAL = framed("01 83 02")


def in_ascii(text: str) -> bytes:
    """A frame of Modbus ASCII: *Modbus over Serial Line* V1.02, section 2.5.2."""
    body = bytes.fromhex(text)
    return b":" + (body + bytes([-sum(body) & 0xFF])).hex().upper().encode() + b"\r\n"


def cut(frame: bytes, line: str = "7E1", to: str = "8N1") -> bytes:
    """*frame* as a unit at the one setting sends it and a master at the other receives it."""
    return received(sent(frame, Format.of(line)), Format.of(to))


class TestTheModel:
    """What is worked out by hand for `A`, 41H = 100 0001B, lowest bit first: 1000001."""

    def test_bits(self) -> None:
        assert sent(b"A", Format.of("7E1"))[12:-12] == [0, 1, 0, 0, 0, 0, 0, 1, 0, 1]
        assert sent(b"A", Format.of("7O1"))[12:-12] == [0, 1, 0, 0, 0, 0, 0, 1, 1, 1]
        assert sent(b"A", Format.of("8N1"))[12:-12] == [0, 1, 0, 0, 0, 0, 0, 1, 0, 1]
        assert cut(b"A", "7E1") == b"A"
        assert cut(b"A", "7O1") == cut(b"A", "7N2") == b"\xc1"

    @pytest.mark.parametrize("setting", [*SEVEN, *EIGHT])
    def test_what_is_sent_and_received_alike_is_the_same(self, setting: str) -> None:
        data = bytes(range(128))
        assert cut(data, setting, setting) == data


class TestTheBytes:
    @pytest.mark.parametrize("unit", [1, 2, 3, 17, 127, 128, 247])
    @pytest.mark.parametrize("setting", SEVEN)
    @pytest.mark.parametrize("master", EIGHT)
    def test_an_answer_is_told_by_its_parity_bits(self, unit: int, setting: str, master: str) -> None:
        answers = [framed(f"{unit:02X} {rest}") for rest in ("03 02 13 88", "08 00 00 A5 37", "83 02", "03 02 00 00")]
        came = [cut(answer, setting, master) for answer in answers]
        assert all((each.bit_count() % 2 == 0) for each in came[0]) == (SEVEN[setting] == "7E1")
        found = agreed(seen_in(unit, each) for each in came)
        assert found is not None
        assert (found.format, found.ascii, found.unit) == (SEVEN[setting], False, unit)

    @pytest.mark.parametrize("setting", SEVEN)
    @pytest.mark.parametrize("master", EIGHT)
    @pytest.mark.parametrize("before", [b"", b"\x00", b"\xff\x00", b"\x3a"])
    def test_a_frame_of_modbus_ascii_is_told_by_itself(self, setting: str, master: str, before: bytes) -> None:
        came = before + cut(in_ascii("01 03 02 13 88"), setting, master)
        for found in (ascii_in(came), agreed([seen_in(1, came)])):
            assert found is not None
            assert (found.format, found.ascii, found.unit) == (SEVEN[setting], True, 1)

    def test_modbus_ascii_in_eight_bits_tells_no_format(self) -> None:
        found = ascii_in(in_ascii("11 03 00 6B 00 03"))
        assert found is not None
        assert (found.format, found.ascii, found.unit, str(found)) == (None, True, 0x11, "Modbus ASCII")

    @pytest.mark.parametrize("setting", [*SEVEN, "7N1"])
    @pytest.mark.parametrize("resync", [True, False])
    @pytest.mark.parametrize("pause", [0, 1, 5, 20])
    def test_a_receiver_that_loses_its_place_tells_nothing_false(self, setting: str, resync: bool, pause: int) -> None:
        """As at 8E1 behind 7N1, whose characters are two bits shorter."""
        for frame, master in itertools.product((READ, ECHO, REFUSAL, in_ascii("01 03 02 13 88")), EIGHT):
            came = received(sent(frame, Format.of(setting), pause), Format.of(master), resync)
            found = seen_in(1, came)
            assert found is None or found.format == SEVEN.get(setting, "7N2")


class TestWhatIsNone:
    @pytest.mark.parametrize("frame", [READ, ECHO, REFUSAL, framed("01 03 04 00 00 00 00")])
    def test_a_whole_answer_is_none(self, frame: bytes) -> None:
        assert seen_in(1, frame) is None

    @pytest.mark.parametrize(
        "frame", [cut(READ), cut(ECHO, "7O1"), cut(REFUSAL, "7N2"), cut(in_ascii("01 03 02 13 88"))]
    )
    def test_one_that_is_cut_or_changed_is_none_or_the_same(self, frame: bytes) -> None:
        whole = seen_in(1, frame)
        assert whole is not None
        for at in range(len(frame)):
            assert seen_in(1, frame[:at]) is None
            for bit in range(8):
                other = seen_in(1, frame[:at] + bytes([frame[at] ^ 1 << bit]) + frame[at + 1 :])
                assert other is None or other.format == whole.format

    def test_an_answer_with_one_wrong_bit_or_byte_is_no_proof(self) -> None:
        """Alone one may look so, where its only highest bit is wrong; three of three do not."""
        answers = [framed(f"01 08 00 00 {word:04X}") for word in range(0, 0x10000, 2731)]
        for at, bit in itertools.product(range(8), range(8)):
            came = [each[:at] + bytes([each[at] ^ 1 << bit]) + each[at + 1 :] for each in answers]
            assert agreed(seen_in(1, each) for each in came) is None

    def test_what_disagrees_is_no_proof(self) -> None:
        even, odd = (seen_in(1, cut(ECHO, line)) for line in ("7E1", "7O1"))
        assert even is not None
        assert odd is not None
        assert agreed([even, even, odd]) is None
        assert agreed([even, even]) is None
        assert agreed([even, even, even, None, None, None, None]) is None
        assert agreed([]) is None
        assert agreed([even, None, even, even]) == even

    @pytest.mark.parametrize(
        "text",
        [b":", b":\r\n", b":01\r\n", b":010302138\r\n", b":01030213884F\r\n", b":0103021388ZZ\r\n", b": 01 03\r\n"],
    )
    def test_what_only_looks_like_modbus_ascii_is_none(self, text: bytes) -> None:
        assert ascii_in(text) is None


@pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
class TestTheDoctor:
    """The unit's receiver is eight bits wide, its sender seven: what a pseudo-terminal can carry of it."""

    @staticmethod
    def findings(answer: Callable[[bytes], bytes], unit: int | None = 1, **options: object) -> list[Finding]:
        with on_a_terminal(answer) as path:
            return list(examine(path, unit, listen=0.01, **options))  # type: ignore[arg-type]

    @pytest.mark.parametrize("unit", [1, 3])
    @pytest.mark.parametrize("setting", ["7E1", "7O1", "7N2"])
    def test_a_unit_is_told_what_it_is(self, unit: int, setting: str) -> None:
        findings = self.findings(lambda request: cut(good(request), setting), unit)
        assert wrong(findings) == {"seven_bits"}
        found = named(findings, "seven_bits")
        assert (found.severity, found.unit, found.values["format"]) == (Severity.FAULT, unit, setting)
        assert f"unit {unit} answers with 7 data bits" in found.text
        assert setting in found.text
        assert "two units" not in str(found)

    @pytest.mark.parametrize("setting", ["7E1", "7O1"])
    def test_one_that_refuses_all_is_told_too(self, setting: str) -> None:
        refuse = lambda request: cut(framed(f"{request[0]:02X} {request[1] | 0x80:02X} 02"), setting)  # noqa: E731
        assert named(self.findings(refuse), "seven_bits").values["format"] == setting

    def test_one_behind_a_serial_server_is_told(self) -> None:
        with on_a_socket(lambda request: cut(good(request), "7E1")) as url:
            assert named(list(examine(url, 1, listen=0.01)), "seven_bits").values["format"] == "7E1"

    def test_one_whose_highest_bits_are_gone_is_told(self) -> None:
        """A serial server that is set to seven bits hands them over so."""
        gone = lambda request: bytes(byte & 0x7F for byte in good(request))  # noqa: E731
        found = named(self.findings(gone), "seven_bits")
        assert found.values["format"] is None
        assert "the answers of unit 1 come without the highest bit of each byte" in found.text

    def test_one_that_answers_in_ascii_is_told(self) -> None:
        said = cut(in_ascii("01 03 02 13 88"))
        found = named(self.findings(lambda _: said), "seven_bits")
        assert (found.values["ascii"], found.values["format"]) == (True, "7E1")
        assert "unit 1 answers in Modbus ASCII with 7 data bits and even parity (7E1) at 19200 bit/s" in found.text

    def test_beside_units_that_answer_it_is_told_by_its_echoes(self) -> None:
        with on_a_terminal(lambda request: cut(good(request), "7E1")) as path, Bus(path, timeout=0.1) as bus:
            for unit in (1, 3):
                [found] = Echoes.of(bus, unit, 4, lambda _: None).findings(None)
                assert (found.name, found.unit, found.values["format"]) == ("seven_bits", unit, "7E1")

    def test_the_command_says_so(self) -> None:
        with on_a_terminal(lambda request: cut(good(request), "7E1")) as path:
            told = CliRunner().invoke(cli, ["doctor", path, "--unit", "1", "--listen", "0.01"])
        assert told.exit_code == 6
        assert "7 data bits and even parity (7E1)" in told.stdout
        assert "two units" not in told.stdout


class TestTheSettingsGiven:
    @pytest.mark.parametrize("setting", ["7E1", "7O1", "7N2"])
    def test_seven_bits_here_are_told_and_eight_are_asked_at(self, setting: str) -> None:
        asked: list[int] = []

        def opened(_: object, **options: Any) -> Bus:
            asked.append(options["bytesize"])
            wire = {name: options[name] for name in ("bytesize", "parity", "stopbits")}
            return Bus(Simulator({1: "gd350"}, transport="process", clock="virtual", **wire), read_only=True)

        line = Format.of(setting)
        findings = list(
            examine("/dev/line", 1, bytesize=7, parity=line.parity, stopbits=line.stop, listen=0.01, open=opened)
        )
        assert wrong(findings) == {"seven_bits"}
        found = named(findings, "seven_bits")
        assert f"{setting} has 7 data bits, and Modbus RTU has 8" in found.text
        assert asked == [7, *[8] * (len(asked) - 1)]
        assert named(findings, "answers").unit == 1

    def test_a_port_that_has_seven_of_its_own_is_not_asked(self) -> None:
        with Simulator({1: "gd350"}, transport="process", clock="virtual", bytesize=7) as line:
            assert wrong(list(examine(line, 1))) == {"seven_bits"}


class TestListening:
    @pytest.mark.parametrize("setting", ["7E1", "7O1", "7N2"])
    def test_a_master_that_speaks_ascii_is_told_and_nothing_is_asked(self, setting: str) -> None:
        wire = Wire(cut(in_ascii("02 03 00 00 00 01") + in_ascii("02 03 02 13 88"), setting))
        findings = list(examine(wire, listen=0.05))
        assert [finding.name for finding in findings] == ["port", "other_master"]
        assert findings[-1].values["protocol"] == "modbus-ascii"
        assert findings[-1].values["format"] == setting
        assert setting in findings[-1].text
        assert ":020300000001FA" in findings[-1].text
        assert wire.sent == b""

    def test_its_cut_and_changed_bytes_are_no_traceback(self) -> None:
        whole = cut(in_ascii("02 03 00 00 00 01"), "7O1")
        for at in range(len(whole)):
            for came in (whole[:at], whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :]):
                with Bus(Wire(came)) as bus:
                    assert heard(bus, 0.001).name in ("quiet", "unknown_traffic", "no_bias", "other_master")


def test_what_is_told_reads_well() -> None:
    even = SevenBits(("even",), False, 1, b"")
    assert str(even) == "7 data bits and even parity (7E1)"
