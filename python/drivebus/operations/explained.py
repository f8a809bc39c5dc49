"""Questions to one unit, whose refusals say what its family means by them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivebus import _native, tables
from drivebus.errors import LINE_ERRORS, Refused
from drivebus.line.asking import Read
from drivebus.line.tasks import carried_out
from drivebus.operations import events
from drivebus.operations.drive_view import DriveView

__all__ = ["carried_out_of", "explained", "read_words"]

_LOCKED = ("password_error", "password_protected")
"""What INVT's families call the exceptions that have to do with the user password."""

_UNKNOWN, _NOWHERE = "unknown", "not_in_the_specification"
"""What an exception is called that no profile names, and one that the specification does not name either."""


async def read_words(
    unit: DriveView, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False
) -> list[int]:
    """Reads words by address or place, as they are. As `Bus.read`, but a refusal says what this family means by it."""
    with explained(unit):
        return await unit.bus.ask(Read.at(unit.address, address, count, urgent=urgent, verify=verify))


async def carried_out_of(unit: DriveView, task: _native.Task) -> Any:
    """What *task* comes to with *unit*, whose refusals say what this family means by them."""
    return await carried_out(task, unit.bus, lambda: explained(unit))


@contextmanager
def explained(unit: DriveView) -> Iterator[None]:
    """A block in which a refusal says what this family means by its code, and what it was that was refused."""
    try:
        yield
    except LINE_ERRORS as error:
        events.failed(unit, error)
        raise
    except Refused as error:
        events.answered(unit)
        name, meaning = unit.profile.exception(error.code)
        if name == _UNKNOWN and error.name != _NOWHERE:
            name = error.name
            meaning = f"as in the Modbus specification; its meaning to {unit.profile.title} is not known"
        raise Refused(
            f"unit {unit.address} refused {_asked(error.request)}: exception {error.code:02X}H, {name}: {meaning}"
            f"{_about_password(unit, name)}",
            code=error.code,
            name=name,
            meaning=meaning,
            means=unit.profile.exception_means(error.code),
            unit=error.unit,
            request=error.request,
            raw=error.raw,
            started=error.started,
            ended=error.ended,
        ) from None
    events.answered(unit)


def _about_password(unit: DriveView, exception: str) -> str:
    """What to do about a drive that is locked."""
    if exception not in _LOCKED:
        return ""
    described = map(unit.profile.describe, unit.profile.names())
    password = next((known for known in described if known.code and "password" in known.label.lower()), None)
    held = "The user password" if password is None else f"{password.code} holds the user password"
    return (
        f". {held}{' is set' if password is None else ', and it is set'}: type it in at the keypad, or take it off "
        "there, and ask again. How to unlock the drive over the bus is not printed"
    )


def _asked(request: bytes) -> str:
    """What a request frame asked for, for people."""
    touched = _native.touched(request[1:-2])
    if touched is None:
        return "the request"
    place, count, words = touched
    address, table = tables.shown(place), tables.split(place)[0]
    if words is None and table == "holding":
        return f"to read {count} word{'s' if count != 1 else ''} at {address}"
    if words is None:
        return f"to read {address}" if count == 1 else f"to read {count} from {address} on"
    if table == "coil" and len(words) == 1:
        return f"to switch {address} {'on' if words[0] else 'off'}"
    return f"to write {words[0]} at {address}" if len(words) == 1 else f"to write {len(words)} words at {address}"
