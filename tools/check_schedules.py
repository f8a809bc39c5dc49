"""Leaves each wake-up of the queue and the bus out once, in a copy, and expects `tests/schedules` to notice.

`make schedules` runs it. A search that finds nothing when somebody is not called searches nothing.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
QUEUE = "crates/line/src/turns/queue.rs"
WORK = "crates/line/src/turns/queue/work.rs"
CREW = "crates/line/src/turns/crew.rs"
CALL = "crates/line/src/bus/call.rs"
ERRAND = "crates/line/src/bus/errand.rs"
HOST = "crates/line/src/bus/host.rs"

WATCHES = """\
        let mut inside = self.guests.lock();
        let mut voice = channel.voice();
        // Asked under the lock that who opens the port takes after it has counted: no opening falls between.
        let is_said = voice.say_in_passing(&Told::Reconnects(port.figures.reconnects())).ok()?;
        inside.watching.insert(self.number, voice);
"""

# What is broken: the file, what stands there once, and what stands there instead.
BREAKS: list[tuple[str, str, str, str]] = [
    (
        "the next caller is not called",
        QUEUE,
        "Some(Waiter::Thread(thread)) => thread.unpark(),",
        "Some(Waiter::Thread(_)) => {}",
    ),
    ("who leaves calls nobody", QUEUE, "if had_the_line.is_some() || waited.is_some() {", "if false {"),
    (
        "who gives up calls nobody",
        QUEUE,
        "if had_the_line.is_some() || waited.is_some() {",
        "if had_the_line.is_some() {",
    ),
    (
        "who steps aside calls nobody",
        QUEUE,
        "        self.queue.call_next(state);\n        let back",
        "        drop(state);\n        let back",
    ),
    ("who steps aside is not back", QUEUE, "state.order.step_aside(ticket, Waiter::Thread(thread));", "drop(thread);"),
    ("a stop is not counted", CALL, "            bus.halts.count(unit);\n", "            let _ = unit;\n"),
    ("a start that was decided on before a stop is sent", CALL, " && self.halted().is_none()", ""),
    ("a stop is not let pass", QUEUE, "self.ticket.is_stop() || !state.order.has_stop()", "true"),
    (
        "two take the line",
        QUEUE,
        "if self.owner.is_none() {\n            let waiter = self.order.take",
        "{\n            let waiter = self.order.take",
    ),
    ("one of the crew is not woken", WORK, "self.called.notify_one();", ""),
    ("a crew that is dismissed is not woken", WORK, "self.called.notify_all();", ""),
    (
        "work is left, and nobody called",
        WORK,
        "        self.call_next(state);\n        Ok(ticket)",
        "        drop(state);\n        Ok(ticket)",
    ),
    (
        "work is taken back, and nobody called",
        WORK,
        "        self.call_next(state);\n        waiter.and_then",
        "        drop(state);\n        waiter.and_then",
    ),
    ("one of the crew leaves, and calls nobody", WORK, "self.0.call_next(state);", "drop(state);"),
    (
        "no thread is given, and no caller called",
        WORK,
        "                thread.unpark();\n",
        "                let _ = thread;\n",
    ),
    ("no thread is given, and nobody told", WORK, "if state.crew.is_empty() {", "if false {"),
    (
        "who comes is on the way for ever",
        CREW,
        "    pub(crate) fn has_come(&mut self) {\n        self.called = false;",
        "    pub(crate) fn has_come(&mut self) {",
    ),
    ("who is woken still counts as idle", CREW, "            self.idle -= 1;\n", ""),
    (
        "an errand ends, and nobody is told",
        ERRAND,
        "        if self.then.is_some() {\n            self.failed",
        "        if false {\n            self.failed",
    ),
    ("who is in is not ended", HOST, "let _ = stream.shutdown(Shutdown::Read);", "let _ = stream;"),
    (
        "an opening falls between",
        HOST,
        WATCHES,
        WATCHES.replace("        let mut inside = self.guests.lock();\n", "").replace("inside.", "self.guests.lock()."),
    ),
]


def copy(to: Path) -> None:
    """What the search is built from."""
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy(ROOT / name, to / name)
    for name in ("crates", "tests/rust", "tests/soak", "tests/model", "tests/schedules", "benches/rust", "fuzz"):
        shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns("target", "profiles", "corpus"))


def search(place: Path) -> subprocess.CompletedProcess[str]:
    """Searches in the copy."""
    command = ["cargo", "test", "--locked", "--quiet", "-p", "drivebus-schedules"]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target/schedules"), "DRIVEBUS_SCHEDULES": "500"}
    return subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False, timeout=600)


def main() -> int:
    """The command."""
    unnoticed = 0
    with tempfile.TemporaryDirectory(prefix="drivebus-schedules-") as folder:
        place = Path(folder)
        copy(place)
        whole = search(place)
        if whole.returncode != 0:
            print(whole.stdout, whole.stderr, file=sys.stderr)
            return 1
        for what, name, old, new in BREAKS:
            path = place / name
            text = path.read_text(encoding="utf-8")
            if text.count(old) != 1:
                raise SystemExit(f"check_schedules: {name} does not hold this once: {old!r}")
            path.write_text(text.replace(old, new), encoding="utf-8")
            done = search(place)
            path.write_text(text, encoding="utf-8")
            failed = {line.split()[0] for line in done.stdout.splitlines() if re.fullmatch(r"    \w+", line)}
            noticed = done.returncode != 0 and "test result: FAILED" in done.stdout
            print(f"{'noticed' if noticed else 'UNNOTICED'}: {what} ({', '.join(sorted(failed))})", flush=True)
            if "error: could not compile" in done.stderr:
                raise SystemExit(done.stderr)
            unnoticed += not noticed
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main())
