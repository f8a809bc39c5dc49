"""Whether the unit at an address is still the one it was.

A port that was lost and opened again may be another one: an adapter plugged in elsewhere, a cable moved to another
machine, where the same address is another drive. So what the unit says of itself is asked again before anything goes
out that moves a motor or changes a value. A stop does not wait for it.

Families that have an identification code are known by it, and others by which words they answer and which they refuse:
also by what they say where other families have such a code, for that is how one of those gives itself away.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivebus.errors import LINE_ERRORS, NotAllowed, Refused
from drivebus.identify import code_registers
from drivebus.protocols import AwaitableBus, ProfileProtocol

__all__ = ["Identity"]


class Identity:
    """What one unit says it is, and since when that is known.

    Args:
        bus: The line it hangs on; only for how often that was opened again.
        unit: Its address, 1..247.
        profile: Where its family says what it is.
        code: What it said, if it was asked before.
    """

    def __init__(self, bus: AwaitableBus, unit: int, profile: ProfileProtocol, code: int | None = None) -> None:
        self._unit = unit
        self._words, self._probes = _questions(profile)
        self._known = None if code is None else _named(code)
        self._opened = bus.reconnects

    async def check(self, bus: AwaitableBus) -> int:
        """Asks the unit over *bus* what it is, if the port was opened again or nobody has asked yet.

        A unit that refuses to tell is known by that. One that stays silent is not known, and is asked the next time.

        Returns:
            The connection for which that holds: what is sent on it goes to the unit that was asked.

        Raises:
            NotAllowed: Another unit answers at this address now.
            NoAnswer, BadAnswer, PortError: It was asked again, and did not tell. What was to follow was not sent.
        """
        opened = bus.reconnects
        if self._known is not None and opened == self._opened:
            return opened
        try:
            told = await self._ask(bus)
        except LINE_ERRORS as error:
            if self._known is None:
                return opened
            # `started` stays None: of what was to follow, nothing left.
            raise type(error)(
                f"the port was opened again, and unit {self._unit} did not say what it is before anything is written "
                f"to it ({error}); nothing was written",
                unit=self._unit,
                raw=error.raw,
            ) from error
        if self._known is None:
            self._known = told
        elif told != self._known:
            raise NotAllowed(
                f"another drive answers as unit {self._unit} since the port was opened again: its identification was "
                f"{self._known}, and is {told} now; nothing was sent. If that is right, ask for the drive anew: "
                f"bus.drive({self._unit})",
                unit=self._unit,
            )
        self._opened = opened
        return opened

    async def _ask(self, bus: AwaitableBus) -> str:
        answers = [(address, await self._answer(bus, address)) for address in self._probes]
        answers += [(address, await self._answer(bus, address, word=True)) for address in self._words]
        if len(answers) == 1:
            return answers[0][1]
        return ", ".join(f"{_named(address)} {told}" for address, told in answers)

    async def _answer(self, bus: AwaitableBus, address: int, *, word: bool = False) -> str:
        """How the unit answered at *address*: that it did, or which *word* it said, or how it refused to."""
        try:
            [told] = await bus.read(self._unit, address)
        except Refused as error:
            return f"refused with exception {error.code:02X}H"
        return _named(told) if word else "answered"


def _questions(profile: ProfileProtocol) -> tuple[Sequence[int], Sequence[int]]:
    """Where a unit says what it is, and words of which it counts whether it answers: either may be none."""
    register = profile.role("identification")
    address = None if register is None else profile.describe(register).address
    if address is not None:
        return (address,), ()
    signature = profile.signature()
    if signature is not None:
        return (), (*signature["answers"], *signature["refuses"])
    # Whether it has the words that are always asked of its family is better than nothing.
    known = [profile.describe(name) for role in ("state", "fault") if (name := profile.role(role))]
    asked = [each.address for each in known if each.address is not None and each.evidence != "assumed"]
    return code_registers(), asked


def _named(code: int) -> str:
    return f"{code:04X}H"
