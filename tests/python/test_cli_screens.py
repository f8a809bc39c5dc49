"""Every command as a person sees it, in a small window and a large one: nothing cut, nothing beside the screen.

What was on each screen is kept as text in `target/screens`, to be looked at: `make screens` has all sizes and colours.
`make test` has each command in the small window, where there is least room, and every third in the large one, plain.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivebus.cli.registry import GROUPS

if sys.platform == "win32":
    pytest.skip("needs a pseudo-terminal", allow_module_level=True)

from .screens import SIZES, Seen, on_a_terminal

KEPT = Path(__file__).resolve().parents[2] / "target" / "screens"

ONE = "sim://gd350?clock=virtual&seed=1"
TWO = "sim://1=gd350,2=vfd500?clock=virtual&seed=1"

SITE = """
[lines.hall]
port = "sim://1=gd350,2=vfd500?clock=virtual"

[drives.pump1]
line = "hall"
unit = 1

[drives.fan]
line = "hall"
unit = 2

[groups]
all = ["pump1", "fan"]
"""

TRY = ["try", "step", "--from", "5", "--to", "10", "--max-current", "9", "--for", "1"]

COMMANDS: dict[str, tuple[list[str], int]] = {
    "version": (["--version"], 0),
    "help": (["--help"], 0),
    "ports": (["ports"], 0),
    "scan": (["--port", TWO, "scan", "--units", "1-5"], 0),
    "scan of all settings": (["--port", ONE, "scan", "--search"], 0),
    "info": (["--port", ONE, "info"], 0),
    "status": (["--port", ONE, "status"], 0),
    "status of two": (["--drive", "all", "--unverified", "status"], 0),
    "read": (["--port", ONE, "read", "output_current", "P00.11", "2100H", "status_word_2"], 0),
    "read what is none": (["--port", ONE, "read", "output_curent"], 2),
    "monitor": (["--port", ONE, "monitor", "--count", "3", "--interval", "0"], 0),
    "monitor of two": (["--drive", "all", "--unverified", "monitor", "--count", "3", "--interval", "0"], 0),
    "record": (["--port", ONE, "record", "kept.csv", "--count", "3"], 0),
    "record what is there": (["--port", ONE, "record", "requests.csv"], 2),
    "plot": (["plot", "run.jsonl", "-o", "kept.svg"], 0),
    "plot what is none": (["plot", "requests.csv"], 2),
    "panel": (["--port", ONE, "panel"], 0),
    "panel of two": (["--drive", "all", "--unverified", "panel"], 0),
    "drives": (["drives"], 0),
    "run": (["--port", ONE, "run", "10", "--yes"], 2),
    "run without leave": (["--port", ONE, "run", "10"], 2),
    "prepare": (["--port", ONE, "prepare", "--yes"], 0),
    "stop": (["--port", ONE, "stop"], 0),
    "stop_all": (["--port", ONE, "stop", "--all"], 2),
    "coast": (["--port", ONE, "coast"], 0),
    "jog": (["--port", ONE, "jog", "--yes"], 2),
    "try": (["--port", ONE, *TRY, "--yes"], 2),
    "try without leave": (["--port", ONE, *TRY], 2),
    "try step --help": (["try", "step", "--help"], 0),
    "reset": (["--port", ONE, "reset", "--yes"], 0),
    "write": (["--port", ONE, "write", "P00.11=2.5", "P00.12=3"], 0),
    "write what is out of range": (["--port", ONE, "write", "P00.11=99999"], 2),
    "backup": (["--port", ONE, "backup", "kept.toml"], 0),
    "restore": (["--port", ONE, "restore", "older.toml", "--dry-run"], 0),
    "diff": (["--port", ONE, "diff", "older.toml", "--all"], 1),
    "faults": (["--port", ONE, "faults"], 0),
    "faults of a kind": (["faults", "OL1"], 0),
    "faults all": (["--profile", "gd350", "faults", "--all"], 0),
    "describe": (["--profile", "gd350", "describe", "P00.01"], 0),
    "describe a word": (["--profile", "gd350", "describe", "torque"], 0),
    "list": (["--profile", "gd350", "list"], 0),
    "list a group": (["--profile", "gd350", "list", "P00"], 0),
    "doctor": (["doctor", ONE, "--unit", "1"], 0),
    "discover": (["--port", ONE, "discover", "asked", "--group", "P05"], 0),
    "profiles": (["profiles"], 0),
    "profiles show": (["profiles", "show", "gd350"], 0),
    "profiles check": (["profiles", "check", "."], 2),
    "profiles new": (["profiles", "new", "acme", "--like", "gd350"], 0),
    "raw": (["--port", ONE, "raw", "01", "03", "2100", "0001"], 0),
    "raw by a script": (["--port", ONE, "raw", "--script", "requests.txt", "--yes"], 4),
    "raw by a wrong script": (["--port", ONE, "raw", "--script", "wrong.txt"], 2),
    "decode": (["decode", "01 03 02 00 03 F8 45"], 0),
    "decode a capture": (["decode", "line.pcapng"], 0),
    "sniff": (["--port", ONE, "sniff", "--for", "1"], 0),
    "replay": (["replay", "line.pcapng"], 0),
    "share": (["--port", ONE, "share", "--tcp", "127.0.0.1:0"], 0),
    "serve": (["serve", "--check"], 0),
    "hal": (["--port", ONE, "hal", "--rpm-per-hz", "60", "--hal-path", "."], 2),
    "completion": (["completion", "bash"], 0),
    "nobody answers": (["--port", ONE, "--unit", "9", "status"], 3),
    "no such port": (["--port", "/dev/nowhere", "status"], 5),
    "no such command": (["statsu"], 2),
    "trace": (["--port", ONE, "--trace", "status"], 0),
    "sim": (["sim", "--units", "1=gd350,2=vfd500", "--link", "line"], 0),
    "sim ctl": (["sim", "ctl", "status"], 2),
}

WHILE: dict[str, Callable[[list[str]], bool]] = {
    "sim": lambda lines: any("Ctrl-C" in line for line in lines),
    "replay": lambda lines: any("Ctrl-C" in line for line in lines),
    "share": lambda lines: any("Ctrl-C" in line for line in lines),
    "try without leave": lambda lines: any("Go ahead?" in line for line in lines),
    "run without leave": lambda lines: any("Go ahead?" in line for line in lines),
    "panel": lambda lines: any("stopped, 0.00" in line for line in lines),
    "panel of two": lambda lines: any("2 drives" in line for line in lines),
}
"""When a command is ended that does not end by itself."""

LIVE = {"monitor", "monitor of two", "panel", "panel of two"}
"""What shows as much as there is room for."""

AS_GIVEN = {"completion"}
"""What prints a file for another program, whatever the width."""

FEWER_COLUMNS = {"list a group"}
"""What goes without columns in a small window: the codes there stand for the names."""

COLOUR = re.compile(r"\b(3|4|9|10)[0-8]\b")
"""In a sequence that styles text; bold and faint are none, and 39 and 49 are the terminal's own."""

