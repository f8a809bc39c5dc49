"""Asks a drive which parameters it has: group by group, by reads alone, and as politely as any other read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from drivebus import checks
from drivebus.backup import disk
from drivebus.backup.taking import origin_of
from drivebus.discovery.found import Discovery
from drivebus.discovery.kept import Group, Kept
from drivebus.discovery.walk import LAST, Walk
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, Refused
from drivebus.operations import words
from drivebus.operations.unit import Unit

__all__ = ["Progress", "search"]

Progress = Callable[[int, int], object]
"""Is told how many groups are done, and how many there are."""

_BEYOND = 0xFF
"""A number that no parameter has: whoever answers it answers anything."""

_NO_SUCH_ADDRESS = 0x02
_LOCKED = "password_protected"

_ATTEMPTS = 6
"""How often a read is begun whose answer was lost, beyond the repeats of the line itself."""


async def search(
    unit: Unit,
    place: Path | None,
    *,
    groups: Sequence[str] | None,
    resume: bool,
    progress: Progress | None,
    base: str | None,
) -> Discovery:
    """See `Drive.discover`."""
    wanted = _groups(unit, groups)
    if place is not None:
        Discovery.check(unit.profile, place, base)
    await unit.memory.identity.check(unit.bus)
    part = None if place is None else disk.part_of(place)
    kept = Kept.begin(part, await origin_of(unit), resume=resume)
    asking = _Search(unit, kept)
    try:
        if not kept.groups:
            await asking.check_that_it_refuses(wanted)
        for done, group in enumerate(wanted):
            if progress is not None:
                progress(done, len(wanted))
            if group not in kept.groups:
                kept.groups[group] = await asking.group(group)
                kept.keep()
        if progress is not None:
            progress(len(wanted), len(wanted))
    except BaseException as error:
        if part is not None and hasattr(error, "add_note"):
            error.add_note(f"{len(kept.groups)} of {len(wanted)} groups are in {part}; the rest follows")
        raise
    found = _result(unit, kept, wanted)
    if place is not None:
        found.save(place, base=base)
        kept.done()
    return found


class _Search:
    """The reads of one discovery."""

    def __init__(self, unit: Unit, kept: Kept) -> None:
        self._unit = unit
        self._kept = kept

    async def check_that_it_refuses(self, wanted: Sequence[int]) -> None:
        """Raises `NotAllowed` if the drive answers to numbers that no parameter has: it would have everything."""
        ends = dict.fromkeys((wanted[0], wanted[len(wanted) // 2], wanted[-1]))
        answers = [await self._read(group, _BEYOND, 1) for group in ends]
        if not any(isinstance(answer, Refused) for answer in answers):
            raise NotAllowed(
                f"unit {self._unit.address} answers at {' and '.join(_address(group) for group in ends)}, where no "
                "parameter can be: what it answers does not tell what it has. Nothing was written",
                unit=self._unit.address,
            )

    async def group(self, group: int) -> Group:
        """What is there of one *group*."""
        walk = Walk(self._unit.profile.max_words)
        while (asked := walk.ask()) is not None:
            first, count = asked
            answer = await self._read(group, first, count)
            if isinstance(answer, Refused):
                walk.was_refused(count, "" if answer.code == _NO_SUCH_ADDRESS else str(answer))
            else:
                walk.answered(answer)
        told = {index: how for index, how in walk.refused.items() if how}
        # A group that is full to its last number may be one that has no end, and one that never says that there is no
        # such address says nothing else either.
        full = len(walk.found) + len(told) > LAST
        if full and (not walk.found or not isinstance(await self._read(group, _BEYOND, 1), Refused)):
            return Group(doubtful=True)
        return Group(walk.found, told)

    async def _read(self, group: int, first: int, count: int) -> list[int] | Refused:
        """The words, or how they were refused.

        Raises:
            Refused: The drive is locked: it would refuse each.
            NotAllowed: Another drive answers at this address since the port was opened again.
            NoAnswer, BadAnswer, PortError: However often it was asked.
        """
        unit = self._unit
        for attempt in range(1, _ATTEMPTS + 1):
            await unit.memory.identity.check(unit.bus, judged=False)
            self._kept.requests += 1
            try:
                came = await words.read_words(unit, group << 8 | first, count)
            except Refused as error:
                if error.name == _LOCKED:
                    raise
                return error
            except (NoAnswer, BadAnswer):
                if attempt == _ATTEMPTS:
                    raise
            else:
                await unit.memory.identity.check(unit.bus, judged=False)
                return came
        raise AssertionError  # the last attempt returns or raises


def _groups(unit: Unit, groups: Sequence[str] | None) -> list[int]:
    """The numbers of *groups*, or of all that the family has.

    Raises:
        NotAllowed: It has none whose codes tell addresses; or one of *groups* is none of them.
    """
    profile = unit.profile
    known = {_named(group): group for group in profile.parameter_groups()}
    if not known:
        raise NotAllowed(
            f"the codes of {profile.title} do not tell addresses: nothing can be asked for but what its profile lists",
            unit=unit.address,
        )
    if groups is None:
        return list(known.values())
    if isinstance(groups, str) or not groups or not all(isinstance(group, str) for group in groups):
        raise NotAllowed(f'groups is {checks.shown(groups)}, not a list of groups; give one such as ["P00", "P09"]')
    for group in groups:
        if group not in known:
            raise NotAllowed(
                f"{checks.shown(group)} is not a group that can be searched in a {profile.title}: that is P00 to "
                f"P{LAST}, without those that the maker keeps closed or that are addresses of registers"
            )
    return sorted({known[group] for group in groups})


def _result(unit: Unit, kept: Kept, wanted: Sequence[int]) -> Discovery:
    """What was found in the groups that were *wanted*, by the codes that the profile has for them."""
    profile = unit.profile
    rows = [profile.describe(name) for name in profile.names()]
    codes = {row.address: row.code for row in rows if row.kind == "parameter" and row.code is not None}
    # The second word of a number is no parameter by itself.
    second = {row.address + 1 for row in rows if row.address is not None and row.words == 2}
    words: dict[str, int] = {}
    refused: dict[str, str] = {}
    for group in wanted:
        for index, word in kept.groups[group].words.items():
            address = group << 8 | index
            if address not in second:
                words[codes.get(address) or _code(group, index)] = word
        for index, how in kept.groups[group].refused.items():
            refused[codes.get(group << 8 | index) or _code(group, index)] = how
    return Discovery(
        unit=unit.address,
        profile=profile,
        taken=kept.taken,
        words=words,
        refused=refused,
        doubtful=tuple(_named(group) for group in wanted if kept.groups[group].doubtful),
        groups=tuple(map(_named, wanted)),
        requests=kept.requests,
    )


def _named(group: int) -> str:
    return f"P{group:02}"


def _code(group: int, index: int) -> str:
    return f"{_named(group)}.{index:02}"


def _address(group: int) -> str:
    return f"{group << 8 | _BEYOND:04X}H"
