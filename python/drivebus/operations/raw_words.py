"""The words of one unit by address: read and written as they are, with refusals in the words of its family."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from drivebus import _native, checks, tables
from drivebus.errors import LINE_ERRORS, PortError, Refused
from drivebus.line.asking import Read, Write
from drivebus.line.tasks import carried_out
from drivebus.line.write_guard import check_words
from drivebus.operations import events
from drivebus.operations.aim import check_harmless
from drivebus.operations.by_name import by_name
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile
from drivebus.values import State

__all__ = ["as_written", "carried_out_of", "explained", "read_words", "send", "write", "write_words"]

_WRITE_ONE, _WRITE_MANY = 0x06, 0x10

_LOCKED = ("password_error", "password_protected")
"""What INVT's families call the exceptions that have to do with the user password."""

_AGAIN = 4
"""How often an absolute value is sent once more to a drive that could not take it, as it says."""

_UNKNOWN, _NOWHERE = "unknown", "not_in_the_specification"
"""What an exception is called that no profile names, and one that the specification does not name either."""


async def read_words(
    unit: DriveView, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False
) -> list[int]:
    """Reads words by address or place, as they are. As `Bus.read`, but a refusal says what this family means by it."""
    with explained(unit):
        return await unit.bus.ask(Read.at(unit.address, address, count, urgent=urgent, verify=verify))


@by_name("force", after=2)
async def write_words(unit: DriveView, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
    """Writes one word (an int: 06H, or 10H where there is no 06H) or several (a sequence: 10H), as they are. Sent once.

    As `Bus.write`, but another drive that answers at this address gets nothing, and a refusal says what this family
    means by it. A word in the command register moves the motor.

    Args:
        address: 0..0xFFFF, with the bit for RAM or EEPROM where the family has one.
        value: Words of 0..0xFFFF.
        force: Also a command that the family does not define.

    Raises:
        NotAllowed: Out of range, or such a command; or another drive answers at this address since the port was
            opened again. Nothing was sent.
        NoAnswer, BadAnswer, PortError: The drive may have taken it, unless the error's `started` is None.
        Refused: The drive did not take it. An exception by which it says that it took it and is at it is none.
    """
    address, words = checks.address(address), checks.payload(value)
    if not checks.flag("force", force):
        check_words([unit.profile], unit.address, address, words)
    if unit.profile.is_command(address):
        unit.record.sent.started_as = State.UNKNOWN.value
    await write(unit, address, words, force=force)


async def write(
    unit: DriveView,
    address: int,
    value: int | Sequence[int],
    *,
    read_back: int | None = None,
    force: bool = False,
    judged: bool = True,
    absolute: bool = False,
) -> None:
    """Writes to the unit, if it still is the one it was and, where that is *judged*, does not say it is another.

    An *absolute* value is no command: where the drive says that it is busy or got the request damaged, so that it did
    not take it, it is sent again. With *read_back* the bus does that, and looks first.
    """
    again = 0 if absolute and read_back is None else _AGAIN
    connection = await _made_sure(unit, address, judged)
    while True:
        try:
            await send(unit, address, value, read_back=read_back, connection=connection, force=force)
        except PortError as error:
            if error.started is not None or unit.bus.reconnects == connection:
                raise
            # A port that was lost is opened by what comes next. That was refused, to see first who answers there.
            connection = await _made_sure(unit, address, judged)
            await send(unit, address, value, read_back=read_back, connection=connection, force=force)
        except Refused as error:
            if again >= _AGAIN or error.means != "ask_again":
                raise
            again += 1
            continue
        return


async def _made_sure(unit: DriveView, address: int, judged: bool) -> int:
    """The connection over which the unit is what it was, and, where that is *judged*, takes no harm at *address*."""
    connection = await unit.identity.check(unit.bus, judged=judged)
    if judged:
        await check_harmless(unit, address)
    return connection


def as_written(profile: Profile, value: int | Sequence[int]) -> int | Sequence[int]:
    """*value* as a request carries it: a drive that knows no 06H gets a single word by 10H."""
    by_many = _WRITE_ONE not in profile.functions and _WRITE_MANY in profile.functions
    return [value] if by_many and isinstance(value, int) else value


async def send(
    unit: DriveView,
    address: int,
    value: int | Sequence[int],
    *,
    read_back: int | None = None,
    connection: int | None = None,
    force: bool = False,
) -> None:
    """Writes to whatever unit answers at the address. One that says that it took it and is still at it has taken it."""
    value = as_written(unit.profile, value)
    table, first = tables.split(address)
    shown_at = None if read_back is None else tables.split(read_back)[1]
    try:
        with explained(unit):
            await unit.bus.ask(Write(unit.address, first, value, table, False, shown_at, connection, unit.halts, force))
    except Refused as error:
        # Where the words can be read, the bus has looked whether they are there.
        if error.means != "taken":
            raise
    if unit.taken is not None:
        unit.taken.writes += 1


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
