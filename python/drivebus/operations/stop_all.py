"""The stop of all drives of a line: first every stop goes out, then each is sent until it is taken, and proved.

Nothing is sent to all units at once: the code that stops one family means something else to another. So each drive gets
its own. Those that answered last time come first, so that a silent one keeps none of them waiting.
"""

from __future__ import annotations

from collections.abc import Iterable

from drivebus import checks
from drivebus.errors import BadArgument, DrivebusError, NotStopped
from drivebus.operations import motion
from drivebus.operations.aim import goes_out_at_once
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import WITHIN, Halt

__all__ = ["stop_all"]

_STOP = "stop"


class _Stop:
    """One drive on its way to its proved stop."""

    def __init__(self, unit: DriveView, confirm: float, within: float) -> None:
        self.address = unit.address
        self.failure: DrivebusError | None = None
        self.halt = Halt(motion.halting(unit, _STOP), _STOP, confirm, within)

    async def advance(self) -> bool:
        """Does the next thing. Whether nothing is left to be done."""
        try:
            return await self.halt.advance()
        except DrivebusError as error:
            self.failure = error
            return True


async def stop_all(
    units: Iterable[DriveView], *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False
) -> list[int]:
    """Stops *units*, which hang on one line, and returns their addresses. See `drivebus.Bus.stop_all`."""
    confirm = checks.number("confirm", confirm, 0.0, 3600.0)
    within = checks.number("within", within, 0.0, 3600.0)
    trusted = [unit.trusting(unverified) for unit in units]
    if not trusted:
        raise BadArgument(
            "no drive is known on this bus, so nobody was told to stop: ask for each with drive(unit) first. "
            "If a motor must stop now, use the emergency stop"
        )
    bus = trusted[0].bus
    links = [await bus.link(unit.address) for unit in trusted]
    # Who is silent, or has to be asked first what it is, keeps nobody waiting.
    later = [
        (link.asked > 0 and link.good == 0, not goes_out_at_once(unit, _STOP))
        for link, unit in zip(links, trusted, strict=True)
    ]
    stops = [_Stop(unit, confirm, within) for unit in trusted]
    pending = [stop for stop, _ in sorted(zip(stops, later, strict=True), key=lambda each: each[1])]
    while pending:
        for stop in list(pending):
            began = bus.now()
            if await stop.advance():
                pending.remove(stop)
            took = bus.now() - began
            for other in pending:
                if other is not stop:
                    other.halt.wait(took)
        if pending:
            await bus.sleep(min(stop.halt.pause for stop in pending))
    failures = {stop.address: stop.failure for stop in stops if stop.failure is not None}
    if failures:
        raise _not_stopped(len(stops), failures)
    return [stop.address for stop in stops]


def _not_stopped(count: int, failures: dict[int, DrivebusError]) -> NotStopped:
    whom = ", ".join(str(address) for address in failures)
    reasons = "; ".join(str(error) for error in failures.values())
    return NotStopped(
        f"{count - len(failures)} of {count} drives were proved to stop; not proved: unit{'s' * (len(failures) > 1)} "
        f"{whom}. {reasons}",
        failures=failures,
    )
