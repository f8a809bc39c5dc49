"""Conversations of operations with a drive: what is called, how it ends in a plain form, and holding one.

A conversation is one line of a file of `tests/vectors/operations`: the calls of a program to one drive, each with its
steps and its end. The same calls are carried out to note it and to replay it. tests/vectors/README.md has the form.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from drivebus import Profile
from drivebus.errors import DrivebusError, NotReady, NotStopped, Refused
from drivebus.identify import scan
from drivebus.identify.identify import identify
from drivebus.identify.profile_choice import profile_of
from drivebus.identify.results import Found, Identification
from drivebus.line.asking import asking
from drivebus.line.blocking import at_once
from drivebus.look import Look
from drivebus.operations import (
    bit_words,
    bus_control,
    motion,
    parameters,
    raw_words,
    registers,
    setpoints,
    state,
    stop_all,
    waiting,
)
from drivebus.operations.bus_timeout import BusTimeout
from drivebus.operations.drive_view import DriveView
from drivebus.operations.motor_block import MotorBlock
from drivebus.operations.setpoints import SetpointRange
from drivebus.values import Control, Fault, Snapshot, Status

from .recorded_bus import EPOCH, UNIT, Replaying, Telling

__all__ = ["FOLDER", "Talk", "conversations", "replay"]

FOLDER = Path(__file__).resolve().parent.parent / "vectors" / "operations"

_SCAN_TIMEOUT = 0.1
_BLOCK = 0.2
"""Seconds that the end of a block is given to be taken, and to be seen."""

_OF_A_VIEW: dict[str, Callable[..., Awaitable[object]]] = {
    "bits": bit_words.bits,
    "check_control": bus_control.check_control,
    "coast": motion.coast,
    "end_jog": motion.end_jog,
    "end_run": motion.end_run,
    "fault": state.fault,
    "fault_history": state.fault_history,
    "inputs": bit_words.inputs,
    "jog": motion.jog,
    "jog_stop": motion.jog_stop,
    "look": state.look,
    "monitor": registers.monitor,
    "outputs": bit_words.outputs,
    "ping": state.ping,
    "prepare_control": bus_control.prepare_control,
    "read_setpoint": setpoints.read_setpoint,
    "read_words": raw_words.read_words,
    "reset_fault": motion.reset_fault,
    "run": motion.run,
    "set_virtual_inputs": bit_words.set_virtual_inputs,
    "set_virtual_outputs": bit_words.set_virtual_outputs,
    "settled_profile": registers.settled_profile,
    "special_control": bit_words.special_control,
    "state": state.state,
    "status": state.status,
    "stop": motion.stop,
    "wait_for_speed": waiting.wait_for_speed,
    "wait_until_stopped": waiting.wait_until_stopped,
    "write": parameters.write,
    "write_words": raw_words.write_words,
}
"""What takes a view of its unit first, and what it is given by name behind it."""


class Talk:
    """One program and one drive: the calls come one after another, and know what those before found out.

    Args:
        bus: What notes or replays.
        family: What the unit is named as.
        unverified: Whether what no document proves is done all the same.
        trusted: Whether the name is meant, whatever the unit says.
    """

    def __init__(self, bus: Telling, family: str, *, unverified: bool, trusted: bool) -> None:
        self._bus, self._unverified = bus, unverified
        self._view = self._of(Profile.builtin(family), None, trusted)
        self._checked: SetpointRange | None = None
        self._watchdog: BusTimeout | None = None

    def end_of(self, call: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """How *call* ends: what it returns, or the error that it raises, in a plain form."""
        with warnings.catch_warnings():
            # They go to the program, and change nothing of what is asked.
            warnings.simplefilter("ignore")
            try:
                return {"result": plain(at_once(self._carried_out(call, given)))}
            except DrivebusError as error:
                return plain_error(error)

    def _of(self, profile: Profile, code: int | None, trusted: bool) -> DriveView:
        return DriveView.create(self._bus, UNIT, profile, code, unverified=self._unverified, trust_profile=trusted)

    async def _carried_out(self, call: str, given: Mapping[str, Any]) -> object:
        bus, view = self._bus, self._view
        if call in _OF_A_VIEW:
            named = {name: value for name, value in given.items() if name != "names"}
            return await _OF_A_VIEW[call](view, *given.get("names", ()), **named)
        if call == "identify":
            return await identify(bus.ask, UNIT)
        if call == "scan":
            return await scan.look_for(asking(bus, timeout=_SCAN_TIMEOUT, retries=0), bus.now, UNIT)
        if call == "choose":
            profile, code = await profile_of(bus, UNIT, None, None, self._unverified)
            self._view = self._of(profile, code, False)
            return profile
        if call == "contradiction":
            # The words are for people.
            return await registers.contradiction(view) is not None
        if call == "read":
            return await registers.read(view, *given["names"], verify=given.get("verify", False))
        if call == "check_setpoints":
            self._checked = await setpoints.check_setpoints(view, **given)
            return self._checked
        if call == "write_setpoint":
            given = {name: value for name, value in given.items() if name != "checked"} | (
                {"checked": self._checked} if given.get("checked") else {}
            )
            await setpoints.write_setpoint(view, **given)
            return None
        if call == "block":
            await _in_a_block(view, **given)
            return None
        if call == "stop_all":
            return await stop_all.stop_all([view], **given)
        return await self._watched(call, given)

    async def _watched(self, call: str, given: Mapping[str, Any]) -> object:
        """The drive's own time-out: set, kept from running out, and given back."""
        if call == "set_timeout":
            self._watchdog = BusTimeout(self._view, **given)
            await self._watchdog.set()
            return self._watchdog.armed
        watchdog = self._watchdog
        if watchdog is None:
            return None
        if call == "keep_awake":
            return await watchdog.ask()
        assert call == "give_back"
        await watchdog.give_back()
        return [watchdog.armed, None if watchdog.error is None else plain_error(watchdog.error)]


