"""Profiles with coils and input registers: what a row may say, what is read how, and a drive that is known by it alone.

The drive does not exist. What must come is worked out by hand from its rows below.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from drivebus import Bus, NotAllowed, Profile, Simulator, tables
from drivebus.rtu import written as written_to
from drivebus.sniffer.frames import carried, place_of, written_by

from .odd_slave import framed

MANIFEST = """
name = "mill"
title = "A mill"
kind = "inverter"
version = 1
source = "its book"

[requests]
functions = [0x01, 0x02, 0x03, 0x04, 0x05, 0x06]
max_words = 8
source = "its book, p. 1"

[parameters]
address = "listed"
source = "its book, p. 1"

[commands]
register = "run_command"
moves = ["run_command", "way"]
source = "its book, p. 2"

[commands.codes]
run_forward = 1
run_reverse = 1
stop = 0

[commands.first]
run_forward = { register = "way", code = 1 }
run_reverse = { register = "way", code = 0 }

[state]
register = "turning"
source = "its book, p. 2"

[state.codes]
stopped = 0
forward = 1
reverse = 2

[status]
frequency = "speed"

[setpoints.frequency]
register = "wanted"
"""

COLUMNS = "address,table,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n"

ROWS = """0x0010,coil,run_command,Runs,,,no,,,,rw,yes,,p. 2
0x0011,coil,way,1 is forward,,,no,,,,rw,yes,,p. 2
0x0010,discrete,door,Open,,,no,,,,ro,yes,,p. 2
0x0010,input,speed,Speed,Hz,10,no,0.0,50.0,,ro,yes,,p. 3
0x0011,input,turning,Way,,1,no,0,2,,ro,yes,,p. 3
0x0010,,wanted,Wanted,Hz,10,no,0.0,50.0,,rw,yes,,p. 3
0x0011,holding,brake,Brake,,1,no,0,9,,rw,yes,,p. 3
"""

PARAMETERS = "code,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n"
FAULTS = "code,mnemonic,label,cause,remedy,verified,note,source\n"


def folder(place: Path, manifest: str = MANIFEST, rows: str = ROWS) -> Path:
    for name, text in {
        "profile.toml": manifest,
        "registers.csv": COLUMNS + rows,
        "parameters.csv": PARAMETERS,
        "faults.csv": FAULTS,
    }.items():
        (place / name).write_text(text, encoding="utf-8")
    return place


def test_one_address_is_another_place_in_each_table(tmp_path: Path) -> None:
    profile = Profile.load(folder(tmp_path))
    found = {name: profile.address(name) for name in ("wanted", "run_command", "door", "speed")}
    assert found == {"wanted": 0x10, "run_command": 0x1_0010, "door": 0x2_0010, "speed": 0x4_0010}
    assert {profile.name_at(place): name for name, place in found.items()} == {name: name for name in found}
    assert [tables.shown(place) for place in found.values()] == [
        "0010H",
        "coil 0010H",
        "discrete input 0010H",
        "input register 0010H",
    ]
    assert (profile.describe("speed").table, profile.describe("speed").address) == ("input", 0x10)
    assert profile.is_command(0x1_0011)
    assert not profile.is_command(0x11)
    assert not profile.is_command(0x4_0011)
    assert profile.command("run_reverse") == (0x1_0010, 1)
    assert profile.command_first("run_reverse") == (0x1_0011, 0)
    assert profile.command_first("stop") is None


def test_no_read_runs_from_one_table_into_another(tmp_path: Path) -> None:
    profile = Profile.load(folder(tmp_path))
    names = ["speed", "door", "brake", "turning", "wanted", "way", "run_command"]
    plan = profile.compile(names)
    assert set(plan.reads) == {(0x10, 2), (0x1_0010, 2), (0x2_0010, 1), (0x4_0010, 2)}
    words = {0x10: [100, 3], 0x1_0010: [1, 0], 0x2_0010: [1], 0x4_0010: [99, 2]}
    values = plan.values([words[place] for place, _ in plan.reads])
    assert [float(value) for value in values] == [9.9, 1, 3, 2, 10.0, 0, 1]


def test_a_drive_does_what_its_profile_says_of_coils(tmp_path: Path) -> None:
    mill = str(folder(tmp_path))
    with Simulator({1: mill}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive, machine = bus.drive(1, mill), simulator.drive(1)
        for reverse, state in ((False, "forward"), (True, "reverse")):
            drive.run(hz=5.0, reverse=reverse)
            simulator.advance(15.0)
            assert (machine.state, drive.state().name.lower(), drive.read("speed")) == (state, state, 5.0)
        drive.stop()
        simulator.advance(15.0)
        assert (machine.state, drive.read("speed")) == ("stopped", 0.0)
        asked = [frame[1:6].hex(" ") for _, side, frame in simulator.line.trace() if side == "master" and frame[1] == 5]
        # Forward is 1 at coil 0011H here; the third run turns a motor that runs.
        assert asked == ["05 00 11 ff 00", "05 00 10 ff 00", "05 00 11 00 00", "05 00 10 ff 00", "05 00 10 00 00"]
        with Bus(simulator) as other:
            poll = other.poll({other.drive(1, mill): ["speed", "door", "run_command"]}, interval=0.5)
            with poll:
                sample = next(iter(poll))
        assert dict(sample) == {"speed": 0.0, "door": 0, "run_command": 0}


def test_a_coil_can_be_read_as_one_thing_and_written_as_another(tmp_path: Path) -> None:
    rows = ROWS.replace("0x0011,coil,way,1 is forward,,,no,,,,rw", "0x0011,coil,way,1 is forward,,,no,,,,wo")
    rows += "0x0011,coil,lamp,Lit,,,no,,,,ro,yes,,p. 4\n"
    profile = Profile.load(folder(tmp_path, rows=rows))
    for place, read, written in ((0x1_0011, "lamp", "way"), (0x11, "brake", "brake"), (0x4_0011, "turning", "turning")):
        assert (profile.name_at(place), profile.name_at(place, written=True)) == (read, written)
    assert profile.command_first("run_forward") == (0x1_0011, 1)
    assert profile.command_reason("run_forward") is None


@pytest.mark.parametrize("command", ["stop", "coast"])
def test_nothing_comes_before_what_halts_a_motor(tmp_path: Path, command: str) -> None:
    row = f'{command} = {{ register = "way", code = 1 }}\n'
    manifest = MANIFEST.replace("[commands.first]\n", f"[commands.first]\n{row}").replace(
        "stop = 0\n", f"{command} = 0\n"
    )
    [mistake] = Profile.check(folder(tmp_path, manifest))
    assert mistake["reason"] == (
        f"way is written before {command}, so it must come before a start: a stop and a reset wait for nothing"
    )


def test_what_comes_first_can_be_bits(tmp_path: Path) -> None:
    manifest = MANIFEST.replace('"run_command", "way"]', '"run_command", "brake"]')
    for code, bits in ((1, "{ free = 1, ahead = 1 }"), (0, "{ free = 1 }")):
        manifest = manifest.replace(
            f'{{ register = "way", code = {code} }}', f'{{ register = "brake", code = {bits} }}'
        )
    manifest += '[bits]\nbrake = [{ name = "free", bits = [0, 0] }, { name = "ahead", bits = [3, 3] }]\n'
    profile = Profile.load(folder(tmp_path, manifest=manifest))
    first = {name: profile.command_first(name) for name in ("run_forward", "run_reverse")}
    assert first == {"run_forward": (0x11, 9), "run_reverse": (0x11, 1)}


@pytest.mark.parametrize(
    ("file", "find", "put", "said"),
    [
        ("profile.toml", "0x01, 0x02,", "0x02,", '"functions" has no 0x01, by which run_command is read'),
        ("profile.toml", "0x02, 0x03, 0x04,", "0x02, 0x03,", '"functions" has no 0x04, by which speed is read'),
        ("profile.toml", "0x05, 0x06]", "0x06]", '"functions" has no 0x05, by which run_command is written'),
        ("profile.toml", '"run_command", "way"]', '"run_command"]', '"moves" must hold "way"'),
        ("profile.toml", 'run_reverse = { register = "way", code = 0 }', "", "run_reverse has the code of run_forward"),
        ("profile.toml", 'register = "way"', 'register = "door"', "so it must have one word that can be written"),
        ("registers.csv", "0x0010,discrete", "0x0010,discrit", 'table "discrit" must be one of holding, input, coil'),
        ("registers.csv", "Speed,Hz,10,no,0.0,50.0,,ro", "Speed,Hz,10,no,0.0,50.0,,rw", 'table "input" is only read'),
        ("registers.csv", "door,Open,,,", "door,Open,m,1,", "a bit has no unit"),
        ("registers.csv", "0x0011,coil,way", "0x0010,coil,way", "way is at coil 0010H, where run_command is already"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, file: str, find: str, put: str, said: str) -> None:
    path = folder(tmp_path) / file
    text = path.read_text(encoding="utf-8")
    assert find in text
    path.write_text(text.replace(find, put), encoding="utf-8")
    with pytest.raises(NotAllowed) as caught:
        Profile.load(tmp_path)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("pdu", "place", "words"),
    [
        # Modbus Application Protocol V1.1b3: 6.1, 6.5, 6.6, 6.11, 6.12.
        ("01 0013 0013", (0x1_0013, 0x13), None),
        ("05 00AC FF00", (0x1_00AC, 1), [1]),
        ("06 0001 0003", (1, 1), [3]),
        ("0F 0013 000A 02 CD01", (0x1_0013, 10), [1, 0, 1, 1, 0, 0, 1, 1, 1, 0]),
        ("10 0001 0002 04 000A 0102", (1, 2), [0x000A, 0x0102]),
        ("08 0000 1234", None, None),
    ],
)
def test_what_is_sent_and_what_is_heard_are_told_alike(
    pdu: str, place: tuple[int, int] | None, words: list[int] | None
) -> None:
    body = bytes.fromhex(pdu)
    heard = framed("01" + pdu)
    assert (place_of(heard), written_by(heard)) == (place, words)
    if body[0] > 4:
        # What confirms a write carries none of its words, nor where the request broke off before them.
        for asked in (heard, framed("01" + pdu[:12])):
            assert carried(framed("01" + pdu[:12]), asked) is None
    assert written_to(body) == (None if place is None or words is None else (place[0], words))
