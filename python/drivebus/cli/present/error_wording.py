"""What the library's errors advise, in words of the command line: `drivebus reset` where Python has `reset_fault()`."""

from __future__ import annotations

import re

from drivebus import DrivebusError
from drivebus.advice import Advice, Text

__all__ = ["WORDS", "in_commands"]

WORDS = {
    # calls
    "broadcast": "",
    "coast": "`drivebus coast`",
    "identify": "`drivebus info`",
    "jog": "`drivebus jog`",
    "own_methods": "",
    "prepare_control": "`drivebus prepare`",
    "reset_fault": "`drivebus reset`",
    "run": "`drivebus run`",
    "search": "`drivebus scan --search`",
    "stats": "`drivebus doctor`",
    "stop": "`drivebus stop`",
    "stop_and_wait": "`drivebus stop --wait 30`",
    "to_ram": "write without `--store` in a loop",
    "unplug": "",
    "write": "`drivebus write`",
    # arguments
    "force": "`--force`",
    "motor": "`--motor`",
    "max_current": "`--max-current off`",
    "profile": "`--profile`",
    "raw": "`--raw`",
    "replace": "`--force`",
    "reserved": "give --reserved",
    "resume": "`--fresh`",
    "serial": "`--serial`",
    "store": "`--store`",
    "transport": "`--transport {}`",
    "trust_profile": "`--trust-profile`",
    "twice": "`--twice`",
    "unverified": "`--unverified`",
    "variants": "`--variant {}=…`",
}
"""What calls and arguments of Python's are here, `{}` for the value; empty where no command leads there."""

_WITH_VALUE = {"profile": "`--profile {}`"}
"""The same, where a value is meant."""

# A name that nothing is near to.
_NAMELESS = r"\S+ has no \"[^\"]*\"$"


def in_commands(said: str | DrivebusError) -> str:
    """What *said* says, with commands and options where it names calls and arguments of Python's."""
    text = said.text if isinstance(said, DrivebusError) else Text(said)
    told = "".join(part if isinstance(part, str) else _here(part) for part in text.parts)
    return re.sub(_NAMELESS, lambda nameless: f"{nameless[0]}; `drivebus list` shows what it has", told)


def _here(advice: Advice) -> str:
    words = WORDS[advice.name] if advice.value is None else _WITH_VALUE.get(advice.name, WORDS[advice.name])
    return words.format(advice.value)
