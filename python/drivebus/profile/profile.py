"""Families of drives: what their registers, parameters, faults and commands mean.

A profile is data; the package ships some, and `Profile.load` reads one from a folder of your own.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drivebus import _native, checks
from drivebus.errors import BadArgument, Decision

if TYPE_CHECKING:
    from drivebus.profile.facts import (
        Alias,
        FactorySerial,
        IdentificationCode,
        Memory,
        RequestRules,
        Setting,
        StartStep,
        Variant,
    )
    from drivebus.profile.plan import ReadPlan
    from drivebus.values import Description, Fault, WatchdogSettings

__all__ = ["Profile", "native_of", "profiles"]

_PLANS_KEPT = 256
"""Plans of one profile that are kept for the next time; a program asks for the same few names again and again."""


class Profile:
    """What one family of drives means by its words. Immutable, and shared freely between drives and threads."""

    __slots__ = ("_descriptions", "_names", "_native", "_orders", "_places", "_plans")

    def __init__(self, native: _native.Profile) -> None:
        self._native = native
        self._names = native.names()
        self._descriptions: dict[str, Description] = {}
        self._plans: dict[tuple[str, ...], ReadPlan] = {}
        self._places: dict[int | None, str] = {}
        self._orders: dict[int | None, str] = {}

    @classmethod
    def builtin(cls, name: str) -> Profile:
        """A shipped profile by its name, or by what its drives are called: `"atv312"`, `"ATV312"`, `"Altivar 312"`.

        Case, blanks and signs are not looked at.

        Raises:
            NotAllowed: There is none of that name; the message has the closest.
        """
        return _builtin(name)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Profile:
        """A profile from a folder with `profile.toml` and its CSV files.

        Raises:
            NotAllowed: The folder or a line in it is wrong; the message names file, line and reason.
        """
        return cls(_native.Profile.load(path))

    @classmethod
    def find(cls, profile: str | os.PathLike[str] | Profile) -> Profile:
        """The profile that *profile* means: itself, a shipped name, or a folder.

        Raises:
            NotAllowed: There is none; the message has the closest, or what is wrong in the folder.
        """
        if isinstance(profile, Profile):
            return profile
        if isinstance(profile, str) and profile.strip():
            # A shipped name comes first: what a command means must not depend on the folder one happens to be in.
            there = os.path.isdir(profile)  # noqa: PTH112 - Path raises where a name is too long
            is_folder = profile not in profiles() and (os.sep in profile or there)
            return cls.load(profile) if is_folder else cls.builtin(profile)
        if isinstance(profile, os.PathLike):
            return cls.load(profile)
        raise BadArgument(
            f"{checks.shown(profile)} is not a profile; give a name ({', '.join(profiles())}), a folder, or a Profile"
        )

    @property
    def name(self) -> str:
        """The family in one word, such as `"gd350"`."""
        return self._native.name

    @property
    def title(self) -> str:
        """The family as its maker calls it."""
        return self._native.title

    @property
    def maker(self) -> str:
        """Who makes the drives of this family; empty where the profile does not say."""
        return self._native.maker

    @property
    def models(self) -> list[str]:
        """What its maker calls drives of this family beside the title; each is taken in place of the name."""
        return self._native.models

    def aliases(self) -> list[Alias]:
        """Drives under another name that are this family; each name is taken in place of the profile's."""
        from drivebus.profile.facts import Alias

        return [Alias(*each) for each in self._native.aliases()]

    @property
    def family(self) -> str:
        """The family: its own name, or for an overlay that of the profile below it."""
        return self._native.family

    def reports_as(self) -> list[str]:
        """The families whose codes a unit may report: with a profile that lists none, also those of what it extends."""
        return self._native.reports_as()

    @property
    def kind(self) -> str:
        """`"inverter"`, or `"rectifier"` for a unit that feeds no motor."""
        return self._native.kind

    @property
    def version(self) -> int:
        """The version of the profile itself."""
        return self._native.version

    @property
    def source(self) -> str:
        """The document it rests on."""
        return self._native.source

    @property
    def functions(self) -> list[int]:
        """The function codes that the drive takes."""
        return self._native.functions

    @property
    def max_words(self) -> int:
        """Most words in one read or write."""
        return self._native.max_words

    def parameter_groups(self) -> list[int]:
        """The groups, 0..99, in which a code is its own address: P05.06 is at 0506H. Empty where there is no such rule.

        Left out are groups that the maker keeps closed, and those at whose addresses registers stand.
        """
        return self._native.parameter_groups()

    def unlisted_groups(self) -> list[int]:
        """The high bytes, 0..255, of addresses that may hold parameters without a row: with those of the rule."""
        return self._native.unlisted_groups()

    def requests(self) -> RequestRules:
        """What else is known of requests."""
        from drivebus.profile.facts import RequestRules

        return RequestRules(**self._native.requests())

    def serial(self) -> FactorySerial | None:
        """How the factory sets the line; None where that is not printed."""
        from drivebus.profile.facts import FactorySerial

        known = self._native.serial()
        return None if known is None else FactorySerial(**known)

    def counts(self) -> dict[str, dict[str, int]]:
        """How much is documented: `registers`, `parameters` and `faults`.

        Each with `total`, `sourced`, `unsourced`, `unverified` (printed in part or for a sister series) and `assumed`.
        """
        return self._native.counts()

    @staticmethod
    def check(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
        """Every mistake in the profile in a folder; an empty list if there is none.

        Each is a dict of `file`, `line` (None where a file cannot be read) and `reason`.
        """
        return [{"file": file, "line": line, "reason": reason} for file, line, reason in _native.Profile.check(path)]

    @staticmethod
    def schema() -> str:
        """The JSON schema (draft 7) of `profile.toml`, for editors: its keys and their types."""
        return _native.Profile.schema()

    def names(self) -> list[str]:
        """Every register name and parameter code, registers first, in address order."""
        return list(self._names)

    def search(self, text: str, limit: int = 20) -> list[str]:
        """Names and codes in which all words of *text*, or their synonyms (`"ramp"`), occur; the best first."""
        return self._native.search(text, checks.whole("limit", limit, 0, 10_000))

    def role(self, role: str, /) -> str | None:
        """The register with a role that every family has under some name; None where it is not known.

        Roles are `"state"`, `"fault"` (the present one), `"frequency"` (at the output), `"setpoint"` (the frequency in
        force), `"deceleration"` (the time of a stop's ramp) and `"ramp_start"` (the frequency it is counted from),
        `"identification"`, and for each of `setpoint_names` one such as `"setpoints.torque"`.
        """
        return self._native.role(role)

    @property
    def status_words(self) -> list[str]:
        """The words whose bit fields tell more of the state than the state itself."""
        return self._native.status_words()

    def monitor_names(self) -> list[str]:
        """The registers that `Drive.monitor` reads when it is given no names."""
        return self._native.monitor_names()

    def name_at(self, address: int, /, *, written: bool = False) -> str | None:
        """The register or parameter at *address* (0..0xFFFF, or the `place` of another table), or None.

        Where a state is read and a command is written, that is the state; with *written*, the command.
        """
        if not self._places:
            # The first of two names for one place is the one that is meant.
            rows = [self.describe(name) for name in self._names]
            named = list(zip(rows, self._names, strict=True))[::-1]
            self._orders = {row.place: name for row, name in named if row.access == "wo"}
            self._places = self._orders | {row.place: name for row, name in named if row.access != "wo"}
        return (written and self._orders.get(address)) or self._places.get(address)

    def describe(self, name: str, /) -> Description:
        """Everything that is known about one register or parameter. NotAllowed names the closest name."""
        known = self._descriptions.get(name)
        if known is None:
            from drivebus.values import Description

            known = self._descriptions[name] = Description(**self._native.describe(name))
        return known

    def plain_address(self, address: int, /) -> int:
        """*address* without the bit that says where a written parameter is kept."""
        stored = self._native.stored_address(address)
        return address if stored is None else stored

    def address(self, name: str, /, *, store: bool | None = None) -> int:
        """Where *name* is read; with *store* given, where it is written for RAM (False) or EEPROM (True).

        Beside the holding registers that is its `Description.place`.
        """
        return self._native.address(name, store=store)

    def read_back(self, name: str, /) -> int | None:
        """Where a write to *name* can be read back; None if that would not show whether the drive took it.

        A command, and a parameter whose write does something (P00.15 tunes the motor), tell nothing.
        """
        return self._native.read_back(name)

    def decode(self, name: str, raw: int, /) -> int | float:
        """*raw* (0..0xFFFF) in engineering units."""
        return self._native.decode(name, raw)

    def encode(self, name: str, value: object, /) -> int:
        """*value* as a word 0..0xFFFF. NotAllowed names value, range and unit."""
        return self._native.encode(name, value)

    def fields(self, name: str, raw: int, /) -> dict[str, str]:
        """The bit fields of a word, such as `{"ready": "ready", "motor": "motor 1"}`; empty for a plain number."""
        return self._native.fields(name, raw)

    def plan(self, names: Sequence[str], /) -> list[tuple[int, int]]:
        """The fewest reads (address, count) that hold all *names*."""
        return self._native.plan(names)

    def compile(self, names: Sequence[str], /) -> ReadPlan:
        """The fewest reads that hold all *names*, and the way from their words to values."""
        key = tuple(names)
        try:
            plan = self._plans.get(key)
        except TypeError:  # what cannot be looked up is no name, as the core says in its own words
            plan = None
        if plan is None:
            from drivebus.profile.plan import ReadPlan

            native = self._native.compile(key)
            plan = ReadPlan(native, [self.describe(name) for name in native.names])
            if len(self._plans) >= _PLANS_KEPT:
                self._plans.clear()
            self._plans[key] = plan
        return plan

    def command(self, name: str, /) -> tuple[int, int]:
        """Address and code of a command such as `"run_forward"` or `"coast"`."""
        return self._native.command(name)

    def command_first(self, name: str, /) -> tuple[int, int] | None:
        """Place and word of what is written before the command, which says which way the motor turns; None for most."""
        return self._native.command_first(name)

    def command_reason(self, name: str, /) -> str | None:
        """Why a command is not verified; None where it is, or where the family has no such command."""
        return self._native.command_reason(name)

    def commands(self) -> dict[str, int]:
        """Every command of the family with its code, verified or not."""
        return self._native.commands()

    def command_codes(self) -> dict[int, str]:
        """Every code that the family defines at its command register, and what it means."""
        return self._native.command_codes()

    def command_registers(self) -> dict[int, dict[int, str]]:
        """Every register that takes commands, with the codes that the family defines there.

        Most families have one; some take the reset of a fault in another.
        """
        return self._native.command_registers()

    def start_sequence(self) -> list[StartStep]:
        """The words that come, in this order, before one that runs or jogs a motor at rest; none of most families."""
        from drivebus.profile.facts import StartStep

        return [StartStep(**step) for step in self._native.start_sequence()]

    @property
    def command_address(self) -> int | None:
        """Where commands are written, as `address` tells places; None where the family has none."""
        return self._native.command_address

    def memory(self) -> Memory | None:
        """Where a written parameter is kept: None where every write may wear EEPROM."""
        from drivebus.profile.facts import Memory

        known = self._native.memory()
        return None if known is None else Memory(**known)

    def is_command(self, address: int, /) -> bool:
        """Whether a write to *address* can move a motor."""
        return self._native.is_command(address)

    def state(self, raw: int, /) -> str:
        """The name of the state that the state word *raw* shows."""
        return self._native.state(raw)

    def is_in_fault(self, raw: int, /) -> bool:
        """Whether the state word says that the drive is in fault, which it may run in."""
        return self._native.is_in_fault(raw)

    def state_tells_fault(self) -> bool:
        """Whether the state word can say that the drive is in fault. Where it cannot, the fault number alone does."""
        return self._native.state_tells_fault()

    def rest_by_frequency(self) -> bool:
        """Whether a motor only rests once its output frequency is zero, too: its state word may say so on the ramp."""
        return self._native.rest_by_frequency()

    def state_reason(self) -> str | None:
        """Why the states are not verified; None where they are, or where the family has no state word."""
        return self._native.state_reason()

    def setpoint_names(self) -> list[str]:
        """What can be given over the bus beside commands, such as `"frequency"` and `"torque"`."""
        return self._native.setpoint_names()

    def needs(self, setpoint: str, /) -> list[Setting]:
        """What must be set before the drive takes *setpoint*."""
        from drivebus.profile.facts import Setting

        return [Setting(**row) for row in self._native.needs(setpoint)]

    def variants(self) -> dict[str, Variant]:
        """Parameters that decide what some registers mean, by what they decide, such as `"speed_unit"`."""
        from drivebus.profile.facts import Variant

        return {name: Variant(**row) for name, row in self._native.variants().items()}

    @property
    def variants_chosen(self) -> dict[str, str]:
        """The choices that `with_variants` was given, by the name of the variant."""
        return self._native.variants_chosen

    def with_variants(self, chosen: Mapping[str, str]) -> Profile:
        """This profile for a drive whose variants are known: parameters that change the meaning of registers.

        Raises:
            NotAllowed: There is no such variant, or it has no such choice; the message has those that there are.
        """
        return Profile(self._native.with_variants(chosen))

    def control(self) -> list[Setting]:
        """What must be set before the drive obeys the bus, in the order in which to set it."""
        from drivebus.profile.facts import Setting

        return [Setting(**row) for row in self._native.control()]

    def fault_number(self, raw: int, /) -> int:
        """The number in the word of the present fault: its bit field `fault`, where it shares its word with others."""
        return self._native.fault_number(raw)

    def fault(self, code: int, /) -> Fault:
        """One fault by its number; an unknown number says so in its label."""
        return _fault(self._native.fault(code))

    def faults(self) -> list[Fault]:
        """Every fault that is known, by number."""
        return [_fault(row) for row in self._native.faults()]

    def fault_named(self, mnemonic: str) -> Fault | None:
        """One fault by its letters on the keypad, such as `"OL1"`, or None. Capitals count: STo and STO differ."""
        return next((fault for fault in self.faults() if fault.mnemonic == mnemonic), None)

    def exceptions(self) -> dict[int, tuple[str, str]]:
        """Name and meaning of every exception code that the family documents."""
        return self._native.exceptions()

    def exception(self, code: int, /) -> tuple[str, str]:
        """Name and meaning of an exception code in this family."""
        return self._native.exception(code)

    def exception_means(self, code: int, /) -> Decision:
        """Whether an exception is a decision: see `Refused.means`. Where the profile says nothing, as in Modbus."""
        return self._native.exception_means(code)

    def identifies(self, code: int) -> str | None:
        """The family that identification *code* names, as far as this profile knows; None if it does not."""
        return self._native.identify(code)

    def identifications(self) -> list[IdentificationCode]:
        """The identification codes that this profile knows."""
        from drivebus.profile.facts import IdentificationCode

        rows = self._native.identifications()
        return [IdentificationCode(**{**row, "shared": tuple(row["shared"])}) for row in rows]

    def signature(self) -> dict[str, list[int]] | None:
        """How a unit without a code is identified: the addresses that it `answers` and `refuses`, one word each."""
        signature = self._native.signature()
        return None if signature is None else {"answers": signature[0], "refuses": signature[1]}

    @property
    def identification_address(self) -> int | None:
        """The address of the identification code, 0..0xFFFF; None if it is not known."""
        register = self.role("identification")
        return None if register is None else self.address(register)

    @property
    def watchdog(self) -> WatchdogSettings | None:
        """The settings that make the drive act by itself when its bus falls silent; None if the family has none."""
        from drivebus.values import WatchdogSettings

        settings = self._native.watchdog()
        return None if settings is None else WatchdogSettings(**settings)

    @property
    def maximum_frequency(self) -> str | None:
        """The parameter that holds the drive's highest output frequency, if it has one."""
        register = self.role("setpoints.frequency")
        return None if register is None else self.describe(register).high_from

    @property
    def fault_history(self) -> tuple[str, ...]:
        """The parameters that hold the last faults, the latest first."""
        return tuple(self._native.fault_history())

    @property
    def fault_values(self) -> tuple[str, ...]:
        """The parameters that hold what was measured when the drive tripped last."""
        return tuple(self._native.fault_values())

    def acts(self) -> list[str]:
        """The parameters that act when they are written, such as one that tunes the motor."""
        return self._native.acts()

    def serial_parameters(self) -> list[str]:
        """The parameters that set the line."""
        return self._native.serial_parameters()

    def motor_parameters(self) -> list[str]:
        """The parameters that describe the motor."""
        return self._native.motor_parameters()

    def last_parameters(self) -> list[str]:
        """The parameters that are to be written last of many, in this order."""
        return self._native.last_parameters()

    def __repr__(self) -> str:
        return f"Profile({self.name!r})"


def profiles() -> list[str]:
    """The names of the profiles that come with the package."""
    return _native.Profile.builtin_names()


def native_of(profile: Profile) -> _native.Profile:
    """What *profile* is in the core."""
    return profile._native


@functools.cache
def _builtin(name: str) -> Profile:
    # One object each, whatever it is called: equal profiles are the same profile.
    native = _native.Profile.builtin(name)
    return Profile(native) if native.name == name else _builtin(native.name)


def _fault(row: dict[str, Any]) -> Fault:
    from drivebus.values import Fault

    known: dict[str, Any] = {key: "" if told is None else told for key, told in row.items() if key != "source"}
    return Fault(**known)
