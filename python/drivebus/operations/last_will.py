"""The last will of a program: what halts a unit that it runs, left with whoever has the port.

A program that is killed tells nobody to stop. What it left says it for it, before anything else goes there. Whoever
carries it out halts the unit as `Halt` does: as the family that the unit shows, and with a proof. Where no shipped
family was named, or a program does so that knows none, the frames of the will are sent as they are.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TypeAlias

from drivebus import _native, tables
from drivebus._native import encode_write
from drivebus.identify import codes
from drivebus.identify.contradiction import contradiction
from drivebus.identify.refusals import Answer
from drivebus.line.protocols import KeepsWills
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile
from drivebus.profile.profile import native_of

__all__ = ["WAYS", "LastWill", "Named", "look_of", "named_as", "requests_of"]

_READ = {"coil": 0x01, "discrete": 0x02, "holding": 0x03, "input": 0x04}
_WRITE_COIL = 0x05
_ANY = 1
"""Some unit: a PDU does not say which."""

WAYS = ("stop", "coast")
"""What halts a motor, a jog included: the first of them first."""


Named: TypeAlias = tuple[_native.Profile, list[str], bool, bool]
"""As what a unit was named: its profile, the commands that halt it, whether that family is meant whatever the unit
says, and whether what is not verified is done all the same."""


class LastWill:
    """What halts one unit, left and taken back.

    Args:
        unit: The unit, with the trust of what runs it.
        silence: The drive's own time-out in seconds, where one was set.
        first: What is tried first, `"stop"` or `"coast"`.
    """

    def __init__(self, unit: DriveView, silence: float = 0.0, first: str = "stop") -> None:
        self._unit = unit
        self._silence = silence
        self._ways = sorted(WAYS, key=lambda way: way != first)
        self._number: int | None = None

    def leave(self) -> None:
        """Leaves it, before what it is for."""
        line, unit = self._unit.bus.line, self._unit
        # Somebody's own bus may know of no such thing.
        if self._number is None and isinstance(line, KeepsWills):
            usable = [way for way in self._ways if unit.evidence.unusable(way) is None]
            ways = [requests_of(unit.profile, way) for way in usable]
            if ways:
                look = None if unit.identity.trusted else look_of(unit.profile)
                named = named_as(unit, usable)
                self._number = line.leave_will(unit.address, ways, look=look, silence=self._silence, named=named)

    def unsure(self) -> str:
        """Why the unit may run on when this program is gone, though it acts by itself when it hears nothing."""
        line, unit = self._unit.bus.line, f"unit {self._unit.address}"
        port = line.port if isinstance(line, KeepsWills) else ""
        if port.startswith("sim:"):
            return ""
        feeds = f"each request of anybody else keeps {unit} from acting by itself"
        if self._number is None:
            return f"{feeds}, and nobody halts it when this program is gone"
        if port.startswith("socket:"):
            return f"{feeds}, and other computers may use this serial server"
        return ""

    def withdraw(self) -> None:
        """Takes it back: it is not needed any more."""
        line, number = self._unit.bus.line, self._number
        self._number = None
        if number is not None and isinstance(line, KeepsWills):
            line.withdraw_will(number)


def named_as(unit: DriveView, commands: Sequence[str]) -> Named:
    """As what *unit* is halted by *commands*."""
    return native_of(unit.profile), list(commands), unit.identity.trusted, unit.unverified


def requests_of(profile: Profile, command: str) -> list[bytes]:
    """The PDUs of *command*, as it is sent."""
    first = profile.command_first(command)
    return [_write(profile, *each) for each in (first, profile.command(command)) if each is not None]


def _write(profile: Profile, place: int, word: int) -> bytes:
    table, address = tables.split(place)
    if table == "coil":
        return bytes([_WRITE_COIL]) + address.to_bytes(2, "big") + (b"\xff\0" if word else b"\0\0")
    return _pdu(encode_write(_ANY, address, [word] if native_of(profile).is_written_by_many else word))


def _pdu(frame: bytes) -> bytes:
    """What of *frame* says what is meant, and neither to whom nor whether it came whole."""
    return frame[1:-2]


@functools.lru_cache(maxsize=16)
def look_of(profile: Profile) -> tuple[bytes, tuple[bytes, ...]] | None:
    """The read by which a unit says what it is, and the answers of units of other families; None if there is none."""
    own = codes.address_of(profile)
    at = next(iter(codes.registers()), None) if own is None else own
    if at is None or (own is None and profile.name_at(at) is not None):
        return None
    table, address = tables.split(at)
    function = _READ[table]
    others = [code for code in codes.all_listed() if contradiction(profile, 1, [Answer(at, code, None)]) is not None]
    question = bytes([function]) + address.to_bytes(2, "big") + b"\0\1"
    return question, tuple(bytes([function, 2]) + code.to_bytes(2, "big") for code in others)
