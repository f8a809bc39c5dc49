"""What `drivebus profiles new` writes: the files of a profile that is sound and knows next to nothing yet.

Every example row is `assumed`: it says how a row looks, and nothing can be sent on its word.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import drivebus
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.profile_answers import Answers

__all__ = ["NAMES", "family_name", "files", "files_of_answers", "files_of_table"]

_REGISTERS = "address,name,label,unit,scale,signed,words,low,high,high_from,variant,access,verified,note,source\n"
_PARAMETERS = (
    "code,name,label,unit,scale,signed,words,low,low_from,high,high_from,default,access,choices,verified,note,source\n"
)
_FAULTS = "code,mnemonic,label,cause,remedy,verified,note,source\n"

_EXAMPLE_REGISTER = "0x1000,example_frequency,An example,Hz,100,no,,0.00,50.00,,,ro,assumed,Replace this row.,\n"
_EXAMPLE_PARAMETER = (
    "P00.00,example_choice,An example,,1,no,,0,,2,,0,stop,0=keypad;1=terminals;2=bus,assumed,Replace this row.,\n"
)
_EXAMPLE_FAULT = "1,OC,An example,Why it may have come,What to do about it,assumed,Replace this row.,\n"

_SCHEMA = "profile.schema.json"

NAMES = ("profile.toml", "registers.csv", "parameters.csv", "faults.csv", _SCHEMA)
"""The files of a profile."""

_HEAD = """\
#:schema ./{schema}
# {what}
#
# The long tables stand beside this file: registers.csv, parameters.csv, faults.csv. After each change:
#   drivebus profiles check {folder}
# {schema} says what each key means: an editor shows it while you type. A whole profile in words:
#   drivebus profiles show gd350

name = "{name}"
title = "{title}"
"""

_VERSION = """\
version = 1  # count it up when you change something: backups keep it
source = "Which manual, which edition, which chapter"
"""

_NEW = """\
kind = "inverter"  # or "rectifier", which has no reverse, no jog and no frequency

# The line as the drive leaves the factory.
# [serial]
# baud_rate = 9600
# format = "8N1"
# unit = 1
# response_delay_ms = 5
# verified = true
# source = "…, p. …"

# The functions that the drive knows, and the most words it takes in one request.
[requests]
functions = [0x03, 0x06]
max_words = 1
source = "Not read yet: what nearly every drive can"

# P05.06 is at 0506H. Without [parameters.memory] every write of a parameter is taken to wear EEPROM.
[parameters]
{rule}
# closed_groups = [99]   # groups that nobody may touch
# acts = ["P00.15"]      # writing it does something, such as tuning the motor
# serial = ["P14"]       # the drive's own line: a restore leaves it alone unless asked
# motor = ["P02"]        # the motor's data: likewise
# last = ["P00.01"]      # what a restore writes last, in this order
source = "Not read yet: the rule of most drives with codes such as P05.06"

# [parameters.memory]
# bit = 15               # of the address
# means = "ram"          # set, the write goes to RAM only; "eeprom": set, it is kept
# Instead, where all stays in RAM until a word stores it:
# store = {{ register = "…", word = 1, idle = 0 }}  # idle: what stands there before, and when it is through
# verified = true
# source = "…, p. …"

# Where the drive says what it is.
# [identification]
# register = "identification_code"
#
# [[identification.codes]]
# code = 0x0100
# family = "{name}"
# title = "{title}"
# verified = true
# source = "…, p. …"

# A motor is started only where the drive can also be told to stop or to coast.
# [commands]
# register = "control_command"
# moves = ["control_command"]    # every register whose write can start a motor
# source = "…, p. …"
#
# [commands.codes]               # also run_reverse, jog_forward, jog_reverse, jog_stop
# run_forward = 1
# stop = 5
# coast = 6
# reset_fault = 7

# What the drive does, as a number …
# [state]
# register = "status_word"
# source = "…, p. …"
#
# [state.codes]                  # also power_off, pre_exciting
# forward = 1
# reverse = 2
# stopped = 3
# fault = 4
#
# … or as bits; of those that fit, one that runs, else the first:
# [[state.when]]
# is = "fault"
# fields = {{ fault = 1 }}

# Where status() looks beside the state.
# [status]
# fault = "fault_code"
# frequency = "running_frequency"
# setpoint = "set_frequency_actual"

# The time that the ramp of a stop takes to 0 Hz, and the frequency that it is counted from.
# [ramp]
# deceleration = "P00.12"
# start = "P00.03"

# What must be set before the drive obeys the bus, in this order.
# [[control]]
# code = "P00.01"
# value = 2
# label = "run commands come from the bus"
# verified = true
# source = "…, p. …"

# [setpoints.frequency]
# register = "set_frequency"

