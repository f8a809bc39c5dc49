"""Which messages are commands, by their age and what they say. Time is an argument."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivebus.sinks.mqtt_commands import Command, Commands, Heard, NotTaken

WALL = 1_767_225_600.0
"""2026-01-01T00:00:00Z."""


def read(order: str, said: object, age: float = 0.0, commands: Commands | None = None, **told: object) -> Command:
    payload = said if isinstance(said, bytes) else json.dumps(said).encode()
    heard = Heard("pump", order, payload, **told)  # type: ignore[arg-type]
    return (commands or Commands()).read(heard, WALL + age, 100.0)


@pytest.mark.parametrize("when", [WALL, "2026-01-01T00:00:00Z", "2026-01-01T01:00:00.000+01:00", int(WALL)])
def test_a_command_of_now(when: object) -> None:
    taken = read("run", {"id": "a", "time": when, "hz": 20, "reverse": True}, age=0.5)
    assert taken == Command("pump", "run", "a", 20.0, True, 1.5)
    assert read("setpoint", {"time": when, "hz": 12.5}).hz == 12.5


def test_a_clock_that_is_ahead_gives_no_more_time() -> None:
    assert read("reset", {"time": WALL}, age=-1.5).left == 2.0
    assert read("reset", {"time": WALL, "id": "x"}, expiry=1).left == 1.0


@pytest.mark.parametrize("expiry", [0, 1, 2])
def test_a_command_that_expires(expiry: int) -> None:
    assert read("reset", {"id": "a"}, expiry=expiry).left == expiry


@pytest.mark.parametrize(
    ("said", "told", "why"),
    [
        ({"time": WALL}, {"kept": True}, "to keep"),
        ({"time": WALL}, {"age": 2.1}, "it is 2.1 s old"),
        ({"time": WALL}, {"age": -2.1}, "before its time"),
        ({"time": WALL - 86_400}, {}, "86400.0 s old"),
        ({}, {}, "does not say when"),
        ({"id": "a"}, {}, "does not say when"),
        ({}, {"expiry": 1}, "neither"),
        ({"id": "a"}, {"expiry": 3}, "may be delivered for 3 s"),
        ({"time": WALL * 1000}, {}, "neither Unix time in seconds"),
        ({"time": "2026-01-01T00:00:00"}, {}, "its zone"),
        ({"time": "yesterday"}, {}, "neither Unix time"),
        ({"time": True}, {}, "neither Unix time"),
        ({"time": None}, {}, "neither Unix time"),
        ({"time": WALL, "hz": "20"}, {}, '"hz" is not a number'),
        ({"time": WALL, "hz": True}, {}, '"hz" is not a number'),
        ({"time": WALL, "hz": 10**400}, {}, '"hz" is not a number'),
        (b'{"time": 1767225600, "hz": NaN}', {}, "not JSON"),
        (b'{"time": 1767225600, "hz": 1e999}', {}, '"hz" is not a number'),
        (b'{"time": 1767225600, "hz": 1, "hz": 2}', {}, "not JSON"),
        ({"time": WALL, "reverse": 1}, {}, '"reverse" is neither'),
        ({"time": WALL, "revers": True}, {}, 'did you mean "reverse"'),
        ({"time": WALL, "id": 7}, {}, '"id" is not a text'),
        ({"time": WALL, "id": "x" * 101}, {}, '"id" is not a text'),
        ([], {}, "not a JSON object"),
        (b"", {}, "not JSON"),
        (b"on", {}, "not JSON"),
        (b"\xff", {}, "not JSON"),
        (b"[" * 1000, {}, "not JSON"),
        (b" " * 1001, {}, "1001 bytes"),
    ],
)
def test_what_is_no_command(said: object, told: dict[str, object], why: str) -> None:
    with pytest.raises(NotTaken, match=why):
        read("run", said, **told)  # type: ignore[arg-type]


def test_the_same_once() -> None:
    commands = Commands()
    read("run", {"id": "a", "time": WALL}, commands=commands)
    for order, said in (("run", {"id": "a", "time": WALL}), ("reset", {"id": "a", "time": WALL + 1})):
        with pytest.raises(NotTaken, match="in the last 60 s") as caught:
            read(order, said, commands=commands)
        assert caught.value.id == "a"
    read("reset", {"time": WALL}, commands=commands)
    with pytest.raises(NotTaken, match="in the last 60 s"):
        read("reset", {"time": WALL}, commands=commands)
    again = Heard("pump", "run", json.dumps({"id": "a", "time": WALL + 61}).encode())
    assert commands.read(again, WALL + 61, 161.0).id == "a"


def test_another_drive_may_have_the_same_id() -> None:
    commands = Commands()
    for drive in ("pump", "fan"):
        said = json.dumps({"id": "a", "time": WALL}).encode()
        assert commands.read(Heard(drive, "run", said), WALL, 100.0).drive == drive


def test_so_many_at_most_are_remembered() -> None:
    commands = Commands()
    for number in range(10_000):
        read("reset", {"id": str(number), "time": WALL}, commands=commands)
    with pytest.raises(NotTaken, match="more than 10000"):
        read("reset", {"id": "last", "time": WALL}, commands=commands)


@pytest.mark.parametrize("order", ["stop", "coast"])
def test_a_halt_need_not_say_when(order: str) -> None:
    commands = Commands()
    for said in (b"", b"{}", b"", {"id": "a"}, {"id": "b", "time": WALL}):
        assert read(order, said, commands=commands).order == order
    with pytest.raises(NotTaken, match="old"):
        read(order, {"time": WALL}, age=3.0)
    with pytest.raises(NotTaken, match="to keep"):
        read(order, b"", kept=True)
    with pytest.raises(NotTaken, match="not known here"):
        read(order, {"hz": 1})


@given(st.binary(max_size=1_100), st.sampled_from(["run", "setpoint", "stop", "odd/one"]), st.booleans())
def test_any_bytes_are_a_command_of_now_or_none(payload: bytes, order: str, kept: bool) -> None:
    taken = taken_or_why(order, payload, kept)
    if isinstance(taken, str):
        assert taken.isprintable()
    else:
        assert not kept
        assert 0.0 <= taken.left <= 2.0


@given(st.dictionaries(st.sampled_from(["id", "time", "hz", "reverse"]), st.none() | st.floats() | st.text()))
def test_any_json_is_a_command_of_now_or_none(said: dict[str, object]) -> None:
    taken = taken_or_why("run", json.dumps(said).encode(), kept=False)
    if isinstance(taken, str):
        assert len(taken) < 2_000
    else:
        assert "time" in said


def taken_or_why(order: str, payload: bytes, kept: bool) -> Command | str:
    try:
        return Commands().read(Heard("pump", order, payload, kept), WALL, 0.0)
    except NotTaken as error:
        return str(error)
