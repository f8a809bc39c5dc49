"""The stop of all drives of a line, side by side: which of them were proved to stop, in words.

In which order they are told and looked at is decided in the core (`crates/drive`).
"""

from __future__ import annotations

from collections.abc import Iterable

from drivebus import checks
from drivebus.errors import BadArgument, DrivebusError, NotStopped
from drivebus.operations import motion
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import WITHIN, Halt, halt_all

__all__ = ["stop_all"]

_STOP = "stop"


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
    came = await halt_all([Halt(motion.halting(unit, _STOP), _STOP, confirm, within) for unit in trusted])
    failures = {unit.address: error for unit, error in zip(trusted, came, strict=True) if error is not None}
    if failures:
        raise _not_stopped(len(trusted), failures)
    return [unit.address for unit in trusted]


def _not_stopped(count: int, failures: dict[int, DrivebusError]) -> NotStopped:
    whom = ", ".join(str(address) for address in failures)
    reasons = "; ".join(str(error) for error in failures.values())
    return NotStopped(
        f"{count - len(failures)} of {count} drives were proved to stop; not proved: unit{'s' * (len(failures) > 1)} "
        f"{whom}. {reasons}",
        failures=failures,
    )
