"""Writing registers and parameters of one unit by name: what is allowed, and where it is kept.

All checks come before the first write: names, ranges (also those that other parameters narrow), the state the drive
must be in, and evidence. What makes a motor turn is not written here: commands are refused, `Drive` has methods for
them.

What is sent is decided in the core (`crates/drive`); here are the names and values that go there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import overload

from drivebus import _native, checks
from drivebus.errors import BadArgument
from drivebus.operations import not_kept
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.in_parts import counted

__all__ = ["write"]


@overload
async def write(
    unit: DriveView, name: str, value: object, *, store: bool = False, unverified: bool = False
) -> None: ...
@overload
async def write(
    unit: DriveView, name: Mapping[str, object], *, store: bool = False, unverified: bool = False
) -> None: ...
async def write(
    unit: DriveView,
    name: str | Mapping[str, object],
    value: object = None,
    *,
    store: bool = False,
    unverified: bool = False,
) -> None:
    """Writes one value, or several from a mapping.

    Each goes out by a request of its own. Parameters with successive codes, in that order, share one (10H) where the
    documents of the family print that they may: `Profile.requests()["joined"]` has the page.

    A confirmation that was lost is cleared up by reading the value. Only where the drive shows another one is the
    write repeated, as often as the bus repeats a read. What does something when it is written (P00.15 tunes the
    motor) tells nothing by being read: it is sent once.

    Parameters go to RAM: they are lost when the drive is switched off. With *store* they go to EEPROM, whose
    write life is limited; one that already has its value is not written again. A drive tells the value in force,
    not where it is kept: what this object wrote to RAM is stored, what somebody else did is taken for stored.
    Where no way to write to RAM alone is known of the family, a parameter is written only with *store*.

    All checks come first: if one value is not allowed, none is sent. A range that another parameter narrows (P00.04
    is not above P00.03) is asked of the drive, in one go with its state; each of several values sees those before.

    Args:
        name: A register name or parameter code, or a mapping of them to values.
        value: In engineering units, or the label of a choice.
        store: Keep parameters in EEPROM. Registers are kept nowhere, and are written as they are.
        unverified: Also what is not verified for the family.

    Raises:
        NotAllowed: Unknown name, out of range, read-only, a command, not verified, or writable only while stopped
            and the drive runs; or another drive answers at this address since the port was opened again. Nothing
            was sent.
        NoAnswer, BadAnswer, PortError: The drive may have taken the value all the same, unless the error's
            `started` is None: then it was not sent.
        Refused: The drive kept what it had. Of parameters that shared a request it may have taken some: the error's
            note has what it shows.
        Unconfirmed: The drive shows another value, however often it was written.

    Where one of several fails, those before it were written: the error's `in_part` is true, and its note names them.
    """
    if not isinstance(name, (str, Mapping)):
        raise BadArgument(
            f"a name is a text, or a mapping of names to values, and {checks.shown(name)} is neither; nothing was sent",
            unit=unit.address,
        )
    store = checks.flag("store", store)
    wanted = name if isinstance(name, Mapping) else {name: value}
    if not isinstance(name, Mapping) and value is None:
        raise BadArgument(f'no value is given for "{name}"; say write("{name}", value)')
    for each in wanted:
        unit.profile.describe(each)  # whatever is no name is told so
    values = list(wanted.items())
    with counted(unit.trusting(unverified)) as view:
        kind, told = await call_core(view, lambda core: _native.Values(core).write(values, store))
        if kind != "done":
            done, *why = told
            error = not_kept.in_words(view, *why, store=store, given=wanted)
            raise not_kept.written_before(error, done)
