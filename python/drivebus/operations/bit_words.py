"""Words whose bits are things of their own: terminals, and the special control word.

They are told and given by the names that the profile has for the bits. Words that can move a motor are sent once and
never repeated, under the checks of a command.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivebus import _native, checks
from drivebus.errors import BadArgument, DrivebusError, NotAllowed
from drivebus.operations import bus_control, not_commanded, not_ready, not_written, setpoints
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import read_words
from drivebus.profile.evidence import refusal_of

__all__ = ["bits", "inputs", "outputs", "set_virtual_inputs", "set_virtual_outputs", "special_control"]

_WORD = 16
_INPUTS, _OUTPUTS = "input_state", "output_state"
"""What the words of the terminals are called in every family that has them."""


async def bits(unit: DriveView, name: str, *, unverified: bool = False) -> dict[str, str]:
    """The bit fields of the word *name*, such as `{"motor": "motor 1"}`; empty for a plain number.

    Raises:
        NotAllowed: Unknown name, or not verified; nothing was sent.
        NoAnswer, BadAnswer, Refused: See each.
    """
    unit = unit.trusting(unverified)
    return unit.profile.fields(name, await _word(unit, name))


async def inputs(unit: DriveView, *, unverified: bool = False) -> dict[str, bool]:
    """The digital inputs by the names of their terminals: True if on. Errors as for `bits`."""
    return await _terminals(unit.trusting(unverified), _INPUTS)


async def outputs(unit: DriveView, *, unverified: bool = False) -> dict[str, bool]:
    """The digital outputs by the names of their terminals: True if on. Errors as for `bits`."""
    return await _terminals(unit.trusting(unverified), _OUTPUTS)


async def set_virtual_inputs(
    unit: DriveView, /, *, unverified: bool = False, force: bool = False, **terminals: bool
) -> None:
    """Sets inputs that the bus gives in the place of terminals: `set_virtual_inputs(S1=True)`.

    What is not named keeps what the drive says it has; where the word can only be written, it is off. What an input
    does is set in the drive: it may start a motor. Sent once. The drive takes its commands from the terminals then,
    so it need not obey the bus.

    Args:
        terminals: On or off for each name.
        unverified: Also where that is not verified for the family.
        force: Over a bad link too, as for `run`.

    Raises:
        NotAllowed: No such input, the drive is in fault or would not heed it, the link is bad, or it is not
            verified. Nothing was sent.
        NoAnswer, BadAnswer, PortError, Refused: Before it was sent, or the drive did not take it.
        Unconfirmed: It was sent, and nothing is known of it: the motor may turn.
    """
    await _set_bits(unit.trusting(unverified), "virtual_inputs", terminals, force)


async def set_virtual_outputs(
    unit: DriveView, /, *, unverified: bool = False, force: bool = False, **terminals: bool
) -> None:
    """Sets outputs that the bus commands: `set_virtual_outputs(RO1=True)`. Otherwise as `set_virtual_inputs`."""
    await _set_bits(unit.trusting(unverified), "virtual_outputs", terminals, force)


async def special_control(
    unit: DriveView, /, *, unverified: bool = False, force: bool = False, **fields: bool | int | str
) -> None:
    """Writes fields of the special control word: `special_control(motor=2, pre_excitation=True)`.

    A field takes True or False, a label that the profile has for it, or a number: that of its label ("motor 2"), or
    else its raw value. Otherwise as `set_virtual_inputs`.
    """
    await _set_bits(unit.trusting(unverified), "special_control", fields, force)


async def _word(unit: DriveView, name: str) -> int:
    unit.evidence.require_readable([name])
    [word] = await read_words(unit, unit.profile.address(name))
    return word


async def _terminals(unit: DriveView, name: str) -> dict[str, bool]:
    try:
        unit.profile.describe(name)
    except NotAllowed:
        raise BadArgument(
            f"no {name.replace('_', ' ')} word of {unit.profile.title} is known; unit {unit.address} was not asked",
            unit=unit.address,
        ) from None
    word = await _word(unit, name)
    return {field: bool(word & mask) for field, mask in _masks(unit, name).items()}


async def _set_bits(unit: DriveView, setpoint: str, given: Mapping[str, object], force: bool) -> None:
    setpoints.register_of(unit, setpoint)
    force = checks.flag("force", force)
    fields = [(name, _plain(value)) for name, value in given.items()]
    kind, told = await call_core(unit, lambda core: _native.Values(core).set_bits(setpoint, fields, force))
    if kind == "not_commanded":
        raise not_commanded.in_words(unit, *told, confirm=0.0)
    if kind != "done":
        raise _not_set(unit, setpoint, given, *told)


def _plain(value: object) -> bool | int | str:
    """*value*, or the text of what no field can be."""
    is_plain = isinstance(value, (bool, str)) or (isinstance(value, int) and 0 <= value <= 0xFFFF)
    return value if is_plain else repr(value)  # type: ignore[return-value]


def _not_set(unit: DriveView, setpoint: str, given: Mapping[str, object], kind: str, told: Any) -> DrivebusError:
    """Why bits were not set: of *kind*, and what is *told* of it, as `_native.Values.set_bits` has it."""
    register = setpoints.register_of(unit, setpoint)
    if kind == "not_ready":
        return not_ready.in_words(unit, None, *told)
    if kind == "not_written":
        return not_written.in_words(unit, *told)
    if kind == "ignored":
        return bus_control.ignored(unit, setpoint, register, told)
    if kind == "unfit":
        name, choices = told
        allowed = ", ".join(f"{number} = {label}" for number, label in choices.items())
        return BadArgument(f"{name} is {checks.shown(given[name])}, which {register} cannot be; allowed is {allowed}")
    if kind == "no_field":
        return refusal_of(checks.one_of, f"bit of {register}", *told)
    if kind == "unproved":
        return refusal_of(unit.evidence.require_bits, register, told)
    if kind == "unreadable":
        return refusal_of(unit.evidence.require_readable, [register])
    if kind == "may_not":
        return refusal_of(unit.evidence.require_writable, register)
    known = ", ".join(unit.profile.fields(register, 0)) or "no bits that are known"
    return BadArgument(f"nothing to set was named; {register} has {known}")


def _masks(unit: DriveView, name: str) -> dict[str, int]:
    """The bits of each field of the word *name*."""
    nothing = unit.profile.fields(name, 0)
    masks = dict.fromkeys(nothing, 0)
    for bit in range(_WORD):
        told = unit.profile.fields(name, 1 << bit)
        for field in masks:
            masks[field] |= (told[field] != nothing[field]) << bit
    return masks
