"""What a unit is, as far as it tells: by its identification code, or by which words it answers and which it refuses.

Only reads. A code says what documents say of it, and no more: some families share one, and some codes are known from
other people's programs alone.
"""

from __future__ import annotations

import functools
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from drivebus.errors import BadAnswer, NoAnswer, Refused
from drivebus.identify import codes
from drivebus.identify.results import Identification
from drivebus.profile import Profile, profiles
from drivebus.protocols import ProfileProtocol

__all__ = ["LOCKED", "UNREACHED", "identify", "no_such_address", "one_of", "usable"]

_ILLEGAL_ADDRESS = 0x02
"""In the Modbus specification, and under this name in the profiles that list their exceptions."""

LOCKED = 0x09
"""The exception of an INVT drive that refuses all but the password. Whose unit this is, nobody knows yet."""

UNREACHED = (0x0A, 0x0B)
"""Exceptions by which a gateway says that the unit behind it is silent or out of reach. Modbus V1.1b3, section 7."""

_PASSWORD = ", as INVT drives do that a user password locks: type it in at the keypad"

Read = Callable[[int, int], Awaitable[list[int]]]


async def identify(read: Read, unit: int) -> Identification:
    """Finds out what *unit* is. *read* asks for one word.

    Raises:
        NoAnswer, BadAnswer, PortError: From its first answer.
    """
    answered: dict[int, bool] = {}
    told: list[str] = []
    code: int | None = None
    for address in codes.registers():
        try:
            [code] = await read(unit, address)
        except Refused as error:
            if error.code in UNREACHED:
                raise NoAnswer(f"no answer, says a gateway: {error}", unit=unit, raw=error.raw) from error
            answered[address] = False
            why = _PASSWORD if error.code == LOCKED else ""
            told.append(f"it refuses {address:04X}H (exception {error.code:02X}H{why})")
            continue
        answered[address] = True
        if code in codes.listed():
            return await _as_it_behaves(read, _by_code(unit, code), address)
        told.append(f"it says {code:04X}H, which no list names")
    candidates = await _by_answers(read, unit, answered)
    if not candidates:
        reason = f"{'; '.join(told)}, and answers like no family that is known by its answers"
        return Identification(unit, (), None, code, "", "unknown", reason)
    seen = ", ".join(f"{address:04X}H {'answered' if yes else 'refused'}" for address, yes in sorted(answered.items()))
    return Identification(
        unit,
        candidates,
        candidates[0] if len(candidates) == 1 else None,
        code,
        one_of(Profile.builtin(name).title for name in candidates),
        "by answers",
        f"it gives no code that is known, and answers as such a unit does: {seen}",
    )


def usable(found: Identification, unverified: bool) -> str | None:
    """The profile that *found* is sure enough of to command a motor by it; with *unverified*, the only candidate."""
    shipped = [name for name in found.candidates if name in profiles()]
    sure = found.certainty in ("certain", "shared") or (unverified and len(found.candidates) == 1)
    return shipped[0] if sure and len(shipped) == 1 else None


def no_such_address(profile: ProfileProtocol, exception: int) -> bool:
    """Whether a unit of *profile* says by *exception* that it has no such address."""
    name, _ = profile.exception(exception)
    return exception == _ILLEGAL_ADDRESS or name == "illegal_address"


def one_of(names: Iterable[str]) -> str:
    """What may be one or the other, for people: "A, B or C"."""
    return _joined(names, "or")


def _joined(names: Iterable[str], word: str) -> str:
    *others, last = dict.fromkeys(names)
    return f"{', '.join(others)} {word} {last}" if others else last


def _by_code(unit: int, code: int) -> Identification:
    rows = codes.listed()[code]
    families = tuple(dict.fromkeys(name for row in rows for name in (row["family"], *(row.get("shared") or ()))))
    titles = [name for row in rows for name in (row["title"], *(row.get("shared") or ()))]
    title = one_of(titles)
    printed = next((row for row in rows if row["verified"]), None)
    says = f"it says {code:04X}H"
    if printed is None:
        certainty, reason = "unverified", f"{says}, which no document prints for {title}, only {rows[0]['source']}"
    elif len(families) > 1:
        certainty, reason = "shared", f"{says}, which {_joined(families, 'and')} report alike"
    else:
        certainty, reason = "certain", f"{says}, printed for {title} in {printed['source']}"
    return Identification(unit, families, families[0] if len(families) == 1 else None, code, title, certainty, reason)


async def _as_it_behaves(read: Read, found: Identification, place: int) -> Identification:
    """*found*, and no more than likely if the unit is in no state of such a drive.

    One word is no proof: another maker's drive may keep its speed at *place*, and turn at just that.
    """
    known = next((Profile.builtin(name) for name in found.candidates if name in profiles()), None)
    register = None if known is None else known.role("state")
    about = None if known is None or register is None else known.describe(register)
    if known is None or about is None or about.address is None or about.evidence == "assumed":
        return found
    try:
        [word] = await read(found.unit, about.address)
    except Refused as error:
        if not no_such_address(known, error.code):
            return found
        against = "refuses"
    except (NoAnswer, BadAnswer):
        return found
    else:
        if known.state(word) != "unknown":
            return found
        against = f"says {word} at"
    reason = (
        f"{found.reason}; but it {against} {about.address:04X}H, where each of those tells its state: "
        f"something else may stand at {place:04X}H"
    )
    return replace(found, certainty="unverified", reason=reason)


async def _by_answers(read: Read, unit: int, answered: dict[int, bool]) -> tuple[str, ...]:
    """The families whose signature *unit* shows. What was asked stands in *answered*, and what is asked goes there."""
    for signature in _signatures().values():
        for address in (*signature["answers"], *signature["refuses"]):
            if address not in answered:
                try:
                    await read(unit, address)
                    answered[address] = True
                except Refused:
                    answered[address] = False
                except (NoAnswer, BadAnswer):
                    # Neither, then: no signature has it.
                    continue
    return tuple(name for name, signature in _signatures().items() if _shows(answered, signature))


def _shows(answered: Mapping[int, bool], signature: Mapping[str, Sequence[int]]) -> bool:
    return all(answered.get(address) is True for address in signature["answers"]) and all(
        answered.get(address) is False for address in signature["refuses"]
    )


@functools.cache
def _signatures() -> dict[str, dict[str, list[int]]]:
    found = {name: Profile.builtin(name).signature() for name in profiles()}
    return {name: signature for name, signature in found.items() if signature is not None}
