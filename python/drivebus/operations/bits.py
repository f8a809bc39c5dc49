"""Words whose bits are things of their own: terminals, and the special control word.

They are told and given by the names that the profile has for the bits. Words that can move a motor are sent once and
never repeated, under the checks of a command.
"""

from __future__ import annotations

from collections.abc import Mapping

from drivebus import checks
from drivebus.errors import NotAllowed
from drivebus.operations.commands import A_WORD
from drivebus.operations.motion import Motion
from drivebus.values import Description

__all__ = ["Terminals"]

_WORD = 16
_INPUTS, _OUTPUTS = "input_state", "output_state"
"""What the words of the terminals are called in every family that has them."""


class Terminals(Motion):
    """Terminals and other bits of one drive."""

    async def bits(self, name: str, *, unverified: bool = False) -> dict[str, str]:
        """What the bits of the word *name* say, such as `{"motor": "motor 1"}`; empty for a plain number.

        Raises:
            NotAllowed: Unknown name, or not verified; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        drive = self.trusting(unverified)
        return drive.profile.fields(name, await drive._word(name))

    async def inputs(self, *, unverified: bool = False) -> dict[str, bool]:
        """The digital inputs by the names at their terminals: whether each is on. Errors as for `bits`."""
        return await self.trusting(unverified)._terminals(_INPUTS)

    async def outputs(self, *, unverified: bool = False) -> dict[str, bool]:
        """The digital outputs by the names at their terminals: whether each is on. Errors as for `bits`."""
        return await self.trusting(unverified)._terminals(_OUTPUTS)

    async def set_virtual_inputs(self, /, *, unverified: bool = False, force: bool = False, **terminals: bool) -> None:
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
        await self.trusting(unverified)._set_bits("virtual_inputs", terminals, force)

    async def set_virtual_outputs(self, /, *, unverified: bool = False, force: bool = False, **terminals: bool) -> None:
        """Sets outputs that the bus commands: `set_virtual_outputs(RO1=True)`. Otherwise as `set_virtual_inputs`."""
        await self.trusting(unverified)._set_bits("virtual_outputs", terminals, force)

    async def special_control(
        self, /, *, unverified: bool = False, force: bool = False, **fields: bool | int | str
    ) -> None:
        """Writes fields of the special control word: `special_control(motor=2, pre_excitation=True)`.

        A field takes True or False, a label that the profile has for it, or a number: that of its label ("motor 2"), or
        else its raw value. Otherwise as `set_virtual_inputs`.
        """
        await self.trusting(unverified)._set_bits("special_control", fields, force)

    async def _word(self, name: str) -> int:
        self._evidence.reads([name])
        [word] = await self.read_words(self.profile.address(name))
        return word

    async def _terminals(self, name: str) -> dict[str, bool]:
        try:
            self.profile.describe(name)
        except NotAllowed:
            raise NotAllowed(
                f"no {name.replace('_', ' ')} word of {self.profile.title} is known; unit {self.unit} was not asked",
                unit=self.unit,
            ) from None
        word = await self._word(name)
        return {field: bool(word & mask) for field, mask in self._masks(name).items()}

    async def _set_bits(self, setpoint: str, given: Mapping[str, object], force: bool) -> None:
        register = self._setpoint_register(setpoint)
        self._evidence.writes(register)
        known, masks = self.profile.describe(register), self._masks(register)
        if not given:
            raise NotAllowed(f"nothing to set was named; {register} has {', '.join(masks) or 'no bits that are known'}")
        wanted = [
            (masks[checks.one_of(f"bit of {register}", name, list(masks))], _bits(known, name, value))
            for name, value in given.items()
        ]
        for name in given:
            if name in known.unverified_bits:
                self._evidence.rule(f"where {name} is in {register} of {self.profile.title}", known.note)
        moves = self.profile.is_command(self.profile.address(register))
        if moves:
            self._check_it_can_be_stopped()
            await self._prove_link(checks.flag("force", force))
            # These words stand in for terminals, so the drive need not take its commands from the bus.
            await self._ready_to_start(by_bus=False)
        await self._check_heeded(setpoint, register)
        # What can only be written tells nothing: there, what is not named is off.
        word = 0 if known.access == "wo" else await self._word(register)
        for mask, value in wanted:
            word = (word & ~mask) | (value * (mask & -mask) & mask)
        address = self.profile.address(register)
        if not moves:
            await self._write(address, word, read_back=self.profile.read_back(register))
            return
        self._ventured.update([register] if self.unverified else [])
        await self._send_once(A_WORD, address, word)

    def _masks(self, name: str) -> dict[str, int]:
        """The bits of each field of the word *name*."""
        nothing = self.profile.fields(name, 0)
        masks = dict.fromkeys(nothing, 0)
        for bit in range(_WORD):
            told = self.profile.fields(name, 1 << bit)
            for field in masks:
                masks[field] |= (told[field] != nothing[field]) << bit
        return masks


def _bits(known: Description, name: str, value: object) -> int:
    """*value* as the bits of the field *name*."""
    choices = (known.bits or {}).get(name) or {0: "off", 1: "on"}
    numbers = {label: number for number, label in choices.items()}
    if isinstance(value, bool):
        if len(choices) == 2:
            return int(value)
    elif isinstance(value, str):
        if value in numbers:
            return numbers[value]
    elif isinstance(value, int):
        called = numbers.get(f"{name} {value}", value)
        if called in choices:
            return called
    allowed = ", ".join(f"{number} = {label}" for number, label in choices.items())
    raise NotAllowed(f"{name} {value!r} is nothing that {known.name} can be; allowed is {allowed}")
