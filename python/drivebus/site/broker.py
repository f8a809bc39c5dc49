"""Where a broker of MQTT is, and who this is for it: the keys of each section that needs one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivebus.site.reading import Reading, Wrong, flag, text, whole

__all__ = ["BROKER_KEYS", "SiteBroker", "broker_of", "that"]

BROKER_KEYS = ("host", "port", "username", "password_file", "ca_file", "tls")
_PLAIN, _ENCRYPTED = 1883, 8883


@dataclass(frozen=True)
class SiteBroker:
    """A broker.

    Attributes:
        host: Its computer.
        port: Where it listens there.
        tls: Whether the way there is encrypted.
        username: Who this is for it; empty: nobody.
        password_file: A file with the password.
        ca_file: The certificates that are trusted; None: those of the system.
    """

    host: str
    port: int
    tls: bool = True
    username: str = ""
    password_file: Path | None = None
    ca_file: Path | None = None


def broker_of(file: Reading, table: dict[str, Any], section: str) -> SiteBroker | None:
    """What the *table* of *section* says of its broker; what is wrong in it is complained of."""
    # Not for who has no such table: a stop waits for all that is loaded.
    from drivebus.sinks.this_computer import is_loopback

    where = (section,)
    host = file.value(where, table, "host", text, needed=True)
    tls = file.value(where, table, "tls", flag)
    if tls is None:
        tls = host is None or not is_loopback(host)
    port = file.value(where, table, "port", whole(1, 0xFFFF)) or (_ENCRYPTED if tls else _PLAIN)
    username = file.value(where, table, "username", text) or ""
    password, ca = (_file(file, table, section, key) for key in ("password_file", "ca_file"))
    if password is not None and not username:
        file.complain((*where, "password_file"), "a password is one of somebody: say username")
    if ca is not None and not tls:
        file.complain((*where, "ca_file"), "certificates are for a way that is encrypted: say tls = true")
    if "spool" not in file.data:
        file.complain(where, "samples wait in a spool until the broker has them: say [spool]")
    return None if host is None else SiteBroker(host, port, tls, username, password, ca)


def that(why_not: Callable[[str], str]) -> Callable[[Any], str]:
    """A text, if there is nothing that *why_not* says against it."""

    def read(value: Any) -> str:
        if why := why_not(text(value)):
            raise Wrong(why)
        return text(value)

    return read


def _file(file: Reading, table: dict[str, Any], section: str, key: str) -> Path | None:
    given = file.value((section,), table, key, text)
    return None if given is None else file.path.parent / given
