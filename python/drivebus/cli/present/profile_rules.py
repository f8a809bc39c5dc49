"""The rules of a family for people to read: what `drivebus profiles show` prints.

Whatever may be used only with `unverified=True` says so, with its reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import drivebus
from drivebus import tables
from drivebus.line import huanyang
from drivebus.line.write_guard import code_text

__all__ = ["COUNTED", "counted", "in_words", "known", "memory"]

COUNTED = ["rows", "total", "with a source", "without", "unverified", "assumed"]


def counted(kind: str, counts: Mapping[str, int]) -> list[Any]:
    """A row of the table of `COUNTED`."""
    return [kind, *(counts[column] for column in ("total", "sourced", "unsourced", "unverified", "assumed"))]


def known(profile: drivebus.Profile) -> dict[str, Any]:
    """The same rules for programs."""
    return {
        "name": profile.name,
        "family": profile.family,
        "title": profile.title,
        "maker": profile.maker,
        "models": profile.models,
        "aliases": profile.aliases(),
        "kind": profile.kind,
        "version": profile.version,
        "functions": profile.functions,
        "max_words": profile.max_words,
        "requests": profile.requests(),
        "source": profile.source,
        "serial": profile.serial(),
        "identifications": profile.identifications(),
        "signature": profile.signature(),
        "command_register": profile.command_address,
        "commands": profile.commands(),
        "command_codes": profile.command_codes(),
        "command_registers": profile.command_registers(),
        "start_sequence": profile.start_sequence(),
        "commands_not_usable": _reasons(profile),
        "states": _states(profile),
        "state_reason": profile.state_reason(),
        "memory": profile.memory(),
        "control": profile.control(),
        "setpoints": {
            name: {"register": profile.role(f"setpoints.{name}"), "needs": profile.needs(name)}
            for name in profile.setpoint_names()
        },
        "variants": profile.variants(),
        "watchdog": None if profile.watchdog is None else vars(profile.watchdog),
        "left_alone": {"serial": profile.serial_parameters(), "motor": profile.motor_parameters()},
    }


def in_words(profile: drivebus.Profile) -> Iterator[tuple[str, list[str]]]:
    """Title and lines of each section; a section that has nothing to say says that."""
    over = "" if profile.family == profile.name else f", over {profile.family}"
    yield (
        f"{profile.name}: {profile.title}",
        [
            f"{profile.kind}, profile version {profile.version}{over}",
            f"made from: {profile.source}",
            *([f"also called: {', '.join(profile.models)}"] if profile.models else ()),
            *(f"{alias.name} is one, as {alias.source} has it: {alias.note}" for alias in profile.aliases()),
        ],
    )
    yield "Line", _line(profile)
    yield "Identification", _identification(profile)
    yield "Commands", _commands(profile)
    yield "States", _state_lines(profile)
    yield "Memory", memory(profile)
    yield "What must be set before it obeys the bus", _needs(profile.control())
    yield "Setpoints over the bus", _setpoints(profile)
    if profile.variants():
        yield "What a parameter decides", list(_variants(profile))
    yield "If the bus falls silent", _watchdog(profile)
    yield "Left alone by a restore, unless asked", _left_alone(profile)


def _line(profile: drivebus.Profile) -> list[str]:
    functions = ", ".join(f"{function:02X}H" for function in profile.functions)
    words = "1 word" if profile.max_words == 1 else f"{profile.max_words} words"
    requests = profile.requests()
    lines = [f"functions {functions}; {words} in one request at most{_doubt(requests.verified, requests.note)}"]
    if requests.protocol == "huanyang":
        lines.append(f"speaks {huanyang.NAME}, and no Modbus")
    if requests.max_written < min(profile.max_words, 123):
        lines.append(f"{requests.max_written} words in one write at most")
    if requests.joined:
        lines.append("one request may write several parameters")
    if not requests.across_groups:
        lines.append("no read leaves its group of parameters")
    if requests.single_parameters:
        lines.append("a read has one parameter and no more")
    if requests.zeros:
        groups = ", ".join(f"{group:02X}xxH" for group in requests.zeros)
        lines.append(f"what is not there reads as 0 in {groups}")
    if requests.absent is not None:
        lines.append(f"what is not there reads as {requests.absent:04X}H")
    serial = profile.serial()
    if serial is None:
        return [*lines, "its factory setting is not known"]
    unit = "" if serial.unit is None else f", unit {serial.unit}"
    doubt = "" if serial.verified else " [unverified]"
    return [*lines, f"factory setting: {serial.baud_rate} bit/s {serial.format}{unit}{doubt}"]


def _identification(profile: drivebus.Profile) -> list[str]:
    lines = []
    for row in profile.identifications():
        if row.family != profile.family:
            continue
        shared = f"; shared with {', '.join(row.shared)}" if row.shared else ""
        lines.append(f"{row.code:04X}H is {row.title}{shared}{_doubt(row.verified, row.note)}")
    register = profile.role("identification")
    if lines and register is not None:
        lines.insert(0, f"asked in {_place(profile, register)}")
    signature = profile.signature()
    if signature is not None:
        told = [
            f"{what} {', '.join(tables.shown(place) for place in signature[key])}"
            for key, what in (("answers", "answers"), ("refuses", "refuses"))
            if signature[key]
        ]
        lines.append(f"identified by how it answers reads: {'; '.join(told)}")
    return lines or ["it has no identification; give --profile"]


def _commands(profile: drivebus.Profile) -> list[str]:
    codes = profile.command_codes()
    if profile.command_address is None or not codes:
        return ["none known: it cannot be started or stopped over the bus"]
    reasons = _reasons(profile)
    lines = []
    registers = profile.command_registers()
    for address in sorted(registers, key=lambda address: address != profile.command_address):
        lines.append(f"written to {tables.shown(address)}")
        for code, label in sorted(registers[address].items()):
            either = label.split(" or ")
            for command in either if {*either} <= {*profile.commands()} else [label]:
                doubt = " [unverified]" if command in reasons else ""
                lines.append(f"{_code(code, command)}{_after(profile, command)}{doubt}")
    for number, step in enumerate(profile.start_sequence()):
        until = ", ".join(f"{field} = {value}" for field, value in step.until.items())
        when = "before a run or jog from rest:" if number == 0 else "then"
        lines.append(f"{when} {_code(step.word, step.label).lstrip()}, until {until}")
    why = [f"unverified, so not usable without --unverified: {reason}" for reason in dict.fromkeys(reasons.values())]
    return [*lines, *why]


def _after(profile: drivebus.Profile, command: str) -> str:
    """What goes out before *command*, if anything does."""
    first = profile.command_first(command) if command in profile.commands() else None
    return "" if first is None else f", after {first[1]} at {tables.shown(first[0])}"


def _code(code: int, label: str) -> str:
    """A code and what it means; words of bits as manuals print them too."""
    printed = code_text(code)
    return f"{code:>3} {label.replace('_', ' ')}" + ("" if printed == f"{code}" else f" ({printed})")


def _reasons(profile: drivebus.Profile) -> dict[str, str]:
    reasons = {name: profile.command_reason(name) for name in profile.commands()}
    return {name: reason for name, reason in reasons.items() if reason is not None}


def _states(profile: drivebus.Profile) -> dict[str, Any]:
    register = profile.role("state")
    if register is None:
        return {}
    word = profile.describe(register)
    codes: dict[Any, Any] = dict(word.choices)
    return codes or {field: dict(values) for field, values in (word.bits or {}).items()}


def _state_lines(profile: drivebus.Profile) -> list[str]:
    register = profile.role("state")
    if register is None:
        return ["none known"]
    lines = [f"read in {_place(profile, register)}"]
    reason = profile.state_reason()
    if reason is not None:
        lines.append(f"not usable without --unverified: {reason}")
    for what, means in _states(profile).items():
        if isinstance(means, str):
            lines.append(f"{what:>3} {means.replace('_', ' ')}")
        elif not means:
            lines.append(f"{what}: a number")
        else:
            lines.append(f"{what}: {', '.join(f'{value} = {label}' for value, label in means.items())}")
    return lines


def memory(profile: drivebus.Profile) -> list[str]:
    """Where a parameter that is written is kept."""
    rule = profile.memory()
    if rule is None:
        return ["no write to RAM alone is known: every write of a parameter may wear EEPROM, and needs --store"]
    if rule.means == "store":
        told = f"{rule.store_word:04X}H to {rule.store_register}"
        lines = [f"parameters stay in RAM; --store writes {told}, which keeps all of them"]
    else:
        lines = [_by_bit(rule)]
    if rule.reason is not None:
        lines.append(f"not usable without --unverified: {rule.reason}")
    return lines


def _by_bit(rule: Any) -> str:
    ram = "RAM only, without it EEPROM too" if rule.means == "ram" else "EEPROM too, without it RAM only"
    return f"a parameter written with bit {rule.bit} of its address set goes to {ram}"


def _needs(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    return [
        f"{row['code']} = {row['value']}: {row['label']}{_doubt(row['verified'], row['note'])}" for row in rows
    ] or ["nothing known"]


def _setpoints(profile: drivebus.Profile) -> list[str]:
    lines = []
    for name in profile.setpoint_names():
        register = profile.role(f"setpoints.{name}")
        if register is None:
            continue
        lines.append(f"{name.replace('_', ' ')}: {_place(profile, register)}")
        lines += [f"  needs {line}" for line in _needs(profile.needs(name)) if profile.needs(name)]
    return lines or ["none known"]


def _variants(profile: drivebus.Profile) -> Iterator[str]:
    for name, variant in profile.variants().items():
        reason = "" if variant.reason is None else f" [{variant.reason}]"
        if variant.between is None:
            yield f"{name}: {variant.parameter} is one of {', '.join(variant.choices)}{reason}"
            yield f"  to say which: --variant {name}={next(iter(variant.choices))}"
        else:
            low, high = variant.between
            yield f"{name}: what {variant.parameter} says, {low} to {high}{reason}"
            yield f'  to say it: --variant {name}="{high}"'


def _watchdog(profile: drivebus.Profile) -> list[str]:
    watchdog = profile.watchdog
    if watchdog is None:
        return ["nothing known"]
    actions = " or ".join(watchdog.choices)
    doubt = "" if watchdog.verified else " [unverified]"
    if watchdog.action is None:
        fault = "" if watchdog.fault is None else f" {profile.fault(watchdog.fault)}"
        return [f"after {watchdog.timeout}, it trips{fault}; what that does to the motor is set elsewhere{doubt}"]
    return [f"after {watchdog.timeout}, {watchdog.action} makes it {actions}{doubt}"]


def _left_alone(profile: drivebus.Profile) -> list[str]:
    kinds = (("line", profile.serial_parameters()), ("motor", profile.motor_parameters()))
    return [f"{what}: {', '.join(codes)}" for what, codes in kinds if codes] or ["nothing known"]


def _place(profile: drivebus.Profile, name: str) -> str:
    row = profile.describe(name)
    return f"{name}, whose address is not known" if row.address is None else f"{name} ({tables.shown(row.place or 0)})"


def _doubt(verified: bool, note: str) -> str:
    if verified:
        return ""
    return f" [unverified: {note}]" if note else " [unverified]"
