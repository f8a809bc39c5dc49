"""The words of one unit by address: read and written as they are, with refusals in the words of its family."""

from __future__ import annotations

from collections.abc import Sequence

from drivebus import checks
from drivebus.line.write_guard import check_words
from drivebus.operations import not_written
from drivebus.operations.by_name import by_name
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import read_words
from drivebus.values import State

__all__ = ["read_words", "write", "write_words"]


@by_name("force", after=2)
async def write_words(unit: DriveView, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
    """Writes one word (an int: 06H, or 10H where there is no 06H) or several (a sequence: 10H), as they are. Sent once.

    As `Bus.write`, but another drive that answers at this address gets nothing, and a refusal says what this family
    means by it. A word in the command register moves the motor.

    Args:
        address: 0..0xFFFF, with the bit for RAM or EEPROM where the family has one.
        value: Words of 0..0xFFFF.
        force: Also a command that the family does not define.

    Raises:
        NotAllowed: Out of range, or such a command; or another drive answers at this address since the port was
            opened again. Nothing was sent.
        NoAnswer, BadAnswer, PortError: The drive may have taken it, unless the error's `started` is None.
        Refused: The drive did not take it. An exception by which it says that it took it and is at it is none.
    """
    address, words = checks.address(address), checks.payload(value)
    if not checks.flag("force", force):
        check_words([unit.profile], unit.address, address, words)
    if unit.profile.is_command(address):
        unit.record.sent.started_as = State.UNKNOWN.value
    await write(unit, address, words, force=force)


async def write(
    unit: DriveView,
    address: int,
    value: int | Sequence[int],
    *,
    read_back: int | None = None,
    force: bool = False,
    absolute: bool = False,
) -> None:
    """Writes to the unit, if it still is the one it was and does not say it is another.

    An *absolute* value is no command: where the drive says that it is busy or got the request damaged, so that it did
    not take it, it is sent again. With *read_back* the bus does that, and looks first.
    """
    kind, told = await call_core(unit, lambda core: core.write(address, value, read_back, absolute, force))
    if kind != "done":
        raise not_written.in_words(unit, *told)
