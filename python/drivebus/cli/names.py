"""What people type for a register: its name, a parameter code, or an address; and the values they give it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

import drivebus
from drivebus.cli.option_types import with_a_point
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.wrong_use import WrongUse
from drivebus.line.addresses import EVERYBODY, Addresses

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

__all__ = [
    "complete_assignment",
    "complete_group",
    "complete_name",
    "complete_profile",
    "complete_units",
    "complete_variant",
    "completions",
    "evidence",
    "named",
    "parse_assignment",
    "parse_families",
    "parse_hex",
    "parse_units",
    "parse_variants",
    "resolve",
    "without_unit",
]

_ADDRESS = r"(?:0x([0-9a-f]{1,4})|([0-9a-f]{1,4})h)"


def resolve(profile: drivebus.Profile, text: str, *, written: bool = False) -> str | int:
    """The name that *text* stands for, or the address where the profile has no name for it.

    An address stands for what is read there, or with *written* for what is written.

    An unknown name stays what it is: the profile refuses it and names the closest.
    """
    if not text.strip():
        raise WrongUse("an empty text is not a name; give one such as output_current, P00.11 or 3004H")
    if "=" in text:
        raise WrongUse(f'"{text}" is not a name; `drivebus write {text}` gives something a value')
    match = re.fullmatch(_ADDRESS, text, re.IGNORECASE)
    if match:
        address = int(match[1] or match[2], 16)
        return profile.name_at(address, written=written) or address
    return text


def named(profile: drivebus.Profile, text: str) -> str:
    """As `resolve`, for what needs a name: an address without one is refused."""
    place = resolve(profile, text)
    if isinstance(place, int):
        raise drivebus.BadArgument(f"{profile.name} has no name for address {place:04X}H; `read` takes it as it is")
    return place


def evidence(profile: drivebus.Profile, row: drivebus.Description) -> str:
    """How well *row* is proved, with what its values mean: a state's codes may be less sure than its place."""
    if row.evidence == "verified" and profile.state_reason() is not None and row.name == profile.role("state"):
        return "unverified"
    return row.evidence


