"""What one drive is doing, as its status words say, in the fewest reads.

Which words those are, and what they mean, the profile says. What no document of the family proves is left out, and the
reason is kept: half of a status is better than none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from drivebus.errors import NotAllowed
from drivebus.operations.registers import Registers
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence
from drivebus.profile.plan import ReadPlan
from drivebus.values import ControlSource, Fault, State

__all__ = ["Looks", "Seen"]


class Seen(NamedTuple):
    """The status words of one look, decoded.

    What the family's words do not tell, or may not be asked for, stands in *missing*, with the reason.
    """

    state: State
    fields: Mapping[str, str]
    fault: Fault | None
    time: float
    missing: Mapping[str, str]
    in_fault: bool
    """Whether the state word says that the drive is in fault. It may run all the same."""

    @property
    def source(self) -> ControlSource | None:
        """Where the drive takes its commands from, if its words tell."""
        channel = self.fields.get("control_channel")
        return next((source for source in ControlSource if source.value == channel), None)

    @property
    def tripped(self) -> bool:
        """Whether the drive is in fault: by its state word, or where that is not known by its fault number."""
        return self.in_fault or ("state" in self.missing and self.fault is not None)

    def __str__(self) -> str:
        if "state" in self.missing:
            return f"state not known, {self.fault or ('fault not known' if 'fault' in self.missing else 'no fault')}"
        if self.in_fault and self.state is not State.FAULT:
            return f"{self.state}, in fault: {self.fault or 'not named'}"
        return f"{self.state}, {self.fault}" if self.fault else str(self.state)


class _Look(NamedTuple):
    """What a look reads, worked out once for each profile."""

    plan: ReadPlan | None
    state: str | None
    words: Sequence[str]
    fault: str | None
    missing: Mapping[str, str]


class Looks(Registers):
    """Looks at the state of one drive."""

    def _know(self, profile: Profile, unverified: bool) -> None:
        super()._know(profile, unverified)
        self._look: _Look | None = None

    async def look(self, *, urgent: bool = False, unverified: bool = False) -> Seen:
        """The status words, in one read where they stand side by side.

        Raises:
            NotAllowed: Nothing of them may be read; the message has the reason.
        """
        drive = self.trusting(unverified)
        seen = await drive._glance(urgent=urgent)
        if drive._planned_look().plan is None:
            what = f"nothing of the state of unit {self.unit} may be read"
            raise drive._evidence.missing(what, seen.missing["state"], Evidence.without_state)
        return seen

    async def _glance(self, *, urgent: bool = False) -> Seen:
        """As `look`; where nothing may be read, nothing is, and nothing is told."""
        look = self._planned_look()
        if look.plan is None:
            return Seen(State.UNKNOWN, {}, None, 0.0, look.missing, False)
        answers: list[list[int]] = []
        first = 0.0
        for address, count in look.plan.reads:
            with self._explained():
                words, time, _ = await self.bus.read_stamped(self.unit, address, count, urgent=urgent)
            first = first if answers else time
            answers.append(words)
        values = dict(zip(look.plan.names, map(int, look.plan.values(answers)), strict=True))
        fields: dict[str, str] = {}
        for word in look.words:
            fields.update(self.profile.fields(word, values[word]))
        fault = values[look.fault] if look.fault is not None else 0
        seen = Seen(
            State.UNKNOWN if look.state is None else self._state_of(values[look.state]),
            fields,
            self.profile.fault(fault) if fault else None,
            first,
            look.missing,
            look.state is not None and self.profile.is_in_fault(values[look.state]),
        )
        self._remember(str(seen))
        return seen

    async def state(self, *, unverified: bool = False) -> State:
        """What the drive is doing: one read of its state word.

        Raises:
            NotAllowed: The family has no state word that is known, or verified. Nothing was sent.
        """
        drive = self.trusting(unverified)
        [word] = await drive.read_words(drive.profile.address(drive._state_word("telling the state")))
        state = drive._state_of(word)
        drive._remember(str(state))
        return state

    async def ping(self) -> None:
        """One read of what the family is known to answer: of its state word, if it has one.

        Raises:
            NotAllowed: Nothing of it is known. Nothing was sent.
        """
        if self._evidence.without_state() is None:
            await self.state()
            return
        roles = [self.profile.role("state"), self.profile.role("fault")]
        named = [*roles, *self.profile.monitor_names(), *self.profile.names()]
        for name in self._evidence.readable(name for name in named if name is not None):
            await self.read_words(self.profile.address(name))
            return
        raise NotAllowed(f"nothing is known that {self.profile.title} answers, so unit {self.unit} was not asked")

    def _planned_look(self) -> _Look:
        if self._look is None:
            self._look = self._plan_look()
        return self._look

    def _plan_look(self) -> _Look:
        missing: dict[str, str] = {}
        state, fault = self.profile.role("state"), self.profile.role("fault")
        no_state, no_fault = self._evidence.without_state(), self._evidence.without_fault()
        words = self._evidence.readable(word for word in self.profile.status_words if word != state)
        if no_state is not None:
            state, missing["state"] = None, no_state
        if no_fault is not None:
            fault, missing["fault"] = None, no_fault
        names = [*([state] if state else []), *words, *([fault] if fault else [])]
        in_status = [state] if state is not None and state in self.profile.status_words else []
        plan = self.profile.compile(names) if names else None
        return _Look(plan, state, [*in_status, *words], fault, missing)

    def _state_word(self, what: str) -> str:
        """The name of the state word, for what cannot be done without."""
        reason = self._evidence.without_state()
        name = self.profile.role("state")
        if reason is None and name is not None:
            return name
        needs = f"{what} needs a state word, and that of {self.profile.title} may not be used"
        raise self._evidence.missing(needs, reason or "", Evidence.without_state)

    def _state_of(self, word: int) -> State:
        try:
            return State(self.profile.state(word))
        except ValueError:
            return State.UNKNOWN
