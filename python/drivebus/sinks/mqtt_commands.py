"""What a message must be to be a command: of now, said once, and all of it understood. Time is an argument.

What a broker kept for later is no command, and neither is one whose age nobody knows. Whoever halts a motor need not
say when; where that is said, it counts.
"""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from datetime import datetime
from typing import Any, NamedTuple

from drivebus import checks
from drivebus.sinks.order_words import HALTS

__all__ = ["Command", "Commands", "Heard", "NotTaken"]

OLDEST = 2.0
"""Seconds after which a command is none any more, and for which the clock of who gives it may be ahead."""
_REMEMBERED = 60.0
"""Seconds for which a command is known again."""
_MOST_REMEMBERED = 10_000
_LARGEST = 1_000
"""Bytes of a command."""
_LONGEST_ID = 100
"""Characters."""
_LATEST = 1e11
"""Seconds. No clock shows such a Unix time; milliseconds are above it."""
_KEYS = {"run": ("hz", "reverse"), "setpoint": ("hz",)}


class Heard(NamedTuple):
    """A message as it came.

    Attributes:
        drive: The drive that its topic names.
        order: What its topic orders.
        payload: What it says.
        kept: Whether it was given to the broker to keep.
        expiry: Seconds for which the broker would still deliver it; None: it did not say.
    """

    drive: str
    order: str
    payload: bytes
    kept: bool = False
    expiry: float | None = None


class Command(NamedTuple):
    """A command that may be carried out.

    Attributes:
        drive: The drive, which need not exist.
        order: What it is told, which it need not know.
        id: What whoever gave it calls it; empty: nothing.
        hz: A frequency, where it has one.
        reverse: Whether it shall turn the other way.
        left: Seconds within which it must have been sent.
    """

    drive: str
    order: str
    id: str
    hz: float | None
    reverse: bool
    left: float


class NotTaken(Exception):
    """A message that is no command, with the reason in words.

    Attributes:
        id: What whoever sent it calls it, as far as that could be read.
    """

    def __init__(self, why: str, named: str = "") -> None:
        super().__init__(why)
        self.id = named


class Commands:
    """Reads messages, and knows those again that it took."""

    def __init__(self) -> None:
        self._taken: OrderedDict[tuple[object, ...], float] = OrderedDict()

    def read(self, heard: Heard, wall: float, now: float) -> Command:
        """The command in *heard*.

        Args:
            heard: The message.
            wall: Unix time in seconds.
            now: Seconds of a clock that only goes forward.

        Raises:
            NotTaken: It is none. Nothing of it may be carried out.
        """
        if heard.kept:
            raise NotTaken("it was given to the broker to keep, and such a command is never carried out")
        if len(heard.payload) > _LARGEST:
            raise NotTaken(f"it has {len(heard.payload)} bytes, and a command has {_LARGEST} at most")
        said = _said(heard)
        named = _id(said)
        try:
            left, is_known = _left(heard, said, wall)
            if not is_known and not named and heard.order not in HALTS:
                raise NotTaken('it has neither a "time" nor an "id", so that it cannot be told from the one before')
            command = Command(heard.drive, heard.order, named, _hz(said), _reverse(said), left)
            self._take_once((heard.drive, named) if named else (heard.drive, heard.order, heard.payload), now, said)
        except NotTaken as error:
            raise NotTaken(str(error), named) from None
        return command

    def _take_once(self, key: tuple[object, ...], now: float, said: dict[str, Any]) -> None:
        while self._taken and next(iter(self._taken.values())) <= now - _REMEMBERED:
            self._taken.popitem(last=False)
        if "id" not in said and "time" not in said:
            # A halt without either, which may be given as often as somebody likes.
            return
        if key in self._taken:
            raise NotTaken(f"it came already in the last {_REMEMBERED:g} s")
        if len(self._taken) >= _MOST_REMEMBERED:
            raise NotTaken(f"there were more than {_MOST_REMEMBERED} commands in the last {_REMEMBERED:g} s")
        self._taken[key] = now


def _said(heard: Heard) -> dict[str, Any]:
    if not heard.payload and heard.order in HALTS:
        return {}
    try:
        said = json.loads(heard.payload.decode(), parse_constant=_no_number, object_pairs_hook=_once)
    except (ValueError, RecursionError):
        raise NotTaken("it is not JSON") from None
    if not isinstance(said, dict):
        raise NotTaken('it is not a JSON object, such as {"time": "2026-01-31T12:00:00Z"}')
    allowed = ("id", "time", *_KEYS.get(heard.order, ()))
    for key in said:
        if key not in allowed:
            raise NotTaken(
                f"{checks.shown(key)} is not known here{checks.closest(key, allowed)}; allowed is "
                + ", ".join(f'"{each}"' for each in allowed)
            )
    return said


def _no_number(text: str) -> float:
    raise ValueError(text)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands there twice")
    return found


def _id(said: dict[str, Any]) -> str:
    named = said.get("id", "")
    if not isinstance(named, str) or len(named) > _LONGEST_ID:
        raise NotTaken(f'"id" is not a text of {_LONGEST_ID} characters at most')
    return named


def _hz(said: dict[str, Any]) -> float | None:
    if "hz" not in said:
        return None
    value = _number(said["hz"])
    if value is None:
        raise NotTaken(f'"hz" is not a number: {checks.shown(said["hz"])}')
    return value


def _reverse(said: dict[str, Any]) -> bool:
    value = said.get("reverse", False)
    if not isinstance(value, bool):
        raise NotTaken(f'"reverse" is neither true nor false: {checks.shown(value)}')
    return value


def _left(heard: Heard, said: dict[str, Any], wall: float) -> tuple[float, bool]:
    """Seconds within which the command must have been sent, and whether it says when it was given."""
    left = OLDEST
    if heard.expiry is not None:
        if heard.expiry > OLDEST:
            # How much of that has passed already nobody knows.
            if "time" not in said:
                raise NotTaken(f"it may be delivered for {heard.expiry:g} s, and a command for {OLDEST:g} s at most")
        else:
            left = heard.expiry
    elif "time" not in said and heard.order not in HALTS:
        raise NotTaken('it does not say when it was given: say "time", or let it expire')
    if "time" not in said:
        return left, False
    age = wall - _time(said["time"])
    if age > OLDEST:
        raise NotTaken(f"it is {age:.1f} s old, and a command is none any more after {OLDEST:g} s")
    if age < -OLDEST:
        raise NotTaken(f"it comes {-age:.1f} s before its time: a clock is wrong, there or here")
    return min(left, OLDEST - max(age, 0.0)), True


def _time(value: object) -> float:
    number = _number(value)
    if number is not None and abs(number) < _LATEST:
        return number
    told = value if isinstance(value, str) else ""
    try:
        # Python 3.10 knows no Z.
        at = datetime.fromisoformat(told[:-1] + "+00:00" if told.endswith(("Z", "z")) else told)
    except ValueError:
        raise NotTaken(f'"time" is neither Unix time in seconds nor ISO 8601: {checks.shown(value)}') from None
    if at.tzinfo is None:
        raise NotTaken(f'"time" does not say its zone, such as Z: {checks.shown(value)}')
    return at.timestamp()


def _number(value: object) -> float | None:
    """*value* as a number; None: it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
