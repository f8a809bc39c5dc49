"""What some drives want to be told before they run: words in an order, each sent once, and seen before the next.

Nothing is left out because the state shows it already. Such a drive heeds the change of a word, and no state tells
which word it was given last; a start that is always the same costs a few exchanges and has no second way to go wrong.
"""

from __future__ import annotations

from drivebus.advice import Text, call
from drivebus.errors import LINE_ERRORS, BadAnswer, NoAnswer, NotReady, PortError, Refused, Unconfirmed
from drivebus.look import Look
from drivebus.operations import commands, raw_words, state
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import Evidence
from drivebus.profile.facts import StartStep

__all__ = ["check_seen", "lead_up"]

_ADVICE = "See what holds it back (its terminals, its mains, its keypad, who else commands it), then start it again"


def check_seen(unit: DriveView) -> None:
    """Raises `NotAllowed` where *unit* wants words before a run and its state between them may not be read."""
    if unit.profile.start_sequence():
        reason = unit.evidence.without_state()
        if reason is not None:
            what = f"unit {unit.address} is started by several words, and its state must be seen between them"
            raise unit.evidence.missing(what, reason, Evidence.without_state)


async def lead_up(unit: DriveView, command: str, within: float) -> None:
    """Sends what the family wants before *command*; nothing where it wants nothing.

    The state is looked at once after each word in any case, and again for *within* seconds.

    Raises:
        Refused: The drive did not take one of the words.
        NoAnswer, BadAnswer, PortError: The line failed before the first word was sent.
        Unconfirmed: A word was sent and the state does not show it, or a stop was given meanwhile. *command* was not
            sent.
    """
    steps = unit.profile.start_sequence()
    before = unit.record.halts_begun
    for number, step in enumerate(steps):
        await _Step(unit, command, step, before, is_first=number == 0).take(within)


class _Step:
    """One word of the sequence, on its way.

    Args:
        unit: The drive.
        command: What follows when all words are through.
        step: The word, as `Profile.start_sequence` has it.
        halts_before: How many stops had begun when the sequence did.
        is_first: Whether nothing was sent before it.
    """

    def __init__(self, unit: DriveView, command: str, step: StartStep, halts_before: int, *, is_first: bool) -> None:
        self._unit, self._command, self._step = unit, command, step
        self._halts_before, self._is_first = halts_before, is_first
        self._called = f"{step['label']} ({step['word']:04X}H)"

    async def take(self, within: float) -> None:
        """Sends the word, and looks until the state shows it."""
        unit = self._unit
        address, _ = unit.profile.command(self._command)
        try:
            await raw_words.write(unit, address, self._step.word)
        except NotReady as error:
            if self._is_first or error.why != "halted":
                raise
            raise self._failed(f"it was told to stop before {self._called} was sent") from error
        except LINE_ERRORS as error:
            if error.started is None and self._is_first:
                raise
            sent = "could not be sent" if error.started is None else "was sent and not confirmed"
            raise self._failed(f"{self._called} {sent} ({error})", error) from error
        deadline = unit.bus.now() + within
        while True:
            try:
                seen = await state.glance(unit)
                if unit.record.halts_begun != self._halts_before:
                    raise self._failed(f"it was told to stop when {self._called} had been sent")
                if seen.tripped:
                    trip = f"it is in fault {seen.fault or '(not named)'} since {self._called} was sent"
                    raise self._failed(Text(f"{trip}. Remove the cause, then ", call("reset_fault")))
                if seen.word is not None and seen.word & self._step.mask == self._step.value:
                    return
                last = self._told(seen)
            except (NoAnswer, BadAnswer, Refused) as error:
                last = f"its last answer was {error}; {state.seen_last(unit)}"
            except PortError as error:
                raise self._failed(f"the port was lost when {self._called} had been sent ({error})", error) from error
            if unit.bus.now() >= deadline:
                raise self._failed(
                    f"{self._called} was sent, once, and {last}, within {within:g} s (`confirm`). {_ADVICE}"
                )
            await unit.bus.sleep(commands.POLL_INTERVAL)

    def _told(self, seen: Look) -> str:
        """What the state word shows, and where that is not what is waited for."""
        name, word = self._unit.profile.role("state"), seen.word
        if name is None or word is None:
            return f"its state is not known: {seen}"
        fields = self._unit.profile.fields(name, word)
        wanted = {field: self._unit.profile.fields(name, self._step.value)[field] for field in self._step.until}
        differ = [
            f"{field} {fields[field]} and not {label}" for field, label in wanted.items() if fields[field] != label
        ]
        return f"its state word shows {word:04X}H ({seen}), with {', '.join(differ)}"

    def _failed(self, why: str, error: NoAnswer | BadAnswer | PortError | None = None) -> Unconfirmed:
        return Unconfirmed(
            Text(f"unit {self._unit.address} was not started: ", why, f". {commands.said(self._command)} was not sent"),
            unit=self._unit.address,
            request=b"" if error is None else error.request,
            started=None if error is None else error.started,
            ended=None if error is None else error.ended,
        )
