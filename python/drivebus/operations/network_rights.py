"""What clients of a network may do, in the words of each drive's family: places and words, and what they do.

The core lets pass what stands here, word by word, and knows nothing of drives. So here it is said which words move a
motor, which halt it, and which wear its memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

from drivebus import checks, tables
from drivebus.errors import LINE_ERRORS, BadArgument
from drivebus.line.blocking import at_once
from drivebus.line.write_guard import commanded_at
from drivebus.operations import last_will
from drivebus.operations.drive_view import DriveView
from drivebus.operations.kept import store_register
from drivebus.profile.evidence import Evidence

__all__ = ["READS", "WRITES", "Halts", "Writable", "halts_of", "is_what_it_should_be", "moves", "of_drive", "of_unit"]

READS, WRITES = (1, 2, 3, 4), (5, 6, 15, 16)
"""Function codes of the reads and of the writes that can be allowed."""

Writable: TypeAlias = tuple[str, int, "list[int] | None", str, "int | None", str, "int | None"]
"""Table and address; the words, or any; what it does; where the same is in RAM; its name; where what it replaces is
read."""

_GROUPS = {"run": ("run_forward", "run_reverse"), "jog": ("jog_forward", "jog_reverse"), "reset": ("reset_fault",)}
"""What people call several commands."""

_STOPS = ("stop", "coast", "jog_stop")

_MOVES = ("virtual_inputs", "special_control")
"""Setpoints by which a motor can be started."""


class Halts(NamedTuple):
    """How a unit is halted: for clients that may write to it, and for one that is gone."""

    unit: int
    stops: list[Writable]
    ways: list[list[bytes]]
    look: tuple[bytes, Sequence[bytes]] | None
    named: last_will.Named


def moves(writes: Iterable[Writable]) -> bool:
    """Whether any of *writes* may move a motor."""
    return any(means == "moves" for _, _, _, means, _, _, _ in writes)


def of_unit(unit: int, addresses: Iterable[object]) -> list[Writable]:
    """The holding registers at *addresses* of a unit that is no drive, as far as is known.

    Raises:
        BadArgument: One is no address, or commands a drive of some family.
    """
    writes: list[Writable] = []
    for given in addresses:
        address = checks.whole("write", given, 0, 0xFFFF, hexadecimal=True)
        families = commanded_at(address)
        if families is not None:
            raise BadArgument(
                f"{tables.shown(address)} of unit {unit} may command a motor: it is the command register of "
                f"{families}. Give the drive itself, with its profile, and name commands"
            )
        writes.append(("holding", address, None, "sets", None, tables.shown(address), None))
    return writes


def of_drive(evidence: Evidence, registers: Iterable[object], commands: Iterable[object]) -> list[Writable]:
    """The *registers* and *commands* of a drive by name, as far as its family is *evidence* of them. It is not asked.

    Raises:
        NotAllowed: One is unknown, or not verified for the family.
    """
    writes = [write for name in registers for write in _register(evidence, name)]
    return writes + [write for name in commands for write in _command(evidence, name)]


def halts_of(unit: DriveView) -> Halts:
    """How *unit* is halted; without ways where no document proves one."""
    usable = [name for name in _STOPS if unit.evidence.unusable(name) is None]
    stops = [write for name in usable for write in _code(unit.evidence, name, "stops")]
    ends = [way for way in last_will.WAYS if way in usable]
    ways = [last_will.requests_of(unit.profile, way) for way in ends]
    look = None if unit.identity.trusted else last_will.look_of(unit.profile)
    return Halts(unit.address, stops, ways, look, last_will.named_as(unit, ends))


def is_what_it_should_be(unit: DriveView) -> None:
    """Asks *unit* who it is, if it answers.

    Raises:
        NotAllowed: It says that it is another drive.
    """
    try:
        at_once(unit.identity.check(unit.bus))
    except LINE_ERRORS:
        # It is asked again before something is written to it.
        return


def _command(evidence: Evidence, name: object) -> Iterator[Writable]:
    profile = evidence.profile
    known = {*profile.commands(), *_GROUPS, *profile.setpoint_names()}
    known |= {"setpoint"} if "frequency" in known else set()
    if not isinstance(name, str) or name not in known:
        hint = checks.closest(name, known) if isinstance(name, str) else ""
        raise BadArgument(
            f"{checks.shown(name)} is no command or setpoint of {profile.title}{hint}", unit=evidence.unit
        )
    if name == "setpoint" or name in profile.setpoint_names():
        setpoint = "frequency" if name == "setpoint" else name
        register = profile.role(f"setpoints.{setpoint}")
        yield from _register(evidence, register)
        return
    # Some families know one direction only.
    for command in [each for each in _GROUPS.get(name, (name,)) if each == name or each in profile.commands()]:
        evidence.require_command(command)
        means = "stops" if command in _STOPS else "sets" if command == "reset_fault" else "moves"
        yield from _code(evidence, command, means)
        if means == "moves":
            place = profile.command(command)[0]
            for step in profile.start_sequence():
                yield _at(place, [step.word], "sets", step.label)


def _code(evidence: Evidence, command: str, means: str) -> Iterator[Writable]:
    place, code = evidence.profile.command(command)
    yield _at(place, [code], means, command)
    first = evidence.profile.command_first(command)
    if first is not None:
        yield _at(first[0], [first[1]], "sets", command)


def _register(evidence: Evidence, name: object) -> Iterator[Writable]:
    profile = evidence.profile
    means = "sets"
    if not isinstance(name, str):
        raise BadArgument(
            f"a register of a drive is named by its name or code, and {checks.shown(name)} is neither",
            unit=evidence.unit,
        )
    evidence.require_writable(name)
    known = profile.describe(name)
    called = known.code or known.name
    if known.access == "ro":
        raise BadArgument(f"{called} of {profile.title} can only be read", unit=evidence.unit)
    place = profile.address(name)
    if profile.is_command(place):
        raise BadArgument(
            f"{called} of {profile.title} takes commands: name those that are allowed among the commands",
            unit=evidence.unit,
        )
    started_by = [profile.role(f"setpoints.{setpoint}") for setpoint in _MOVES]
    if {called, name} & {*profile.acts(), *started_by}:
        means = "moves"
    shown = profile.read_back(name)
    shown_at = shown if shown is not None and known.kind == "parameter" and shown <= 0xFFFF else None
    stores = store_register(profile)
    if stores is not None and stores in {known.name, known.code}:
        yield _at(place, None, "wears", called)
    elif known.kind != "parameter" or stores is not None:
        # What stays in RAM until all is stored wears nothing by itself.
        yield _at(place, None, means, called, shown_at=shown_at)
    elif profile.memory() is None:
        yield _at(place, None, means if means == "moves" else "wears", called, shown_at=shown_at)
    else:
        in_ram, kept = profile.address(name, store=False), profile.address(name, store=True)
        yield _at(in_ram, None, means, called, shown_at=shown_at)
        yield _at(kept, None, means if means == "moves" else "wears", called, instead=in_ram, shown_at=shown_at)


def _at(
    place: int,
    words: list[int] | None,
    means: str,
    name: str,
    *,
    instead: int | None = None,
    shown_at: int | None = None,
) -> Writable:
    table, address = tables.split(place)
    return table, address, words, means, instead, name, shown_at