async def _in_a_block(view: DriveView, *, standstill: float | None = None, fails: bool = False, **run: Any) -> None:
    """A motor that turns for a block of the program, which may end with an error of its own."""

    async def start() -> None:
        await motion.run(view, **run)

    async def end(unit: DriveView, within: float) -> None:
        await motion.end_run(unit, within, confirm=_BLOCK)

    block = MotorBlock(view, start, end, standstill, _BLOCK)
    try:
        await block.begin()
    except DrivebusError as error:
        await block.fail(error)
        raise
    await (block.fail(RuntimeError()) if fails else block.finish())


def conversations(family: str) -> Iterator[dict[str, Any]]:
    """What was noted of *family*, one after another."""
    for line in (FOLDER / f"{family}.jsonl").read_text(encoding="utf-8").splitlines():
        yield json.loads(line)


def replay(conversation: Mapping[str, Any]) -> None:
    """Holds *conversation* once more. Raises `AssertionError` where anything is asked, or ends, otherwise."""
    bus = Replaying()
    talk = Talk(
        bus,
        conversation["family"],
        unverified=conversation.get("unverified", False),
        trusted=conversation.get("trusted", False),
    )
    for call in conversation["calls"]:
        bus.begin(call["steps"])
        end = talk.end_of(call["do"], call.get("with", {}))
        bus.finish()
        assert end == call["end"], f"it ended with {end}, and not with {call['end']}"


def plain_error(error: DrivebusError) -> dict[str, Any]:
    """*error* without its words: its class, what a program asks it, and whether it says that the drive may obey it."""
    told: dict[str, Any] = {"error": type(error).__name__}
    if error.started is not None:
        told["sent"] = True
    if error.may_have_taken:
        told["may_have_taken"] = True
    if isinstance(error, Refused):
        told |= {"code": error.code, "name": error.name, "means": error.means}
    if isinstance(error, NotReady) and error.why:
        told["why"] = error.why
    if isinstance(error, NotStopped):
        told["failures"] = {str(unit): plain_error(each) for unit, each in error.failures.items()}
    return told


def plain(value: object) -> Any:
    """*value* as JSON has it, without what is only for people."""
    if isinstance(value, Enum):
        return value.value
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return round(value, 6)
    if isinstance(value, Fault):
        return {"fault": value.code, **({"values": plain(value.values)} if value.values else {})}
    if isinstance(value, Snapshot):
        return {"values": plain(dict(value)), "time": _moment(value.time), "duration": plain(value.duration)}
    if isinstance(value, Control):
        return [[item.code, plain(item.wanted), plain(item.actual), item.ok] for item in value]
    if isinstance(value, Profile):
        return {"profile": value.name, **({"variants": value.variants_chosen} if value.variants_chosen else {})}
    if isinstance(value, SetpointRange):
        return [value.low, value.high, plain(value.profile)]
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)) and not isinstance(value, Look):
        return [plain(each) for each in value]
    return _plain_fields(value)


def _plain_fields(value: object) -> dict[str, Any]:
    """A record by its attributes, without texts that say why, and without what is not told."""
    known = value._asdict() if isinstance(value, Look) else _attributes(value)
    if isinstance(value, (Look, Status)):
        known["missing"] = sorted(value.missing)
        known["time"] = _moment(value.time)
    elif isinstance(value, (Found, Identification)):
        known = {name: each for name, each in known.items() if name not in ("unit", "title", "reason", "problem")}
    return {name: plain(each) for name, each in known.items() if each not in (None, [], (), {})}


def _attributes(value: object) -> dict[str, Any]:
    assert is_dataclass(value), f"{value!r} has no plain form"
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _moment(time: float) -> float:
    """Seconds from the beginning; 0.0 also where nothing was asked."""
    return round(time - EPOCH, 6) if time else 0.0