def parse_assignment(text: str) -> tuple[str, int | float | str]:
    """Name and value of `NAME=VALUE`; the value a number, or the label of a choice."""
    name, equals, value = text.partition("=")
    name, value = name.strip(), value.strip()
    if not equals or not name or not value:
        raise WrongUse(f'"{text}" is not an assignment; write NAME=VALUE, such as P00.11=5.0')
    if with_a_point(value):
        raise WrongUse(f'"{text}" has a comma in its number{with_a_point(value)}')
    for kind in (lambda digits: int(digits, 0), float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def without_unit(value: int | float | str, unit: str) -> int | float | str:
    """*value* as a number, where it was typed with its own unit: `5s`, `12.5 Hz`."""
    if isinstance(value, str) and unit and value.endswith(unit):
        try:
            return float(value.removesuffix(unit))
        except ValueError:
            return value
    return value


def parse_hex(parts: tuple[str, ...]) -> bytes:
    """Bytes typed in any of the usual ways: `01 03 21 00`, `01032100`, `0x01,0x03`."""
    text = re.sub(r"0x|[\s,:]", "", " ".join(parts), flags=re.IGNORECASE)
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise WrongUse(
            f'"{" ".join(parts)}" is not hexadecimal bytes; write two digits each, such as 01 03 21 00 00 01'
        ) from None


def parse_units(text: str, addresses: Addresses = EVERYBODY) -> list[int]:
    """Units of a text such as `1-31,40`, if the line has such *addresses*; which those are may not be known yet."""
    units: list[int] = []
    for part in text.split(","):
        begins, is_range, ends = (each.strip() for each in part.partition("-"))
        given = [begins, ends] if is_range else [begins]
        if not all(each.isdecimal() and len(each) <= 20 for each in given):
            raise WrongUse(f'"{part}" is not a unit address; write 1-247, or a list such as 1-31,40')
        first, last = int(given[0]), int(given[-1])
        # What a line has is without a gap.
        why = addresses.why_not(first) or addresses.why_not(last)
        if why:
            which, are = ("units", "are") if is_range else ("unit", "is")
            raise WrongUse(f'{which} "{part.strip()}" {are} out of range; allowed is 1 to 247; {in_commands(why)}')
        if first > last:
            raise WrongUse(f'units "{part.strip()}": the first is above the last; write {last}-{first}')
        units.extend(range(first, last + 1))
    return units


def parse_families(text: str | None) -> dict[int, str] | str | None:
    """What `--profile` says of several units: `3=gd350,5=vfd500`; one name is for all of them."""
    if text is None or "=" not in text:
        return text
    families: dict[int, str] = {}
    for part in text.split(","):
        units, _, name = part.partition("=")
        if not name.strip():
            raise WrongUse(f'"{part}" is not a unit and its family; write 3=gd350, or a list such as 1-4=gd350')
        families |= dict.fromkeys(parse_units(units), name.strip())
    return families


def parse_variants(_context: click.Context, _parameter: click.Parameter, texts: tuple[str, ...]) -> dict[str, str]:
    """Names and choices of texts such as `speed_unit=Hz`."""
    chosen: dict[str, str] = {}
    for text in texts:
        name, equals, choice = (part.strip() for part in text.partition("="))
        if not equals or not name or not choice:
            raise click.BadParameter(f'"{text}" is not a choice; write NAME=CHOICE, such as speed_unit=Hz')
        if chosen.setdefault(name, choice) != choice:
            raise click.BadParameter(f"{name} is given twice, as {chosen[name]} and as {choice}")
    return chosen


def _names(context: click.Context) -> list[str]:
    """Registers and parameters; a parameter by its code and by the name that it may have."""
    named = ((name, profile.describe(name).name) for profile in _profiles(context) for name in profile.names())
    return list(dict.fromkeys(name for both in named for name in both))


def _profiles(context: click.Context) -> list[drivebus.Profile]:
    """The profile that stands on the line already; without one, all that are shipped."""
    asked = context.find_root().params.get("profile")
    try:
        return [drivebus.Profile.find(asked)] if asked else [*map(drivebus.Profile.builtin, drivebus.profiles())]
    except drivebus.NotAllowed:
        return []


def completions(texts: Iterable[str], kind: str = "plain") -> list[CompletionItem]:
    """*texts* as the shell offers them; of the *kind* `"file"` or `"dir"` it looks for those that begin so itself."""
    from click.shell_completion import CompletionItem

    return [CompletionItem(text, type=kind) for text in texts]


def complete_name(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Names and codes of the profile that is given, or of all, for the shell."""
    return completions(name for name in _names(context) if name.lower().startswith(incomplete.lower()))


def complete_assignment(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """As `complete_name`, up to the equals sign."""
    return completions(f"{item.value}=" for item in complete_name(context, parameter, incomplete))


def complete_group(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Groups of the profile that is given, or of all; behind the dot codes."""
    known = (profile.describe(name) for profile in _profiles(context) for name in profile.names())
    codes = {".", "-"} & set(incomplete)
    texts = [row.code if codes else row.group for row in known if row.code is not None]
    return completions(text for text in dict.fromkeys(texts) if text.lower().startswith(incomplete.lower()))


def _called(profile: drivebus.Profile) -> list[str]:
    """What people may call drives of *profile*, beside its name."""
    aliases = (alias.name for alias in profile.aliases())
    return [profile.title.removeprefix(profile.maker).strip(), *profile.models, *aliases]


def complete_profile(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Names of the shipped profiles, and folders, for the shell."""
    begun = incomplete.lower()
    known = [name for name in drivebus.profiles() if name.startswith(begun)]
    if not known and begun:
        # What has a blank in it a shell takes apart.
        called = (name for family in drivebus.profiles() for name in _called(drivebus.Profile.builtin(family)))
        known = sorted(name for name in called if name.lower().startswith(begun) and " " not in name)
    return completions(known) or completions([incomplete], "dir")


def complete_units(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The families behind the last unit of `1=gd350,2=`, for the shell."""
    before, equals, begun = incomplete.rpartition("=")
    if not equals or "," in begun:
        return []
    return completions(f"{before}={name}" for name in drivebus.profiles() if name.startswith(begun))


def complete_variant(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """What the registers of the profile that is given may be, for the shell."""
    chosen = (
        f"{name}={choice}"
        for profile in _profiles(context)
        for name, variant in profile.variants().items()
        for choice in variant.choices
    )
    return completions(text for text in dict.fromkeys(chosen) if text.startswith(incomplete))
