"""Samples that are delivered, and what has to be true then; and a program that delivers, to be killed.

Each line that the program reads begins a new one, in a fork of this.
`python -m tests.python.delivering CONNINFO SCHEMA SPOOL` answers each line with the number of a process, then with a
line for each commit of it, and with `ended` when it was killed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from importlib import import_module
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

from drivebus.sinks import Postgres, PostgresSettings, delivery
from drivebus.spool import Layout, Reader, Spool

from .postgres_server import Server, Way, until

__all__ = [
    "LAYOUT",
    "SIZE",
    "Rows",
    "cut_afterwards",
    "delivered",
    "delivering",
    "equal",
    "feed",
    "held",
    "is_in",
    "quiet",
    "quoted",
]

Rows = dict[tuple[str, int], tuple[Any, ...]]

LAYOUT = Layout("pump", "gd350", ("output_current", "set speed", "0x3000"), ("A", "rpm", ""), (1, 0, 0))
SIZE = 1 << 30
_AT_ONCE = 25


def quiet(_: str) -> None:
    """Hears what is told, and keeps it to itself."""


def feed(spool: Spool, samples: int, layout: Layout = LAYOUT) -> None:
    """Adds samples that differ, one of ten missing, and commits them."""
    for number in range(spool.last, spool.last + samples):
        values = [number / 10 + place for place in range(len(layout.names))]
        spool.add(layout, 1.7e9 + number / 4, 0.125, "" if number % 10 else "no answer", values if number % 10 else ())
    spool.commit()


def held(reader: Reader) -> Rows:
    """All that the spool has."""
    return {
        (each.epoch, each.seq): (
            each.time,
            each.took,
            each.layout.drive,
            each.missing or None,
            *(each.values or (None,) * len(each.layout.names)),
        )
        for each in reader.after(0, 1 << 40)
    }


def quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def delivered(postgres: Server, schema: str, layout: Layout = LAYOUT, table: str = "gd350") -> Rows:
    """All that a table has, by the columns of *layout*."""
    columns = ", ".join(map(quoted, layout.names))
    found = postgres.ask(
        "SELECT epoch, seq, extract(epoch FROM time)::double precision, took, drive, missing,"
        f" {columns} FROM {quoted(schema)}.{quoted(table)}"
    )
    rows: Rows = {(epoch, seq): tuple(rest) for epoch, seq, *rest in found}
    assert len(rows) == len(found)
    return rows


@contextmanager
def delivering(spool: Spool, to: Server | Way, schema: str, tell: Callable[[str], None] = quiet) -> Iterator[Postgres]:
    """Delivers; at the end all that the spool has is in."""
    with Postgres(spool, PostgresSettings(to.conninfo, "gateway 1", schema), tell) as sink:
        yield sink
        until(lambda: is_in(sink))


def is_in(sink: Postgres) -> bool:
    status = sink.status()
    return bool(status["connected"] and not status["behind"])


def equal(spool: Spool, postgres: Server, schema: str) -> None:
    """What was delivered is what the spool has, and the numbers that are in say so."""
    with closing(spool.reader("test")) as reader:
        assert delivered(postgres, schema) == held(reader)
    reached = postgres.ask(f"SELECT gateway, first, last FROM {quoted(schema)}.reached")
    assert reached == [("gateway 1", 1, spool.last)]


@contextmanager
def cut_afterwards(path: Path, chance: Random) -> Iterator[None]:
    """The spool at *path* is closed in this block; then it is as it was before, but for the end of one of its files."""
    kept = {each: each.read_bytes() for each in (path, path.with_name(f"{path.name}-wal"))}
    yield
    cut = chance.choice(list(kept))
    kept[cut] = kept[cut][: chance.randrange(len(kept[cut]) + 1)]
    for each, data in kept.items():
        each.write_bytes(data)


def _deliver(conninfo: str, schema: str, path: Path) -> None:
    delivery._FIRST_PAUSE = 0.01
    with Spool(path, SIZE, quiet) as spool, Postgres(spool, PostgresSettings(conninfo, "killed", schema), quiet):
        for _ in count():
            feed(spool, _AT_ONCE)
            _say("committed")


def _say(line: str) -> None:
    """In one write: a kill leaves all of the line or nothing of it, however Python was told to buffer."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Forks for each line."""
    # Before it forks, so that those who are killed begin at once.
    import_module("drivebus.sinks.postgres_session")
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            try:
                _say(str(os.getpid()))
                _deliver(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
            finally:
                os._exit(1)
        os.waitpid(child, 0)
        _say("ended")


if __name__ == "__main__":
    main()
