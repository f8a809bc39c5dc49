"""The routes of the page, for who is logged in: what is shown, and what is ordered."""

from __future__ import annotations

import asyncio
import functools
import math
import secrets
import time
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import (
    HTMLResponse,
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route

from drivebus.sinks.order_words import HALTS, MOVES
from drivebus.spool.history import history_of
from drivebus.web.audit import tail
from drivebus.web.live import Live
from drivebus.web.log_in import LogIn
from drivebus.web.sessions import Sessions
from drivebus.web.shown import Shown, ShownDrive, Told
from drivebus.web.signed import Cookie, Who
from drivebus.web.templates import Pages
from drivebus.web.tickets import Tickets
from drivebus.web.trend import HOURS, Courses
from drivebus.web.view import happened, plain

__all__ = ["Routes"]

_STREAMS = 4
"""Streams of one session at a time. A browser has six connections to a site, and a stop needs one of them."""
_WITHIN = 2.0
"""Seconds after which an order that still waits is not sent."""
_READERS = 50
"""So many wait for a curve."""


class Routes:
    """What answers whom.

    Args:
        shown: The plant.
        sessions: Who is logged in.
        cookie: Where a browser keeps the token.
        log_in: Looks at passwords.
    """

    def __init__(self, shown: Shown, sessions: Sessions, cookie: Cookie, log_in: LogIn) -> None:
        self.live = Live(shown)
        self._shown = shown
        self._sessions = sessions
        self._cookie = cookie
        self._attempts = log_in
        self._pages = Pages()
        self._tickets = Tickets()
        spool = shown.spool
        self._courses = None if spool is None else Courses(functools.partial(history_of, spool), time.time)
        self._waiting = 0
        # A stop waits for no other order, nor for a drive that is silent, and nobody for who looks at curves.
        self._halting = ThreadPoolExecutor(8 + 4 * len(shown.drives), "page stop")
        self._ordering = ThreadPoolExecutor(8, "page order")
        self._reading = ThreadPoolExecutor(1, "page trend")
        self.app = Starlette(
            routes=[
                Route("/login", self._log_in_page, methods=["GET"]),
                Route("/login", self._log_in, methods=["POST"]),
                Route("/logout", self._log_out, methods=["POST"]),
                Route("/static/{name}", self._file, methods=["GET"]),
                Route("/", self._overview, methods=["GET"]),
                Route("/drive/{name}", self._drive, methods=["GET"]),
                Route("/events", self._events, methods=["GET"]),
                Route("/live", self._live, methods=["GET"]),
                Route("/trend/{name}", self._trend, methods=["GET"]),
                Route("/order", self._order, methods=["POST"]),
                Route("/here", self._here, methods=["POST"]),
            ]
        )

    def close(self) -> None:
        """Takes no more orders; those that were taken are carried out."""
        for pool in (self._halting, self._ordering, self._reading):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _log_in_page(self, request: Request) -> Response:
        if _who(request) is not None:
            return RedirectResponse("/", 303)
        return self._page("login", None, why="", name="")

    async def _log_in(self, request: Request) -> Response:
        form = await _form(request)
        name, password = form.get("name", ""), form.get("password", "")
        status, why, wait = await self._attempts.attempt(_address(request), name, password)
        if status == 200:
            token = self._sessions.begin(name, time.monotonic())
            return self._cookie.give(RedirectResponse("/", 303), token)
        answer = self._page("login", None, status, why=why, name=name[:100])
        if wait:
            answer.headers["retry-after"] = str(math.ceil(wait))
        return answer

    async def _log_out(self, request: Request) -> Response:
        who, _ = await _proven(request)
        self._sessions.end(who.token)
        return self._cookie.take(RedirectResponse("/login", 303))

    async def _file(self, request: Request) -> Response:
        file = self._pages.files.get(request.path_params["name"])
        if file is None:
            raise HTTPException(404)
        # A browser asks whether it has changed: after an update nobody shall order with an old script.
        headers = {"cache-control": "no-cache", "etag": file.mark}
        if request.headers.get("if-none-match") == file.mark:
            return Response(status_code=304, headers=headers)
        return Response(file.data, media_type=file.kind, headers=headers)

    async def _overview(self, request: Request) -> Response:
        return self._page("overview", _who(request), plant=await self.live.now(), drives=self._shown.drives)

    async def _drive(self, request: Request) -> Response:
        drive = self._known(request)
        plant = await self.live.now()
        [now] = [each for each in plant["drives"] if each["name"] == drive.name]
        events = happened(self._shown.events(), drive.name, 50)
        return self._page(
            "drive", _who(request), plant=plant, drive=drive, now=now, events=events, has_trend=self._has_trend(drive)
        )

    async def _events(self, request: Request) -> Response:
        writes = await asyncio.get_running_loop().run_in_executor(self._reading, tail, self._shown.audit)
        plant = await self.live.now()
        return self._page(
            "events",
            _who(request),
            plant=plant,
            events=happened(self._shown.events()),
            writes=writes,
            has_audit=self._shown.audit is not None,
        )

    async def _live(self, request: Request) -> Response:
        who = _is_in(request)
        mark, streams = object(), who.session.streams
        streams.append(mark)
        del streams[:-_STREAMS]

        def is_in() -> bool:
            return self._sessions.of(who.token, time.monotonic(), uses=False) is who.session

        async def stream() -> AsyncIterator[bytes]:
            try:
                # What went before is gone, and comes again soon: a browser that lost us asks again after a second.
                yield b"retry: 1000\n\n"
                async for picture in self.live.pictures(lambda: mark in streams and is_in()):
                    yield picture
                if not is_in():
                    yield b"event: out\ndata: \n\n"
                elif mark not in streams:
                    yield b"event: enough\ndata: \n\n"
            finally:
                with suppress(ValueError):
                    streams.remove(mark)

        return StreamingResponse(stream(), media_type="text/event-stream")

    async def _trend(self, request: Request) -> Response:
        drive = self._known(request)
        name, hours = request.query_params.get("value", ""), request.query_params.get("hours", "1")
        if hours not in map(str, HOURS) or not self._has_trend(drive) or self._courses is None:
            raise HTTPException(404)
        if self._waiting >= _READERS:
            return PlainTextResponse("too many look at curves\n", 503)
        self._waiting += 1
        loop = asyncio.get_running_loop()
        try:
            found = await loop.run_in_executor(
                self._reading, self._courses.of, drive.name, name, int(hours), drive.hold
            )
        except OSError as error:
            return PlainTextResponse(f"{error}\n", 503)
        finally:
            self._waiting -= 1
        # As a browser has them: thousandths of seconds.
        points = [[round(at * 1000), value] for at, value in found.points]
        return JSONResponse({"since": round(found.since * 1000), "until": round(found.until * 1000), "points": points})

    async def _here(self, request: Request) -> Response:
        who, _ = await _proven(request)
        self._shown.here(who.person.name)
        return Response(status_code=204)

    async def _order(self, request: Request) -> Response:
        who, form = await _proven(request)
        if who.person.role != "command":
            raise HTTPException(403, "who may only look gives no orders")
        what = form.get("what", "")
        if what == "stop_all":
            name, address = who.person.name, _address(request)
            told = await asyncio.get_running_loop().run_in_executor(self._halting, self._shown.stop_all, name, address)
        else:
            told = {form.get("drive", ""): await self._one(request, who, what, form)}
        told_as = "stop" if what == "stop_all" else plain(what)
        results = [
            {"drive": plain(drive), "what": told_as, "result": result, "text": plain(text)}
            for drive, (result, text) in told.items()
        ]
        status = 200 if results and all(each["result"] == "done" for each in results) else 409
        if "application/json" in request.headers.get("accept", ""):
            return JSONResponse(results, status)
        return self._page(
            "told", who, status, results=results, back=f"/drive/{form['drive']}" if form.get("from") else "/"
        )

    async def _one(self, request: Request, who: Who, what: str, form: Mapping[str, str]) -> tuple[str, str]:
        """Has one drive told *what*; its result, and what more there is to say."""
        drive = self._shown.drives.get(form.get("drive", ""))
        if drive is None:
            return "not sent", "there is no such drive"
        if what in MOVES:
            # These are ordered once, and at a picture that is fresh. A halt always goes.
            why = self._tickets.why_not(form.get("number", ""), form.get("seen", ""), time.time())
            if why:
                return "not sent", why
        elif what not in HALTS:
            return "not sent", "there is no such order"
        hertz: float | None = None
        if what in ("run", "setpoint"):
            try:
                hertz = float(form.get("hz", ""))
            except ValueError:
                return "not sent", "the speed is not a number"
        told = Told(
            drive.name,
            what,
            hertz,
            form.get("reverse") == "1",
            who.person.name,
            _address(request),
            time.monotonic() + _WITHIN,
        )
        pool = self._halting if what in HALTS else self._ordering
        return await asyncio.get_running_loop().run_in_executor(pool, self._shown.order, told)

    def _known(self, request: Request) -> ShownDrive:
        drive = self._shown.drives.get(request.path_params["name"])
        if drive is None:
            raise HTTPException(404)
        return drive

    def _has_trend(self, drive: ShownDrive) -> bool:
        return self._shown.spool is not None and drive.hold > 0

    def _page(self, template: str, who: Who | None, status: int = 200, **told: Any) -> HTMLResponse:
        commands = who is not None and who.person.role == "command"
        about = {"title": self._shown.title, "who": who, "commands": commands, "dead_man": self._shown.dead_man}
        return HTMLResponse(self._pages.page(template, **about, **told), status)


def _who(request: Request) -> Who | None:
    who: Who | None = request.scope["who"]
    return who


def _is_in(request: Request) -> Who:
    who = _who(request)
    if who is None:
        raise HTTPException(401, "log in first")
    return who


def _address(request: Request) -> str:
    return "somewhere" if request.client is None else request.client.host


async def _form(request: Request) -> dict[str, str]:
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/x-www-form-urlencoded":
        raise HTTPException(415, "that is no form")
    try:
        found = parse_qs((await request.body()).decode("utf-8"), keep_blank_values=True, max_num_fields=20)
    except ValueError:
        raise HTTPException(400, "that is no form") from None
    return {name: values[-1] for name, values in found.items()}


async def _proven(request: Request) -> tuple[Who, dict[str, str]]:
    """Who sends a form, which is one of ours."""
    who, form = _is_in(request), await _form(request)
    if not secrets.compare_digest(form.get("form_token", "").encode(), who.session.form_token.encode()):
        raise HTTPException(403, "that is no form of this session: load the page again")
    return who, form
