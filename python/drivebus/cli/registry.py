"""Which commands there are, by what they are for, and the file that each stands in.

A command is loaded when it is asked for: `drivebus stop` does not wait for what `monitor` needs.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module

import click

__all__ = ["GROUPS", "Commands"]

GROUPS: dict[str, dict[str, tuple[str, ...]]] = {
    "Inspect": {
        "commands.inspect": ("ports", "scan", "info", "status", "read"),
        "commands.monitor": ("monitor",),
        "panel": ("panel",),
        "commands.drives": ("drives",),
    },
    "Move and write": {
        "commands.motion": ("run", "stop", "coast", "jog", "reset", "prepare", "write"),
        "commands.try_motor": ("try",),
    },
    "Save": {
        "commands.backup": ("backup", "restore", "diff"),
        "commands.record": ("record",),
        "commands.plot": ("plot",),
    },
    "Find out": {
        "commands.explain": ("faults", "describe", "list"),
        "commands.doctor": ("doctor",),
        "commands.discover": ("discover",),
        "commands.profiles": ("profiles",),
    },
    "Listen": {"commands.sniff": ("sniff",), "commands.replay": ("replay",)},
    "Machines": {"commands.hal": ("hal",), "commands.share": ("share",), "commands.serve": ("serve",)},
    "Tools": {
        "raw": ("raw",),
        "commands.decode": ("decode",),
        "sim": ("sim",),
        "commands.tools": ("completion", "demo"),
    },
}
"""The names of each file's `COMMANDS`, in the order of the help. A test compares the two."""


class Commands(MutableMapping[str, click.Command]):
    """The commands by name, each loaded when it is fetched."""

    def __init__(self) -> None:
        self._known: dict[str, str | click.Command] = {
            name: file for files in GROUPS.values() for file, names in files.items() for name in names
        }

    def __getitem__(self, name: str) -> click.Command:
        known = self._known[name]
        if isinstance(known, str):
            module = import_module(f"drivebus.cli.{known}")
            [known] = (command for command in module.COMMANDS if command.name == name)
            self._known[name] = known
        return known

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._known[name] = command

    def __delitem__(self, name: str) -> None:
        del self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def __contains__(self, name: object) -> bool:
        return name in self._known
