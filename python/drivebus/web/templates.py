"""The pages as text, made of their templates, and the files that they need. Nothing is read later on."""

from __future__ import annotations

import hashlib
import time
from importlib import resources
from typing import Any, NamedTuple

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from drivebus.web.view import ago, plain

__all__ = ["File", "Pages"]

_KINDS = {".css": "text/css; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".svg": "image/svg+xml"}


class File(NamedTuple):
    """One file: its bytes, their kind, and a mark that changes with them."""

    data: bytes
    kind: str
    mark: str


class Pages:
    """All pages and files."""

    def __init__(self) -> None:
        here = resources.files("drivebus.web")
        found = {each.name: each.read_text("utf-8") for each in (here / "pages").iterdir() if each.name[-5:] == ".html"}
        # What comes from drives and people is text, and never markup.
        self._made = Environment(
            loader=DictLoader(found), autoescape=True, undefined=StrictUndefined, finalize=_without_controls
        )
        self._made.globals["ago"] = ago
        self._made.filters["clock"] = _clock
        self._made.filters["iso"] = _iso
        self.files = {each.name: _file(each.name, each.read_bytes()) for each in (here / "static").iterdir()}

    def page(self, template: str, **told: Any) -> str:
        """The page made of *template*, in which *told* stands."""
        return self._made.get_template(f"{template}.html").render(told)


def _without_controls(value: Any) -> Any:
    return plain(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _file(name: str, data: bytes) -> File:
    kind = _KINDS.get(f".{name.rpartition('.')[2]}", "text/plain; charset=utf-8")
    return File(data, kind, f'"{hashlib.sha256(data).hexdigest()[:16]}"')


def _clock(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))


def _iso(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))
