"""Whether the unit at an address is still the one it was.

A port that was lost and opened again may be another one: an adapter plugged in elsewhere, a cable moved to another
machine, where the same address is another drive. So what the unit says of itself is asked again before anything goes
out that moves a motor or changes a value. A stop does not wait for it.
"""

from __future__ import annotations

from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, PortError, Refused
from drivebus.protocols import AwaitableBus

__all__ = ["Identity"]


class Identity:
    """What one unit says it is, and since when that is known.

    Args:
        bus: The line it hangs on; only for how often that was opened again.
        unit: Its address, 1..247.
        address: Where it says what it is; None where that is not known, and it is not asked.
        code: What it said, if it was asked before.
    """

    def __init__(self, bus: AwaitableBus, unit: int, address: int | None, code: int | None = None) -> None:
        self._unit = unit
        self._address = address
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
        address = self._address
        if address is None or (self._known is not None and opened == self._opened):
            return opened
        try:
            told = await self._ask(bus, address)
        except (NoAnswer, BadAnswer, PortError) as error:
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

    async def _ask(self, bus: AwaitableBus, address: int) -> str:
        try:
            [code] = await bus.read(self._unit, address)
        except Refused as error:
            return f"refused with exception {error.code:02X}H"
        return _named(code)


def _named(code: int) -> str:
    return f"{code:04X}H"
