"""`drivebus raw`: requests by hand at a prompt, by a script, and again and again."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus.cli import cli
from drivebus.cli.present.output import Output
from drivebus.cli.raw.editing import completions
from drivebus.cli.raw.families import UnitFamilies
from drivebus.cli.raw.request import Request
from drivebus.cli.raw.script import requests_of, typed_in
from drivebus.cli.raw.sending import Sender
from drivebus.cli.session import Session

if sys.platform != "win32":
    from .conversation import Conversation

VIRTUAL = "sim://1=gd350,2=vfd500?clock=virtual"
GD350 = drivebus.Profile.builtin("gd350")

no_pty = pytest.mark.skipif(sys.platform == "win32", reason="no pty")


@pytest.fixture
def line() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350", 2: "gd350"}, transport="tcp" if os.name == "nt" else "pty") as simulator:
        yield simulator


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], str]:
    def write(text: str) -> str:
        (tmp_path / "requests.txt").write_text(text, encoding="utf-8")
        return str(tmp_path / "requests.txt")

    return write


def run(*words: str, port: str = VIRTUAL, typed: str | None = None) -> Result:
    return CliRunner().invoke(cli, ["--port", port, *words], prog_name="drivebus", input=typed)


@no_pty
def test_the_prompt_takes_bytes_and_names_asks_before_a_write_and_outlives_mistakes() -> None:
    with Conversation("--port", VIRTUAL, "raw") as talk:
        talk.until("raw> ")
        assert "unit 1 answers 2100H = 3" in talk.say("01 03 2100 0001\n")
        assert "status_word_1 = 3 (stopped)" in talk.say("read status_word_1\n")
        assert 'the closest is "output_current"' in talk.say("read output_curent\n")
        assert "begins no line" in talk.say("status\n")
        asked = talk.say("write P00.11=2.5\n", "Go ahead.*: ")
        assert "01 06 80 0B 00 19 (write P00.11 acceleration_time_1 = 2.5 s)" in asked
        assert "Cancelled. Nothing was written." in talk.say("n\n")
        assert "acceleration_time_1 = 10.0 s" in talk.say("read P00.11\n")
        talk.say("write P00.11=2.5\n", "Go ahead.*: ")
        assert "took P00.11 acceleration_time_1 = 2.5 s" in talk.say("y\n")
        talk.say("unit 2\n")
        assert "--profile" in talk.say("read P00.11\n")
        talk.say("unit 1\n")
        talk.say("01 06 2000 0005\n", "Go ahead.*: ")
        talk.say("y\n")
        assert "ten times" in talk.say("help\n")
        assert talk.end() == 0
        assert "stop` stops it" in talk.text


@no_pty
def test_the_help_warns_that_the_unit_is_hex_and_each_echo_says_it_in_decimal() -> None:
    """Who means unit 11 and writes 11 asks unit 17."""
    assert "unit 11 is 0B" in " ".join(run("raw", "--help").stdout.split())
    done = run("raw", typed="11 03 2100 0001\n0B 03 2100 0001\n", port="sim://11=gd350,17=gd350?clock=virtual")
    asked = [line.strip() for line in done.stdout.splitlines() if line.endswith(": read 2100H")]
    assert asked == ["unit 17: read 2100H", "unit 11: read 2100H"]


@no_pty
def test_the_prompt_completes_names_and_keeps_its_history() -> None:
    with Conversation("--port", VIRTUAL, "--profile", "gd350", "raw", "--yes") as talk:
        talk.until("raw> ")
        assert "output_current = 0.0 A" in talk.say("read output_cu\t\n")
        assert talk.end() == 0
    with Conversation("--port", VIRTUAL, "--profile", "gd350", "raw") as later:
        later.until("raw> ")
        assert "output_current = 0.0 A" in later.say("\x10\n")
        assert later.end() == 0


@no_pty
def test_ctrl_c_ends_a_loop_and_tells_how_far_it_came(line: drivebus.Simulator) -> None:
    with Conversation("--port", line.port, "raw") as talk:
        talk.until("raw> ")
        talk.say("01 03 2100 0001 x100000\n", "(?s)answer.*answer")
        told = talk.say("\x03", r"Interrupted\. .*sent")
        assert re.search(r"Interrupted\. \d+ of 100000 requests were sent", told)
        talk.until("raw> ")
        assert "2100H = 3" in talk.say("01 03 2100 0001\n")
        assert talk.end() == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("01 03 2100 0001\n\n# right so far\nzz 03\n", 'requests.txt, line 4: "zz" begins no line'),
        ("01 03 2100 0001\nread output_curent\n", 'line 2: gd350 has no "output_curent"; the closest is'),
        ("01 03 2100 0001\n00 03 2100 0001", "line 2: no unit 00 answers"),
        ("01 03 2100 0001 x0", "line 1: x0 is out of range"),
        ("01 03 2100 0001 every 2", "line 1: every stands behind a number of times"),
        ("wait soon", 'line 1: wait "soon" is not a number of seconds'),
        ("01 03 2100 0001\n01 06 2000 0063", "line 2: 99 at 2000H is not a command of"),
        ("write P00.11=99999", "line 1: P00.11"),
        ("unit 1-3", 'line 1: "1-3" is several units'),
        ("# nothing", "has no request; nothing was sent"),
    ],
)
def test_a_wrong_line_is_named_before_anything_of_a_script_is_sent(
    line: drivebus.Simulator, script: Callable[[str], str], text: str, said: str
) -> None:
    result = run("--profile", "gd350", "raw", "--script", script(text), "--yes", port=line.port)
    assert result.exit_code == 2
    assert said in result.stderr.replace("\n", " ")
    assert (line.line.requests, result.stdout) == (0, "")


def test_a_script_asks_once_for_all_that_it_writes(line: drivebus.Simulator, script: Callable[[str], str]) -> None:
    file = script("01 03 2100 0001\nwrite set_frequency=10 x2\nunit 2\nwrite P00.11=2.5\n")
    words = ["--profile", "gd350", "raw", "--script", file]
    refused = run(*words, port=line.port)
    assert refused.exit_code == 2
    assert "unit 1: 01 06 20 01 03 E8 (write set_frequency = 10.00 Hz) 2 times\n" in refused.stderr
    assert "unit 2: 02 06 80 0B 00 19 (write P00.11 acceleration_time_1 = 2.5 s)\n" in refused.stderr
    assert line.line.requests == 0
    done = run(*words, "--yes", port=line.port)
    assert done.exit_code == 0
    assert "4 requests were sent." in done.stderr
    assert [word for _, _, word in line.drive(1).writes()] == [1000, 1000]
    assert line.drive(2).register(0x000B) == 25


def test_what_is_piped_in_is_a_script_and_ends_at_the_first_failure_unless_told_otherwise() -> None:
    text = "01 03 6300 0001\nread status_word_1\n"
    ended = run("--json", "raw", typed=text)
    assert (ended.exit_code, len(ended.stdout.splitlines())) == (4, 2)
    assert "Error: standard input, line 1: unit 1, read 6300H" in ended.stderr
    went_on = run("--json", "raw", "--keep-going", typed=text)
    assert (went_on.exit_code, json.loads(went_on.stdout.splitlines()[-1])["words"]) == (4, [3])
    assert "2 requests were sent, 1 without a good answer." in went_on.stderr


def test_read_only_and_options_that_do_not_fit_send_nothing(
    line: drivebus.Simulator, script: Callable[[str], str]
) -> None:
    file = script("01 03 2100 0001\n01 06 2000 0005\n")
    for words in (
        ["--read-only", "raw", "--script", file, "--yes"],
        ["raw", "--script", file, "01 03 2100 0001"],
        ["raw", "01 03 2100 0001", "--interval", "1"],
        ["raw", "--script", f"{file}.not"],
    ):
        assert run(*words, port=line.port).exit_code == 2
    assert line.line.requests == 0


def test_a_request_for_another_unit_than_the_one_that_is_named_is_not_sent(line: drivebus.Simulator) -> None:
    done = run("-u", "7", "raw", "01 06 2000 0005", "--yes", port=line.port)
    assert (done.exit_code, "the request is for unit 1, its first byte, and --unit says 7" in done.stderr) == (2, True)
    assert not line.drive(1).writes()
    assert run("-u", "1", "raw", "01 03 2100 0001", port=line.port).exit_code == 0


def test_repetitions_begin_when_they_are_said_to() -> None:
    with (
        drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        session = Session(simulator.port, 19200, ("8", "E", "1"), 1, "gd350", Output(True))
        families = UnitFamilies(session, bus)
        sender = Sender(session, bus, families, force=False, yes=True)
        text = ["write set_frequency=10 x3 every 0.5", "wait 2"]
        steps = [step for line in typed_in(text, "", 1, False) if (step := requests_of(line, families.find))]
        assert sender.run(steps, count=2, interval=5.0) is None
        moments = [moment for moment, _, _ in simulator.drive(1).writes()]
        gaps = [later - earlier for earlier, later in itertools.pairwise(moments)]
        # The first write of all has its adapter looked at before.
        assert gaps[1:] == pytest.approx([0.5, 4.0, 0.5, 0.5], abs=0.05)
        assert gaps[3:] == pytest.approx([0.5, 0.5], abs=1e-6)


def test_names_are_as_sure_as_every_command_wants_them() -> None:
    rows = [GD350.describe(name) for name in GD350.names()]
    unsure = next(row for row in rows if row.evidence == "unverified" and row.writable and row.address is not None)
    assumed = next(row for row in rows if row.evidence == "assumed" and row.access != "wo" and row.address is not None)
    for text in (f"write {unsure.name}=1", f"read {assumed.name}"):
        [typed] = typed_in([text], "", 1, False)
        with pytest.raises(drivebus.NotAllowed, match="is not verified"):
            requests_of(typed, lambda _: GD350)
    [typed] = typed_in([f"read {unsure.name} {assumed.name}"], "", 1, False)
    assert requests_of(typed, lambda _: GD350, unverified=True) is not None


def test_completion_offers_what_fits_the_place() -> None:
    assert completions([], "w", [1], [GD350]) == ["write ", "wait "]
    assert completions([], "0", [1, 17], [GD350]) == ["01 "]
    assert "03 " in completions(["01"], "0", [1], [GD350])
    assert completions(["read"], "P00.11", [1], [GD350]) == ["P00.11 "]
    assert completions(["write"], "set_freq", [1], [GD350]) == ["set_frequency="]
    assert not [name for name in completions(["write"], "", [1], [GD350]) if name.startswith("output_current")]
    assert completions(["unit"], "", [1, 2], [GD350]) == ["1", "2"]


@given(st.integers(1, 247), st.binary(min_size=1, max_size=252), st.lists(st.sampled_from(["", " ", "  "])))
def test_any_request_is_understood_however_its_bytes_are_spaced(unit: int, pdu: bytes, blanks: list[str]) -> None:
    request = Request(unit, pdu)
    pairs = request.text().split()
    text = pairs[0] + "".join(
        (blanks[place] if place < len(blanks) else " ") + pair for place, pair in enumerate(pairs[1:])
    )
    [typed] = typed_in([f"{text}  # why"], "", 1, True)
    step = requests_of(typed, lambda _: GD350)
    assert getattr(step, "requests", None) == (request,)


@given(st.text(max_size=40))
def test_a_line_is_right_or_says_what_is_wrong(text: str) -> None:
    with contextlib.suppress(click.UsageError, drivebus.NotAllowed):
        for typed in typed_in([text], "", 1, False):
            requests_of(typed, lambda _: GD350)
