"""Lines that people type at the prompt: with history and completion where Python has readline, else as they come."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import drivebus
from drivebus.cli.raw.families import UnitFamilies
from drivebus.cli.raw.script import VERBS
from drivebus.site import state_file

__all__ = ["Editing", "completions"]

_KEPT = 1000
"""Lines of the history that are kept from one run to the next."""

_SEPARATORS = " \t"


class Editing:
    """Reads lines from the terminal, in a `with` block that keeps the history when it ends.

    Attributes:
        unit: Whose names are meant, for the completion.
    """

    def __init__(self, families: UnitFamilies) -> None:
        self.unit = 1
        self._families = families
        self._readline = _readline()
        self._found: list[str] = []

    def __enter__(self) -> Editing:
        if self._readline is not None:
            self._begin(self._readline)
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if self._readline is not None:
            self._keep(self._readline)
            self._readline.set_completer(None)

    def line(self, prompt: str) -> str | None:
        """The next line; None at the end of what is typed."""
        try:
            # Without both terminals Python would not edit, and the prompt would stand among the results.
            if self._readline is None or not sys.stdout.isatty():
                print(prompt, end="", file=sys.stderr, flush=True)
                text = sys.stdin.readline()
                if not text:
                    raise EOFError
                return text
            line = input(prompt)
        except EOFError:
            print(file=sys.stderr)
            return None
        # Not by itself: the answer to a question is nothing to go back to.
        if line.strip():
            self._readline.add_history(line)
        return line

    def complete(self, text: str, number: int) -> str | None:
        """What readline asks for: the *number*-th text that the word *text* may become, or None."""
        assert self._readline is not None
        if number == 0:
            words = self._readline.get_line_buffer()[: self._readline.get_begidx()].split()
            with suppress(drivebus.DrivebusError):
                self._found = completions(words, text, self._units(), self._profiles())
        return self._found[number] if number < len(self._found) else None

    def _units(self) -> list[int]:
        return sorted({self.unit, *self._families.units})

    def _profiles(self) -> list[drivebus.Profile]:
        """The family of the unit if it is known; else all that are shipped."""
        known = self._families.known(self.unit)
        return [known] if known else [drivebus.Profile.builtin(name) for name in drivebus.profiles()]

    def _begin(self, readline: ModuleType) -> None:
        with suppress(OSError):
            readline.read_history_file(state_file("raw_history"))
        readline.set_history_length(_KEPT)
        readline.set_auto_history(False)
        readline.set_completer_delims(_SEPARATORS)
        readline.set_completer(self.complete)
        # What macOS has under this name is another library.
        edits = "libedit" in (readline.__doc__ or "")
        readline.parse_and_bind("bind ^I rl_complete" if edits else "tab: complete")

    def _keep(self, readline: ModuleType) -> None:
        # A user without a home, a full disk, a folder that may not be written to: nothing is kept then.
        with suppress(OSError):
            place = Path(state_file("raw_history"))
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            readline.write_history_file(place)


def completions(
    words: Sequence[str], begun: str, units: Sequence[int], profiles: Sequence[drivebus.Profile]
) -> list[str]:
    """What the word *begun* may become, behind *words* of the same line.

    Args:
        words: What stands before it.
        begun: Its first letters; may be empty.
        units: Those that are known on the line, 1..247.
        profiles: The families that the unit may be of.
    """
    verb = words[0].lower() if words else ""
    if not words:
        found: Iterable[str] = [f"{word} " for word in (*VERBS, "help", "quit")] + [f"{unit:02X} " for unit in units]
    elif verb in ("read", "write"):
        rows = [profile.describe(name) for profile in profiles for name in profile.names()]
        usable = [row for row in rows if row.address is not None and (verb == "read" or row.writable)]
        both = [name for row in usable for name in (row.name, row.code) if name]
        found = [f"{name}{'=' if verb == 'write' else ' '}" for name in both]
    elif len(words) == 1 and verb not in VERBS:
        found = [f"{code:02X} " for code in sorted({code for profile in profiles for code in profile.functions})]
    elif verb == "unit":
        found = [str(unit) for unit in units]
    else:
        found = []
    return [each for each in dict.fromkeys(found) if each.lower().startswith(begun.lower())]


def _readline() -> ModuleType | None:
    """The library that edits lines; None where Python came without."""
    try:
        import readline
    except ImportError:
        return None
    return readline
