"""What both faces of a drive are made of: the view of its unit, and the operations as methods over it."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from drivebus.line.blocking import at_once
from drivebus.line.protocols import AwaitableBus
from drivebus.line.units import units_of
from drivebus.operations import registers
from drivebus.operations.drive_view import DriveView
from drivebus.plain_annotations import plain_annotations
from drivebus.profile import Profile

if TYPE_CHECKING:
    from drivebus.values import Description, Value

__all__ = ["DriveFace", "awaited", "blocking", "documented_by", "unit_of", "views"]

_P = ParamSpec("_P")
_R = TypeVar("_R")
_F = TypeVar("_F", bound=Callable[..., object])


class DriveFace:
    """A drive, as far as nothing has to be waited for.

    Attributes:
        unit: Its address, 1..247.
        profile: What its words mean.
        unverified: Whether what no document of its family proves is done all the same, in every call.
    """

    unit: int
    profile: Profile

    def __init__(self, unit: DriveView) -> None:
        self.unit = unit.address
        self.profile = unit.profile
        self._unit = unit

    def __repr__(self) -> str:
        return f"<Drive {self.unit}: {self.profile.name}{', unverified' if self.unverified else ''}>"

    def __eq__(self, other: object) -> bool:
        """Whether *other* is a handle of the same unit, in the words of the same family."""
        if not isinstance(other, DriveFace):
            return NotImplemented
        return self._unit.record is other._unit.record and self.profile.name == other.profile.name

    def __hash__(self) -> int:
        return hash((id(self._unit.record), self.profile.name))

    @property
    def unverified(self) -> bool:
        """Whether what no document of its family proves is done all the same, in every call."""
        return self._unit.unverified

    def readable(self, *names: str) -> list[str]:
        """Returns *names*, or without any the monitor registers of the family that may be read. Nothing is sent.

        Raises:
            NotAllowed: An unknown name, one that is not verified, or one whose meaning a parameter of the drive decides
                (`variants` of `bus.drive` says which).
        """
        return registers.readable(self._unit, *names)

    def describe(self, name: str) -> Description:
        """All that is known of a register or parameter. Nothing is sent.

        Raises:
            NotAllowed: Unknown name; the message has the closest.
        """
        return self._unit.profile.describe(name)

    def value(self, name: str, raw: int) -> Value:
        """Returns the word *raw* of *name* in engineering units."""
        return registers.value(self._unit, name, raw)


def unit_of(drive: DriveFace) -> DriveView:
    """The view of its unit on which a drive's methods work."""
    return drive._unit


def views(bus: AwaitableBus) -> list[DriveView]:
    """The units of *bus* that a drive was asked for: as who started each last sees it, with what trust it ever had."""
    seen = []
    for record in units_of(bus.line).named():
        profile = record.profile
        if profile is not None:
            trusted = profile.name in record.trusted or record.started_unverified
            seen.append(DriveView.create(bus, record.address, profile, None, unverified=trusted, trust_profile=False))
    return seen


def blocking(
    operation: Callable[Concatenate[DriveView, _P], Coroutine[Any, Any, _R]],
) -> Callable[Concatenate[Any, _P], _R]:
    """The method that carries *operation* out at once, with its name, its signature and its docstring."""

    @functools.wraps(operation)
    def method(drive: DriveFace, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        return at_once(operation(drive._unit, *args, **kwargs))

    return _as_of_a_drive(method)


def awaited(
    operation: Callable[Concatenate[DriveView, _P], Coroutine[Any, Any, _R]],
) -> Callable[Concatenate[Any, _P], Coroutine[None, None, _R]]:
    """The method that awaits *operation*, with its name, its signature and its docstring."""

    @functools.wraps(operation)
    async def method(drive: DriveFace, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        return await operation(drive._unit, *args, **kwargs)

    return _as_of_a_drive(method)


def _as_of_a_drive(method: _F) -> _F:
    """Has `help` show the drive first, and not the unit that the operation takes."""
    signature = inspect.signature(plain_annotations(method))
    unit, *others = signature.parameters.values()
    own = unit.replace(name="self", annotation=inspect.Parameter.empty)
    method.__signature__ = signature.replace(parameters=[own, *others])  # type: ignore[attr-defined]
    return method


def documented_by(other: Callable[..., object]) -> Callable[[_F], _F]:
    """Gives a method the docstring of the operation that it carries out."""

    def document(method: _F) -> _F:
        method.__doc__ = other.__doc__
        return method

    return document
