"""A library's process seen from the judge: each order has a bound, and a process that passes it is ended."""

from __future__ import annotations

import json
import select
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
START = 30.0  # seconds for an interpreter and its imports
BOUND = 5.0  # seconds for a call


class Missing(Exception):
    """The library cannot be imported here."""


@dataclass(frozen=True)
class Outcome:
    """How one call ended: it returned, it raised, or it did neither within the bound."""

    seconds: float
    result: Any = None
    error: str | None = None
    text: str = ""
    hung: bool = False

    @property
    def returned(self) -> bool:
        return self.error is None and not self.hung


class Child:
    """One library in a process of its own. `bound` is what a call may take at most, in seconds."""

    def __init__(self, library: str, bound: float = BOUND) -> None:
        self.bound = bound
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.conformance.worker", library],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
        )
        self._rest = b""
        about = self._line(START)
        if about is None or "missing" in about:
            self.end()
            raise Missing("did not start" if about is None else about["missing"])
        self.about: dict[str, str] = about

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        self._process.kill()
        self._process.communicate()

    def _line(self, bound: float) -> dict[str, Any] | None:
        assert self._process.stdout is not None
        deadline = time.monotonic() + bound
        while b"\n" not in self._rest:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._process.stdout], [], [], left)[0]:
                return None
            came = self._process.stdout.read(65536)
            if not came:
                return None
            self._rest += came
        line, _, self._rest = self._rest.partition(b"\n")
        told: dict[str, Any] = json.loads(line)
        return told

    def order(self, do: str, using: object = (), bound: float | None = None) -> Outcome:
        """Has the library do something, and says how that ended. A process that hung is ended and answers no more."""
        assert self._process.stdin is not None
        bound = self.bound if bound is None else bound
        if self._process.poll() is not None:
            return Outcome(0.0, error="process ended")
        self._process.stdin.write(json.dumps({"do": do, "with": using}).encode() + b"\n")
        told = self._line(bound)
        if told is None:
            gone = self._process.poll() is not None
            self.end()
            return Outcome(bound, error="process ended") if gone else Outcome(bound, hung=True)
        return Outcome(told["seconds"], told.get("result"), told.get("error"), told.get("text", ""))

    def open(
        self, port: Path | str, *, baudrate: int = 19200, timeout: float = 0.2, retries: int | None = 0
    ) -> Outcome:
        """Opens *port*, in three tries: some libraries bound this by the time-out too, and a busy machine is slow."""
        using = {"port": str(port), "baudrate": baudrate, "timeout": timeout, "retries": retries}
        for _ in range(2):
            if (outcome := self.order("open", using)).error is None:
                return outcome
        return self.order("open", using)

    def read(self, address: int, count: int = 1) -> Outcome:
        return self.order("read", [address, count])

    def write(self, address: int, value: int) -> Outcome:
        return self.order("write", [address, value])
