"""Where a site sends what its drives say, as `drivebus serve` does it.

    [prometheus]
    address = "127.0.0.1:9464"

    [postgres]
    conninfo = "host=db.plant.example dbname=plant user=drivebus"
    password_file = "/etc/drivebus/postgres"
    gateway = "hall-1"

Here it is read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivebus.site.reading import Reading, address, text

__all__ = ["SitePostgres", "SitePrometheus", "postgres_of", "prometheus_of"]


@dataclass(frozen=True)
class SitePrometheus:
    """Where Prometheus finds how the plant is.

    Attributes:
        address: `host:port`.
        at: In which line of the file its table begins.
    """

    address: str
    at: int = 1


def prometheus_of(file: Reading) -> SitePrometheus | None:
    """What *file* says of Prometheus; what is wrong in it is complained of."""
    where = ("prometheus",)
    table = file.section("prometheus", ("address",))
    if table is None:
        return None
    given = file.value(where, table, "address", address, needed=True)
    return None if given is None else SitePrometheus(given, file.line_of(where))


@dataclass(frozen=True)
class SitePostgres:
    """Where samples go.

    Attributes:
        conninfo: Where the server is, as libpq reads it, without a password.
        gateway: Whose samples these are.
        schema: Where the tables are.
        password_file: A file with the password; None: libpq has its own means.
        at: In which line of the file its table begins.
    """

    conninfo: str
    gateway: str
    schema: str = "drivebus"
    password_file: Path | None = None
    at: int = 1


def postgres_of(file: Reading) -> SitePostgres | None:
    """What *file* says of PostgreSQL; what is wrong in it is complained of."""
    where = ("postgres",)
    table = file.section("postgres", ("conninfo", "gateway", "schema", "password_file"))
    if table is None:
        return None
    conninfo = file.value(where, table, "conninfo", text, needed=True)
    gateway = file.value(where, table, "gateway", text, needed=True)
    schema = file.value(where, table, "schema", text) or "drivebus"
    password = file.value(where, table, "password_file", text)
    if "spool" not in file.data:
        file.complain(where, "samples wait in a spool until the database has them: say [spool]")
    if conninfo is None or gateway is None:
        return None
    kept = None if password is None else file.path.parent / password
    return SitePostgres(conninfo, gateway, schema, kept, file.line_of(where))
