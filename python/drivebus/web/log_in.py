"""The log-in: one password is looked at after the other, and who is wrong too often waits before."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

from drivebus.web.attempts import Attempts
from drivebus.web.passwords import is_right
from drivebus.web.shown import Person
from drivebus.web.view import plain

__all__ = ["LogIn"]

_WAITING = 8
"""So many wait for their password to be looked at: each takes memory and a tenth of a second of a core."""
_LONGEST = 64
"""Characters of a name; nobody has a longer one."""


class LogIn:
    """Looks at passwords.

    Args:
        people: Who may log in, by name.
        tell: Hears in words who was let in, and who was not.
        clock: A clock in seconds that only goes forward.
    """

    def __init__(
        self, people: Mapping[str, Person], tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._people = people
        self._tell = tell
        self._clock = clock
        self._attempts = Attempts()
        self._looking = ThreadPoolExecutor(1, "page log-in")
        self._waiting = 0

    async def attempt(self, address: str, name: str, password: str) -> tuple[int, str, float]:
        """Whether *name* is let in from *address*: a status of HTTP, why not in words, and seconds to wait."""
        if self._waiting >= _WAITING:
            return 503, "Too many log in at this moment. Try again.", 1.0
        self._waiting += 1
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._looking, self.look_at, address, name, password)
        finally:
            self._waiting -= 1

    def look_at(self, address: str, name: str, password: str) -> tuple[int, str, float]:
        """The same, in the thread that calls this; one at a time."""
        name = name[:_LONGEST]
        shown = plain(name)
        wait = self._attempts.wait(address, name, self._clock())
        if wait > 0:
            return 429, f"Too many wrong passwords. Try again in {math.ceil(wait)} s.", wait
        person = self._people.get(name)
        if not is_right(password, None if person is None else person.password):
            self._attempts.failed(address, name, self._clock())
            self._tell(f"web: a log-in as {shown!r} from {address} failed")
            return 403, "Name or password is wrong.", 0.0
        self._attempts.succeeded(address, name)
        self._tell(f"web: {shown} is logged in from {address}")
        return 200, "", 0.0

    def close(self) -> None:
        """Looks at no more."""
        self._looking.shutdown(wait=False, cancel_futures=True)