# What `monitor` shows when it is not told what.
[monitor]
registers = []

# Exceptions that mean something else than in the Modbus specification.
# [[exceptions]]
# code = 0x04
# name = "out_of_range"
# meaning = "the value is out of range"
# source = "…, p. …"

# Words whose bits mean something: [highest bit, lowest bit].
# [bits]
# status_word = [
#     {{ name = "fault", bits = [3, 3], values = {{ 0 = "no fault", 1 = "tripped" }} }},
# ]
"""

_BY_CODE = 'address = "group.index"  # or "listed": each row of parameters.csv has its own, in a column "address"'
_LISTED = 'address = "listed"  # each row of parameters.csv has its own'

_EXTENDS = """\

# Everything of {base} that is not said here is taken over, as unverified: it can be read, and written only with
# unverified=True, until your own manual prints it too and `confirmed` names it.
[extends]
profile = "{base}"
assumption = "Not said yet: why this drive should be like {base}, and which document says so"
confirmed = []  # names and codes of {base} that your manual prints too, such as "control_command", "P00.03"
# confirmed_source = "…, p. …"   # needed as soon as something is confirmed
"""

_OVERLAY = """\

# The same drive as {base}, and what you know of it beyond that: rows of the tables beside this file stand in place of
# those of the same name or code, and tables below in place of the same tables. The rest stays as it is.
[overlay]
profile = "{base}"
"""


def family_name(folder: str) -> str:
    """A name for the profile in *folder*, made of what a name may hold."""
    return re.sub(r"[^a-z0-9_-]+", "-", folder.lower()).strip("-") or "my-drive"


def files(folder: str, *, like: str | None = None, overlay: str | None = None, listed: bool = False) -> dict[str, str]:
    """The files of a profile in *folder*, by name: from nothing, after a sibling, or over a shipped profile.

    With *listed*, each parameter has an address of its own.
    """
    name = family_name(folder)
    if overlay is not None:
        words = {"what": f"What we know of our {overlay} beyond its profile.", "title": f"{name}, a {overlay}"}
        rest = _VERSION + _OVERLAY.format(base=overlay)
    elif like is not None:
        words = {"what": f"A family that is much like {like}.", "title": name}
        rest = _VERSION + _EXTENDS.format(base=like)
    else:
        words = {"what": "A family of drives.", "title": name}
        rest = _VERSION + _NEW.format(name=name, title=name, rule=_LISTED if listed else _BY_CODE)
    filled = like is None and overlay is None
    return {
        "profile.toml": _HEAD.format(schema=_SCHEMA, folder=folder, name=name, **words) + rest,
        "registers.csv": _REGISTERS + _EXAMPLE_REGISTER * filled,
        "parameters.csv": _PARAMETERS + _EXAMPLE_PARAMETER * filled,
        "faults.csv": _FAULTS + _EXAMPLE_FAULT * filled,
        _SCHEMA: drivebus.Profile.schema(),
    }


def files_of_table(folder: str, table: ManualTable) -> dict[str, str]:
    """The files of a new profile in *folder* whose rows are those of *table*.

    What the loader does not take of a row goes into its note. A row that it does not take at all is left out.
    *table* tells both.
    """
    written = files(folder, listed=bool(table.parameters)) | {"faults.csv": _FAULTS}
    if any(row.table == "input" for row in table.rows):
        written["profile.toml"] = written["profile.toml"].replace("functions = [0x03, ", "functions = [0x03, 0x04, ")
    return _with_rows(written, table)


def files_of_answers(folder: str, answers: Answers) -> dict[str, str]:
    """The files of a new profile in *folder* that says what was answered.

    Its rows are taken as in `files_of_table`.
    """
    rules = answers.rules(folder, family_name(folder)) + "\n"
    written = {"profile.toml": rules, "faults.csv": _FAULTS + answers.fault_rows(), _SCHEMA: drivebus.Profile.schema()}
    return _with_rows(written, answers.table)


def _with_rows(written: dict[str, str], table: ManualTable) -> dict[str, str]:
    """*written*, and the rows of *table* that the loader takes beside it."""
    while True:
        written |= table.csv()
        with tempfile.TemporaryDirectory(prefix="drivebus-profile-") as place:
            for name, text in written.items():
                Path(place, name).write_text(text, encoding="utf-8", newline="\n")
            problems = drivebus.Profile.check(place)
        # A mistake of the rules is no row's; whoever wrote them is told.
        rows = {"registers.csv": table.registers, "parameters.csv": table.parameters}
        wrong = {
            (Path(problem["file"]).name, problem["line"]): problem["reason"]
            for problem in problems
            if problem["line"] is not None and Path(problem["file"]).name in rows
        }
        if not wrong:
            return written
        for (name, line), reason in wrong.items():
            table.give_up(rows[name][line - 2], reason)
