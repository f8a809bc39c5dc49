"""Samples of a spool in PostgreSQL, each exactly once, through every end of the server, the network or this program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drivebus.errors import NotAllowed
from drivebus.sinks.delivery import Delivery
from drivebus.spool import Spool

if TYPE_CHECKING:
    from drivebus.sinks.postgres_session import Session

__all__ = ["Postgres", "PostgresSettings"]


@dataclass(frozen=True)
class PostgresSettings:
    """Where samples go.

    Attributes:
        conninfo: Where the server is, as libpq reads it: `host=… dbname=… user=…` or a URI, without a password. The
            certificate of another computer is verified unless this says otherwise.
        gateway: Whose samples these are: no other that delivers into the same tables has this name.
        schema: Where the tables are; it is made where it is missing.
        password_file: A file with the password, which others may not read. Without one, libpq has its own means, such
            as PGPASSFILE.
    """

    conninfo: str
    gateway: str
    schema: str = "drivebus"
    password_file: Path | None = None


class Postgres:
    """Delivers what is in a spool to a PostgreSQL database.

    Whatever goes wrong there is told once and tried again, for ever.

    Args:
        spool: What is delivered.
        settings: Where to.
        tell: Hears in words what people should know.

    Raises:
        NotAllowed: The settings cannot be, or psycopg is not installed. Nothing was connected.
    """

    def __init__(self, spool: Spool, settings: PostgresSettings, tell: Callable[[str], None]) -> None:
        self._delivery = Delivery(spool, "postgres", _session(settings), tell)

    @staticmethod
    def check(settings: PostgresSettings) -> None:
        """Whether *settings* can be. Nothing is connected.

        Raises:
            NotAllowed: They cannot, or psycopg is not installed.
        """
        _session(settings)

    def start(self) -> None:
        """Begins to deliver, in a thread of its own."""
        self._delivery.start()

    def close(self) -> None:
        """Ends within a second; what is not in stays in the spool. Closing again does nothing."""
        self._delivery.close()

    def status(self) -> dict[str, Any]:
        """How it does: `connected`, `why` it is not, `behind`: samples not in yet, and `delivered` since it began."""
        return self._delivery.status()

    def __enter__(self) -> Postgres:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _session(settings: PostgresSettings) -> Session:
    try:
        from drivebus.sinks.postgres_session import Session
    except ImportError as error:
        raise NotAllowed(f"PostgreSQL needs {error.name or 'libpq'}: pip install 'drivebus[postgres]'") from None
    return Session(settings.conninfo, settings.gateway, settings.schema, settings.password_file)
