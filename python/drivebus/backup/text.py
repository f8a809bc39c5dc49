"""How a backup looks in its file: TOML, one parameter a line, always in the same order.

The same drive gives the same lines, so that version control shows what changed and nothing else.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from drivebus.backup.rules import Rules
from drivebus.backup.unread import Unread
from drivebus.errors import NotAllowed
from drivebus.profile import Profile
from drivebus.profile.plan import labelled
from drivebus.values import Choice, Value, counted

if TYPE_CHECKING:
    from drivebus.backup.model import Backup

__all__ = ["FORMAT", "printable", "text", "worded"]

FORMAT = 1

_HEAD = """\
# The parameters of one drive. A line may be changed or taken out: change the value, and the raw word with it or take
# `raw = …` out. `told` is what the drive told where no document of its family says what that means: leave it as it is.
# `unread` is why there is no value: the drive has no such parameter, keeps it closed, refused it, or it was lost.
# `drivebus diff` compares this file with the drive, `drivebus restore` shows what it would write first.
"""


def text(backup: Backup) -> str:
    """The whole file."""
    origin, raw, unread, profile = backup.origin, backup.raw, backup.unread, backup.profile
    header: dict[str, Any] = {"format": FORMAT, "complete": backup.complete}
    if not backup.complete:
        header["interrupted"] = backup.interrupted
    lines = [_HEAD.rstrip("\n"), *(f"{key} = {_toml(value)}" for key, value in header.items()), "", "[drive]"]
    for key in (
        "family",
        "profile",
        "title",
        "unit",
        "identification",
        "firmware",
        "profile_version",
        "drivebus",
        "taken",
    ):
        value = getattr(origin, key)
        if key == "identification" and value is not None:
            lines.append(f"identification = 0x{value:04X}")
        elif key == "taken":
            lines.append(f"taken = {value:%Y-%m-%dT%H:%M:%SZ}")
        else:
            lines.append(f"# {key}: not known" if value is None else f"{key} = {_toml(value)}")
    rules = Rules(profile)
    sections: dict[str, list[str]] = {"parameters": [], "readings": []}
    for code in sorted({*raw, *unread}, key=rules.place):
        is_set = rules.uncompared(code) is None
        section = sections["parameters" if is_set else "readings"]
        if code in raw:
            section.append(_line(backup, code, is_set))
        else:
            section.append(_lacking(profile.describe(code).label, code, unread[code]))
    lines += ["", "[parameters]", *sections["parameters"]]
    if sections["readings"]:
        lines += [
            "",
            "# Never restored: what can only be read, the fault history, and what does something when written.",
        ]
        lines += ["[readings]", *sections["readings"]]
    return "\n".join(lines) + "\n"


def _line(backup: Backup, code: str, is_set: bool) -> str:
    profile, raw = backup.profile, backup.raw[code]
    known = profile.describe(code)
    value = worded(profile, code, raw)
    fields = {"value": counted(value, known.scale), "raw": str(raw)}
    if known.unit:
        fields = {"value": fields["value"], "unit": _toml(known.unit), "raw": fields["raw"]}
    if is_set and known.evidence != "verified" and code in backup.told:
        fields["told"] = str(backup.told[code])
    if _is_beyond(profile, code, raw):
        fields["beyond"] = "true"
    if code in backup.in_ram:
        fields["ram"] = "true"
    comment = f"{known.label}: {value.label}" if isinstance(value, Choice) else known.label
    if code in backup.in_ram:
        comment += "; in RAM alone, where the program that took this had put it: lost when the drive is switched off"
    inside = ", ".join(f"{key} = {shown}" for key, shown in fields.items())
    return printable(f"{code} = {{ {inside} }}  # {comment}")


def _lacking(label: str, code: str, why: Unread) -> str:
    """The line of a parameter that was not read; a remark if it was not asked for, as the profile says so again."""
    if why.why == "not asked":
        return printable(f"# {code} ({label}) is not here: {why}")
    return printable(f"{code} = {{ unread = {_toml(why.why)}, reason = {_toml(str(why))} }}  # {label}")


def _is_beyond(profile: Profile, code: str, raw: int) -> bool:
    """Whether the drive told a value that its family's documents do not allow."""
    if profile.describe(code).words > 1:
        return False
    try:
        profile.encode(code, profile.decode(code, raw))
    except NotAllowed:
        return True
    return False


def worded(profile: Profile, code: str, raw: int) -> Value:
    """*raw* in engineering units, and with its label where the profile has one."""
    return labelled(profile.describe(code), profile.decode(code, raw))


def _toml(value: object) -> str:
    """*value* as TOML has it: JSON writes plain text, numbers, true and false in the same way."""
    return json.dumps(value, ensure_ascii=False)


def printable(line: str) -> str:
    """*line* as one line: a label, or a file, may hold anything."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)
