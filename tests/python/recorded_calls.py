"""What is called in the conversations that are noted: each operation of a drive, as its family can have it."""

from __future__ import annotations

from typing import Any, NamedTuple

from drivebus import Profile
from drivebus.values import Description

from .recorded_scenes import HZ

__all__ = ["Case", "Named", "cases_of"]

_CONFIRM: dict[str, Any] = {"confirm": 0.1}
_HALT: dict[str, Any] = {"confirm": 0.2, "within": 0.2}
_WAIT: dict[str, Any] = {"timeout": 0.1}


class Named(NamedTuple):
    """One call, by the name of `recorded_operations`, and what it is given."""

    do: str
    given: dict[str, Any]


class Case(NamedTuple):
    """What a program does with one drive.

    Attributes:
        name: What that is called.
        calls: Its calls, one after another.
        stands: How the drive stands where no mishap says it.
    """

    name: str
    calls: list[Named]
    stands: str = "ready"


def cases_of(profile: Profile) -> list[Case]:
    """Every operation, on a drive of *profile*; what its family lacks is called as well, and is refused."""
    return [*_asking(profile), *_moving(profile), *_halting(), *_setting(profile), *_of_bits(profile)]


def _one(name: str, stands: str = "ready", /, **given: Any) -> Case:
    return Case(name, [Named(name.partition(",")[0].replace(" ", "_"), given)], stands)


def _asking(profile: Profile) -> list[Case]:
    monitors, parameters = profile.monitor_names(), _parameters(profile, "run")
    names = [*monitors[:1], *(each.name for each in parameters[:1])]
    state = profile.role("state")
    place = None if state is None else profile.describe(state).place
    return [
        _one("identify"),
        _one("scan"),
        _one("choose"),
        _one("contradiction"),
        _one("ping"),
        _one("state"),
        _one("look"),
        _one("status"),
        _one("fault"),
        _one("fault history"),
        _one("monitor"),
        _one("read", names=names or ["output_current"]),
        _one("read, verified", names=names[:1] or ["output_current"], verify=True),
        _one("read words", address=0x2100 if place is None else place, count=2),
        _one("check control"),
        _one("read setpoint"),
        _one("settled profile", names=_frequency(profile)),
        _one("wait for speed", "forward", **_WAIT),
        _one("wait until stopped", **_WAIT),
        _one("wait until stopped, from speed", "forward", **_WAIT),
    ]


def _moving(profile: Profile) -> list[Case]:
    hz: dict[str, Any] = {"hz": HZ} if "frequency" in profile.setpoint_names() else {}
    return [
        _one("run", **hz, **_CONFIRM),
        _one("run, in reverse", **hz, reverse=True, **_CONFIRM),
        _one("run, as it is set", **_CONFIRM),
        _one("run, forced", **hz, force=True, confirm=0.0),
        _one("jog", **_CONFIRM),
        _one("jog, in reverse", reverse=True, **_CONFIRM),
        Case("run and stop", [Named("run", hz | _CONFIRM), Named("stop", _HALT)]),
        Case("run and coast", [Named("run", hz | _CONFIRM), Named("coast", _HALT)]),
        Case("run and turn round", [Named("run", hz | _CONFIRM), Named("run", hz | {"reverse": True} | _CONFIRM)]),
        Case("run and end", [Named("run", hz | _CONFIRM), Named("end_run", {"within": 0.2, "confirm": 0.2})]),
        Case("run in a block", [Named("block", hz | _CONFIRM)]),
        Case("run in a block, to standstill", [Named("block", hz | _CONFIRM | {"standstill": 0.5})]),
        Case("run in a block that fails", [Named("block", hz | _CONFIRM | {"fails": True})]),
        Case("jog and end", [Named("jog", _CONFIRM), Named("end_jog", {"within": 0.2})]),
        Case("choose, run and stop", [Named("choose", {}), Named("run", hz | _CONFIRM), Named("stop", _HALT)]),
    ]


