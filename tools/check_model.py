"""Breaks each rule of the protocol core once in a copy, and expects the model's search to refute it.

`check_model.py` builds each broken copy of `crates/rtu` under the target folder, searches the line on which the rule
matters, and prints the shortest run that shows what the rule is for, or what is never seen without it. A rule that can
be broken unnoticed is a finding: the exit code is 1 then, or where the text that a break replaces is no longer there.
Where something is replaced beside the rule, that everything holds with this alone is searched too; so it is where a
rule only holds back what is assumed. `check_model.py NAME …` takes those whose names hold one of these words; with
`--texts` it only looks whether what they replace is still there.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

DOUBT = "crates/rtu/src/doubt.rs"
ATTRIBUTION = "crates/rtu/src/doubt/attribution.rs"
DAMAGED = "crates/rtu/src/doubt/damaged.rs"
OWED = "crates/rtu/src/doubt/owed.rs"
LENGTHS = "crates/rtu/src/doubt/lengths.rs"
JUDGE = "crates/rtu/src/master/judge.rs"
MASTER = "crates/rtu/src/master.rs"
AGREEMENT = "crates/rtu/src/agreement.rs"
TORN = "crates/rtu/src/master/torn.rs"
CONVERSATION = "crates/rtu/src/conversation.rs"
ATTEMPT = "crates/rtu/src/conversation/attempt.rs"
CAME_TO = "crates/rtu/src/conversation/came_to.rs"
FIRST_CONTACT = "crates/rtu/src/conversation/first_contact.rs"
KNOWN = "crates/rtu/src/conversation/known.rs"
LONGER = "crates/rtu/src/conversation/longer_reads.rs"
WRITE_BACK = "crates/rtu/src/conversation/write_back.rs"


# Where something is replaced, what, and by what.
Change = tuple[str, str, str]


@dataclass(frozen=True)
class Break:
    """One rule broken: what is replaced, and the search that refutes it."""

    name: str
    file: str
    old: str
    new: str
    search: str
    # What is replaced too, so that the rule matters within the search's bounds.
    beside: Change | None = None
    # Whether it breaks nothing: the rule only holds back what is assumed here, and everything still holds.
    holds: bool = False


@dataclass(frozen=True)
class Result:
    """What a break came to: in capitals where it is not as it should be."""

    broken: Break
    verdict: str
    shown: str
    seconds: float

    def __str__(self) -> str:
        what = f'{self.verdict}: not "{self.broken.name}" ({self.broken.search}), {self.seconds:.0f} s'
        return f"\n{what}\n{self.shown}" if self.shown else f"\n{what}"


@dataclass(frozen=True)
class Found:
    """What a search found: the run that refutes something, if one does, and else what was not seen."""

    run: str
    unseen: frozenset[str]


# A damaged answer is believed to be all, from the first on.
BELIEVED = ("self.enough.is_some_and(|enough| now >= enough + again(timeout))", "true")

# The master begins what could be mistaken, in quarantine.
BEGUN = (
    "if self.in_quarantine(now, unit) && !self.doubts.tells_apart(now, unit, request.expected()) =>",
    "if false && !self.doubts.tells_apart(now, unit, request.expected()) =>",
)

# Open requests of one kind share one time, as five of them do; the search leaves fewer open.
ONE_TIME = (DOUBT, "const APART: usize = 4;", "const APART: usize = 1;")

BREAKS = [
    # --- first contact
    Break(
        "another program may have asked any unit",
        DOUBT,
        "self.strangers = UnitSet::ALL;",
        "",
        "first-contact --openings 0",
    ),
    Break(
        "first contact lasts a second",
        DOUBT,
        "self.strangers_until = now + FIRST_CONTACT;",
        "self.strangers_until = now;",
        "first-contact --openings 0",
    ),
    Break(
        "first contact lasts no longer",
        DOUBT,
        "self.strangers_until = now + FIRST_CONTACT;",
        "self.strangers_until = now + FIRST_CONTACT * 2;",
        "first-contact --openings 0",
    ),
    Break(
        "opening the line begins first contact", MASTER, "self.doubts.opened(now);", "", "first-contact --openings 0"
    ),
    Break(
        "no read tells its answer from a stranger's",
        DOUBT,
        "&& !self.is_strange(now, unit)\n                && !self.has_forgotten",
        "&& !self.has_forgotten",
        "first-contact --openings 0",
    ),
    Break("an echo ends first contact", DOUBT, "self.strangers.remove(unit);", "", "first-contact --openings 0"),
    Break(
        "no stranger's answer is taken for one that was seen",
        DOUBT,
        "if self.is_strange(now, unit) {\n            return is_nobodys;",
        "if false {\n            return is_nobodys;",
        # What is open was asked before the line was opened again: behind it nothing is that could be mistaken.
        "overtaking-no-echo --openings 1 --requests 2 --faults 0 --retries 0",
    ),
    # --- what is left open
    Break(
        "a time-out leaves the request open",
        JUDGE,
        "Open::Long => self",
        "Open::Long if !self.beside.is_spoilt() => {}\n            Open::Long => self",
        "in-order",
    ),
    Break(
        "a damaged answer leaves the request open",
        JUDGE,
        "Open::Long => self",
        "Open::Long if self.beside.is_spoilt() => {}\n            Open::Long => self",
        "in-order",
    ),
    Break(
        "an answer to something else leaves the request open",
        JUDGE,
        "(false, ..) => self.doubts.left_open(now, unit, expected, timeout),",
        "(false, ..) => {}",
        "first-contact --openings 0 --requests 3 --refusals 1",
    ),
    Break(
        "a request given up is left open",
        MASTER,
        "self.doubts.left_open(now, unit, expected, timeout);\n                true",
        "let _ = (unit, expected, timeout);\n                true",
        "in-order --aborts 1",
    ),
    Break(
        "a request that was going out is left open",
        MASTER,
        "self.doubts.left_open(now, unit, job.expected, job.timeout);",
        "let _ = (unit, now);",
        "in-order",
    ),
    Break(
        "a stop that the adapter may have confirmed is still owed",
        MASTER,
        "self.doubts.left_open(now, unit, request.expected(), timeout);",
        "let _ = (now, unit, request, timeout);",
        "adapter-echoes --refusals 1 --faults 0",
    ),
    Break(
        "requests of one kind are counted",
        DOUBT,
        "(open.count.saturating_add(1), open.owed.saturating_add(owed))",
        "(1, open.owed.saturating_add(owed))",
        "overtaking --requests 5 --faults 0",
        beside=ONE_TIME,
    ),
    Break(
        "the time counts from the latest",
        DOUBT,
        "open.given_up = open.given_up.max(since);\n            open.last = open.last.max(last);",
        "",
        "in-order --lingers 0 --faults 0",
        beside=ONE_TIME,
    ),
    Break("what is left open puts the unit in doubt", DOUBT, "self.open.insert(what.0);", "", "in-order"),
    # --- the quarantine
    Break(
        "nothing that could be mistaken is asked in quarantine",
        KNOWN,
        "_ => in_quarantine,",
        "_ => false,",
        "first-contact --openings 0",
        beside=(MASTER, *BEGUN),
    ),
    Break(
        "the master would not begin it, but a conversation never tries to",
        MASTER,
        *BEGUN,
        "first-contact --openings 0",
        holds=True,
    ),
    Break(
        "a read of the same length tells nothing apart",
        DOUBT,
        "&& !self\n                    .possible(now, unit)\n                    "
        ".any(|open| self.could_pass(open, expected) || open.expected.could_pass_for_cut(expected)))",
        ")",
        "in-order",
    ),
    Break("an echo ends the quarantine", DOUBT, "self.open.remove(unit);\n        if echoed", "if echoed", "in-order"),
    Break(
        "a read that tells apart ends the quarantine",
        JUDGE,
        "(true, false, echo) if echo || apart =>",
        "(true, false, echo) if echo =>",
        "silent-on-08H --requests 3",
    ),
    Break(
        "another read does not end it",
        JUDGE,
        "(true, false, echo) if echo || apart =>",
        "(true, false, echo) =>",
        "in-order --requests 4 --faults 0",
    ),
    Break(
        "the refusal of an echo ends it",
        DOUBT,
        "self.settle(now, unit, false);",
        "self.left_open(now, unit, Expected::ECHO, Duration::ZERO);",
        "refuses-08H --requests 3",
    ),
    Break(
        "not at first contact",
        DOUBT,
        "if self.is_strange(now, unit) || self.has_forgotten",
        "if self.has_forgotten",
        "refuses-08H --requests 3",
    ),
    Break(
        "time ends it where no echo ever came",
        DOUBT,
        "asked.is_none_or(|asked| now >= asked + PATIENCE)",
        "asked.is_none()",
        "silent-on-08H --requests 3",
    ),
    Break("time does not end it where echoes come", DOUBT, "self.echoers.insert(unit);", "", "in-order --retries 0"),
    Break(
        "a unit that returns none any more is one that never did", DOUBT, "self.echoers.remove(unit);", "", "replaced"
    ),
    Break(
        "an open echo does not prolong it",
        DOUBT,
        ".filter(|open| !open.expected.is_echo())",
        "",
        "silent-on-08H --requests 3",
    ),
    Break(
        "every open answer seen ends it",
        DOUBT,
        "if !self.has_forgotten(now, unit) && self.of(unit).all(|open| open.expected.is_echo()) {\n"
        "            self.open.remove(unit);",
        "if false {",
        "in-order",
    ),
    # --- what may overtake
    Break(
        "an open answer may overtake for three seconds",
        DOUBT,
        "pub const OVERTAKING: Duration = Duration::from_secs(3);",
        "pub const OVERTAKING: Duration = Duration::from_secs(1);",
        "overtaking --requests 4 --faults 0",
    ),
    Break(
        "and no longer",
        DOUBT,
        "pub const OVERTAKING: Duration = Duration::from_secs(3);",
        "pub const OVERTAKING: Duration = Duration::from_secs(6);",
        "overtaking --requests 4 --faults 0",
    ),
    Break(
        "an echo proves nothing of what may overtake",
        DOUBT,
        "self.forget(unit, |open| open.is_past(now) || open.expected.is_echo());",
        "self.forget(unit, |_| true);",
        "overtaking --requests 4 --faults 0",
    ),
    Break(
        "what is taken may have been the open one",
        DOUBT,
        "open.last = capped(now, open.given_up, open.window);",
        "",
        "in-order --requests 3 --lingers 1",
    ),
    Break(
        "but not for ever",
        DOUBT,
        "open.last = capped(now, open.given_up, open.window);",
        "open.last = now;",
        "in-order-commands --requests 4 --refusals 0",
    ),
    Break(
        "nor where another kind displaces it",
        DOUBT,
        "self.enter(now, (unit, expected, because), window, since);",
        "self.enter(now, (unit, expected, because), window, now.max(since));",
        # A read given up is displaced by the refusal of a longer one, and this by that of the first: nine seconds pass.
        "overtaking-one --requests 5 --refusals 1 --quits 2 --retries 0",
    ),
    Break(
        "a refusal may have been another's",
        DOUBT,
        "self.enter(now, (unit, expected, because), window, since);\n        }\n    }",
        "let _ = (window, since, because);\n        }\n    }",
        # A refusal is taken for another read's, whose answer for the next's, and so on: until nobody asks twice.
        "overtaking --requests 5 --refusals 1 --retries 0",
    ),
    Break(
        "one answer more than could be mistaken",
        ATTRIBUTION,
        "words = words.saturating_add(open.count);",
        "",
        "overtaking --requests 4 --faults 0",
    ),
    Break(
        "and one refusal more",
        ATTRIBUTION,
        "refusal = refusal.saturating_add(open.count);",
        "",
        "overtaking --requests 3 --refusals 1 --retries 0",
    ),
    Break(
        "a write waits",
        ATTRIBUTION,
        "Some(latest) if !expected.is_read() => Attribution::Wait(latest),",
        "",
        "overtaking-commands --requests 4 --refusals 0",
    ),
    Break(
        "a refusal of another write is not believed",
        DOUBT,
        "|| self.possible(now, unit).any(rival)",
        "",
        "in-order-commands --requests 4",
    ),
    # --- what was seen
    Break(
        "an answer seen takes one of its kind away",
        OWED,
        "open.count -= 1;",
        "open.count = 0;",
        "overtaking --requests 4 --faults 0",
        beside=ONE_TIME,
    ),
    Break(
        "not when it is the same frame again",
        DOUBT,
        "if !is_new {",
        "if false {",
        "overtaking --requests 4 --faults 1",
    ),
    Break(
        "nor when the adapter may have sent it",
        DOUBT,
        "self.closes(now, answers, |open| !open.expected.may_repeat_request(), false);",
        "self.closes(now, answers, |_| true, false);",
        "adapter-echoes --requests 4 --retries 0",
    ),
    # --- other lengths
    Break(
        "of a unit that gave another length no length proves anything",
        LENGTHS,
        "self.any_length.insert(unit);",
        "",
        "other-lengths --requests 3",
    ),
    Break(
        "not when the line brings the same frame twice",
        LENGTHS,
        "&& self.is_new(now, frame, at_once)\n        {",
        "{",
        "stop-reads --deep",
    ),
    Break(
        "one that comes in its turn shows it",
        JUDGE,
        "self.doubts.learn_length(now, (unit, expected), &frame, at_once);",
        "",
        "other-lengths --requests 3",
    ),
    Break(
        "so does one that comes beside",
        JUDGE,
        "self.doubts.learn_length_beside(now, unit, &frame, at_once);",
        "",
        "other-lengths --requests 3",
    ),
    Break(
        "the answer to a read of any length may be taken for that to any other",
        ATTRIBUTION,
        "if self.could_pass(open, expected) {\n                words",
        "if open.expected.could_pass_for(expected) {\n                words",
        "other-lengths",
    ),
    Break(
        "no read tells its answer from that to another",
        DOUBT,
        ".any(|open| self.could_pass(open, expected) || open.expected.could_pass_for_cut(expected)))",
        ".any(|open| open.expected.could_pass_for_cut(expected)))",
        "other-lengths",
    ),
    Break(
        "which of its reads was answered is not known",
        DOUBT,
        "if self.gives_any_length(unit) && self.of(unit).any(|open| is_read_by(open, frame)) {",
        "if false && self.of(unit).any(|open| is_read_by(open, frame)) {",
        "other-lengths --requests 5 --quits 1",
    ),
    Break(
        "what is taken may have been the open one, of whatever length",
        DOUBT,
        "passes(open, expected, any_length) || (refused",
        "passes(open, expected, false) || (refused",
        "other-lengths --requests 5",
    ),
    # --- what is forgotten
    Break(
        "what there is no room for is waited for",
        DOUBT,
        "self.forgotten.insert(oldest.unit);",
        "let _ = oldest.unit;",
        # The echo that it is silent on takes the place of the read before.
        "silent-on-08H --requests 3",
        beside=(DOUBT, "const KEPT: usize = 32;", "const KEPT: usize = 1;"),
    ),
    # --- the master
    Break(
        "a request goes out once", MASTER, "self.state = State::Sending { job };", "", "in-order-commands --requests 4"
    ),
    Break(
        "the adapter confirms nothing",
        JUDGE,
        "self.echo_due || !(expected.may_repeat_request() || self.never_echoes && expected.is_write())",
        "!expected.may_repeat_request()",
        "adapter-echoes",
    ),
    Break(
        "the adapter's echo of a read is known",
        JUDGE,
        "self.echo_due || !(expected.may_repeat_request() || self.never_echoes && expected.is_write())",
        "self.echo_due",
        "adapter-echoes",
    ),
    # --- damaged answers
    Break(
        "what came damaged may come again",
        JUDGE,
        "Open::For(time) => self.doubts.may_come_again(now, unit, expected, time.max(timeout)),",
        "Open::For(_) => {}",
        "damaged-again",
    ),
    Break(
        "for a second",
        TORN,
        "const AGAIN: Duration = Duration::from_secs(1);",
        "const AGAIN: Duration = Duration::from_millis(500);",
        "damaged-again",
    ),
    Break(
        "one that did not is not enough",
        TORN,
        "const ALONE: usize = 3;",
        "const ALONE: usize = 1;",
        # Who asks again what came damaged is answered by either: it takes three calls.
        "damaged-again --faults 2 --retries 0",
    ),
    Break(
        "a second has to pass",
        TORN,
        "self.enough.is_some_and(|enough| now >= enough + again(timeout))",
        "self.enough.is_some_and(|enough| now >= enough)",
        "damaged-again --requests 2 --retries 0",
        # Else it takes four calls, three of them damaged.
        beside=(TORN, "const ALONE: usize = 3;", "const ALONE: usize = 1;"),
    ),
    Break(
        "a damaged answer may have been another's",
        JUDGE,
        "self.doubts.none_came_again(unit);\n                self.takes(now, unit, expected, timeout, false);",
        "self.doubts.none_came_again(unit);",
        "damaged-once --lingers 1",
        beside=(TORN, *BELIEVED),
    ),
    Break(
        "where none comes again, the first damaged answer could be believed",
        TORN,
        *BELIEVED,
        "damaged-once --faults 3",
        holds=True,
    ),
    Break(
        "what is taken in its place has its own time",
        DOUBT,
        "open.window = open.window.max(window(timeout));",
        "",
        "damaged-again-one --requests 5",
    ),
    # --- the agreement
    Break(
        "answers have to be the same",
        AGREEMENT,
        "self.latest.times = self.latest.times.saturating_add(1);",
        "self.latest.times = self.latest.times.saturating_add(1).saturating_add(self.other.times);",
        "overtaking-one --changes 1",
    ),
    Break(
        "as often as it takes",
        AGREEMENT,
        "self.latest.times >= needed",
        "self.latest.times >= needed.min(1)",
        "overtaking-one",
    ),
    # --- the conversation
    Break(
        "a question that may be mistaken is put until the answers agree",
        ATTEMPT,
        "self.course.hearing.is_none() && attribution == Attribution::Certain && !twice",
        "self.course.hearing.is_none() && !twice",
        "overtaking-one",
    ),
    Break(
        "the refusal of a read put apart refuses nothing that was asked",
        CAME_TO,
        "self.attempt.apart = false;\n            self.course.asks_otherwise();",
        "self.attempt.apart = false;\n            return self.end_attempt(now, known, result);",
        "overtaking-one",
    ),
    Break(
        "a read is put so that its answer is told apart",
        LONGER,
        "find(&|read| master.tells_apart(now, unit, read))\n",
        "find(&|_| true)\n",
        "overtaking --requests 4",
    ),
    Break(
        "a write waits until nothing open could confirm it",
        KNOWN,
        "Attribution::Wait(until) => Next::Overtaken(until),",
        "Attribution::Wait(_) => Next::Ask(Attribution::Certain),",
        "overtaking-commands --refusals 0",
    ),
    Break(
        "the adapter is looked at before what it could confirm",
        KNOWN,
        "if self.echo == OwnEcho::Unknown && (ask",
        "if false && (ask",
        "adapter-echoes",
    ),
    Break(
        "the adapter is looked at behind a stop that did not wait for it",
        CAME_TO,
        "if known.echo == OwnEcho::Unknown\n                    && ask.destination.unit().is_some()",
        "if false\n                    && ask.destination.unit().is_some()",
        "adapter-echoes",
    ),
    Break(
        "an adapter that is found to echo then has confirmed the stop",
        CAME_TO,
        "let (OwnEcho::Unknown | OwnEcho::Present, Some(unit)) =",
        "let (OwnEcho::Unknown, Some(unit)) =",
        "adapter-echoes",
    ),
    Break(
        "of a program that asks one at a time two questions may be open",
        FIRST_CONTACT,
        "const LEFT_OPEN: u8 = 2;",
        "const LEFT_OPEN: u8 = 1;",
        "stop-reads",
    ),
    Break(
        "a write that another one's confirmation may have confirmed is looked up",
        ATTEMPT,
        "self.course.is_unproven();",
        "",
        "read-back",
    ),
    Break(
        "what the unit shows is compared with what was written",
        WRITE_BACK,
        "let is_shown = self.shows_what_was_written();",
        "let is_shown = true;",
        "read-back",
    ),
    Break(
        "what is read back is not asked in doubt",
        CONVERSATION,
        "request: write.read, timeout, in_doubt: false }",
        "request: write.read, timeout, in_doubt: true }",
        "read-back --requests 4 --retries 0 --aborts 0 --changes 0",
    ),
    Break(
        "a write that went out once went out",
        WRITE_BACK,
        "Err(Slip { sent: slip.sent.or(write.before), ..slip })",
        "Err(slip)",
        "read-back",
    ),
]


def copy(root: Path, to: Path) -> None:
    """What the model is built of, as a workspace of its own."""
    for name in ("crates/rtu", "tests/model"):
        shutil.copytree(root / name, to / name, dirs_exist_ok=True, ignore=shutil.ignore_patterns("target"))
    shutil.copy(root / "Cargo.lock", to / "Cargo.lock")
    manifest = (root / "Cargo.toml").read_text(encoding="utf-8")
    manifest = re.sub(r"^members = .*$", 'members = ["crates/rtu", "tests/model"]', manifest, flags=re.MULTILINE)
    manifest = re.sub(r"^default-members = .*$", "", manifest, flags=re.MULTILINE)
    (to / "Cargo.toml").write_text(manifest, encoding="utf-8")


def build(place: Path) -> Path:
    """Builds the model in *place*: the program that searches."""
    # Built some eighty times, and searched in seconds.
    quick = {"LTO": "off", "CODEGEN_UNITS": "16", "OPT_LEVEL": "1", "INCREMENTAL": "true"}
    quick = {f"CARGO_PROFILE_RELEASE_{name}": value for name, value in quick.items()}
    command = ["cargo", "build", "--quiet", "--release", "-p", "drivebus-model"]
    environment = os.environ | quick | {"RUSTFLAGS": "-Awarnings", "CARGO_TARGET_DIR": str(place / "target")}
    done = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"check_model: {' '.join(command)} failed:\n{done.stderr}")
    return place / "target/release/drivebus-model"


def look_up(text: str, file: str, old: str) -> None:
    """What is to be replaced in *file* stands there once."""
    if text.count(old) != 1:
        raise SystemExit(f"check_model: out of date: {file} holds {text.count(old)} times {old!r}")


@contextmanager
def changed(place: Path, changes: list[Change]) -> Iterator[None]:
    """Replaces in *place* what *changes* say, and puts it back at the end."""
    whole = {file: (place / file).read_text(encoding="utf-8") for file, _, _ in changes}
    try:
        for file, old, new in changes:
            text = (place / file).read_text(encoding="utf-8")
            look_up(text, file, old)
            (place / file).write_text(text.replace(old, new), encoding="utf-8")
        yield
    finally:
        for file, text in whole.items():
            (place / file).write_text(text, encoding="utf-8")


class Searches:
    """The searches of broken copies: built one at a time in one place, and run beside each other."""

    def __init__(self, place: Path) -> None:
        """Copies what is built to *place*."""
        self.place = place
        self.building, self.number = threading.Lock(), itertools.count()
        copy(ROOT, place)
        self.programs = place / "searches"
        shutil.rmtree(self.programs, ignore_errors=True)
        self.programs.mkdir()

    def run(self, changes: list[Change], bounds: str) -> Found:
        """Searches within *bounds* where *changes* are made."""
        with self.building, changed(self.place, changes):
            program = self.programs / f"{next(self.number)}"
            shutil.copy(build(self.place), program)
        search = [str(program), *bounds.split()]
        done = subprocess.run(search, capture_output=True, text=True, check=False)
        program.unlink()
        if done.returncode not in (0, 1):
            raise SystemExit(f"check_model: {' '.join(search)} failed:\n{done.stderr}")
        shown = [line for line in done.stdout.splitlines() if not line.startswith(("line ", "all "))][1:]
        if shown and (unseen := re.fullmatch(r"not seen: \[(.*)\]", shown[0])):
            return Found("", frozenset(unseen[1].split(", ")))
        return Found("\n".join(shown), frozenset())

    def check(self, broken: Break) -> Result:
        """Breaks one rule; where something is replaced beside it, only this before."""
        began = time.monotonic()
        beside = [broken.beside] if broken.beside else []
        if beside and (alone := self.run(beside, broken.search)).run:
            return Result(broken, "NOT ALONE", alone.run, time.monotonic() - began)
        found = self.run([(broken.file, broken.old, broken.new), *beside], broken.search)
        shown = found.run
        if found.unseen and (missed := found.unseen - self.run(beside, broken.search).unseen):
            shown = f"never seen, as it is otherwise: {', '.join(sorted(missed))}"
        verdict = ("REFUTED" if broken.holds else "refuted") if shown else ("holds" if broken.holds else "UNNOTICED")
        return Result(broken, verdict, shown, time.monotonic() - began)


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="only breaks whose names hold one of these")
    parser.add_argument("--texts", action="store_true", help="only look whether what is replaced is still there")
    parser.add_argument("--threads", type=int, default=2, help="so many searches at a time (default: %(default)s)")
    arguments = parser.parse_args()
    names: list[str] = arguments.names
    chosen = [broken for broken in BREAKS if not names or any(name in broken.name for name in names)]
    if arguments.texts:
        for broken in chosen:
            for file, old, _ in filter(None, [(broken.file, broken.old, broken.new), broken.beside]):
                look_up((ROOT / file).read_text(encoding="utf-8"), file, old)
        return 0
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
    began, searches = time.monotonic(), Searches(target / "model")
    results = []
    with ThreadPoolExecutor(max(1, arguments.threads)) as pool:
        for result in pool.map(searches.check, chosen):
            print(result, flush=True)
            results.append(result)
    wrong = [result for result in results if result.verdict.isupper()]
    count = [sum(result.verdict == verdict for result in results) for verdict in ("refuted", "holds")]
    print(
        f"\n{len(results)} rules: {count[0]} refuted, {count[1]} hold, {len(wrong)} not as they should be, "
        f"in {time.monotonic() - began:.0f} s"
    )
    for result in wrong:
        print(f"not as it should be: {result.broken.name}: {result.verdict}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
