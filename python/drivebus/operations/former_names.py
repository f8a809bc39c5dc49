"""Setpoints by the names that they had: each still works, says the name that it has now, and goes with 1.0."""

from __future__ import annotations

import warnings
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Generic, TypeVar, overload

from drivebus import checks
from drivebus.errors import level_of_the_program
from drivebus.line.blocking import at_once
from drivebus.operations import setpoints
from drivebus.operations.drive_base import DriveFace, unit_of

__all__ = ["AwaitedFormerNames", "BlockingFormerNames"]

_T = TypeVar("_T")
_Reads = Coroutine[Any, Any, float]


def _is_now(former: str, now: str) -> None:
    """Says once for each place of the program that *former* is *now*."""
    text = f"drive.{former} is drive.{now} now, and goes with drivebus 1.0"
    warnings.warn(text, DeprecationWarning, stacklevel=level_of_the_program())


def _call(call: str, name: str, value: str = "") -> str:
    """How *call* is written for the setpoint *name*."""
    given = [value] if value else []
    return f"{call}({', '.join(given if name == 'setpoint' else [*given, repr(name)])})".replace("'", '"')


class _Setpoint(Generic[_T]):
    """A setpoint as an attribute."""

    def __init__(self, name: str, read: Callable[[_Reads], _T]) -> None:
        self._name = name
        self._read = read
        self.__doc__ = f"Formerly `{_call('read_setpoint', name)}` and `{_call('write_setpoint', name, '…')}`."

    @overload
    def __get__(self, drive: None, owner: type[DriveFace]) -> _Setpoint[_T]: ...
    @overload
    def __get__(self, drive: DriveFace, owner: type[DriveFace]) -> _T: ...
    def __get__(self, drive: DriveFace | None, owner: type[DriveFace]) -> _T | _Setpoint[_T]:
        if drive is None:
            return self
        _is_now(self._name, _call("read_setpoint", self._name))
        return self._read(setpoints.read_setpoint(unit_of(drive), _of(self._name)))

    def __set__(self, drive: DriveFace, value: float) -> None:
        now = _call("write_setpoint", self._name, checks.shown(value))
        if self._read is _as_it_is:
            raise AttributeError(f"nothing was sent: a drive of asyncio is told by await drive.{now}")
        _is_now(f"{self._name} = {checks.shown(value)}", now)
        at_once(setpoints.write_setpoint(unit_of(drive), value, _of(self._name)))


def _of(name: str) -> str:
    return "frequency" if name == "setpoint" else name


def _as_it_is(read: _Reads) -> Awaitable[float]:
    return read


def _blocking(name: str) -> _Setpoint[float]:
    return _Setpoint(name, at_once)


def _awaited(name: str) -> _Setpoint[Awaitable[float]]:
    return _Setpoint(name, _as_it_is)


class BlockingFormerNames(DriveFace):
    """What a drive whose calls block had beside `read_setpoint` and `write_setpoint`."""

    torque = _blocking("torque")
    pid = _blocking("pid")
    pid_feedback = _blocking("pid_feedback")
    forward_limit = _blocking("forward_limit")
    reverse_limit = _blocking("reverse_limit")
    motoring_torque_limit = _blocking("motoring_torque_limit")
    braking_torque_limit = _blocking("braking_torque_limit")
    vf_voltage = _blocking("vf_voltage")
    analog_output_1 = _blocking("analog_output_1")
    analog_output_2 = _blocking("analog_output_2")

    def ask(self, setpoint: str, *, unverified: bool = False) -> float:
        """Formerly `read_setpoint`."""
        _is_now("ask", "read_setpoint")
        return at_once(setpoints.read_setpoint(unit_of(self), setpoint, unverified=unverified))

    def give(self, setpoint: str, value: float, *, unverified: bool = False) -> None:
        """Formerly `write_setpoint`, which takes the value first."""
        _is_now("give", "write_setpoint")
        at_once(setpoints.write_setpoint(unit_of(self), value, setpoint, unverified=unverified))


def _setter(name: str) -> Callable[..., Coroutine[Any, Any, None]]:
    async def write(self: DriveFace, value: float, *, unverified: bool = False) -> None:
        _is_now(f"set_{name}", _call("write_setpoint", name, "…"))
        await setpoints.write_setpoint(unit_of(self), value, _of(name), unverified=unverified)

    write.__name__ = write.__qualname__ = f"set_{name}"
    write.__doc__ = f"Formerly `{_call('write_setpoint', name, '…')}`."
    return write


class AwaitedFormerNames(DriveFace):
    """What a drive of asyncio had beside `read_setpoint` and `write_setpoint`."""

    setpoint = _awaited("setpoint")
    torque = _awaited("torque")
    pid = _awaited("pid")
    pid_feedback = _awaited("pid_feedback")
    forward_limit = _awaited("forward_limit")
    reverse_limit = _awaited("reverse_limit")
    motoring_torque_limit = _awaited("motoring_torque_limit")
    braking_torque_limit = _awaited("braking_torque_limit")
    vf_voltage = _awaited("vf_voltage")
    analog_output_1 = _awaited("analog_output_1")
    analog_output_2 = _awaited("analog_output_2")

    set_torque = _setter("torque")
    set_pid = _setter("pid")
    set_pid_feedback = _setter("pid_feedback")
    set_forward_limit = _setter("forward_limit")
    set_reverse_limit = _setter("reverse_limit")
    set_motoring_torque_limit = _setter("motoring_torque_limit")
    set_braking_torque_limit = _setter("braking_torque_limit")
    set_vf_voltage = _setter("vf_voltage")
    set_analog_output_1 = _setter("analog_output_1")
    set_analog_output_2 = _setter("analog_output_2")

    async def set_setpoint(self, hz: float, *, unverified: bool = False) -> None:
        """Formerly `write_setpoint(…)`."""
        _is_now("set_setpoint", "write_setpoint(…)")
        await setpoints.write_setpoint(unit_of(self), hz, unverified=unverified)

    async def ask(self, setpoint: str, *, unverified: bool = False) -> float:
        """Formerly `read_setpoint`."""
        _is_now("ask", "read_setpoint")
        return await setpoints.read_setpoint(unit_of(self), setpoint, unverified=unverified)

    async def give(self, setpoint: str, value: float, *, unverified: bool = False) -> None:
        """Formerly `write_setpoint`, which takes the value first."""
        _is_now("give", "write_setpoint")
        await setpoints.write_setpoint(unit_of(self), value, setpoint, unverified=unverified)
