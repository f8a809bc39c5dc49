"""The stop of all drives of a line: first every stop goes out, then each is proved.

Nothing is sent to all units at once: the code that stops one family means something else to another. So each drive gets
its own. Those that answered last time come first, so that a silent one keeps none of them waiting.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from drivebus import checks
from drivebus.errors import LINE_ERRORS, DrivebusError, NotAllowed, NotStopped
from drivebus.operations import commands, halts, motion, words
from drivebus.operations.unit import Unit

__all__ = ["stop_all"]

_STOP = "stop"


@dataclass(slots=True)
class _Told:
    """One drive, and what became of its stop."""

    unit: Unit
    sent: float = 0.0
    confirmed: float = 0.0
    failure: DrivebusError | None = None


async def stop_all(units: Iterable[Unit], *, confirm: float = 1.0, unverified: bool = False) -> list[int]:
    """Stops *units*, which hang on one line, and returns their addresses. See `drivebus.Bus.stop_all`."""
    confirm = checks.number("confirm", confirm, 0.0, 3600.0)
    all_told = [_Told(motion.halting(unit.trusting(unverified), _STOP)) for unit in units]
    if not all_told:
        raise NotAllowed(
            "no drive is known on this bus, so nobody was told to stop: ask for each with drive(unit) first. "
            "If a motor must stop now, use the emergency stop"
        )
    links = [await one.unit.bus.link(one.unit.address) for one in all_told]
    is_deaf = [link.asked > 0 and link.good == 0 for link in links]
    for one, _ in sorted(zip(all_told, is_deaf, strict=True), key=lambda each: each[1]):
        await _tell(one)
    await _prove([one for one in all_told if one.failure is None], confirm)
    failures: dict[int, DrivebusError] = {}
    for one in all_told:
        failure = one.failure
        if isinstance(failure, LINE_ERRORS):
            # Only now: this asks a unit that gave no answer for its state.
            failure = await commands.explained(one.unit, _STOP, failure)
        if failure is not None:
            failures[one.unit.address] = failure
    if failures:
        raise _not_stopped(len(all_told), failures)
    return [one.unit.address for one in all_told]


async def _tell(one: _Told) -> None:
    """Sends one drive its stop, once; what comes of it is looked at later."""
    unit = one.unit
    one.sent = unit.bus.now()
    try:
        unit.evidence.commands(_STOP)
        halts.begin(unit)
        await words.send(unit, *unit.profile.command(_STOP), urgent=True)
        unit.memory.halts += 1
    except DrivebusError as error:
        unit.memory.halts += error.started is not None
        one.failure = error
    one.confirmed = unit.bus.now()


async def _prove(told: Iterable[_Told], within: float) -> None:
    """Looks at each in turn until all have shown that they stop, or are not worth another look."""
    pending = [(one, motion.proof_of_halt(one.unit, _STOP, one.sent, one.confirmed, within)) for one in told]
    while pending:
        for one, proof in list(pending):
            began = one.unit.bus.now()
            try:
                proved = await proof.look()
            except DrivebusError as error:
                one.failure, proved = error, True
            if proved:
                pending.remove((one, proof))
            took = one.unit.bus.now() - began
            for _, other in pending:
                if other is not proof:
                    other.wait(took)
        if pending:
            await pending[0][0].unit.bus.sleep(commands.POLL_INTERVAL)


def _not_stopped(count: int, failures: dict[int, DrivebusError]) -> NotStopped:
    whom = ", ".join(str(address) for address in failures)
    reasons = "; ".join(str(error) for error in failures.values())
    return NotStopped(
        f"{count - len(failures)} of {count} drives were proved to stop; not proved: unit{'s' * (len(failures) > 1)} "
        f"{whom}. {reasons}",
        failures=failures,
    )
