"""A family that wants words before a run: each goes out once, and the next when the state shows it.

The drive is that of `crates/sim/tests/profiles/acme`, which does not exist, with two words before its run: 3 arms it,
7 warms it up. Its state word is A000H: bit 0 armed, bit 1 warm, bit 2 on, bit 3 backwards, bit 7 tripped. 12H runs, 22H
runs backwards, 1 stops.
"""

from __future__ import annotations

import asyncio
import itertools
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State, Unconfirmed
from drivebus.cli.present import profile_rules
from drivebus.line.asking import Write
from drivebus.line.meaning import meaning

ACME = Path(__file__).resolve().parents[2] / "crates/sim/tests/profiles/acme"
ORDER, STATUS = 0x9000, 0xA000
ARM, WARM, RUN, BACK, STOP, COAST, RESET = 3, 7, 0x12, 0x22, 1, 0, 0x80
SEQUENCE = """
[[commands.sequence]]
word = 3
label = "arm"
until = { armed = 1, warm = 0 }

[[commands.sequence]]
word = 7
label = "warm up"
until = { armed = 1, warm = 1 }

[state]
"""


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    folder = tmp_path / "acme"
    shutil.copytree(ACME, folder)
    manifest = (folder / "profile.toml").read_text(encoding="utf-8")
    for there, instead in (
        ("\n[state]\n", SEQUENCE),
        (
            '    { name = "ready", bits = [0, 0], values = { 0 = "not ready", 1 = "ready" } },\n',
            '    { name = "armed", bits = [0, 0] },\n    { name = "warm", bits = [1, 1] },\n',
        ),
    ):
        assert there in manifest
        manifest = manifest.replace(there, instead)
    (folder / "profile.toml").write_text(manifest, encoding="utf-8")
    return Profile.load(folder)


@pytest.fixture
def line(profile: Profile) -> Iterator[Simulator]:
    with Simulator({1: profile}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator, profile: Profile) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, profile, variants={"speed_unit": "Hz"})
        drive.write("speed_unit", 1, store=True)
        drive.prepare_control()
        yield drive


def commanded(line: Simulator) -> list[int]:
    return [word for _, address, word in line.drive(1).writes() if address == ORDER]


def asked(line: Simulator) -> list[bytes]:
    return [frame for _, who, frame in line.line.trace() if who == "master"]


def test_each_word_goes_out_once_and_is_seen_before_the_next(line: Simulator, drive: Drive) -> None:
    before = len(asked(line))
    drive.run(hz=20.0)
    assert drive.state() is State.FORWARD
    assert commanded(line) == [ARM, WARM, RUN]
    sent = asked(line)[before:]
    orders = [at for at, frame in enumerate(sent) if frame[1] == 6 and frame[2:4] == b"\x90\x00"]
    assert [frame[4:6].hex() for frame in sent if frame[1] == 6 and frame[2:4] == b"\x90\x00"] == [
        "0003",
        "0007",
        "0012",
    ]
    for one, next_one in itertools.pairwise(orders):
        between = sent[one + 1 : next_one]
        assert between, "the state is read"
        assert {frame[1] for frame in between} == {3}
    drive.stop()
    line.advance(20.0)
    drive.run(hz=20.0, reverse=True)
    assert commanded(line) == [ARM, WARM, RUN, STOP, ARM, WARM, BACK]


def test_a_motor_that_turns_gets_the_run_alone(line: Simulator, drive: Drive) -> None:
    drive.run(hz=20.0)
    line.advance(5.0)
    drive.run(hz=10.0)
    drive.run(reverse=True)
    assert commanded(line) == [ARM, WARM, RUN, RUN, BACK]


def test_the_drive_itself_obeys_no_run_out_of_its_turn(line: Simulator, drive: Drive) -> None:
    for words, armed, warm in (
        ([RUN], 0, 0),
        ([WARM], 0, 0),
        ([WARM, RUN], 0, 0),
        ([ARM], 1, 0),
        ([ARM, RUN], 1, 0),
        ([ARM, WARM], 1, 1),
        ([ARM, WARM, ARM, RUN], 1, 0),
        ([ARM, WARM, COAST, RUN], 0, 0),
        ([ARM, WARM, COAST, WARM, RUN], 0, 0),
    ):
        drive.coast(confirm=0)
        for word in words:
            drive.write_words(ORDER, word)
        assert line.drive(1).state == "stopped", words
        [shown] = drive.bus.read(1, STATUS)
        assert (shown & 1, shown >> 1 & 1) == (armed, warm), words
    for word in (ARM, WARM, RUN):
        drive.write_words(ORDER, word)
    assert line.drive(1).state == "forward"


