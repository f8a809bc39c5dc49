"""Writing registers and parameters of one unit by name: what is allowed, and where it is kept.

All checks come before the first write: names, ranges (also those that other parameters narrow), the state the drive
must be in, and evidence. What makes a motor turn is not written here: commands are refused, `Drive` has methods for
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, overload

from drivebus import checks
from drivebus.advice import Advice, Text, argument, call, joined
from drivebus.errors import BadArgument, DrivebusError, NotReady
from drivebus.operations import glances, parameter_writes, registers, state, unit_variants
from drivebus.operations.drive_view import DriveView
from drivebus.operations.in_parts import counted
from drivebus.operations.parameter_writes import Planned, key
from drivebus.profile.evidence import Evidence
from drivebus.values import Description, Value

__all__ = ["check_now", "plan_write", "write"]


class _Limit(NamedTuple):
    """Another parameter that narrows a range."""

    other: str
    low: bool


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
    _check_deciding(unit, wanted)
    unit = await unit_variants.settled(unit.trusting(unverified), *wanted)
    planned = [plan_write(unit, each, asked, store) for each, asked in wanted.items()]
    await check_now(unit, planned)
    done: list[str] = []
    with counted(unit) as view:
        for run in _runs(unit, planned):
            try:
                await parameter_writes.write(view, run, store)
            except DrivebusError as error:
                if done and hasattr(error, "add_note"):
                    error.add_note(f"written before it: {', '.join(done)}")
                raise
            done += [item.name for item in run]


def _runs(unit: DriveView, planned: Sequence[Planned]) -> Iterator[list[Planned]]:
    """The writes in their order; those that may share a request stand together."""
    run: list[Planned] = []
    for item in planned:
        if run and not _may_follow(unit, run, item):
            yield run
            run = []
        run.append(item)
    if run:
        yield run


def _may_follow(unit: DriveView, run: Sequence[Planned], item: Planned) -> bool:
    """Whether *item* may be written by the request that writes *run*.

    What narrows another one's range does not share its request: in which order a drive checks the words is not printed.
    """
    profile, last = unit.profile, run[-1]
    if item.address != last.address + 1 or len(run) == profile.max_words or not profile.requests().joined:
        return False
    alone = unit.evidence.cached(_alone)
    if not all(_is_plain(unit, each) and key(each.known) not in alone for each in (last, item)):
        return False
    together = {key(each.known) for each in (*run, item)}
    narrows = any(key(profile.describe(limit.other)) in together for limit in _limits(unit, item.known))
    narrowed = any(
        key(profile.describe(limit.other)) == key(item.known) for each in run for limit in _limits(unit, each.known)
    )
    return not narrows and not narrowed


def _is_plain(unit: DriveView, item: Planned) -> bool:
    """Whether *item* is a parameter that is simply kept, while the drive runs too."""
    return (
        item.known.kind == "parameter" and item.known.access == "run" and unit.profile.read_back(item.name) is not None
    )


def _alone(evidence: Evidence) -> frozenset[str]:
    """Parameters that decide who commands the drive, or how the line is set."""
    profile = evidence.profile
    names = [*profile.serial_parameters(), *(need.code for need in profile.control())]
    return frozenset(key(profile.describe(name)) for name in names)


def _check_deciding(unit: DriveView, wanted: Mapping[str, object]) -> None:
    """Raises `NotAllowed` if one of *wanted* changes what another one means, or what this drive was said to be."""
    for variant, rule in unit_variants.rules(unit).items():
        parameter = key(unit.profile.describe(rule.parameter))
        name = next((name for name in wanted if key(unit.profile.describe(name)) == parameter), None)
        if name is None:
            continue
        depends = next((other for other in wanted if unit.profile.describe(other).variant == variant), None)
        if depends is not None:
            raise BadArgument(
                f"{name} decides what {depends} means; nothing was sent to unit {unit.address}. Write {name} by "
                "itself, and first",
                unit=unit.address,
            )
        chosen = unit.profile.variants_chosen.get(variant)
        if chosen is not None and unit.profile.encode(name, wanted[name]) != rule.choices[chosen]:
            raise BadArgument(
                Text(
                    f"{name} = {checks.shown(wanted[name])} would change the {variant} of unit {unit.address}, which "
                    f"was said to be {chosen}; nothing was sent. Write it without ",
                    Advice("variants", variant, "variants=…"),
                ),
                unit=unit.address,
            )


def plan_write(unit: DriveView, name: str, value: object, store: bool) -> Planned:
    """The write of *value* to *name*. Raises `NotAllowed` where the profile does not allow it."""
    known = unit.profile.describe(name)
    if not known.writable:
        raise BadArgument(f"{name} ({known.label}) is read-only; nothing was sent", unit=unit.address)
    if known.place is not None and unit.profile.is_command(known.place):
        raise BadArgument(
            Text(
                f"{name} ({known.label}) can move the motor, so write() refuses it; use ",
                joined(map(call, ("run", "stop", "coast", "jog", "reset_fault")), ", ", " or "),
                Advice("own_methods", None, ", or for terminals and the special control word their own methods"),
            ),
            unit=unit.address,
        )
    unit.evidence.require_writable(name)
    if known.kind == "parameter" and not store and unit.profile.memory() is None:
        raise BadArgument(
            Text(
                f"no way to write {name} to RAM alone is known of {unit.profile.title}, so every write may wear its "
                f"EEPROM; nothing was sent to unit {unit.address}. Use ",
                argument("store", True),
                " to keep it there",
            ),
            unit=unit.address,
        )
    raw = unit.profile.encode(name, value)
    unit.evidence.require_writable_word(name, raw)
    address = unit.profile.address(name, store=store)
    unit.evidence.require_kept(name, store=store)
    return Planned(known, name, address, raw)


async def check_now(unit: DriveView, planned: Sequence[Planned]) -> None:
    """Checks what only the drive knows: whether it is stopped, and ranges that its parameters narrow."""
    only_stopped = [item.name for item in planned if item.known.access == "stop"]
    # Where no state is known the drive has to refuse by itself.
    state_word = unit.profile.role("state") if only_stopped and unit.evidence.without_state() is None else None
    limits = [limit for item in planned for limit in _limits(unit, item.known)]
    others = unit.evidence.readable(dict.fromkeys(limit.other for limit in limits))
    names = [*([state_word] if state_word else []), *others]
    if not names:
        return
    values = await registers.snapshot(unit, *names)
    if state_word is not None:
        now = state.state_of(unit, int(values[state_word]))
        glances.remember(unit, str(now))
        if now.running:
            raise NotReady(
                f"{', '.join(only_stopped)} can be written only while the drive is stopped, and unit {unit.address} "
                f"runs ({now}); nothing was written",
                why="turning",
                unit=unit.address,
            )
    in_force = {key(unit.profile.describe(name)): values[name] for name in others}
    for item in planned:
        _check_range(unit, item, in_force)
        in_force[key(item.known)] = registers.value(unit, item.name, item.raw)


def _check_range(unit: DriveView, item: Planned, in_force: Mapping[str, Value]) -> None:
    value = registers.value(unit, item.name, item.raw)
    for other, low in _limits(unit, item.known):
        narrow = unit.profile.describe(other)
        limit = in_force.get(key(narrow))
        if limit is None or (value >= limit if low else value <= limit):
            continue
        raise BadArgument(
            f"{item.name} ({item.known.label}) = {value:g} {item.known.unit} is {'below' if low else 'above'} "
            f"{other} ({narrow.label}), which is {limit:g} {narrow.unit} in unit {unit.address}; nothing was written. "
            f"Write {other} first, or before it in the same call",
            unit=unit.address,
        )


def _limits(unit: DriveView, known: Description) -> list[_Limit]:
    """The parameters that narrow the range of *known*, by its own row or by theirs."""
    named = ((known.low_from, True), (known.high_from, False))
    limits = [_Limit(other, low) for other, low in named if other is not None]
    if known.kind == "parameter":
        have = {unit.profile.describe(limit.other).code for limit in limits}
        limits += [limit for limit in unit.evidence.cached(_narrowing).get(key(known), ()) if limit.other not in have]
    return limits


def _narrowing(evidence: Evidence) -> Mapping[str, Sequence[_Limit]]:
    """For each parameter the others whose range it narrows, as limits of its own."""
    profile = evidence.profile
    found: dict[str, list[_Limit]] = {}
    for other in map(profile.describe, profile.names()):
        if other.kind == "parameter":
            for bound, low in ((other.low_from, False), (other.high_from, True)):
                if bound is not None:
                    found.setdefault(key(profile.describe(bound)), []).append(_Limit(key(other), low))
    return found
