"""One request as it goes out: a unit and a PDU, what they may be, and whether they change anything in the unit."""

from __future__ import annotations

from dataclasses import dataclass

import drivebus
from drivebus import tables
from drivebus.cli import names
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.wrong_use import WrongUse
from drivebus.line.addresses import Addresses
from drivebus.line.meaning import meaning
from drivebus.rtu import framed

__all__ = ["Request", "check_commands", "request_of"]

_DIAGNOSTICS = 0x08
"""Of this function some change the state of the unit's own port, and none a word of it."""


@dataclass(frozen=True)
class Request:
    """What is asked of one unit.

    Attributes:
        unit: Its address.
        pdu: Function code and data, 1..253 bytes.
    """

    unit: int
    pdu: bytes

    @property
    def body(self) -> bytes:
        """Unit and PDU: the frame without its CRC."""
        return bytes([self.unit]) + self.pdu

    @property
    def writes(self) -> bool:
        """Whether it can change a word of the unit, and so move its motor."""
        return self.pdu[0] != _DIAGNOSTICS and not self.only_looks

    @property
    def only_looks(self) -> bool:
        """Whether it changes nothing at all, the state of the unit's own port included."""
        return not drivebus.rtu.is_write(self.pdu)

    def text(self) -> str:
        """Its bytes, as people type them."""
        return self.body.hex(" ").upper()

    def meaning(self, profile: drivebus.Profile | None) -> str:
        """What it asks for, in words; with the names of *profile*, if the family is known."""
        return meaning(framed(self.body), True, None, profile).partition(": ")[2]


def request_of(parts: tuple[str, ...], force: bool, addresses: Addresses) -> Request:
    """The request in hexadecimal *parts*. With *force*, the last two bytes may look like its CRC.

    Raises:
        click.UsageError: It is no request, or the line has other *addresses*.
        NotAllowed: It may change something in all units behind a gateway.
    """
    body = names.parse_hex(parts)
    if not 2 <= len(body) <= 254:
        raise WrongUse(
            f"{len(body)} {'byte is' if len(body) == 1 else 'bytes are'} not a request; give the unit, then 1 to 253 "
            "bytes of PDU, and no CRC"
        )
    why = addresses.why_not(body[0])
    if why:
        raise WrongUse(
            f"no unit {body[0]:02X} answers; the first byte is the unit, 01 to F7. Unit {body[0]}: {in_commands(why)}"
        )
    addresses.unit(body[0], changes=not drivebus.rtu.only_reads(body[1:]))
    if not force and len(body) > 4 and framed(body[:-2]) == body:
        asked = body[:-2].hex(" ").upper()
        raise WrongUse(f"the last two bytes are the CRC of the others, and it is added; give {asked}")
    return Request(body[0], body[1:])


def check_commands(request: Request) -> None:
    """Raises `NotAllowed` where *request* writes to a command register a code that no family with that register has.

    What the unit is, nobody has said; what the code cannot mean is known all the same.
    """
    written = drivebus.rtu.may_write(request.pdu)
    if not written:
        return
    families = [drivebus.Profile.builtin(name) for name in drivebus.profiles()]
    for address, word in (place for first, words in written for place in enumerate(words, first)):
        there = [family for family in families if address in family.command_registers()]
        if there and not any(word in family.command_registers()[address] for family in there):
            raise drivebus.BadArgument(
                f"{word} at {tables.shown(address)} is not a command of any family that has its command register there "
                f"({', '.join(family.name for family in there)}); nothing was sent to unit {request.unit}. With "
                "--profile the family is known; --force sends it anyway"
            )