def _halting() -> list[Case]:
    return [
        _one("stop", "forward", **_HALT),
        _one("stop, at rest", **_HALT),
        _one("stop, by ramp", "fast", **_HALT),
        _one("stop, unproved", "forward", confirm=0.0, within=0.2),
        _one("coast", "forward", **_HALT),
        _one("jog stop", "forward", **_HALT),
        _one("stop all", "forward", **_HALT),
        Case("reset fault", [Named("reset_fault", _CONFIRM)], "tripped"),
        Case("reset fault and run", [Named("reset_fault", _CONFIRM), Named("run", _CONFIRM)], "tripped"),
    ]


def _setting(profile: Profile) -> list[Case]:
    run, stop = _parameters(profile, "run"), _parameters(profile, "stop")
    # What a family lacks has a name that it does not know.
    one = {run[0].name: _value(profile, run[0])} if run else {"P99.99": 1}
    several = {each.name: _value(profile, each) for each in run[:3]} or one
    at_rest = {each.name: _value(profile, each) for each in stop[:1]} or one
    others = [name for name in ("torque", "pid") if name in profile.setpoint_names()] or ["torque"]
    timeout = {"timeout": 1.0, "action": profile.watchdog.choices[0] if profile.watchdog else "stop"}
    address = profile.address(_frequency(profile)[0]) if _frequency(profile) else 0x2001
    return [
        _one("prepare control", "keypad"),
        _one("prepare control, stored", "keypad", store=True),
        _one("prepare control, of a setpoint", "keypad", setpoint=others[0]),
        _one("write setpoint", value=HZ),
        _one("write setpoint, of another", value=1.0, name=others[0]),
        Case(
            "write setpoint, checked",
            [
                Named("check_setpoints", {"low": 1.0, "high": 10.0}),
                Named("write_setpoint", {"value": HZ, "checked": True}),
            ],
        ),
        _one("write", name=one),
        _one("write, several", name=several),
        _one("write, at rest", name=at_rest),
        _one("write, stored", name=one, store=True),
        Case("write and store", [Named("write", {"name": one}), Named("write", {"name": one, "store": True})]),
        _one("write words", address=address & 0xFFFF, value=200),
        Case("time-out", [Named("set_timeout", timeout), Named("keep_awake", {}), Named("give_back", {})]),
    ]


def _of_bits(profile: Profile) -> list[Case]:
    state = profile.role("state")
    return [
        _one("bits", name=state or "status_word_1"),
        _one("inputs"),
        _one("outputs"),
        _one("set virtual inputs", **_bit(profile, "virtual_inputs")),
        _one("set virtual outputs", **_bit(profile, "virtual_outputs")),
        _one("special control", **_bit(profile, "special_control")),
    ]


def _bit(profile: Profile, setpoint: str) -> dict[str, Any]:
    """The first bit of the word of *setpoint*, on; some bit where the family has none."""
    register = profile.role(f"setpoints.{setpoint}")
    names = list(profile.fields(register, 0)) if register else []
    return {names[0] if names else "S1": True}


def _frequency(profile: Profile) -> list[str]:
    return [name for name in [profile.role("setpoints.frequency")] if name is not None]


def _parameters(profile: Profile, access: str) -> list[Description]:
    """Parameters that may simply be written, those first whose rows documents print."""
    apart = {*profile.serial_parameters(), *profile.acts(), *(row.code for row in profile.control())}
    known = [profile.describe(name) for name in profile.names()]
    plain = [
        each
        for each in known
        if each.kind == "parameter" and each.access == access and each.place is not None and each.words == 1
        if not each.choices and not each.variant and each.high is not None and each.low is not None
        if not {each.name, each.code} & apart and each.high_from is None and each.low_from is None
    ]
    return sorted(plain, key=lambda each: not each.verified)


def _value(profile: Profile, known: Description) -> Any:
    """A value that is not the factory's."""
    low = known.low
    value = low if low != known.default else profile.decode(known.name, profile.encode(known.name, low) + 1)
    profile.encode(known.name, value)
    return value
