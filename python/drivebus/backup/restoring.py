"""Gives a drive its parameters back: only what differs, in an order that it accepts, and never one twice.

What the drive has is read first, so that a restore that was cut off goes on where it was: what is there is not written
again.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence

from drivebus import checks
from drivebus.advice import Text, argument
from drivebus.backup.compare import amount
from drivebus.backup.create import Progress, origin_of
from drivebus.backup.model import Backup
from drivebus.backup.order import Order, Step
from drivebus.backup.reading import Reader
from drivebus.backup.results import Restoration, Restored
from drivebus.backup.rules import Rules
from drivebus.backup.text import worded
from drivebus.backup.writing import place, store_all, stores_all, write
from drivebus.errors import LINE_ERRORS, BadArgument, NotAllowed, NotReady, Refused, Unconfirmed, WrongDrive
from drivebus.operations import kept, state
from drivebus.operations.drive_view import DriveView
from drivebus.profile.refusals import means

__all__ = ["Restore"]

_HAD = {"restored": "it was written and read back", "same": "the drive had it"}
"""What was seen of a parameter before the last look at it."""


class Restore:
    """One restore of one drive."""

    def __init__(
        self, unit: DriveView, backup: Backup, *, dry_run: bool, twice: bool, progress: Progress | None
    ) -> None:
        self._unit = unit
        self._profile = unit.profile
        self._backup = backup
        self._rules = Rules(unit.profile)
        self._dry_run = dry_run
        self._twice = twice
        self._progress = progress
        self._pending = self._done = 0
        self._had: dict[str, int] = {}
        self._has: dict[str, int] = {}
        self._results: dict[str, tuple[str, str]] = {}
        self._refused: list[str] = []
        self._to_ask_again: set[str] = set()
        self._raw: Collection[str] = ()
        self._order: list[str] = []

    async def run(
        self, *, groups: Sequence[str] | None, serial: bool, motor: bool, raw: Sequence[str], force: bool
    ) -> Restoration:
        """See `Drive.restore`."""
        try:
            return await self._run(groups=groups, serial=serial, motor=motor, raw=raw, force=force)
        except (*LINE_ERRORS, Unconfirmed, KeyboardInterrupt) as error:
            if not self._dry_run:
                self._note(error)
            raise

    async def _run(
        self, *, groups: Sequence[str] | None, serial: bool, motor: bool, raw: Sequence[str], force: bool
    ) -> Restoration:
        chosen = self._rules.selected(self._backup, groups)
        self._raw = frozenset(self._named(raw))
        left = functools.partial(self._rules.unasked, serial=serial, motor=motor, raw=self._raw)
        wanted = [code for code in chosen if not self._leave(code)]
        asked = [code for code in wanted if left(code) is None]
        await self._check_identity(force)
        pairs = self._rules.bounds()
        bounding = {code for pair in pairs if {*pair} & {*asked} for code in pair}
        await self._read(wanted, bounding)
        for code in wanted:
            if code not in self._results and code not in asked:
                self._results[code] = ("skipped", left(code) or "")
        pending = [code for code in asked if code not in self._results and self._may_be_sent(code)]
        if pending and not self._dry_run:
            await self._check_stopped(pending)
        self._pending = len(pending)
        lines = [code for code in pending if self._rules.is_serial(code)]
        await self._carry_out([code for code in pending if code not in lines], pairs)
        if not self._dry_run:
            await self._look_again()
            await store_all(self._unit, asked)
        await self._change_line(lines)
        lacking = self._lacking(groups)
        return Restoration([self._item(code) for code in (*chosen, *lacking)], self._order, self._dry_run)

    def _lacking(self, groups: Sequence[str] | None) -> list[str]:
        """What the backup does not have: of another family what this one lacks, and what could not be read then."""
        unread = self._backup.unread
        lost = self._rules.selected([code for code, why in unread.items() if why.open], groups)
        for code in lost:
            self._results[code] = ("unread", f"the backup does not have it: {unread[code].why}: {unread[code]}")
        # What a drive of the same family had not is no part of what it was set to.
        other = [code for code, why in unread.items() if self._backup.translated_from and not why.open]
        for code in other:
            self._results[code] = ("missing", unread[code])
        return [code for code in unread if code in self._results]

    def _named(self, raw: Sequence[str]) -> Sequence[str]:
        """*raw*, if the backup has each.

        Raises:
            NotAllowed: It is no list of codes, or the backup lacks one; nothing was sent.
        """
        if isinstance(raw, str) or not all(isinstance(code, str) for code in raw):
            raise BadArgument(f'raw is {checks.shown(raw)}, not a list of codes; give one such as ["P05.01"]')
        for code in raw:
            if code not in self._backup:
                raise BadArgument(f"the backup has no {checks.shown(code)}{checks.closest(code, self._backup)}")
        return raw

    def _to_ram(self, code: str) -> bool:
        """Whether *code* goes to RAM alone: nothing is known of it but where the backup had it."""
        return code in self._raw and code in self._backup.in_ram

    def _leave(self, code: str) -> bool:
        reason = self._rules.unread(code, self._unit.unverified) or self._rules.uncompared(code)
        if reason is not None:
            self._results[code] = ("skipped", reason)
        return reason is not None

    async def _check_identity(self, force: bool) -> None:
        others = self._backup.origin.other(await origin_of(self._unit))
        if others and not force:
            raise WrongDrive(
                Text(
                    f"the backup is not of the drive at unit {self._unit.address}: {'; '.join(others)}; nothing was "
                    "written. If that is right, say ",
                    argument("force", True),
                ),
                unit=self._unit.address,
            )

    async def _read(self, wanted: Sequence[str], bounding: set[str]) -> None:
        """What the drive has of *wanted*, and of what bounds it."""
        readable = [code for code in bounding if self._rules.unread(code, self._unit.unverified) is None]
        words = await Reader(self._unit, sorted({*wanted, *readable}, key=self._rules.place)).rest()
        self._had, self._has = words.raw, dict(words.raw)
        for code in wanted:
            if (why := words.unread.get(code)) is not None:
                is_there = why.why != "not there"
                self._results[code] = ("unread", f"not written, {why.why}: {why}") if is_there else ("missing", why)
            elif words.raw[code] == self._backup.raw[code] and (
                self._to_ram(code) or stores_all(self._unit) or not kept.is_in_ram(self._unit, code)
            ):
                self._results[code] = ("same", "")

    def _may_be_sent(self, code: str) -> bool:
        """Whether it is known where *code* is stored, and what its value means; of all, before the first is written."""
        unproved = None if self._unit.unverified else self._backup.unproved(code)
        try:
            place(self._unit, code, store=not self._to_ram(code))
        except NotAllowed as error:
            self._results[code] = ("blocked", error.text)
        else:
            if unproved is not None:
                self._results[code] = ("blocked", _unproved(unproved))
        return code not in self._results

    async def _check_stopped(self, pending: Sequence[str]) -> None:
        """Refuses while the motor turns, where something is written that a drive takes only while it stands.

        What no document says when it may be written, counts as that.
        """
        stopped = [code for code in pending if self._profile.describe(code).access not in ("run", "rw")]
        if not stopped:
            return
        try:
            now = await state.state(self._unit)
        except NotAllowed:
            # Its family does not say where it tells its state; the drive itself refuses what it must.
            return
        if now.running:
            raise NotReady(
                f"{', '.join(stopped[:5])}{' and others' if len(stopped) > 5 else ''} can be restored only while the "
                f"drive is stopped, and unit {self._unit.address} runs ({now}); nothing was written",
                why="turning",
                unit=self._unit.address,
            )

    async def _carry_out(self, pending: Sequence[str], pairs: Sequence[tuple[str, str]]) -> None:
        """Writes *pending*, step by step. What was refused is tried again after the others: these may have hindered."""
        order = Order(
            {code: float(self._profile.decode(code, word)) for code, word in self._has.items()},
            {code: float(self._backup[code]) for code in pending},
            pairs,
            self._rules.last(),
            self._may_pass,
        )
        written = -1
        while written != len(self._order):
            written = len(self._order)
            await self._write_all(order, self._refused)
            if not self._refused:
                break
        passing = [code for code in self._refused if code in self._to_ask_again]
        if passing:
            # These were not judged: the drive was busy, or the request came damaged.
            await self._write_all(order, passing)
        self._say_what_hindered(order)

    async def _write_all(self, order: Order, again: Sequence[str]) -> None:
        """Writes what *order* has, and *again* what was refused before; what is refused now is noted."""
        order.again(again)
        self._refused = []
        while (step := order.next()) is not None:
            await self._take(step, order)

    def _say_what_hindered(self, order: Order) -> None:
        passing = order.passing(self._would_pass)
        for code in order.rest:
            by = order.hindrance(code, float(self._backup[code]))
            limit = "another parameter" if by is None else f"{by}, which the drive has at {self._shown(by)}"
            other, why = self._results.get(by or "", ("", ""))
            cause = Text("; that was refused: ", why) if other == "refused" else _by_way_of(passing.get(code, ()))
            self._results[code] = ("blocked", Text(f"it would be beyond {limit}", cause))
        for code, (result, reason) in self._results.items():
            if result in ("refused", "blocked") and self._has[code] != self._had[code]:
                self._results[code] = (result, Text(reason, f"; on the way there it was given {self._shown(code)}"))

    async def _take(self, step: Step, order: Order) -> None:
        """Does one step, and says to *order* what came of it."""
        code = step.code
        raw = self._backup.raw[code] if step.final else self._profile.encode(code, step.value)
        try:
            keep = not self._to_ram(code) if step.final else not self._keeps_in_ram(code)
            shown = await self._write(code, raw, store=keep, final=step.final)
        except Refused:
            if step.final:
                self._refused.append(code)
                order.leave(code)
            else:
                order.cannot(step)
            return
        except NotAllowed as error:
            self._note(error)
            raise
        order.wrote(step, float(self._profile.decode(code, shown)))

    def _may_pass(self, code: str, value: float) -> bool:
        """Whether *code* may have *value* on the way to its own."""
        return self._fits(code, value) and (self._twice or self._keeps_in_ram(code))

    def _would_pass(self, code: str, value: float) -> bool:
        """Whether it may not only because that would be one more write to its memory."""
        return self._fits(code, value) and not self._twice and not self._keeps_in_ram(code)

    def _fits(self, code: str, value: float) -> bool:
        try:
            self._profile.encode(code, value)
        except NotAllowed:
            return False
        return True

    def _keeps_in_ram(self, code: str) -> bool:
        """Whether a way is known to write *code* without wearing its memory."""
        try:
            place(self._unit, code, store=False)
        except NotAllowed:
            return False
        return True

    async def _change_line(self, codes: Sequence[str]) -> None:
        """Writes settings of the serial line, after all else and the address last: the drive may obey them at once."""
        gone = None
        for code in reversed(codes):
            if gone is not None:
                self._results[code] = ("blocked", f"the drive is not heard any more since {gone} was written")
                continue
            try:
                await self._write(code, self._backup.raw[code])
            except Refused:
                continue
            except LINE_ERRORS as error:
                if error.started is None:
                    raise
                gone = code
                self._results[code] = (
                    "differs",
                    "it was written, and the drive was not heard since: it may obey its new line already",
                )
        if codes and gone is None and not self._dry_run:
            await store_all(self._unit, codes)

    async def _write(self, code: str, raw: int, *, store: bool = True, final: bool = True) -> int:
        """Writes one parameter, or says that it would, and notes what came of it."""
        if self._dry_run:
            shown = raw
        else:
            try:
                shown = await write(self._unit, code, raw, self._has[code], store=store)
            except Refused as error:
                if final:
                    self._results[code] = ("refused", f"{_meaning(error)}; the drive did not take it")
                if means(self._profile, error.code) == "ask_again":
                    self._to_ask_again.add(code)
                raise
            self._has[code] = shown
        self._order.append(code)
        if final:
            result = "planned" if self._dry_run else "restored"
            self._results[code] = (result, "") if shown == raw else ("differs", "the drive shows another value")
            self._done += 1
            if self._progress is not None:
                self._progress(self._done, self._pending)
        return shown

    def _shown(self, code: str) -> str:
        return amount(self._profile, code, worded(self._profile, code, self._has[code]))

    async def _look_again(self) -> None:
        """Reads once more what the drive is to have now: one parameter may have moved another."""
        if not self._order:
            return
        had = {code: result for code, (result, _) in self._results.items() if result in _HAD}
        words = await Reader(self._unit, sorted(had, key=self._rules.place)).rest()
        self._has.update(words.raw)
        for code, result in had.items():
            if (why := words.unread.get(code)) is not None:
                self._results[code] = ("unread", f"{_HAD[result]}; what it has now could not be read, {why.why}: {why}")
            elif words.raw[code] != self._backup.raw[code]:
                self._results[code] = ("differs", f"{_HAD[result]}, and another parameter changed it since")

    def _note(self, error: BaseException) -> None:
        """Has *error* say what was restored before it."""
        restored = [code for code, (result, _) in self._results.items() if result == "restored"]
        if hasattr(error, "add_note"):
            done = f"restored before it: {', '.join(restored)}" if restored else "nothing was restored before it"
            error.add_note(f"{done}; a second restore writes only what is still missing")

    def _item(self, code: str) -> Restored:
        result, reason = self._results[code]
        if code not in self._backup:
            return Restored(code, "", "", None, None, None, result, reason)
        known = self._profile.describe(code)
        before, after = (
            None if code not in words else worded(self._profile, code, words[code]) for words in (self._had, self._has)
        )
        return Restored(code, known.label, known.unit, before, self._backup[code], after, result, reason)


def _meaning(error: Refused) -> str:
    return f"exception {error.code:02X}H, {error.name}: {error.meaning}" if error.meaning else str(error)


def _by_way_of(codes: Sequence[str]) -> Text:
    if not codes:
        return Text()
    return Text(
        f"; what the drive has is beyond its own limits, and only another value of {' and '.join(codes)} leads there, "
        "on the way. Its family has no known write to RAM alone: ",
        argument("twice", True),
        " writes the memory twice",
    )


def _unproved(reason: str) -> Text:
    return Text(
        f"it is not what the drive told, and what it means is not verified: {reason.rstrip('.')}. Use ",
        argument("unverified", True),
        " to write it anyway",
    )
