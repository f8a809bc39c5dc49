"""A PostgreSQL server of our own, and what befalls it: it is stopped and started, and the way to it breaks."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import psycopg
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
SECRET = "secretive"
"""A user who has to say a password: `the right one`."""
NOBODY = 65534
"""The user and the group of a server that root starts: it refuses to be root's."""
FOR_TESTS = ("-c", "fsync=off", "-c", "listen_addresses=", "-c", "max_connections=40", "-c", "log_min_messages=panic")


def lacking() -> NoReturn:
    """Skips the test, or fails it where nothing may be skipped."""
    reason = "PostgreSQL is missing: run `make interop-parts`, or on Debian `apt-get install postgresql`"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


def programs() -> Path:
    """The folder of the server's programs: the system's, or the one that was unpacked."""
    for root in (Path("/"), ROOT / ".tools"):
        for folder in sorted((root / "usr/lib/postgresql").glob("*/bin"), reverse=True):
            if (folder / "initdb").exists() and (folder / "postgres").exists():
                return folder
    if found := shutil.which("initdb"):
        return Path(found).resolve().parent
    lacking()


def until(holds: Callable[[], object], seconds: float = 60.0) -> None:
    """Waits until it holds. The time only ends a test that has failed."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it never came true"
        threading.Event().wait(0.005)


class Server:
    """One server at a Unix socket, with one database."""

    def __init__(self, folder: Path, bin_folder: Path) -> None:
        self.folder = folder
        self._bin = bin_folder
        self._as: dict[str, Any] = {}
        libraries = [str(each) for each in (ROOT / ".tools/usr/lib").glob("*-linux-*")]
        path = os.pathsep.join([*libraries, os.environ.get("LD_LIBRARY_PATH", "")])
        self._as["env"] = {"PATH": os.environ["PATH"], "LD_LIBRARY_PATH": path, "LC_ALL": "C"}
        if os.geteuid() == 0:
            os.chown(folder, NOBODY, NOBODY)
            self._as |= {"user": NOBODY, "group": NOBODY, "extra_groups": []}
        self._data = folder / "data"
        command: list[str | Path] = [
            bin_folder / "initdb",
            "-D",
            self._data,
            "-U",
            "owner",
            "-A",
            "trust",
            "-E",
            "UTF8",
            "--no-sync",
        ]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder, **self._as)
        rules = self._data / "pg_hba.conf"
        rules.write_text(f"local all {SECRET} scram-sha-256\n{rules.read_text()}")
        self.conninfo = f"host={folder} user=owner dbname=postgres"
        self.start()
        self.ask(f"CREATE ROLE {SECRET} LOGIN PASSWORD 'the right one'")

    def start(self) -> None:
        """Starts it; returns when it takes connections."""
        command: list[str | Path] = [self._bin / "postgres", "-D", self._data, "-k", self.folder, *FOR_TESTS]
        self._process = subprocess.Popen(
            command, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **self._as
        )
        until(self._answers)

    def stop_at_once(self) -> None:
        """As `pg_ctl stop -m immediate` does."""
        self._process.send_signal(3)
        self._process.wait(60)

    def _answers(self) -> bool:
        with suppress(psycopg.OperationalError):
            psycopg.connect(self.conninfo).close()
            return True
        return False

    def ask(self, query: str, *arguments: object) -> list[tuple[Any, ...]]:
        """What *query* gives."""
        with psycopg.connect(self.conninfo, autocommit=True) as connection:
            cursor = connection.execute(query.encode(), arguments or None)
            return cursor.fetchall() if cursor.description else []


@contextmanager
def server() -> Iterator[Server]:
    """A server, until the tests have ended."""
    bin_folder = programs()
    # Short, and not pytest's: the socket's path has 107 bytes, and the server's user must get there.
    folder = Path(tempfile.mkdtemp(prefix="drivebus-pg-"))
    try:
        made = Server(folder, bin_folder)
        try:
            yield made
        finally:
            made.stop_at_once()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Way:
    """A way to a server that forwards, and breaks where it is told to."""

    def __init__(self, folder: Path, to: Path) -> None:
        self.conninfo = f"host={folder} user=owner dbname=postgres"
        self.cut: Callable[[], bool] | None = None
        """Asked at each commit: whether its answer is lost after the server gave it; None: nothing breaks."""
        self.is_silent = False
        """Whether it takes all and forwards nothing, from now on."""
        self.broken = 0
        """How many answers were lost."""
        self.swallowed = 0
        """Bytes that were taken, and not forwarded."""
        self._to = str(to / ".s.PGSQL.5432")
        self._listening = socket.socket(socket.AF_UNIX)
        self._listening.bind(str(folder / ".s.PGSQL.5432"))
        self._listening.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Nobody gets through any more."""
        self._listening.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listening.accept()
                threading.Thread(target=self._forward, args=(client,), daemon=True).start()

    def _forward(self, client: socket.socket) -> None:
        with client, socket.socket(socket.AF_UNIX) as there, suppress(OSError):
            there.connect(self._to)
            answers = threading.Thread(target=self._back, args=(there, client), daemon=True)
            answers.start()
            while data := client.recv(1 << 16):
                if self.is_silent:
                    self.swallowed += len(data)
                    continue
                if b"COMMIT\0" in data and self.cut is not None:
                    # Nothing of the answer gets through; whether it was given is the server's affair.
                    client.shutdown(socket.SHUT_WR)
                    is_given = self.cut()
                    there.sendall(data)
                    self.broken += 1
                    if is_given:
                        answers.join(10)
                    break
                there.sendall(data)
            # Or the other thread would wait for ever.
            there.shutdown(socket.SHUT_RDWR)

    def _back(self, there: socket.socket, client: socket.socket) -> None:
        with suppress(OSError):
            while data := there.recv(1 << 16):
                client.sendall(data)
            client.shutdown(socket.SHUT_RDWR)
