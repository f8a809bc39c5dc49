"""Asks a drive which parameters it has: group by group, by reads alone, and as politely as any other read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from drivebus import checks
from drivebus.backup import atomic_file
from drivebus.backup.create import origin_of
from drivebus.backup.unread import Unread, lost, refused
from drivebus.discovery.found import Discovery
from drivebus.discovery.group_scan import LAST, Walk
from drivebus.discovery.progress_file import Group, ProgressFile
from drivebus.errors import BadAnswer, BadArgument, NoAnswer, Refused, WrongDrive
from drivebus.operations import raw_words
from drivebus.operations.drive_view import DriveView

__all__ = ["Progress", "search"]

Progress = Callable[[int, int], object]
"""Is told how many groups are done, and how many there are."""

_BEYOND = 0xFF
"""A number that no parameter has: whoever answers it answers anything."""

_LOCKED = "password_protected"

_ATTEMPTS = 6
"""How often a read is begun whose answer was lost, beyond the repeats of the line itself. A refusal that says that the
drive was busy, or that the request came damaged, counts as that."""


async def search(
    unit: DriveView,
    place: Path | None,
    *,
    groups: Sequence[str] | None,
    resume: bool,
    progress: Progress | None,
    base: str | None,
) -> Discovery:
    """See `Drive.discover`."""
    wanted = _groups(unit, groups)
    if place is not None and not (resume and _is_unchanged(unit, place, base)):
        Discovery.check(unit.profile, place, base)
    part = None if place is None else atomic_file.part_of(place)
    await unit.identity.check(unit.bus)
    kept = ProgressFile.begin(part, await origin_of(unit), resume=resume)
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
            elif kept.groups[group].unsettled:
                await asking.settle(group, kept.groups[group])
                kept.keep()
        if progress is not None:
            progress(len(wanted), len(wanted))
    except BaseException as error:
        if part is not None and hasattr(error, "add_note"):
            error.add_note(f"{len(kept.groups)} of {len(wanted)} groups are in {part}; the rest follows")
        raise
    found = _result(unit, kept, wanted)
    if place is not None:
        found.write(place, base)
        if found.complete:
            kept.done()
    return found


def _is_unchanged(unit: DriveView, place: Path, base: str | None) -> bool:
    """Whether *place* is what an earlier call made that did not settle all, and nobody edited it."""
    if not (place.name and place.is_dir() and atomic_file.is_there(atomic_file.part_of(place))):
        return False
    kept = ProgressFile.of(atomic_file.part_of(place))
    if {*kept.groups} - {*unit.profile.parameter_groups()}:
        return False
    found = _result(unit, kept, [*kept.groups])
    files = found.files(place.name, base)
    return {each.name for each in place.iterdir()} == {*files} and all(
        atomic_file.read(place / name) == text.encode() for name, text in files.items()
    )


class _Search:
    """The reads of one discovery."""

    def __init__(self, unit: DriveView, kept: ProgressFile) -> None:
        self._unit = unit
        self._kept = kept

    async def check_that_it_refuses(self, wanted: Sequence[int]) -> None:
        """Raises `NotAllowed` if the drive answers to numbers that no parameter has: it would have everything."""
        ends = dict.fromkeys((wanted[0], wanted[len(wanted) // 2], wanted[-1]))
        answers = [await self._read(group, _BEYOND, 1) for group in ends]
        refusals = [answer for answer in answers if isinstance(answer, Refused)]
        if any(self._why(refusal).why != "lost" for refusal in refusals):
            return
        # That it was busy, or got a damaged request, proves nothing.
        for refusal in refusals:
            raise refusal
        if all(isinstance(answer, list) for answer in answers):
            raise WrongDrive(
                f"unit {self._unit.address} answers at {' and '.join(_address(group) for group in ends)}, where no "
                "parameter can be: what it answers does not tell what it has. Nothing was written",
                unit=self._unit.address,
            )

    async def group(self, group: int) -> Group:
        """What is there of one *group*."""
        profile = self._unit.profile
        walk = Walk(1 if profile.requests().single_parameters else profile.max_words)
        while (asked := walk.ask()) is not None:
            first, count = asked
            answer = await self._read(group, first, count)
            if isinstance(answer, list):
                walk.answered(answer)
            else:
                walk.was_refused(count, self._why(answer))
        told = {index: why for index, why in walk.refused.items() if why.why != "not there"}
        # A group that is full to its last number may be one that has no end, and one that never says that there is no
        # such address says nothing else either. What was lost says nothing of the group.
        full = len(walk.found) + sum(why.why != "lost" for why in told.values()) > LAST
        if full and (not walk.found or isinstance(await self._read(group, _BEYOND, 1), list)):
            return Group(doubtful=True)
        found = Group(walk.found)
        for index, why in told.items():
            _sort_in(found, index, why)
        return found

    async def settle(self, group: int, kept: Group) -> None:
        """Asks once more for what is not settled of *group*."""
        for index in sorted(kept.unsettled):
            answer = await self._read(group, index, 1)
            del kept.unsettled[index]
            if isinstance(answer, list):
                [kept.words[index]] = answer
            else:
                _sort_in(kept, index, self._why(answer))

    def _why(self, answer: Refused | NoAnswer | BadAnswer) -> Unread:
        if isinstance(answer, Refused):
            return refused(self._unit.profile, answer)
        return lost(answer)

    async def _read(self, group: int, first: int, count: int) -> list[int] | Refused | NoAnswer | BadAnswer:
        """The words, or how they were refused, or lost however often they were asked for while others are answered.

        Raises:
            Refused: The drive is locked: it would refuse each.
            NotAllowed: Another drive answers at this address since the port was opened again.
            NoAnswer, BadAnswer: Nothing is answered any more.
            PortError: See there.
        """
        unit = self._unit
        for attempt in range(1, _ATTEMPTS + 1):
            await unit.identity.check(unit.bus, judged=False)
            self._kept.requests += 1
            try:
                came = await raw_words.read_words(unit, group << 8 | first, count)
            except Refused as error:
                if error.name == _LOCKED:
                    raise
                if attempt == _ATTEMPTS or self._why(error).why != "lost":
                    return error
            except (NoAnswer, BadAnswer) as error:
                if attempt == _ATTEMPTS:
                    if not await self._is_heard(group):
                        raise
                    return error
            else:
                await unit.identity.check(unit.bus, judged=False)
                return came
        raise AssertionError  # the last attempt returns or raises

    async def _is_heard(self, group: int) -> bool:
        """Whether the drive answers at all: then it is one number that it is silent about."""
        self._kept.requests += 1
        try:
            await raw_words.read_words(self._unit, group << 8 | _BEYOND)
        except (NoAnswer, BadAnswer):
            return False
        except Refused:
            return True
        return True


def _groups(unit: DriveView, groups: Sequence[str] | None) -> list[int]:
    """The numbers of *groups*, or of all that the family has.

    Raises:
        NotAllowed: It has none whose codes tell addresses; or one of *groups* is none of them.
    """
    profile = unit.profile
    known = {_named(group): group for group in profile.parameter_groups()}
    if not known:
        raise BadArgument(
            f"the codes of {profile.title} do not tell addresses: nothing can be asked for but what its profile lists",
            unit=unit.address,
        )
    if groups is None:
        return list(known.values())
    if isinstance(groups, str) or not groups or not all(isinstance(group, str) for group in groups):
        raise BadArgument(f'groups is {checks.shown(groups)}, not a list of groups; give one such as ["P00", "P09"]')
    for group in groups:
        if group not in known:
            raise BadArgument(
                f"{checks.shown(group)} is not a group that can be searched in a {profile.title}: that is P00 to "
                f"P{LAST}, without those that the maker keeps closed or that are addresses of registers"
            )
    return sorted({known[group] for group in groups})


def _result(unit: DriveView, kept: ProgressFile, wanted: Sequence[int]) -> Discovery:
    """What was found in the groups that were *wanted*, by the codes that the profile has for them."""
    profile = unit.profile
    rows = [profile.describe(name) for name in profile.names()]
    codes = {row.address: row.code for row in rows if row.kind == "parameter" and row.code is not None}
    # The second word of a number is no parameter by itself.
    second = {row.address + 1 for row in rows if row.address is not None and row.words == 2}
    words: dict[str, int] = {}
    refused: dict[str, str] = {}
    unsettled: dict[str, Unread] = {}
    for group in wanted:
        for index, word in sorted(kept.groups[group].words.items()):
            address = group << 8 | index
            if address not in second:
                words[codes.get(address) or _code(group, index)] = word
        for index, how in kept.groups[group].refused.items():
            refused[codes.get(group << 8 | index) or _code(group, index)] = how
        for index, why in kept.groups[group].unsettled.items():
            unsettled[codes.get(group << 8 | index) or _code(group, index)] = why
    return Discovery(
        unit=unit.address,
        profile=profile,
        taken=kept.taken,
        words=words,
        refused=refused,
        unsettled=unsettled,
        doubtful=tuple(_named(group) for group in wanted if kept.groups[group].doubtful),
        groups=tuple(map(_named, wanted)),
        requests=kept.requests,
    )


def _sort_in(group: Group, index: int, why: Unread) -> None:
    """Notes in *group* that the number *index* was not told, for *why*."""
    if why.open:
        group.unsettled[index] = why
    elif why.why != "not there":
        group.refused[index] = str(why)


def _named(group: int) -> str:
    return f"P{group:02}"


def _code(group: int, index: int) -> str:
    return f"{_named(group)}.{index:02}"


def _address(group: int) -> str:
    return f"{group << 8 | _BEYOND:04X}H"
