"""What both faces of a drive are made of: the view of its unit, and the operations as methods over it."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable, Coroutine, Mapping
from typing import Any, Concatenate, ParamSpec, TypeVar

from drivebus.line.blocking import at_once
from drivebus.line.protocols import AwaitableBus
from drivebus.operations import registers
from drivebus.operations.unit import Unit
from drivebus.profile import Profile
from drivebus.values import Description, Value

__all__ = ["DriveFace", "LivingDrives", "awaited", "blocking", "documented_by", "unit_of"]

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

    def __init__(self, unit: Unit) -> None:
        self.unit = unit.address
        self.profile = unit.profile
        self._unit = unit

    def __repr__(self) -> str:
        return f"<Drive {self.unit}: {self.profile.name}{', unverified' if self.unverified else ''}>"

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


def unit_of(drive: DriveFace) -> Unit:
    """The view of its unit on which a drive's methods work."""
    return drive._unit


class LivingDrives:
    """The drives that a bus gave out: how far each is trusted, and what is remembered of those that somebody has."""

    def __init__(self) -> None:
        self._drives: weakref.WeakSet[DriveFace] = weakref.WeakSet()
        self._trusted: set[tuple[int, str]] = set()

    def add(self, drive: DriveFace) -> None:
        """From now on *drive* is known."""
        self._drives.add(drive)
        if drive.unverified:
            self._trusted.add((drive.unit, drive.profile.name))

    def views(self, bus: AwaitableBus, profiles: Mapping[int, Profile]) -> list[Unit]:
        """The units of *profiles* on *bus*: each as who started it last sees it, and trusted as far as it ever was."""
        return [self._view(bus, address, profile) for address, profile in profiles.items()]

    def _view(self, bus: AwaitableBus, address: int, profile: Profile) -> Unit:
        held = [unit_of(drive) for drive in self._drives if drive.unit == address]
        same = [unit for unit in held if unit.profile.name == profile.name]
        trusted = (address, profile.name) in self._trusted or any(unit.memory.started_unverified for unit in same)
        if not same:
            return Unit.at(bus, address, profile, None, unverified=trusted, trust_profile=False)
        return max(same, key=lambda unit: unit.memory.starts).trusting(trusted)


def blocking(
    operation: Callable[Concatenate[Unit, _P], Coroutine[Any, Any, _R]],
) -> Callable[Concatenate[Any, _P], _R]:
    """The method that carries *operation* out at once, with its name, its signature and its docstring."""

    @functools.wraps(operation)
    def method(drive: DriveFace, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        return at_once(operation(drive._unit, *args, **kwargs))

    return method


def awaited(
    operation: Callable[Concatenate[Unit, _P], Coroutine[Any, Any, _R]],
) -> Callable[Concatenate[Any, _P], Coroutine[Any, Any, _R]]:
    """The method that awaits *operation*, with its name, its signature and its docstring."""

    @functools.wraps(operation)
    async def method(drive: DriveFace, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        return await operation(drive._unit, *args, **kwargs)

    return method


def documented_by(other: Callable[..., object]) -> Callable[[_F], _F]:
    """Gives a method the docstring of the operation that it carries out."""

    def document(method: _F) -> _F:
        method.__doc__ = other.__doc__
        return method

    return document
