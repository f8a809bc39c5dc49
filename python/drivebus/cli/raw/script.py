"""The lines that `drivebus raw` takes, at its prompt and in a script, and what each asks for.

A line is a request in hex, or `read` or `write` with names; behind it stands how often, and how fast. `unit` says whose
names are meant, `wait` waits. Whatever is wrong with a line is found before anything of a script is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import click

import drivebus
from drivebus.advice import Text
from drivebus.cli import names
from drivebus.cli.option_types import with_a_point
from drivebus.cli.raw.request import Request, request_of
from drivebus.cli.wrong_use import WrongUse
from drivebus.line.addresses import EVERYBODY, Addresses

__all__ = ["VERBS", "Send", "Step", "Typed", "Wait", "located", "requests_of", "typed_in"]

VERBS = ("read", "write", "unit", "wait")
"""What a line can begin with that is no request in hex."""

SERIAL = Addresses()
"""The units of a serial line of which nothing else is said."""

_MOST_TIMES = 1_000_000
_LONGEST_WAIT = 86_400.0
"""Seconds."""


@dataclass(frozen=True)
class Typed:
    """A line that is right as far as one sees without knowing the units.

    Attributes:
        where: The file and the number of the line; empty at the prompt and on the command line.
        verb: One of `VERBS`, or `"hex"`.
        words: What follows the verb, or the bytes.
        unit: Whose names are meant.
        times: How often it is sent.
        every: Seconds from one time to the next; None as fast as the line allows.
        seconds: How long is waited; 0 unless the verb is `"wait"`.
    """

    where: str
    verb: str
    words: tuple[str, ...]
    unit: int
    times: int = 1
    every: float | None = None
    seconds: float = 0.0


@dataclass(frozen=True)
class Send:
    """Requests that are sent one after the other, *times* times, every so many seconds."""

    where: str
    requests: tuple[Request, ...]
    times: int = 1
    every: float | None = None


@dataclass(frozen=True)
class Wait:
    """Seconds in which nothing is sent."""

    seconds: float


Step = Send | Wait


@contextmanager
def located(where: str) -> Iterator[None]:
    """A block whose errors say *where* the line stands that is wrong; nothing where that is empty."""
    try:
        yield
    except click.UsageError as error:
        raise WrongUse(f"{where}: {error.message}" if where else error.message) from None
    except drivebus.NotAllowed as error:
        if not where:
            raise
        raise drivebus.BadArgument(Text(f"{where}: ", error.text)) from None


def typed_in(lines: Iterable[str], name: str, unit: int, force: bool, addresses: Addresses = SERIAL) -> Iterator[Typed]:
    """The lines of a script, without those that are empty.

    Args:
        lines: The text.
        name: The file, for errors; empty at the prompt.
        unit: Whose names are meant, until a line says otherwise.
        force: Whether a request may end with what looks like its own CRC.
        addresses: Which units the line may have.

    Raises:
        click.UsageError, NotAllowed: A line is wrong; the message says which and why.
    """
    for number, line in enumerate(lines, 1):
        where = f"{name}, line {number}" if name else ""
        words = tuple(line.partition("#")[0].split())
        if not words:
            continue
        with located(where):
            typed = _typed(words, where, unit, force, addresses)
        unit = typed.unit
        yield typed


def _typed(words: tuple[str, ...], where: str, unit: int, force: bool, addresses: Addresses) -> Typed:
    verb = words[0].lower()
    if verb == "wait":
        return Typed(where, verb, (), unit, seconds=_seconds(_only(words, "wait 0.5"), "wait"))
    if verb == "unit":
        units = names.parse_units(_only(words, "unit 2"), addresses)
        if len(units) > 1:
            raise WrongUse(f'"{words[1]}" is several units; a request goes to one')
        return Typed(where, verb, (), units[0])
    words, times, every = _repeated(words)
    if verb in ("read", "write"):
        if not words[1:]:
            raise WrongUse(
                "read what? Give a name, such as read output_current"
                if verb == "read"
                else "write what? Give a name and a value, such as write P00.11=2.5"
            )
        for word in words[1:] if verb == "write" else ():
            names.parse_assignment(word)
        return Typed(where, verb, words[1:], unit, times, every)
    if not words or not re.fullmatch(r"(0x|[0-9a-f:,])+", words[0], re.IGNORECASE):
        raise WrongUse(
            f'"{(words or ("x",))[0]}" begins no line; give unit and PDU in hex, such as 01 03 2100 0001, or '
            f"{', '.join(VERBS[:-1])} or {VERBS[-1]}"
        )
    request_of(words, force, addresses)
    return Typed(where, "hex", words, unit, times, every)


def _only(words: tuple[str, ...], example: str) -> str:
    """The one word behind the verb."""
    if len(words) != 2:
        raise WrongUse(f"{words[0]} takes one number; write {example}")
    return words[1]


def _seconds(text: str, what: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        raise WrongUse(f'{what} "{text}" is not a number of seconds{with_a_point(text)}') from None
    if not 0 <= seconds <= _LONGEST_WAIT:
        raise WrongUse(f"{what} {text} is out of range; allowed is 0 to {_LONGEST_WAIT:g} seconds")
    return seconds


def _repeated(words: tuple[str, ...]) -> tuple[tuple[str, ...], int, float | None]:
    """The words in front of `x10`, or of `x10 every 0.5`, and what these say."""
    every = None
    if "every" in words:
        at = words.index("every")
        if len(words) != at + 2 or not re.fullmatch(r"x\d+", words[at - 1], re.IGNORECASE):
            raise WrongUse("every stands behind a number of times; write x10 every 0.5")
        every, words = _seconds(words[-1], "every"), words[:at]
    match = re.fullmatch(r"x(\d+)", words[-1], re.IGNORECASE)
    if match is None:
        return words, 1, None
    digits = match[1].lstrip("0")
    if not digits or len(digits) > len(str(_MOST_TIMES)) or int(digits) > _MOST_TIMES:
        raise WrongUse(f"{words[-1]} is out of range; allowed is x1 to x{_MOST_TIMES}")
    return words[:-1], int(digits), every


def requests_of(typed: Typed, family: Callable[[int], drivebus.Profile], unverified: bool = False) -> Step | None:
    """What *typed* asks for; None for what is only said.

    Args:
        typed: The line.
        family: What tells the family of a unit, asked only where names are used.
        unverified: Whether names may be used that no document of the very family proves. Bytes always may.

    Raises:
        NotAllowed: A name or a value is wrong, or not verified.
        NoAnswer, BadAnswer, PortError: The unit did not tell its family.
    """
    with located(typed.where):
        match typed.verb:
            case "unit":
                return None
            case "wait":
                return Wait(typed.seconds)
            case "read":
                requests = _reads(typed, family(typed.unit), unverified)
            case "write":
                requests = tuple(_write(typed.unit, word, family(typed.unit), unverified) for word in typed.words)
            case _:
                requests = (request_of(typed.words, True, EVERYBODY),)  # who may be asked was looked at
        return Send(typed.where, requests, typed.times, typed.every)


def _reads(typed: Typed, profile: drivebus.Profile, unverified: bool) -> tuple[Request, ...]:
    """The fewest reads of all that is named."""
    places = [names.resolve(profile, word) for word in typed.words]
    reads = [(place, 1) for place in places if isinstance(place, int)]
    wanted = [place for place in places if isinstance(place, str)]
    for name in wanted:
        _check_proved(profile.describe(name), ("verified", "unverified"), "reading", unverified)
    reads += profile.plan(wanted) if wanted else []
    return tuple(
        Request(typed.unit, b"\x03" + address.to_bytes(2, "big") + count.to_bytes(2, "big")) for address, count in reads
    )


def _write(unit: int, text: str, profile: drivebus.Profile, unverified: bool) -> Request:
    """The write of *text*, a name and a value. A parameter goes to RAM."""
    name, value = names.parse_assignment(text)
    place = names.resolve(profile, name, written=True)
    if isinstance(place, int):
        if not isinstance(value, int) or not 0 <= value <= 0xFFFF:
            raise WrongUse(f'"{value}" is not a word from 0 to 65535, which is what an address takes')
        address, word = place, value
    else:
        known = profile.describe(place)
        if not known.writable:
            raise drivebus.BadArgument(f"{place} ({known.label}) is read-only")
        _check_proved(known, ("verified",), "writing", unverified)
        address = profile.address(place, store=False)
        word = profile.encode(place, names.without_unit(value, known.unit))
    return Request(unit, b"\x06" + address.to_bytes(2, "big") + word.to_bytes(2, "big"))


def _check_proved(row: drivebus.Description, enough: tuple[str, ...], doing: str, unverified: bool) -> None:
    """Raises `NotAllowed` where less is known of *row* than every command asks for."""
    if row.evidence not in enough and not unverified:
        reason = (row.reason or "no document of this family says so").rstrip(".")
        raise drivebus.Unverified(
            f"{doing} {row.code or row.name} ({row.label}) is not verified: {reason}. Use --unverified, or hex, to "
            "do it anyway"
        )
