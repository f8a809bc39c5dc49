"""What a unit is, as far as it tells: by its identification code, or by which words it answers and which it refuses.

Only reads are sent here. Whether what was found is enough to command a motor by it is decided in `profile_choice`.
"""

from __future__ import annotations

from dataclasses import replace

from drivebus import tables
from drivebus.errors import BadAnswer, NoAnswer
from drivebus.identify import codes, signatures
from drivebus.identify.families import all_of, one_of, shipped
from drivebus.identify.refusals import LOCKED, UNREACHED, answer_at
from drivebus.identify.results import Certainty, Identification
from drivebus.line.asking import Ask
from drivebus.profile import Profile
from drivebus.profile.facts import IdentificationCode
from drivebus.profile.family import family_of

__all__ = ["identify"]

_PASSWORD = ", as INVT drives do that a user password locks: type it in at the keypad"


async def identify(ask: Ask, unit: int) -> Identification:
    """Finds out what *unit* is. *read* asks for one word.

    Raises:
        NoAnswer, BadAnswer, PortError: From its first answer.
    """
    answered: dict[int, bool] = {}
    told: list[str] = []
    code: int | None = None
    for address in codes.registers():
        answer = await answer_at(ask, unit, address)
        code = answer.word
        if answer.exception is not None:
            if answer.exception in UNREACHED:
                raise NoAnswer(f"no answer, says a gateway (exception {answer.exception:02X}H)", unit=unit)
            answered[address] = False
            why = _PASSWORD if answer.exception == LOCKED else ""
            told.append(f"it refuses {address:04X}H (exception {answer.exception:02X}H{why})")
            continue
        assert code is not None
        answered[address] = True
        rows = codes.listed_at(address, code)
        if rows:
            return await _as_it_behaves(ask, _by_code(unit, code, rows), address)
        told.append(f"it reports {code:04X}H, which is not a known code")
    candidates = await signatures.shown_by(ask, unit, answered)
    if not candidates:
        reason = f"{'; '.join(told)}, and its answers fit no known family"
        return Identification(unit, (), None, code, "", "unknown", reason)
    told_by = [signatures.listed()[name] for name in candidates]
    telling = {place for signature in told_by for place in (*signature["answers"], *signature["refuses"])}
    seen = ", ".join(
        f"{tables.shown(place)} {'answered' if answered[place] else 'refused'}" for place in sorted(telling)
    )
    return Identification(
        unit,
        candidates,
        candidates[0] if len(candidates) == 1 else None,
        code,
        one_of(Profile.builtin(name).title for name in candidates),
        "by answers",
        f"it has no known code, and answers like such a unit: {seen}",
    )


def _by_code(unit: int, code: int, rows: list[IdentificationCode]) -> Identification:
    """What *unit* is by the *rows* that are listed for its *code*."""
    families = tuple(codes.families_in(rows))
    title = one_of(name for row in rows for name in (row.title, *row.shared))
    printed = next((row for row in rows if row.verified), None)
    says = f"it reports {code:04X}H"
    certainty: Certainty
    if printed is None:
        certainty, reason = "unverified", f"{says}, which no document prints for {title}, only {rows[0].source}"
    elif len(families) > 1:
        certainty, reason = "shared", f"{says}, which {all_of(families)} share"
    else:
        certainty, reason = "certain", f"{says}, printed for {title} in {printed.source}"
    return Identification(unit, families, families[0] if len(families) == 1 else None, code, title, certainty, reason)


async def _as_it_behaves(ask: Ask, found: Identification, place: int) -> Identification:
    """Gives *found* back, as no more than likely if the unit is in no state of such a drive.

    One word is no proof: another maker's drive may keep its speed at *place*, and turn at just that.
    """
    known = next(map(Profile.builtin, shipped(found.candidates)), None)
    register = None if known is None else known.role("state")
    about = None if known is None or register is None else known.describe(register)
    if known is None or about is None or about.place is None or about.evidence == "assumed":
        return found
    try:
        answer = await answer_at(ask, found.unit, about.place)
    except (NoAnswer, BadAnswer):
        return found
    if answer.word is None:
        if answer.exception is None or not family_of(known).lacks_address(answer.exception):
            return found
        against = "refuses"
    else:
        if known.state(answer.word) != "unknown":
            return found
        against = f"says {answer.word} at"
    reason = (
        f"{found.reason}; but it {against} {tables.shown(about.place)}, where such a drive has its state: "
        f"{place:04X}H may have another meaning"
    )
    return replace(found, certainty="unverified", reason=reason)
