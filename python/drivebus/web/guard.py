"""What each request has to be before anything else looks at it, and what each answer says to a browser.

A page of ours is asked for by its own name (or a name of somebody else's leads here), nothing is ordered from another
page, a body is short and comes soon, and what goes wrong inside is told, and shows nothing.
"""

from __future__ import annotations

import asyncio
import traceback
from collections.abc import Awaitable, Callable, Collection, MutableMapping
from typing import Any, TypeAlias

__all__ = ["BODY", "Guard", "why_not"]

Message: TypeAlias = "MutableMapping[str, Any]"
App: TypeAlias = "Callable[[Message, Callable[[], Awaitable[Message]], Callable[[Message], Awaitable[None]]], Any]"

BODY = 4_096
"""Bytes of a body."""
_BODY_WITHIN = 10.0
"""Seconds in which it comes."""
_LONGEST_PATH, _LONGEST_HEAD = 2_000, 16_384
"""Bytes."""
_READS = ("GET", "HEAD")
_HEADERS = [
    (
        b"content-security-policy",
        b"default-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; object-src 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    # Forms of ours bring their origin with that, and links to others bring nothing.
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), geolocation=(), microphone=()"),
]


def why_not(scheme: str, method: str, headers: dict[bytes, bytes], hosts: Collection[str]) -> tuple[int, str]:
    """Why a request is not looked at, as status and words; (0, ""): it may be. *hosts* are our names."""
    host = headers.get(b"host", b"").decode("latin-1").lower()
    if name_of(host) not in hosts:
        return 421, "this page is not asked for by that name; hosts in the file says by which it is"
    if method not in (*_READS, "POST"):
        return 405, "nothing takes that"
    origin, site = headers.get(b"origin"), headers.get(b"sec-fetch-site", b"").decode("latin-1")
    is_ours = origin is not None and origin.decode("latin-1").lower() == f"{scheme}://{host}"
    if method == "POST" and not (is_ours or (origin is None and site == "same-origin")):
        return 403, "that comes from another page"
    # Whoever follows a link to us comes from elsewhere, and sees the log-in. Scripts and frames of others get nothing.
    comes_to_look = headers.get(b"sec-fetch-mode", b"navigate") == b"navigate"
    if (origin is not None and not is_ours) or (site in ("cross-site", "same-site") and not comes_to_look):
        return 403, "that comes from another page"
    return 0, ""


def name_of(host: str) -> str:
    """The name in `name:port`, or `[address]:port`; empty where it is neither."""
    if host.startswith("["):
        name, end, port = host[1:].partition("]")
        return name if end and (not port or port[1:].isdigit()) else ""
    name, _, port = host.partition(":")
    return name.rstrip(".") if not port or port.isdigit() else ""


class Guard:
    """Stands before *app*.

    Args:
        app: What answers.
        hosts: The names that the page is asked for by, in small letters.
        tell: Hears in words of what went wrong inside.
    """

    def __init__(self, app: App, hosts: Collection[str], tell: Callable[[str], None]) -> None:
        self._app = app
        self._hosts = hosts
        self._tell = tell

    async def __call__(self, scope: Message, receive: Callable[[], Any], send: Callable[[Message], Any]) -> None:
        """One request."""
        if scope["type"] != "http":
            return
        started = False

        async def answer(message: Message) -> None:
            nonlocal started
            if message["type"] == "http.response.start":
                started = True
                kept = [each for each in message.get("headers", []) if each[0].lower() != b"server"]
                names = {name.lower() for name, _ in kept}
                extra = [(b"cache-control", b"no-store")] if b"cache-control" not in names else []
                message["headers"] = [*kept, *_HEADERS, *extra]
            await send(message)

        headers = _headers(scope)
        status, why = why_not(scope["scheme"], scope["method"], headers, self._hosts)
        head = sum(len(name) + len(value) for name, value in scope["headers"])
        if len(scope["raw_path"]) > _LONGEST_PATH or head > _LONGEST_HEAD:
            status, why = 400, "that is too long"
        try:
            # Of what is refused, too: where something is left unread, the client may not see the answer.
            body = await _body(headers, receive)
        except _Unfit as error:
            status, why = status or error.status, why or str(error)
        if status:
            await _refuse(answer, status, why)
            return
        try:
            await self._app(scope, _given(body, receive), answer)
        except Exception:
            self._tell(f"web: {scope['method']} failed: {traceback.format_exc(limit=-3)}")
            if started:
                raise
            await _refuse(answer, 500, "that went wrong; the log says how")


class _Unfit(Exception):
    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


def _headers(scope: Message) -> dict[bytes, bytes]:
    """The headers; what must be there once and is there twice is nothing."""
    found: dict[bytes, bytes] = {}
    for name, value in scope["headers"]:
        found[name] = b"" if name in found and name in (b"host", b"origin", b"sec-fetch-site") else value
    return found


async def _body(headers: dict[bytes, bytes], receive: Callable[[], Any]) -> bytes:
    length = headers.get(b"content-length", b"0")
    if not length.isdigit() or int(length) > BODY:
        raise _Unfit(413, f"that is longer than {BODY} bytes")
    body = b""

    async def whole() -> bytes:
        nonlocal body
        more = True
        while more:
            message = await receive()
            if message["type"] != "http.request":
                raise _Unfit(400, "that broke off")
            body += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body) > BODY:
                raise _Unfit(413, f"that is longer than {BODY} bytes")
        return body

    try:
        return await asyncio.wait_for(whole(), _BODY_WITHIN)
    except asyncio.TimeoutError:
        raise _Unfit(408, "that came too slowly") from None


def _given(body: bytes, receive: Callable[[], Any]) -> Callable[[], Any]:
    """Gives *body* once, and then tells when the client is gone."""
    is_given = False

    async def give() -> Any:
        nonlocal is_given
        if is_given:
            return await receive()
        is_given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return give


async def _refuse(send: Callable[[Message], Any], status: int, why: str) -> None:
    body = f"{why}\n".encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        # Whatever is left of a body is not read.
        (b"connection", b"close"),
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