ESCAPES = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the commands are given: with a site file, a capture, and a backup that differs from the drive."""
    place = tmp_path_factory.mktemp("work")
    (place / "drivebus.toml").write_text(SITE)
    (place / "requests.txt").write_text("read output_current P00.11 x2\nwrite P00.11=2.5\n01 03 6300 0001\n")
    (place / "requests.csv").touch()
    (place / "wrong.txt").write_text("01 03 2100 0001\nread output_curent\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DRIVEBUS_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        seen = on_a_terminal(["--port", ONE, "backup", "older.toml"], SIZES[0], cwd=place)
        assert seen.code == 0, seen.text
        words = ["--port", ONE, "record", "run.jsonl", "--count", "3", "bus_voltage"]
        seen = on_a_terminal(words, SIZES[0], cwd=place)
        assert seen.code == 0, seen.text
        seen = on_a_terminal(["--port", ONE, "--capture", "line.pcapng", "status"], SIZES[0], cwd=place)
        assert seen.code == 0, seen.text
        older = place / "older.toml"
        older.write_text(
            re.sub(r"(?m)^(P00\.11 = .*value = )[0-9.]+(.*raw = )\d+", r"\g<1>7.5\g<2>75", older.read_text())
        )
        yield place


def looked_at(name: str, size: tuple[int, int], colours: bool, folder: Path) -> Seen:
    """What *name* showed; kept for whoever looks."""
    for kept in folder.glob("kept.*"):
        kept.unlink()
    for path in [*(folder / "acme").glob("*"), *(folder / "asked").glob("*")]:
        path.unlink()
    words, _ = COMMANDS[name]
    seen = on_a_terminal(words, size, {} if colours else {"NO_COLOR": "1"}, cwd=folder, until=WHILE.get(name))
    KEPT.mkdir(parents=True, exist_ok=True)
    place = f"{name} {size[0]}x{size[1]}{'' if colours else ' plain'}.txt"
    frame = "\n".join(f"|{line:<{size[0]}}|" for line in seen.lines)
    (KEPT / place).write_text(f"$ drivebus {' '.join(words)}\n{frame}\nexit code {seen.code}\n", encoding="utf-8")
    return seen


WINDOWS = [(size, colours) for size in SIZES for colours in (True, False)]
SMALL, LARGE = WINDOWS[0], WINDOWS[-1]


def windows_for(name: str) -> list[tuple[tuple[int, int], bool]]:
    if os.environ.get("DRIVEBUS_SCREENS") == "all":
        return WINDOWS
    return [SMALL] if [*COMMANDS].index(name) % 3 else [SMALL, LARGE]


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_fits_its_window(name: str, folder: Path) -> None:
    seen = {window: looked_at(name, *window, folder) for window in windows_for(name)}
    for (size, colours), each in seen.items():
        assert each.code == COMMANDS[name][1], each.text
        assert not re.search(r"(Traceback|\{[a-z_]+\}|\bNone\b)", each.text), each.text
        coloured = [sgr for sgr, final in ESCAPES.findall(each.raw) if final == "m" and COLOUR.search(sgr)]
        assert colours or not coloured, coloured
        if name not in AS_GIVEN | LIVE:
            longest = max(len(line) for line in re.split(r"[\r\n]+", ESCAPES.sub("", each.raw)))
            assert longest <= size[0], "the terminal broke a line where it pleased"
            assert not re.search(r"\w(…|\.\.\.)$", each.text, re.MULTILINE), each.text
    # A name that is broken cannot be typed.
    small, large = (set(re.findall(r"\w+_\w+", seen[each].text)) for each in (SMALL, [*seen][-1]))
    assert name in LIVE | AS_GIVEN | FEWER_COLUMNS or large <= small, large - small


def test_no_command_is_left_out() -> None:
    shown = {word for words, _ in COMMANDS.values() for word in words}
    every = {name for files in GROUPS.values() for names in files.values() for name in names}
    assert every - shown == {"demo"}, "the demonstration runs for most of a minute, and has tests of its own"
