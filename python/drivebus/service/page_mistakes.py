"""What is wrong in what a site says of its page: who may reach it, and what becomes of motors when they are gone."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from importlib.util import find_spec

from drivebus.errors import NotAllowed
from drivebus.sinks.this_computer import is_loopback
from drivebus.site import Site, SiteWeb
from drivebus.web import web_context

__all__ = ["of_page"]

_LIBRARIES = ("starlette", "uvicorn", "jinja2")
_HOST = re.compile(r"[A-Za-z0-9_.-]+|[0-9A-Fa-f:.]+|\[[0-9A-Fa-f:.]+\]")
_ALL = ("0.0.0.0", "::")


def of_page(site: Site) -> Iterator[tuple[int, str]]:
    """Each mistake, with its line."""
    web = site.web
    if web is None:
        return
    at = web.lines[""]
    missing = [name for name in _LIBRARIES if find_spec(name) is None]
    if missing:
        yield at, f"this needs {', '.join(missing)}: pip install 'drivebus[web]'"
    if not site.people:
        yield at, "nobody could log in: say who may, as [[people]]"
    if web.dead_man is None and any(person.role == "command" for person in site.people):
        yield (
            at,
            "people may set motors in motion, and nothing says what becomes of one when they are gone: say dead_man, "
            'seconds after which it is halted, or "off" if it shall run on',
        )
    yield from _of_address(web)
    yield from _of_certificate(web)


def _of_address(web: SiteWeb) -> Iterator[tuple[int, str]]:
    at, host = web.lines["address"], web.address.rpartition(":")[0].strip("[]")
    if web.certificate is None and not is_loopback(host.lower()):
        yield (
            at,
            f"passwords and orders would cross the network unencrypted: say certificate and key, or an address of this "
            f"computer alone, such as 127.0.0.1:{web.address.rpartition(':')[2]}",
        )
    if host in _ALL and not web.hosts:
        yield at, "this address has no name: say in hosts by which names the page is asked for"
    for name in web.hosts:
        if not _HOST.fullmatch(name):
            yield web.lines["hosts"], f'"{name}" is not the name of a computer'


def _of_certificate(web: SiteWeb) -> Iterator[tuple[int, str]]:
    if (web.certificate is None) != (web.key is None):
        yield web.lines[""], "certificate and key belong together"
    elif web.certificate is not None and web.key is not None:
        try:
            web_context(web.certificate, web.key)
        except NotAllowed as error:
            yield web.lines["certificate"], str(error)
        else:
            if os.name == "posix" and web.key.stat().st_mode & 0o007:
                yield web.lines["key"], f"everybody on this computer can read {web.key}: chmod o= {web.key}"
