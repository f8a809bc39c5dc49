"""What a frame means, in the names of the unit's family where that is known. Nothing here sends or judges."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus import _native, rtu, tables
from drivebus.errors import DrivebusError
from drivebus.line import huanyang
from drivebus.line.inside import wrong_inside
from drivebus.line.write_guard import code_text
from drivebus.profile import Profile
from drivebus.values import Choice, Description

__all__ = ["meaning"]

_SHOWN = 8
"""So many registers of one frame are named; a poll reads more than a line of text holds."""


def meaning(frame: bytes, sent: bool, asked: bytes | None = None, profile: Profile | None = None) -> str:
    """What *frame* means, in words.

    Args:
        frame: All of it, the CRC included.
        sent: Whether a master sent it; a unit's answer to a write looks like the write.
        asked: The request before it, which says what the words of an answer are.
        profile: The family of the unit, for names.
    """
    try:
        fields = rtu.decode(frame)
    except DrivebusError:
        return "1 byte that is not a frame" if len(frame) == 1 else f"{len(frame)} bytes that are not a frame"
    whom = f"unit {fields.unit}" if fields.unit else "all units"
    if fields.kind == "other" and huanyang.is_sure(frame):
        return huanyang.words(frame, sent)
    inside = wrong_inside(frame, None if sent else asked) if fields.kind == "other" else None
    if inside is not None:
        return inside
    if sent:
        return f"{whom}: {_request(fields, profile)}"
    if frame == asked and fields.kind == "read":
        return "the request itself, sent back"
    return f"{whom} {_answer(fields, asked, profile)}"


def _request(fields: rtu.Frame, profile: Profile | None) -> str:
    first = _place(fields)
    match fields.kind:
        case "read":
            return f"read {_names(first, fields.count or 0, profile)}"
        case "write":
            return f"write {_values(first, [fields.value or 0], profile, written=True)}"
        case "write_many":
            return f"write {_values(first, fields.words or [], profile, written=True)}"
        case "echo":
            return f"echo {fields.data:04X}H"
    return _seldom_request(fields.pdu or b"", profile) or f"function {fields.function:02X}H"


def _seldom_request(pdu: bytes, profile: Profile | None) -> str | None:
    """What the request *pdu* asks for, of a function that few units know; None where it has not the form of one."""
    place, _, words = _native.touched(pdu) or (0, 0, None)
    match pdu[:1]:
        case b"\x0f" if words:
            return f"write {_values(place, words, profile, written=True)}"
        case b"\x11" if len(pdu) == 1:
            return "say what it is"
        case b"\x16" if len(pdu) == 7:
            return f"change bits of {_names(_word(pdu, 1), 1, profile, written=True)}: {_masks(pdu)}"
        case b"\x17" if words:
            read = _names(_word(pdu, 1), _word(pdu, 3), profile)
            return f"write {_values(place, words, profile, written=True)}, then read {read}"
        case b"\x2b" if pdu[1:2] == b"\x0e" and len(pdu) == 4:
            return f"say who made it, from object {pdu[3]:02X}H" if pdu[3] else "say who made it"
    return None


def _seldom_answer(pdu: bytes, asked: bytes | None, profile: Profile | None) -> str | None:
    """The same of an answer, to the frame *asked*."""
    match pdu[:1]:
        case b"\x0f" if len(pdu) == 5:
            return f"took {_names(tables.place('coil', _word(pdu, 1)), _word(pdu, 3), profile, written=True)}"
        case b"\x11" if len(pdu) > 1:
            return f"says that it is {pdu[2:].hex(' ').upper()}"
        case b"\x16" if len(pdu) == 7:
            return f"changed bits of {_names(_word(pdu, 1), 1, profile, written=True)}: {_masks(pdu)}"
        case b"\x17" if asked is not None and asked[1] == 0x17 and len(pdu) == 2 + 2 * _word(asked, 4):
            words = [_word(pdu, at) for at in range(2, len(pdu), 2)]
            return f"answers {_values(_word(asked, 2), words, profile)}"
        case b"\x2b":
            objects = _native.device_objects(pdu)
            return f"says that it is {', '.join(_object(*told) for told in objects)}" if objects else None
    return None


def _object(number: int, value: bytes) -> str:
    """An object of a unit's identification. Those of the maker's own need not be text."""
    text = value.decode("ascii", "replace").strip("\0 ")
    return f'"{text}"' if number < 0x80 and text.isprintable() else value.hex(" ").upper()


def _masks(pdu: bytes) -> str:
    return f"and {_word(pdu, 3):04X}H, or {_word(pdu, 5):04X}H"


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")


def _answer(fields: rtu.Frame, asked: bytes | None, profile: Profile | None) -> str:
    match fields.kind:
        case "read_answer":
            words = fields.words or []
            first = _read_from(asked, fields)
            if first is None:
                return f"answers {' '.join(f'{word:04X}H' for word in words)}"
            return f"answers {_values(first, words[: _asked_for(asked)], profile)}"
        case "write":
            return f"took {_values(_place(fields), [fields.value or 0], profile, written=True)}"
        case "write_many_answer":
            return f"took {_names(_place(fields), fields.count or 0, profile, written=True)}"
        case "echo":
            return f"returns {fields.data:04X}H"
        case "exception":
            code = fields.code or 0
            known = "" if profile is None else f" {', '.join(profile.exception(code))}"
            return f"refuses function {fields.function:02X}H: exception {code:02X}H{known}"
        case "read":
            return f"is asked by another master: read {_names(_place(fields), fields.count or 0, profile)}"
    return _seldom_answer(fields.pdu or b"", asked, profile) or f"answers function {fields.function:02X}H"


def _read_from(asked: bytes | None, answer: rtu.Frame) -> int | None:
    """The first address of the read that *answer* fits."""
    if asked is None:
        return None
    request = rtu.decode(asked)
    if request.kind != "read" or (request.unit, request.table) != (answer.unit, answer.table):
        return None
    return _place(request) if request.count == _count(request, answer) else None


def _count(request: rtu.Frame, answer: rtu.Frame) -> int | None:
    """How many *answer* brings of what was asked: an answer of bits fills its last byte."""
    asked, came = request.count or 0, answer.count or 0
    fills = request.table in tables.BITS and asked <= came < asked + 8
    return asked if fills else answer.count


def _place(fields: rtu.Frame) -> int:
    return tables.place(fields.table, fields.address or 0)


def _names(first: int, count: int, profile: Profile | None, *, written: bool = False) -> str:
    """What stands at *count* addresses from *first* on."""
    where = tables.shown(first) if count == 1 else f"{count} {_many(first)} at {tables.split(first)[1]:04X}H"
    rows = (_row(address, profile, written) for address in range(first, first + count))
    named = [_called(row) for row in rows if row is not None]
    if not named:
        return where
    shown = ", ".join(named[:_SHOWN]) + (", …" if len(named) > _SHOWN else "")
    return f"{shown} ({where})"


def _values(first: int, words: list[int], profile: Profile | None, *, written: bool = False) -> str:
    """What *words* mean that stand at *first* and behind it."""
    shown = [text for text, _ in zip(_each(first, words, profile, written), range(_SHOWN), strict=False)]
    return ", ".join(shown) + (", …" if len(words) > _SHOWN else "")


def _each(first: int, words: list[int], profile: Profile | None, written: bool) -> Iterator[str]:
    at = 0
    while at < len(words):
        address, word = first + at, words[at]
        row = _row(address, profile, written)
        count = 1 if row is None else min(row.words, len(words) - at)
        if profile is None or row is None:
            yield f"{tables.shown(address)} = {word}"
        else:
            yield f"{_called(row)} = {_value(row, words[at : at + count], profile)}"
        at += count


def _value(row: Description, words: list[int], profile: Profile) -> str:
    is_state = row.access == "ro"
    codes = None if row.place is None or is_state else profile.command_registers().get(row.place)
    if codes is not None:
        meant = codes.get(words[0])
        return code_text(words[0]) if meant is None else f"{code_text(words[0])} ({meant.replace('_', ' ')})"
    if row.bits:
        return f"{words[0]:04X}H"
    try:
        value = profile.compile([row.name]).values([words])[0]
    except (DrivebusError, ValueError):
        return " ".join(f"{word:04X}H" for word in words)
    if isinstance(value, Choice):
        return f"{int(value)} ({value.label})"
    return f"{row.text(value)} {row.unit}".rstrip()


def _called(row: Description) -> str:
    return row.name if row.code is None or row.code == row.name else f"{row.code} {row.name}"


def _asked_for(asked: bytes | None) -> int | None:
    return None if asked is None else rtu.decode(asked).count


def _many(place: int) -> str:
    table, _ = tables.split(place)
    return {"coil": "coils", "discrete": "discrete inputs", "input": "input registers"}.get(table, "words")


def _row(address: int, profile: Profile | None, written: bool) -> Description | None:
    """What is read or *written* at *address*, whichever memory it is for."""
    if profile is None:
        return None
    name = profile.name_at(profile.plain_address(address), written=written)
    return None if name is None else profile.describe(name)
