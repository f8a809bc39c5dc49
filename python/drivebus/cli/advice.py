"""What the library's errors advise, in words of the command line: `drivebus reset` where Python has `reset_fault()`."""

from __future__ import annotations

import re

__all__ = ["in_commands"]

_WHOLE = {
    "stop() it, and wait_until_stopped(), before a jog": "`drivebus stop --wait 30` before a jog",
    "(bus.stats() may say how)": "(`drivebus doctor` may say how)",
    "prepare_control() (`drivebus prepare`)": "`drivebus prepare`",
    ", or for terminals and the special control word their own methods": "",
    "; line.unplug() pulls out any port": "",
    "give reserved=True to the bus": "give --reserved",
    "; or use broadcast()": "",
    ", or use broadcast()": "",
    "Write it by a drive without variants=…": "Write it without `--variant`",
}
"""Advice that reads otherwise here as a whole."""

_COMMANDS = {
    "run()": "run",
    "stop()": "stop",
    "coast()": "coast",
    "jog()": "jog",
    "write()": "write",
    "read()": "read",
    "reset_fault()": "reset",
}
"""What a call of Python's is as a command."""

# `force=True (`--force`)`, `variants={…} for bus.drive() (`--variant …`; Hz, rpm)`: both languages at once.
_BOTH = re.compile(r"\w+=(?:\{[^}]*\}|True|…)(?: (?:for|to) bus\.drive\(\))? \(`(--[^`]+)`(?:; ([^)]*))?\)")
# A name that nothing is near to.
_NAMELESS = re.compile(r"\S+ has no \"[^\"]*\"$")
_CALL = re.compile("|".join(re.escape(call) for call in _COMMANDS))


def in_commands(text: str) -> str:
    """*text* with commands and options where it names calls and arguments of Python's."""
    for python, here in _WHOLE.items():
        text = text.replace(python, here)
    text = _NAMELESS.sub(lambda said: f"{said[0]}; `drivebus list` shows what it has", text)
    text = _BOTH.sub(lambda both: f"`{both[1]}`" + (f" ({both[2]})" if both[2] else ""), text)
    return _CALL.sub(lambda call: f"`drivebus {_COMMANDS[call[0]]}`", text)
