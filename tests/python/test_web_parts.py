"""What the page is made of, each by itself and in a time that is given: passwords, sessions, pauses, orders, curves."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus.sinks import DrivePicture, LinePicture, Picture
from drivebus.spool import Layout, Spool
from drivebus.spool.history import history_of
from drivebus.web import Happened, Presence, Shown, ShownDrive, hashed, is_hash
from drivebus.web.attempts import Attempts
from drivebus.web.audit import tail
from drivebus.web.guard import name_of, why_not
from drivebus.web.log_in import LogIn
from drivebus.web.passwords import is_right
from drivebus.web.sessions import IDLE, MOST, Sessions
from drivebus.web.shown import Person
from drivebus.web.tickets import FRESH, Tickets
from drivebus.web.trend import MOST as MOST_POINTS
from drivebus.web.trend import Courses, Point, course
from drivebus.web.view import LineTimes, ago, happened, plain, view

from .page_plant import MARIA, hash_of

HERE = "192.168.7.20"


def test_a_password_is_kept_as_a_hash_of_its_own() -> None:
    one, other = hash_of(MARIA), hashed(MARIA)
    assert one != other
    assert MARIA not in one
    assert is_right(MARIA, one)
    assert is_right(MARIA, other)
    for wrong in ("", MARIA.upper(), MARIA + " ", MARIA + "x" * 10_000, "\0", "é"):
        assert not is_right(wrong, one)


def test_what_is_weaker_or_no_hash_is_none() -> None:
    salt, key = hash_of(MARIA).split("$")[4:]
    for text in (
        *("", MARIA, "scrypt", f"scrypt$16384$8$1${salt}", f"scrypt$1024$8$1${salt}${key}"),
        *(f"scrypt$16384$1$1${salt}${key}", f"scrypt$16385$8$1${salt}${key}", f"scrypt$1048576$8$1${salt}${key}"),
        *(f"scrypt$16384$8$99${salt}${key}", f"scrypt$16384$8$1$AAAA${key}", f"argon2$16384$8$1${salt}${key}"),
        *(f"scrypt$16384$8$1${salt}${key}\n", f"scrypt$16384$8$1${salt}$====================="),
    ):
        assert not is_hash(text), text
    assert not is_right(MARIA, f"scrypt$1024$8$1${salt}${key}")
    assert is_hash(f"scrypt$16384$8$1${salt}${key}")
    assert not is_right("", None)


def test_a_session_ends_by_log_out_or_when_nobody_uses_it() -> None:
    sessions = Sessions()
    token = sessions.begin("maria", 0.0)
    other = sessions.begin("maria", 0.0)
    assert token != other
    assert len(token) >= 43, "256 bits"
    found = sessions.of(token, IDLE)
    assert found is not None
    assert found.person == "maria"
    assert token not in repr(found)
    assert found.form_token not in repr(found)
    assert sessions.of(token, 2 * IDLE, uses=False) is found
    assert sessions.of(token, 2 * IDLE + 1) is None
    assert sessions.of(other, 2 * IDLE + 1) is None
    token = sessions.begin("maria", 0.0)
    sessions.end(token)
    assert sessions.of(token, 0.0) is None
    for wrong in ("", "x", token + "x", token[:-1], "é\udcff"):
        assert sessions.of(wrong, 0.0) is None


def test_there_are_not_more_sessions_than_fit() -> None:
    sessions = Sessions()
    tokens = [sessions.begin("maria", float(at)) for at in range(MOST)]
    assert sessions.of(tokens[0], MOST) is not None, "in use again"
    tokens.append(sessions.begin("maria", MOST + 1.0))
    there = [sessions.of(token, MOST + 1.0, uses=False) is not None for token in tokens]
    assert there == [True, False, *[True] * (MOST - 1)]


def test_pauses_grow_and_end() -> None:
    attempts, now, pauses = Attempts(), 0.0, []
    for _ in range(14):
        pause = attempts.wait(HERE, "maria", now)
        pauses.append(pause)
        now += pause
        assert attempts.wait(HERE, "maria", now) == 0
        attempts.failed(HERE, "maria", now)
    assert pauses == [0, 0, 0, 1, 2, 4, 8, 16, 32, 60, 60, 60, 60, 60]
    attempts.succeeded(HERE, "maria")
    assert attempts.wait(HERE, "maria", now) == 0
    for _ in range(20):
        attempts.failed(HERE, "maria", now)
    assert attempts.wait(HERE, "maria", now + 900) == 0


def test_a_stranger_keeps_nobody_out() -> None:
    """Many addresses try a name: it waits everywhere, but where it was logged in before."""
    attempts = Attempts()
    attempts.succeeded(HERE, "maria")
    for number in range(200):
        attempts.failed(f"10.0.0.{number}", "maria", 0.0)
    assert attempts.wait("10.1.1.1", "maria", 0.0) == 15
    assert attempts.wait(HERE, "maria", 0.0) == 0
    assert attempts.wait("10.1.1.1", "otto", 0.0) == 0


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        ("2001:db8::1", "2001:db8::2:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("::ffff:10.0.0.1", "10.0.0.1", True),
        ("fe80::1%eth0", "fe80::2", True),
        ("somewhere", "somewhere", True),
        ("10.0.0.1", "10.0.0.2", False),
    ],
)
def test_whose_an_address_is(one: str, other: str, is_same: bool) -> None:
    attempts = Attempts()
    for number in range(9):
        attempts.failed(one, f"name {number}", 0.0)
    assert (attempts.wait(other, "another", 0.0) > 0) is is_same


def test_the_memory_of_attempts_is_bounded() -> None:
    attempts = Attempts()
    for number in range(6_000):
        attempts.failed(f"10.{number // 256}.{number % 256}.1", f"{number}", 0.0)
        attempts.failed(f"10.{number // 256}.{number % 256}.1", f"{number}", 0.0)
        attempts.failed(f"10.{number // 256}.{number % 256}.1", f"{number}", 0.0)
    assert attempts.wait("10.0.0.1", "0", 0.0) == 0
    assert attempts.wait("10.23.111.1", "5999", 0.0) == 1


def test_ten_wrong_passwords_and_the_right_one_after_the_pause() -> None:
    now, told = [0.0], list[str]()
    log_in = LogIn({"maria": Person("maria", hash_of(MARIA))}, told.append, lambda: now[0])
    said = [log_in.look_at(HERE, "maria", "wrong one") for _ in range(10)]
    assert [status for status, _, _ in said] == [403] * 3 + [429] * 7
    assert log_in.look_at(HERE, "maria", MARIA)[0] == 429, "in the pause not even the right one is looked at"
    now[0] += said[-1][2]
    assert log_in.look_at(HERE, "maria", MARIA)[0] == 200
    assert log_in.look_at(HERE, "maria\n\x1b[31m" + "x" * 99, MARIA)[0] == 403
    assert not any(MARIA in text or "wrong one" in text or "\x1b" in text or "\n" in text for text in told)
    log_in.close()


def test_who_gives_no_sign_is_gone_once() -> None:
    presence = Presence(5.0)
    presence.here("maria", 0.0)
    presence.here("otto", 3.0)
    assert presence.gone(5.0) == []
    assert presence.gone(5.1) == ["maria"]
    assert presence.gone(5.2) == []
    presence.here("maria", 6.0)
    assert presence.gone(8.1) == ["otto"]
    assert presence.gone(11.1) == ["maria"]


NUMBER = "0123456789abcdef"


def test_an_order_is_given_once_and_at_what_is_shown() -> None:
    tickets = Tickets()
    assert tickets.why_not(NUMBER, "1000", 1000.0 + FRESH) == ""
    assert tickets.why_not(NUMBER, "1000", 1000.0) == "it was given already"
    for number, seen in (
        (NUMBER + "a", str(1000 - FRESH - 0.1)),
        (NUMBER + "b", str(1000 + FRESH + 0.1)),
        (NUMBER + "c", "nan"),
        (NUMBER + "d", "inf"),
        (NUMBER + "e", ""),
        (NUMBER + "f", "then"),
        ("", "1000"),
        ("short", "1000"),
        ("x" * 65, "1000"),
        ("<script>alert(1)</script>", "1000"),
    ):
        assert tickets.why_not(number, seen, 1000.0), (number, seen)


OURS = frozenset({"plant.example", "127.0.0.1", "::1"})


@pytest.mark.parametrize(
    ("status", "method", "headers"),
    [
        (0, "GET", {"host": "plant.example"}),
        (0, "GET", {"host": "PLANT.example:8080"}),
        (0, "GET", {"host": "plant.example.:8080"}),
        (0, "GET", {"host": "[::1]:8080"}),
        (421, "GET", {}),
        (421, "GET", {"host": ""}),
        # A name of somebody else's that leads here.
        (421, "GET", {"host": "evil.example"}),
        (421, "POST", {"host": "evil.example", "origin": "https://evil.example"}),
        (421, "GET", {"host": "plant.example.evil.example"}),
        (421, "GET", {"host": "127.0.0.1@evil.example"}),
        (421, "GET", {"host": "plant.example:80:80"}),
        (421, "GET", {"host": "[::1]evil.example"}),
        (405, "PUT", {"host": "plant.example", "origin": "https://plant.example"}),
        (405, "OPTIONS", {"host": "plant.example", "origin": "https://plant.example"}),
        (0, "POST", {"host": "plant.example", "origin": "https://plant.example"}),
        (0, "POST", {"host": "plant.example:8080", "origin": "https://plant.example:8080"}),
        (0, "POST", {"host": "plant.example", "sec-fetch-site": "same-origin"}),
        (403, "POST", {"host": "plant.example"}),
        (403, "POST", {"host": "plant.example", "origin": "null"}),
        (403, "POST", {"host": "plant.example", "origin": "null", "sec-fetch-site": "same-origin"}),
        (403, "POST", {"host": "plant.example", "origin": "http://plant.example"}),
        (403, "POST", {"host": "plant.example", "origin": "https://plant.example:8443"}),
        (403, "POST", {"host": "plant.example", "origin": "https://evil.example"}),
        (403, "POST", {"host": "plant.example", "sec-fetch-site": "same-site"}),
        (403, "POST", {"host": "plant.example", "sec-fetch-site": "none"}),
        # A stream, a script or a picture that another page asks for; and a link that somebody follows.
        (403, "GET", {"host": "plant.example", "origin": "https://evil.example"}),
        (403, "GET", {"host": "plant.example", "sec-fetch-site": "cross-site", "sec-fetch-mode": "cors"}),
        (403, "GET", {"host": "plant.example", "sec-fetch-site": "same-site", "sec-fetch-mode": "no-cors"}),
        (0, "GET", {"host": "plant.example", "sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}),
        (0, "GET", {"host": "plant.example", "sec-fetch-site": "none", "sec-fetch-mode": "navigate"}),
    ],
)
def test_what_is_looked_at(status: int, method: str, headers: dict[str, str]) -> None:
    raw = {name.encode(): value.encode() for name, value in headers.items()}
    assert why_not("https", method, raw, OURS)[0] == status


@given(st.text(alphabet=st.sampled_from("a.:@[]/0\\ -\0é"), min_size=1, max_size=6))
def test_no_other_name_is_taken_for_ours(more: str) -> None:
    assert (name_of(f"plant.example{more}") in OURS) == bool(re.fullmatch(r"\.*(:0*)?", more))
    assert name_of(f"{more}plant.example") not in OURS


SAMPLES = st.lists(st.tuples(st.floats(0, 1000), st.one_of(st.none(), st.floats(-100, 100))), max_size=60)


@given(SAMPLES, st.sampled_from([0.5, 50.0, 2_000.0]))
def test_a_course_has_all_extremes_and_no_line_over_a_gap(
    samples: list[tuple[float, float | None]], hold: float
) -> None:
    points = course(samples, 0.0, 1000.0, hold)
    assert [at for at, _ in points] == sorted(at for at, _ in points)
    assert set(points) <= set(samples) | {(at, None) for at, _ in samples}
    values = [value for _, value in samples if value is not None]
    shown = [value for _, value in points if value is not None]
    if values:
        assert (min(shown), max(shown)) == (min(values), max(values))
    for (one, had), (other, has) in itertools.pairwise(points):
        if had is not None and has is not None:
            between = sorted(at for at, _ in samples if one <= at <= other)
            assert all(b - a <= hold for a, b in itertools.pairwise(between))
            assert not any(value is None and one < at < other for at, value in samples)


def test_a_long_course_has_as_many_points_as_a_screen() -> None:
    points = course(((at / 10, at % 7) for at in range(864_00)), 0.0, 8_640.0, 60.0)
    assert len(points) <= MOST_POINTS
    assert {value for _, value in points} >= {0.0, 6.0}


def test_who_looks_at_the_same_curve_reads_nothing() -> None:
    now, read = [1e6], list[tuple[str, str, float, float]]()

    def samples(*asked: Any) -> Iterator[tuple[float, float]]:
        read.append(asked)
        return iter([(asked[3] - 1, 5.0)])

    courses = Courses(samples, lambda: now[0])
    one = courses.of("pump", "speed", 1, 60.0)
    assert one.points == [(1e6 - 1, 5.0)]
    assert read == [("pump", "speed", 1e6 - 3_600, 1e6)]
    now[0] += 9.9
    assert courses.of("pump", "speed", 1, 60.0) is one
    assert courses.of("pump", "speed", 24, 60.0) is not one
    now[0] += 0.1
    assert courses.of("pump", "speed", 1, 60.0) is not one
    now[0] -= 1e5
    courses.of("pump", "speed", 1, 60.0)
    assert len(read) == 4, "a clock that was set back is no reason to show what is old"
    for number in range(100):
        courses.of("pump", f"{number}", 1, 60.0)
    courses.of("pump", "99", 1, 60.0)
    courses.of("pump", "0", 1, 60.0)
    assert len(read) == 105


def test_what_a_file_of_samples_has_of_one_value(tmp_path: Path) -> None:
    one = Layout("pump", "gd350", ("speed", "current"), ("Hz", "A"), (2, 1))
    later = Layout("pump", "gd350", ("current", "speed"), ("A", "Hz"), (1, 2))
    other = Layout("fan", "gd350", ("speed",), ("Hz",), (2,))
    with Spool(tmp_path / "spool", 1 << 30, print) as spool:
        for at in range(100):
            spool.add(one if at < 50 else later, float(at), 0.1, "", (at, 1.5) if at < 50 else (1.5, at))
            spool.add(other, float(at), 0.1, "", (7,))
            spool.note("pump", "fault", float(at), "in fault")
        spool.add(later, 100.0, 0.1, "no answer", ())
        spool.commit()

        def found(drive: str, name: str, since: float, until: float) -> list[Point]:
            return list(history_of(spool.path, drive, name, since, until))

        assert found("pump", "speed", 30.0, 60.0) == [(float(at), at) for at in range(30, 61)]
        assert found("pump", "speed", 98.5, 1e9) == [(99.0, 99), (100.0, None)]
        assert found("fan", "speed", -5.0, 1.0) == [(0.0, 7), (1.0, 7)]
        for drive, name in (("fan", "current"), ("pump", "' OR 1=1 --"), ("ghost", "speed"), ("", "")):
            assert found(drive, name, 0.0, 1e9) == []
        assert found("pump", "speed", 1e9, 2e9) == []
    with pytest.raises(OSError, match="nowhere"):
        list(history_of(tmp_path / "nowhere", "pump", "speed", 0.0, 1.0))


LAYOUT = Layout("pump", "gd350", ("speed", "current"), ("Hz", "A"), (2, 1))
SPARSE = Layout("pump", "gd350", ("speed",), ("Hz",), (2,))


def shown_of(*drives: ShownDrive) -> Shown:
    return Shown(
        title="plant",
        drives={each.name: each for each in drives},
        people=(),
        look=lambda: Picture(0.0, ()),
        events=list,
        order=lambda _: ("done", ""),
        stop_all=lambda _person, _address: {},
        started=lambda: {"pump": "maria"},
        here=lambda _: None,
        tell=lambda _: None,
    )


PUMP = ShownDrive("pump", "hall", 1, "a drive")


def looked(*drives: DrivePicture, now: float = 100.0, **line: object) -> dict[str, object]:
    picture = Picture(now, (LinePicture("hall", True, {"occupied": 8.0}, drives, **line),))  # type: ignore[arg-type]
    [drive] = view(shown_of(PUMP), picture, LineTimes(now - 10, {"hall": 3.0}))["drives"]
    assert isinstance(drive, dict)
    return drive


def test_a_value_is_as_old_as_its_poll_allows() -> None:
    quick = DrivePicture(1, LAYOUT, 99.0, "", (50, 3.25), "forward", interval=0.1)
    slow = DrivePicture(2, SPARSE, 80.0, "", (20,), "stopped", interval=10.0)
    drive = looked(slow, quick)
    assert (drive["quality"], drive["speed"], drive["state"], drive["by"]) == ("good", "50.00 Hz", "forward", "maria")
    assert drive["values"] == [
        {"name": "speed", "unit": "Hz", "text": "50.00", "time": 99.0, "limit": 3.0},
        {"name": "current", "unit": "A", "text": "3.2", "time": 99.0, "limit": 3.0},
    ]
    assert looked(slow, quick, now=102.1)["quality"] == "old"
    assert looked(slow)["quality"] == "good"
    assert looked(quick, now=10.0)["quality"] == "old", "the clock was set back"
    assert looked(slow, now=110.1)["quality"] == "old"


def test_what_is_gone_has_no_values() -> None:
    had, gone = DrivePicture(1, LAYOUT, 98.0, "", (50, 3.2)), DrivePicture(2, SPARSE, 99.0, "no\x1banswer", ())
    drive = looked(had, gone)
    assert (drive["quality"], drive["missing"], drive["values"]) == ("gone", "no\\x1banswer", [])
    assert looked()["quality"] == "unknown"
    picture = Picture(1.0, (LinePicture("hall", False, {}, why="no such port"),))
    shown = view(shown_of(PUMP), picture, None)
    assert (shown["drives"][0]["quality"], shown["lines"][0]["why"]) == ("gone", "no such port")
    assert shown["lines"][0]["late"] == ["pump"]


def test_how_much_of_a_line_is_used() -> None:
    picture = Picture(100.0, (LinePicture("hall", True, {"occupied": 8.0}),))
    for before, share in (
        (LineTimes(90.0, {"hall": 3.0}), "50%"),
        (LineTimes(90.0, {"hall": 9.0}), "0%"),
        (LineTimes(99.0, {}), "100%"),
        (LineTimes(10.0, {"hall": 3.0}), ""),
        (None, ""),
    ):
        assert view(shown_of(), picture, before)["lines"][0]["share"] == share


@given(st.text(max_size=400))
def test_no_text_controls_a_terminal_or_a_page(text: str) -> None:
    assert plain(text).isprintable()


def test_events_are_the_newest_first() -> None:
    events = [Happened(float(at), "pump" if at % 2 else "hall", "state", f"{at}\u202e") for at in range(9)]
    assert [each["time"] for each in happened(events, most=3)] == [8.0, 7.0, 6.0]
    assert [each["text"] for each in happened(events, "pump", 2)] == ["7\\u202e", "5\\u202e"]


@pytest.mark.parametrize(
    ("seconds", "words"), [(-1, "0.0 s"), (0.44, "0.4 s"), (9.94, "9.9 s"), (61, "61 s"), (600, "10 min"), (1e4, "3 h")]
)
def test_ages_in_words(seconds: float, words: str) -> None:
    assert ago(seconds) == words


def test_the_tail_of_an_audit(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    told = {"time": "t", "client": "10.0.0.1:5", "unit": 1, "registers": ["P00.11"], "old": [100], "new": [50]}
    lines = [json.dumps(told | {"outcome": f"done {number}"}) for number in range(2_000)]
    lines += ['{"halted": "hung up\\u001b[31m", "client": "x"}', "not JSON", "[" * 5_000, "3", ""]
    path.write_text("\n".join(lines))
    found = tail(path)
    assert len(found) == 100
    assert (found[0]["what"], found[0]["old"]) == ("halted: hung up\\x1b[31m", "")
    assert (found[1]["what"], found[1]["old"], found[1]["outcome"]) == ("P00.11 = 50", "was 100", "done 1999")
    assert tail(tmp_path / "nowhere") == tail(None) == []


def test_what_is_of_others_is_as_it_came() -> None:
    """What stands beside it says where it is from, and its checksums."""
    folder = Path(drivebus.__file__).parent / "web/static"
    told = re.findall(r"^([0-9a-f]{64})  (\S+)$", (folder / "dygraphs.txt").read_text(), re.MULTILINE)
    assert {name for _, name in told} == {path.name for path in folder.glob("dygraph.*")}
    for checksum, name in told:
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == checksum
