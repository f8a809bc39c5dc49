"""The way to a PostgreSQL server: certificates are verified, dead connections noticed, passwords kept secret."""

from __future__ import annotations

import os
from pathlib import Path

from psycopg import ProgrammingError
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from drivebus.errors import BadArgument
from drivebus.sinks.password_file import password_in
from drivebus.sinks.this_computer import is_loopback

__all__ = ["connection_string"]

_SECRETS = ("password", "sslpassword", "oauth_client_secret")
_UNLESS_GIVEN = {
    "connect_timeout": "10",
    # A server that is gone without a word is noticed within half a minute.
    "keepalives_idle": "10",
    "keepalives_interval": "5",
    "keepalives_count": "3",
    "tcp_user_timeout": "25000",
}


def connection_string(given: str, application: str, password_file: Path | None) -> str:
    """What libpq is given: *given*, and what it does not say itself.

    Raises:
        NotAllowed: It has a password in it, cannot be read, or the password's file is not its owner's alone. No
            message repeats any of it.
    """
    try:
        told = {name: str(value) for name, value in conninfo_to_dict(given).items() if value is not None}
    except ProgrammingError:
        # What libpq says of it repeats a part, which may be a password.
        raise BadArgument(
            "the connection string cannot be read: it is neither settings and their values nor a URI"
        ) from None
    if any(secret in told for secret in _SECRETS):
        raise BadArgument("a password does not belong into a connection string: put it into a file of its own")
    if password_file is not None:
        told["password"] = password_in(password_file)
    settings = {**_UNLESS_GIVEN, "application_name": application, **told, "client_encoding": "UTF8"}
    if "sslmode" not in told and not os.environ.get("PGSSLMODE") and not _is_local(told):
        settings["sslmode"] = "verify-full"
    return make_conninfo("", **settings)


def _is_local(told: dict[str, str]) -> bool:
    """Whether all hosts are this computer. Of a service, whose hosts libpq reads from a file, nobody knows."""
    if "service" in told or os.environ.get("PGSERVICE"):
        return False
    hosts = told.get("hostaddr") or os.environ.get("PGHOSTADDR") or told.get("host") or os.environ.get("PGHOST") or ""
    return all(_is_this_computer(host) for host in hosts.split(","))


def _is_this_computer(host: str) -> bool:
    # Unix sockets are named by their folder or with an @; no name is such a socket, or localhost.
    return host == "" or host[0] in "/@" or Path(host).is_absolute() or is_loopback(host)
