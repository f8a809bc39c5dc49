"""Who asks: each request but for the log-in, and the files that it needs, is somebody's who is logged in."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, NamedTuple

from starlette.responses import PlainTextResponse, RedirectResponse, Response

from drivebus.web.guard import App, Message
from drivebus.web.sessions import Session, Sessions
from drivebus.web.shown import Person

__all__ = ["Cookie", "Signed", "Who"]

_OPEN = "/login"
_FILES = "/static/"


class Who(NamedTuple):
    """Somebody who asks: the person, the session and the token that proves it."""

    person: Person
    session: Session
    token: str


class Cookie:
    """The cookie that keeps the token, in a browser that shows it to no script and to no other site.

    Args:
        is_secure: Whether the page is served over TLS. Without that, a browser takes no name with a prefix.
        port: Where it is served: a browser keeps the cookies of all ports of a computer together.
    """

    def __init__(self, is_secure: bool, port: int) -> None:
        self._is_secure = is_secure
        self._name = "__Host-drivebus" if is_secure else f"drivebus-{port}"

    def of(self, scope: Message) -> str:
        """The token that a request brings; empty where it brings none."""
        for name, value in scope["headers"]:
            if name == b"cookie":
                try:
                    found = SimpleCookie(value.decode("latin-1")).get(self._name)
                except CookieError:
                    return ""
                if found is not None:
                    return found.value
        return ""

    def give(self, answer: Response, token: str) -> Response:
        """*answer* with the token."""
        answer.set_cookie(self._name, token, httponly=True, secure=self._is_secure, samesite="strict", path="/")
        return answer

    def take(self, answer: Response) -> Response:
        """*answer* that has the browser forget it."""
        answer.delete_cookie(self._name, httponly=True, secure=self._is_secure, samesite="strict", path="/")
        return answer


class Signed:
    """Stands before *app*, and tells it in `scope["who"]` who asks; None at the log-in, where nobody has to be.

    Args:
        app: What answers.
        sessions: Who is logged in.
        cookie: Where the token is.
        people: Who may be, by name.
        clock: A clock in seconds that only goes forward.
    """

    def __init__(
        self,
        app: App,
        sessions: Sessions,
        cookie: Cookie,
        people: Mapping[str, Person],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._sessions = sessions
        self._cookie = cookie
        self._people = people
        self._clock = clock

    async def __call__(self, scope: Message, receive: Callable[[], Any], send: Callable[[Message], Any]) -> None:
        """One request."""
        token = self._cookie.of(scope)
        session = self._sessions.of(token, self._clock()) if token else None
        person = None if session is None else self._people.get(session.person)
        path = scope["path"]
        scope["who"] = None if session is None or person is None else Who(person, session, token)
        if scope["who"] is not None or path == _OPEN or path.startswith(_FILES):
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        wants_page = scope["method"] in ("GET", "HEAD") and b"text/html" in headers.get(b"accept", b"")
        answer = RedirectResponse(_OPEN, 303) if wants_page else PlainTextResponse("log in first\n", 401)
        await answer(scope, receive, send)
