"""Whether the unit at an address is what it was named as, and still the one it was.

People name a profile, and mistake one drive for another. So what the unit says of itself is asked before anything goes
out that moves a motor or changes a value, and where it speaks against the profile, nothing goes out.

A port that was lost and opened again may be another one: an adapter plugged in elsewhere, a cable moved to another
machine, where the same address is another drive. So it is asked again then. A stop does not wait for it.

Families that have an identification code are known by it, and others by which words they answer and which they refuse:
also by what they say where other families have such a code, for that is how one of those gives itself away.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivebus import tables
from drivebus.advice import Text
from drivebus.errors import LINE_ERRORS, BadAnswer, NoAnswer, PortError, WrongDrive
from drivebus.identify import codes
from drivebus.identify.contradiction import contradiction, is_suspicious, other_signature
from drivebus.identify.refusals import Answer, answer_once, passes, tells_nothing
from drivebus.identify.signatures import shown_by, shows, signature_of
from drivebus.line.asking import asking
from drivebus.line.protocols import AwaitableBus
from drivebus.line.units import UnitRecord
from drivebus.profile import Profile

__all__ = ["SameUnit"]

_HOLDS = 10.0
"""Seconds of the line's clock for which a halt trusts that nobody has put another drive at the address."""


class SameUnit:
    """Makes sure that the unit at an address is what it was named as, and still the one it was.

    Args:
        bus: The line it hangs on; only for how often that was opened again.
        record: What is known of it, which its other handles see too.
        profile: What it was named as.
        code: What it said, if it was asked before.
        trusted: Whether the profile is believed, whatever the unit says.

    Attributes:
        trusted: The same.
    """

    def __init__(
        self,
        bus: AwaitableBus,
        record: UnitRecord,
        profile: Profile,
        code: int | None = None,
        *,
        trusted: bool = False,
    ) -> None:
        self._record = record
        self._unit = record.address
        self._profile = profile
        self.trusted = trusted
        self._words, self._probes = _questions(profile)
        self._identity = record.identity(profile, bus.reconnects)
        if code is not None:
            self._identity.known, self._identity.spoke, self._identity.contradicts = _hex(code), True, False
            self._identity.heard = bus.now()
            self._identity.is_sure = self._is_told([Answer(address, code, None) for address in self._words])

    def is_sure(self, bus: AwaitableBus) -> bool:
        """Whether it said, over the connection that *bus* has now, what no family says that its halts could start."""
        known = self._identity
        return known.is_sure and not known.contradicts and known.connection == bus.reconnects

    def is_known(self, bus: AwaitableBus) -> bool:
        """Whether it said all that it is asked, over the connection that *bus* has, and nothing against its name.

        One that refused all that said nothing: any unit may.
        """
        known = self._identity
        is_told = known.is_sure or (known.known is not None and known.spoke)
        return is_told and not known.contradicts and known.connection == bus.reconnects

    def is_harmless(self, bus: AwaitableBus, place: int) -> bool:
        """Whether a word at *place* was found to do no harm to it, over the connection that *bus* has."""
        return place in self._identity.harmless and self._identity.connection == bus.reconnects

    def found_harmless(self, bus: AwaitableBus, place: int) -> None:
        """A word at *place* does it no harm, for as long as the port stays open: by what it answered."""
        if self._identity.connection == bus.reconnects:
            self._identity.harmless.add(place)

    def settle(self, bus: AwaitableBus) -> None:
        """Takes it for surely what it was named as, for as long as the port stays open: by what else it answered."""
        if self._identity.connection == bus.reconnects:
            self._identity.is_sure, self._identity.heard = True, bus.now()

    def is_old(self, bus: AwaitableBus) -> bool:
        """Whether what it said of itself was said so long ago that another drive may have taken its place unseen."""
        heard = self._identity.heard
        return heard is None or bus.now() - heard > _HOLDS

    def is_another(self) -> None:
        """It showed that it is not what it was named as, over whatever connection: that is asked again."""
        self._identity.contradicts, self._identity.is_sure = True, False
        self._identity.harmless.clear()

    async def check(self, bus: AwaitableBus, *, judged: bool = True, urgent: bool = False) -> int:
        """Asks the unit over *bus* what it is, if the port was opened again or nobody has asked yet.

        A unit that refuses to tell is known by that. One that stays silent is not known, and is asked the next time; so
        is one that refuses for the moment only, as where a password locks it or a gateway does not reach it. Whether it
        contradicts its profile is looked at only where it is to be *judged*, or where it behaves as a unit of another
        family; where it does, it is asked each time.

        Returns:
            The connection for which that holds: what is sent on it goes to the unit that was asked.

        Raises:
            NotAllowed: What it says speaks against the profile, or another unit answers at this address now, or it was
                asked again and refused for the moment.
            NoAnswer, BadAnswer, PortError: It was asked again, and did not tell. What was to follow was not sent.
        """
        opened, known = bus.reconnects, self._identity.known
        # What spoke against the profile may have been put right meanwhile.
        anew = known is None or (judged and self._identity.contradicts)
        if not anew and opened == self._identity.connection:
            return opened
        answers: list[Answer] = []
        failure: NoAnswer | BadAnswer | PortError | None = None
        try:
            await self._ask(bus, answers, urgent)
        except LINE_ERRORS as error:
            failure = error
        if anew or known is None:
            against = other = None
            if not self.trusted:
                against = contradiction(self._profile, self._unit, answers)
                other = await self._other(bus, answers, urgent) if against is None and failure is None else None
            # By the words of another maker even a reset may start the motor.
            self._judge(answers, failure is None, judged or other is not None, against or other)
        else:
            self._compare(answers, failure, known)
        self._identity.heard = bus.now()
        if opened != self._identity.connection:
            self._identity.connection, self._identity.is_sure = opened, self._is_told(answers)
            self._identity.harmless.clear()
        return opened

    def _judge(self, answers: Sequence[Answer], complete: bool, judged: bool, against: str | None) -> None:
        """Takes what a unit said that was not known, and raises where that is *against* its profile and to be *judged*.

        What came before a failure of the line was said all the same, but is not *complete*: the unit stays unknown.
        """
        known = self._identity
        known.contradicts = against is not None
        known.known = self._told(answers) if complete and not self._put_off(answers) else None
        # Of some families no document prints a word that they answer, so that a refusal is all there is.
        known.spoke = any(answer.word is not None for answer in answers) or not _may_be_shown(self._profile)
        known.is_sure = against is None and known.known is not None and self._is_told(answers)
        if against is not None and judged:
            raise WrongDrive(Text(against, "; nothing was written to it"), unit=self._unit)

    def _compare(self, answers: Sequence[Answer], failure: NoAnswer | BadAnswer | PortError | None, known: str) -> None:
        """Raises where the unit does not say what is *known* of it any more."""
        unsaid = f"the port was opened again, and unit {self._unit} has not identified itself since"
        if failure is not None:
            # `started` stays None: of what was to follow, nothing left.
            raise type(failure)(
                f"{unsaid} ({failure}); nothing was written", unit=self._unit, raw=failure.raw
            ) from failure
        told = self._told(answers)
        if self._put_off(answers):
            raise WrongDrive(f"{unsaid} ({told}); nothing was written", unit=self._unit)
        if told != known:
            raise WrongDrive(
                f"another drive answers as unit {self._unit} since the port was opened again: its identification was "
                f"{known}, and is {told} now; nothing was sent. If that is right, ask for the drive anew: "
                f"bus.drive({self._unit})",
                unit=self._unit,
            )

    def _is_told(self, answers: Sequence[Answer]) -> bool:
        """Whether *answers* have the code of the family itself, or its whole signature."""
        code = [
            answer.word is not None and codes.is_own(self._profile, answer.address, answer.word)
            for answer in answers
            if answer.address in self._words
        ]
        if code:
            return all(code)
        return shows(self._profile, answers)

    async def contradiction(self, bus: AwaitableBus, *, urgent: bool = False) -> str | None:
        """What the unit says against its profile, and what to do; None if nothing. Asks it in any case."""
        answers: list[Answer] = []
        await self._ask(bus, answers, urgent)
        self._identity.heard = bus.now()
        against = contradiction(self._profile, self._unit, answers) or await self._other(bus, answers, urgent)
        if against is None and self._identity.known is None:
            self._identity.connection = bus.reconnects
            self._judge(answers, True, False, None)
        elif against is not None:
            self.is_another()
        return against

    async def _other(self, bus: AwaitableBus, answers: Sequence[Answer], urgent: bool) -> str | None:
        """What speaks against the profile where *answers* are strange: the signature of another family."""
        if any(map(passes, answers)) or not is_suspicious(self._profile, answers):
            return None
        told = [answer for answer in answers if not tells_nothing(self._profile, answer)]
        answered = {answer.address: answer.word is not None for answer in told}
        ask = asking(bus, urgent=urgent)
        return other_signature(self._profile, self._unit, await shown_by(ask, self._unit, answered))

    async def _ask(self, bus: AwaitableBus, answers: list[Answer], urgent: bool) -> None:
        """Adds the unit's answers to *answers* as they come, so that a failure of the line leaves the earlier ones."""
        for address in (*self._words, *self._probes):
            answers += [await self._answer(bus, address, urgent)]

    async def _answer(self, bus: AwaitableBus, address: int, urgent: bool) -> Answer:
        return await answer_once(asking(bus, urgent=urgent), self._unit, address)

    def _put_off(self, answers: Sequence[Answer]) -> bool:
        """Whether one of *answers* is a refusal that passes, so that it is not known yet what the unit is."""
        return any(tells_nothing(self._profile, answer) for answer in answers)

    def _told(self, answers: Sequence[Answer]) -> str:
        """The answers as they are compared with later ones: of a probe only that it was answered, and not with what."""
        told = {answer.address: self._shown(answer) for answer in answers}
        if len(told) == 1:
            return next(iter(told.values()))
        return ", ".join(f"{tables.shown(address)} {said}" for address, said in told.items())

    def _shown(self, answer: Answer) -> str:
        if answer.word is None:
            return f"refused with exception {answer.exception:02X}H"
        # Elsewhere any word may change, but for a code that gives another drive away.
        is_code = answer.address in self._words or codes.listed_at(answer.address, answer.word)
        return _hex(answer.word) if is_code else "answered"


def _questions(profile: Profile) -> tuple[Sequence[int], Sequence[int]]:
    """The addresses where a unit says what it is, and those of which counts whether it answers; either may be none."""
    address = codes.address_of(profile)
    if address is not None:
        return (address,), ()
    signature = signature_of(profile)
    if signature is not None:
        return (), (*signature["answers"], *signature["refuses"])
    # Whether it has the words that are always asked of its family is better than nothing.
    known = [profile.describe(name) for role in ("state", "fault") if (name := profile.role(role))]
    asked = [each.place for each in known if each.place is not None and each.evidence != "assumed"]
    # What the profile has there itself is no code.
    others = [address for address in codes.registers() if profile.name_at(address) is None]
    return (), (*others, *asked)


def _may_be_shown(profile: Profile) -> bool:
    """Whether there is a word by which a unit of *profile* shows what it is."""
    return codes.is_listed(profile) or signature_of(profile) is not None or profile.role("state") is not None


def _hex(code: int) -> str:
    return f"{code:04X}H"
