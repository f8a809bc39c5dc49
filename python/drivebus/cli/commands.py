"""Which commands there are, by what they are for, and the file of this folder that each stands in.

A command is loaded when it is asked for: `drivebus stop` does not wait for what `monitor` needs.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module

import click

__all__ = ["GROUPS", "Commands"]

GROUPS: dict[str, dict[str, tuple[str, ...]]] = {
    "Look": {
        "reading": ("ports", "scan", "info", "status", "read"),
        "monitor": ("monitor",),
        "panel": ("panel",),
        "drives": ("drives",),
    },
    "Move, write": {"move": ("run", "stop", "coast", "jog", "reset", "prepare", "write"), "trying": ("try",)},
    "Keep": {"backup": ("backup", "restore", "diff"), "record": ("record",), "plot": ("plot",)},
    "Find out": {
        "explain": ("faults", "describe", "list"),
        "doctor": ("doctor",),
        "discover": ("discover",),
        "profiles": ("profiles",),
    },
    "Overhear": {"sniff": ("sniff",), "replay": ("replay",)},
    "Machines": {"hal": ("hal",)},
    "Tools": {"raw": ("raw",), "frames": ("decode",), "simulation": ("sim",), "tools": ("completion", "demo")},
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