def test_a_drive_that_is_stuck_gets_no_further_word(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    stuck(drive.bus, monkeypatch, 0x0302)
    with pytest.raises(Unconfirmed) as error:
        drive.run(hz=20.0, confirm=0.5)
    assert commanded(line) == [ARM]
    assert line.drive(1).state == "stopped"
    told = str(error.value)
    assert told.startswith(
        "unit 1 was not started: arm (0003H) was sent, once, and its state word shows 0302H (stopped"
    )
    for said in (
        "armed off and not on",
        "warm on and not off",
        "within 0.5 s",
        "run forward was not sent",
        "then start it again",
    ):
        assert said in told
    assert error.value.unit == 1


def stuck(bus: Any, monkeypatch: pytest.MonkeyPatch, word: int) -> None:
    """Whatever is read of the state word, the bus says it is *word*."""
    read = bus.read_stamped

    def other(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
        words, asked, answered = read(unit, address, count, **how)
        if address == STATUS:
            words[0] = word
        return words, asked, answered

    monkeypatch.setattr(bus, "read_stamped", other)


def test_the_state_is_looked_at_once_where_nothing_shall_be_waited_for(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive.run(hz=20.0, confirm=0)
    assert commanded(line) == [ARM, WARM, RUN]
    drive.coast()
    line.drive(1).take_writes()
    stuck(drive.bus, monkeypatch, 0x0300)
    before = len(asked(line))
    with pytest.raises(Unconfirmed, match="within 0 s"):
        drive.run(hz=20.0, confirm=0)
    assert commanded(line) == [ARM]
    reads = [frame for frame in asked(line)[before:] if frame[1:4] == b"\x03\xa0\x00"]
    assert len(reads) == 2, "before it, and after the first word"


def test_a_fault_ends_it(line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    meanwhile(drive.bus, monkeypatch, ARM, lambda: line.drive(1).trip("OL1"))
    with pytest.raises(
        Unconfirmed, match=r"unit 1 was not started: it is in fault .*since arm \(0003H\).*reset_fault\(\)"
    ):
        drive.run(hz=20.0)
    assert commanded(line) == [ARM]
    drive.reset_fault()
    drive.run(hz=20.0)
    assert commanded(line) == [ARM, RESET, ARM, WARM, RUN]


def meanwhile(bus: Any, monkeypatch: pytest.MonkeyPatch, after: int, what: Any) -> None:
    """Does *what*, once, when the word *after* has been written to the command register."""
    write = bus.write
    done: list[int] = []

    def watched(unit: int, address: int, value: Any, /, **how: Any) -> None:
        write(unit, address, value, **how)
        if address == ORDER and value == after and not done:
            done.append(after)
            what()

    monkeypatch.setattr(bus, "write", watched)


@pytest.mark.parametrize("how", ["the same handle", "another handle", "all", "another thread"])
def test_a_stop_meanwhile_goes_out_at_once_and_ends_it(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    bus = drive.bus
    assert isinstance(bus, Bus)

    def stop() -> None:
        if how == "another handle":
            bus.drive(1, drive.profile).stop()
        elif how == "all":
            bus.stop_all()
        elif how == "another thread":
            thread = threading.Thread(target=drive.stop)
            thread.start()
            thread.join()
        else:
            drive.stop()

    meanwhile(drive.bus, monkeypatch, ARM, stop)
    with pytest.raises(Unconfirmed, match=r"not started: it was told to stop when arm \(0003H\) had been sent"):
        drive.run(hz=20.0)
    assert commanded(line) == [ARM, STOP]
    drive.run(hz=20.0)
    assert commanded(line) == [ARM, STOP, ARM, WARM, RUN]


@pytest.mark.parametrize("after", [ARM, WARM, RUN])
def test_an_interruption_within_a_block_stops_it(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    meanwhile(drive.bus, monkeypatch, after, interrupt)
    with pytest.raises(KeyboardInterrupt), drive.running(20.0):
        pytest.fail("it does not begin")
    assert commanded(line) == [*[ARM, WARM, RUN][: [ARM, WARM, RUN].index(after) + 1], STOP]


def test_what_is_stuck_within_a_block_is_stopped_too(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    stuck(drive.bus, monkeypatch, 0x0300)
    with pytest.raises(Unconfirmed, match="was not started"), drive.running(20.0, confirm=0.1):
        pytest.fail("it does not begin")
    assert commanded(line) == [ARM, STOP]


def test_a_confirmation_that_is_lost_is_not_asked_for_again(line: Simulator, drive: Drive) -> None:
    drive.ping()
    # Two reads before a start: the limit of the setpoint, the state. Then the setpoint, and the first word.
    skip = sum(frame[:4] != b"\x01\x06\x90\x00" for frame in start_of(line, drive))
    line.line.script([(skip + 1, "silence")])
    with pytest.raises(
        Unconfirmed, match=r"not started: arm \(0003H\) was sent and not confirmed .*run forward was not sent"
    ):
        drive.run(hz=20.0)
    assert commanded(line).count(RUN) == 1, "that of the start before"
    assert commanded(line)[-1] == ARM


def start_of(line: Simulator, drive: Drive) -> list[bytes]:
    """What one start sends before its first word; the motor stands again afterwards."""
    before = len(asked(line))
    drive.run(hz=20.0)
    sent = asked(line)[before:]
    first = next(at for at, frame in enumerate(sent) if frame[:6] == b"\x01\x06\x90\x00\x00\x03")
    drive.coast()
    return sent[:first]


def test_both_faces_send_the_same(line: Simulator, profile: Profile, drive: Drive) -> None:
    drive.run(hz=20.0)
    drive.coast()
    sent = [frame for frame in asked(line) if frame[2:4] == b"\x90\x00"]
    line.advance(20.0)

    async def main() -> None:
        async with drivebus.aio.Bus(line) as bus:
            awaited = await bus.drive(1, profile, variants={"speed_unit": "Hz"})
            await awaited.run(hz=20.0)
            await awaited.coast()

    asyncio.run(main())
    assert commanded(line) == [ARM, WARM, RUN, COAST] * 2
    assert [frame for frame in asked(line) if frame[2:4] == b"\x90\x00"] == sent * 2


@pytest.mark.usefixtures("drive")
def test_a_task_that_is_cancelled_amid_it_stops_the_motor(
    line: Simulator, profile: Profile, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(line) as bus:
            drive = await bus.drive(1, profile, variants={"speed_unit": "Hz"})
            ask = bus.ask
            task: list[asyncio.Task[None]] = []

            async def watched(request: Any, /) -> Any:
                answer = await ask(request)
                if isinstance(request, Write) and (request.address, request.value) == (ORDER, WARM):
                    task[0].cancel()
                return answer

            monkeypatch.setattr(bus, "ask", watched)

            async def job() -> None:
                async with drive.running(20.0):
                    pytest.fail("it does not begin")

            task.append(asyncio.create_task(job()))
            with pytest.raises(asyncio.CancelledError):
                await task[0]

    asyncio.run(main())
    assert commanded(line) == [ARM, WARM, STOP]


def test_its_words_are_commands(drive: Drive, profile: Profile) -> None:
    assert profile.command_registers()[ORDER] == {
        0: "coast",
        1: "stop",
        3: "arm",
        7: "warm up",
        0x12: "run_forward",
        0x22: "run_reverse",
        64: "beep",
        128: "reset_fault",
    }
    assert [dict(step) for step in profile.start_sequence()] == [
        {"word": 3, "label": "arm", "until": {"armed": 1, "warm": 0}, "mask": 3, "value": 1},
        {"word": 7, "label": "warm up", "until": {"armed": 1, "warm": 1}, "mask": 3, "value": 3},
    ]
    assert profile.is_command(ORDER)
    drive.bus.write(1, ORDER, 3)
    with pytest.raises(NotAllowed, match=r"2 at 9000H is not a command of unit 1.* 3 arm, 7 warm up, 18 run forward"):
        drive.bus.write(1, ORDER, 2)
    frame = bytes.fromhex("01 06 90 00 00 07")
    frame += drivebus.crc16(frame).to_bytes(2, "little")
    assert meaning(frame, True, None, profile) == "unit 1: write order = 7 (warm up)"
    [lines] = [lines for title, lines in profile_rules.in_words(profile) if title == "Commands"]
    assert "  3 arm" in lines
    assert lines[-2:] == [
        "before a run or jog from rest: 3 arm, until armed = 1, warm = 0",
        "then 7 warm up, until armed = 1, warm = 1",
    ]


@pytest.mark.usefixtures("profile")
def test_without_a_state_that_may_be_read_nothing_is_started(tmp_path: Path) -> None:
    folder = tmp_path / "acme"
    manifest = (folder / "profile.toml").read_text(encoding="utf-8")
    manifest = manifest.replace(
        'register = "status"\nsource = "Acme 7 manual, p. 1"\n\n[[state.when]]',
        'register = "status"\nverified = false\nnote = "Page 3 is missing."\nsource = "x"\n\n[[state.when]]',
        1,
    )
    (folder / "profile.toml").write_text(manifest, encoding="utf-8")
    doubted = Profile.load(folder)
    with Simulator({1: doubted}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, doubted, variants={"speed_unit": "Hz"})
        drive.write("speed_unit", 1, store=True)
        drive.prepare_control()
        with pytest.raises(NotAllowed, match=r"started by several words.*Page 3 is missing.*unverified=True"):
            drive.run(hz=20.0)
        assert commanded(line) == []
        drive.run(hz=20.0, unverified=True)
        assert commanded(line) == [ARM, WARM, RUN]
