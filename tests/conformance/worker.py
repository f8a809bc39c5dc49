"""One library in a process of its own: orders on stdin, what became of them on stdout, a JSON object a line each.

    python -m tests.conformance.worker LIBRARY

Orders: `open`, `read`, `repeat`, `write`, `broadcast`, `threads`, `close`. An answer says `result`, or `error` with
the name and text of what was raised, and the seconds the call took.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from importlib import metadata
from typing import Any

from . import libraries


class Worker:
    """Carries out orders with one library."""

    def __init__(self, library: str) -> None:
        self._class = libraries.adapter(library)
        self._master: libraries.Adapter | None = None

    def about(self) -> dict[str, str]:
        version = metadata.version(self._class.distribution)
        return {"distribution": self._class.distribution, "version": version, "settings": self._class.settings}

    def call(self, order: dict[str, Any]) -> Callable[[], object]:
        if order["do"] == "open":
            return lambda: self._open(**order["with"])
        assert self._master is not None
        return {
            "read": lambda: self._read(*order["with"]),
            "write": lambda: self._write(*order["with"]),
            "repeat": lambda: self._repeat(*order["with"]),
            "broadcast": lambda: self._broadcast(*order["with"]),
            "threads": lambda: self._threads(*order["with"]),
            "close": self._master.close,
        }[order["do"]]

    def _open(self, **settings: Any) -> None:
        self._master = self._class(**settings)

    @property
    def master(self) -> libraries.Adapter:
        assert self._master is not None
        return self._master

    def _read(self, address: int, count: int) -> list[int]:
        return list(self.master.read(address, count))

    def _repeat(self, address: int, count: int, times: int) -> None:
        for _ in range(times):
            self.master.read(address, count)

    def _write(self, address: int, value: int) -> list[int] | None:
        said = self.master.write(address, value)
        return None if said is None else list(said)

    def _broadcast(self, address: int, value: int) -> None:
        self.master.broadcast(address, value)

    def _threads(self, threads: int, reads: int) -> dict[str, int]:
        """*reads* reads in each of *threads* threads, every one of another register, which holds its own address."""
        ends: Counter[str] = Counter()

        def one(first: int) -> None:
            for address in range(first, first + reads):
                try:
                    ends["right" if list(self.master.read(address, 1)) == [address] else "wrong"] += 1
                except Exception as error:
                    ends[f"error: {name_of(error)}"] += 1

        running = [threading.Thread(target=one, args=(1000 * (number + 1),)) for number in range(threads)]
        for thread in running:
            thread.start()
        for thread in running:
            thread.join()
        return dict(ends)


def name_of(error: Exception) -> str:
    """What the error is called; with its module where it is only called `error`."""
    if isinstance(error, libraries.ErrorReturned):
        return str(error)
    kind = type(error)
    return f"{kind.__module__}.{kind.__name__}" if kind.__name__.islower() else kind.__name__


def answer(call: Callable[[], object]) -> dict[str, object]:
    """What became of one call, and how long it took."""
    began = time.perf_counter()
    try:
        told: dict[str, object] = {"result": call()}
    except Exception as error:
        told = {"error": name_of(error), "text": str(error)}
    return {**told, "seconds": time.perf_counter() - began}


def main() -> None:
    """Reads orders until stdin ends."""
    logging.disable()  # their logs go to stderr, line by line, and cost time
    replies = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # a library that prints does not disturb the answers
    try:
        worker = Worker(sys.argv[1])
    except ImportError as error:
        print(json.dumps({"missing": str(error)}), file=replies)
        return
    print(json.dumps(worker.about()), file=replies)
    for line in sys.stdin:
        order = json.loads(line)
        print(json.dumps(answer(worker.call(order))), file=replies)
        if order["do"] == "close":
            break
    with contextlib.suppress(OSError):
        replies.close()
    os._exit(0)  # a library's own threads do not keep the process


if __name__ == "__main__":
    main()
