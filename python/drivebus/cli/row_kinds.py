"""What the name of a row says that it is, and whether that or its unit speaks against what it is taken for."""

from __future__ import annotations

import re
from collections.abc import Collection

from drivebus.cli.manual_cells import TableRow

__all__ = ["against"]

_RATE = r"(?:freq\w*|speed)"
_KINDS = {
    "command": r"command|control(?! mode)|reset",
    "setpoint": rf"set ?-?point|reference|\bref\d*\b|target|preset|\bset(?:ting|ted)? ?{_RATE}|\bgiven\b"
    rf"|{_RATE} (?:command|set(?:ting)?\b|order)|command(?:ed)? (?:output )?{_RATE}",
    "state": r"\bstat(?:e|us|es)\b",
    "fault": r"^(?!.*\breset).*(?:fault|\btrip|alarm|error|malfunction|failure)",
    "speed": rf"(?:output|actual|running|operating|operation|present) {_RATE}|{_RATE} (?:output|feedback|actual)",
    "current": r"\bcurrents?\b(?! (?:fault|trip|alarm|error|stat|freq|speed|output freq))|\bamp",
    "voltage": r"volt|\bdc[ -](?:bus|link)|\bmains\b",
    "torque": r"torque",
    "power": r"power(?! ?(?:on|up|off|supply|stage))",
    "temperature": r"temperature|\btemp\b|heat ?sink|thermal",
    "time": r"\btime\b|time-?out|\bhours?\b|duration|delay|interval",
    "energy": r"energy|\bkwh\b",
    "count": r"\bcount(?:er|s)?\b|pulses?\b",
    "terminal": r"\b(?:digital|analogu?e?|virtual) outputs?|\binputs?\b|terminals?\b|relay|\b[da][io]\b",
    "limit": r"\bmax|\bmin(?:imum)?\b|\bupper|\blower|limit|highest|lowest|ceiling",
    "acceleration": r"^(?!.*dece?l).*acce?l",
    "deceleration": r"dece?l",
    "source": r"\bsource|select|channel",
    "pid": r"\bpid\b|\bpi\b",
    "identity": r"version|\bmodel\b|\bserial n|identification",
}
_MEANT = {
    "command": ({"command"}, {"fault"}),
    "setpoint": ({"setpoint"}, {"command", "speed", "limit", "count"}),
    "state": ({"state"}, {"fault", "command"}),
    "speed": ({"speed"}, {"state"}),
    "fault": ({"fault"}, {"state"}),
    "frequency": ({"limit", "speed", "setpoint"}, set[str]()),
    "stop time": ({"deceleration", "time"}, {"command"}),
    "time": ({"time"}, {"fault", "command", "state"}),
}
"""Of what is asked for, what its name may say that it is, and what else may stand in such a name."""


def against(row: TableRow, kind: str, units: Collection[str]) -> str | None:
    """What speaks against *row* as a thing of *kind* that counts in one of *units*; None where nothing does."""
    if row.unit and row.unit not in units:
        return f"{row.code or row.name} is in {row.unit}, by its table"
    plain = " ".join(re.sub("[_/]", " ", row.label.lower()).split())
    kinds = {name for name, words in _KINDS.items() if re.search(words, plain)}
    own, beside = _MEANT[kind]
    # A row that no table has got its name here.
    is_so = not row.line or not kinds or (own & kinds and kinds <= own | beside)
    return None if is_so else f'The table calls {row.shown} "{row.label}"'
