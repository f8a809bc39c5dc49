"""Where people find the page of a site, and who may log in there, as `drivebus serve` does it.

    [web]
    address = "127.0.0.1:8080"
    dead_man = 10

    [[people]]
    name = "maria"
    password = "scrypt$32768$8$1$…"
    role = "command"

Here it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from drivebus.site.reading import Reading, Wrong, address, dead_man_of, listed, one_of, text

__all__ = ["SitePerson", "SiteWeb", "people_of", "web_of"]

_DEAD_MAN = (3.0, 3600.0)
"""Seconds. Pages give a sign of life each second."""
_NAME = 64
"""Characters of a name."""
_KEYS = ("address", "certificate", "key", "hosts", "dead_man")


@dataclass(frozen=True)
class SiteWeb:
    """Where people find the page.

    Attributes:
        address: `host:port`.
        certificate: A file with the certificate and those that it rests on; None: without TLS.
        key: The file with its key.
        hosts: The names that the page is asked for by; none: those of the address and of this computer.
        dead_man: Seconds without an open page after which what somebody set in motion is halted, `"off"`, or None where
            it is not said.
        lines: In which line of the file each key stands, and the table itself by an empty name.
    """

    address: str
    certificate: Path | None = None
    key: Path | None = None
    hosts: tuple[str, ...] = ()
    dead_man: float | Literal["off"] | None = None
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SitePerson:
    """Who may log in.

    Attributes:
        name: What one types.
        password: The hash of the password, as `drivebus serve --password` prints it.
        role: `"look"`, or `"command"` who may order, too.
    """

    name: str
    password: str = field(repr=False)
    role: Literal["look", "command"] = "look"


def web_of(file: Reading) -> SiteWeb | None:
    """What *file* says of the page; what is wrong in it is complained of."""
    where = ("web",)
    table = file.section("web", _KEYS)
    if table is None:
        return None
    given = file.value(where, table, "address", address, needed=True)
    certificate = file.value(where, table, "certificate", text)
    key = file.value(where, table, "key", text)
    hosts = file.value(where, table, "hosts", listed(text, '["plant.example"]'))
    dead_man = file.value(where, table, "dead_man", dead_man_of(*_DEAD_MAN))
    if given is None:
        return None
    folder, at = file.path.parent, {name: file.line_of((*where, name)) for name in table} | {"": file.line_of(where)}
    chain, secret = (None if each is None else folder / each for each in (certificate, key))
    return SiteWeb(given, chain, secret, tuple(hosts or ()), dead_man, at)


def people_of(file: Reading) -> tuple[SitePerson, ...]:
    """Who may log in, as *file* says it; what is wrong in it is complained of."""
    found: dict[str, SitePerson] = {}
    for where, table in file.tables(file.data, ("people",)):
        file.check_keys(table, ("name", "password", "role"), where)
        name = file.value(where, table, "name", _name, needed=True)
        password = file.value(where, table, "password", _hash, needed=True, is_secret=True)
        role: Literal["look", "command"] = file.value(where, table, "role", one_of("look", "command"), needed=True)
        if name in found:
            file.complain((*where, "name"), f'there is another "{name}"')
        if name and password and role:
            found[name] = SitePerson(name, password, role)
    return tuple(found.values())


def _name(value: Any) -> str:
    name = text(value)
    if not name.isprintable() or len(name) > _NAME:
        raise Wrong(f"not a name of up to {_NAME} letters")
    return name


def _hash(value: Any) -> str:
    # Not for who has no page: a stop waits for all that is loaded.
    from drivebus.web.passwords import is_hash

    if not isinstance(value, str) or not is_hash(value):
        raise Wrong("not what drivebus serve --password prints; a password itself does not belong in a file")
    return value
