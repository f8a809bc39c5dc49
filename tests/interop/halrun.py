"""LinuxCNC's HAL without its screens: `halrun` with what a test loads, and `halcmd` beside it.

HAL's memory is one for the whole machine, so one test at a time has it, whoever runs tests here.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

DEADLINE = 30.0
"""Seconds after which a wait has failed. No test that goes well waits for it."""


class Linuxcnc:
    """Where LinuxCNC is, and a Python that its module is made for.

    Args:
        root: What holds its `usr`: the system itself, or the folder that its package was unpacked into.
    """

    def __init__(self, root: Path) -> None:
        self.module = root / "usr/lib/python3/dist-packages"
        # `_hal.cpython-311-…`: an extension for one version of Python, where drivebus is one for all.
        made_for = next(iter(self.module.glob("_hal.cpython-*.so"))).name.split("-")[1]
        ours = sys.implementation.cache_tag.removeprefix("cpython-") == made_for
        self.python = sys.executable if ours else shutil.which(f"python{made_for[0]}.{made_for[1:]}")
        libraries = [str(root / "usr/lib"), *map(str, root.parent.glob("usr/lib/*-linux-gnu"))]
        self.env = {
            **os.environ,
            "PATH": os.pathsep.join([str(root / "usr/bin"), os.environ.get("PATH", "")]),
            "LD_LIBRARY_PATH": os.pathsep.join([*libraries, os.environ.get("LD_LIBRARY_PATH", "")]),
        }
        if not ours:
            self.env["PYTHONPATH"] = os.pathsep.join([sysconfig.get_path("purelib"), sysconfig.get_path("platlib")])

    def command(self, *words: str) -> str:
        """The line of `drivebus` with *words* for a HAL file."""
        return " ".join([str(self.python), "-m", "drivebus", *words, "--hal-path", str(self.module)])


class Session:
    """One `halrun`, at whose prompt nobody types."""

    def __init__(self, linuxcnc: Linuxcnc, folder: Path) -> None:
        self._linuxcnc = linuxcnc
        self._loaded: set[str] = {"drivebus", "other"}
        self.log = folder / "halrun.log"
        self._output = self.log.open("w")
        self._halrun = subprocess.Popen(
            ["halrun"],
            env=linuxcnc.env,
            stdin=subprocess.PIPE,
            stdout=self._output,
            stderr=self._output,
            text=True,
            start_new_session=True,
        )

    def load(self, name: str, *words: str) -> int:
        """Loads `drivebus … hal …`, waits until it is ready, and returns its process."""
        self._load_program(name, self._linuxcnc.command(*words, "--name", name))
        return self.process(name)

    def has(self, program: str) -> bool:
        """Whether this LinuxCNC has *program*."""
        return shutil.which(program, path=self._linuxcnc.env["PATH"]) is not None

    def load_other(self, name: str, line: str) -> None:
        """Loads somebody else's program by its *line*, and waits until it is ready."""
        self._loaded.add(name)
        self._load_program(name, line)

    def _load_program(self, name: str, line: str) -> None:
        """Loads a program by its *line*, and waits until it is ready.

        While another halcmd ends, the prompt's own child may not get at HAL's memory.
        It says so, and has begun nothing: then the line is typed once more.
        """
        typed = 0

        def is_ready() -> bool:
            nonlocal typed
            lost = self.log.read_text().count("hal_init() failed after fork") - before
            while typed <= lost:
                typed += 1
                self.type(f"loadusr -Wn {name} {line}")
            return bool(self.process(name)) and "ready" in self._row(name)

        before = self.log.read_text().count("hal_init() failed after fork")
        self.until(is_ready)

    def unload(self, name: str) -> None:
        """Ends a program, and waits until it has gone."""
        self.halcmd("unloadusr", name)
        self.until(lambda: not self.process(name))

    def setp(self, name: str, pin: str, value: float) -> None:
        """Sets a pin of the program of that *name*."""
        self.halcmd("setp", f"{name}.{pin}", str(value))

    def type(self, line: str) -> None:
        """Types a line at the prompt."""
        assert self._halrun.stdin is not None
        self._halrun.stdin.write(f"{line}\n")
        self._halrun.stdin.flush()

    def halcmd(self, *words: str) -> str:
        """What a halcmd of its own answers."""
        done = subprocess.run(["halcmd", *words], env=self._linuxcnc.env, capture_output=True, text=True, timeout=30)
        return done.stdout.strip()

    def set(self, **pins: float) -> None:
        """Sets pins of `drivebus`, in this order."""
        for name, value in pins.items():
            self.halcmd("setp", f"drivebus.{name.replace('_', '-')}", str(value))

    def shows(self, **pins: float) -> Callable[[], bool]:
        """Whether pins of `drivebus` have these values."""

        def shown() -> bool:
            rows = (line.split() for line in self.halcmd("-s", "show", "pin", "drivebus.").splitlines())
            told = {row[4].removeprefix("drivebus."): _value(row[3]) for row in rows if len(row) >= 5}
            return all(told.get(name.replace("_", "-")) == value for name, value in pins.items())

        return shown

    def until(self, reached: Callable[[], object]) -> None:
        """Waits until it is so."""
        wait_until(reached, lambda: f"{self.halcmd('show', 'pin')}\n{self.log.read_text()}")

    def process(self, name: str) -> int:
        """The process behind a component; 0 where none of that name is loaded."""
        row = self._row(name).split()
        return int(row[3]) if len(row) > 3 else 0

    def _row(self, name: str) -> str:
        rows = self.halcmd("-s", "show", "comp", name).splitlines()
        return next((row for row in rows if name in row.split()), "")

    def processes(self) -> list[int]:
        """Those of HAL itself: `halrun` and the prompt that it runs."""
        children = Path(f"/proc/{self._halrun.pid}/task/{self._halrun.pid}/children").read_text().split()
        return [self._halrun.pid, *map(int, children)]

    def is_up(self) -> bool:
        """Whether the prompt is there."""
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # one of them has ended meanwhile
            return any(Path(f"/proc/{each}/comm").read_text() == "halcmd\n" for each in self.processes()[1:])
        return False

    def end(self) -> None:
        """Ends the prompt, as `exit` does: `halrun` unloads what is there."""
        assert self._halrun.stdin is not None
        with suppress(BrokenPipeError):
            self._halrun.stdin.close()
        self._halrun.wait(DEADLINE)

    def close(self) -> None:
        """Leaves nothing behind, whatever became of the test."""
        for name in self._loaded:
            if process := self.process(name):
                with suppress(ProcessLookupError):  # HAL shows a program for a moment after its end
                    os.kill(process, 9)
        self.end()
        subprocess.run(["halrun", "-U"], env=self._linuxcnc.env, capture_output=True, timeout=30)
        self._output.close()


def _value(told: str) -> float:
    """The value of a pin as halcmd prints it: TRUE, 0x0000000B, 20.5."""
    if told in ("TRUE", "FALSE"):
        return told == "TRUE"
    return int(told, 16) if told.startswith("0x") else float(told)


def wait_until(reached: Callable[[], object], told: Callable[[], object]) -> None:
    """Waits until it is *reached*; what is *told* says why it was not."""
    deadline = time.monotonic() + DEADLINE
    while not reached():
        assert time.monotonic() < deadline, told()
        threading.Event().wait(0.005)


def is_running(process: int) -> bool:
    """Whether *process* is still at work: a zombie is not."""
    try:
        told = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return told.rpartition(")")[2].split()[0] != "Z"


@contextmanager
def hal_for_us() -> Iterator[None]:
    """A block in which no other test here has HAL."""
    with (Path(tempfile.gettempdir()) / "drivebus-tests-of-hal.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
