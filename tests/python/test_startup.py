"""What a program loads before it does what it was asked for: nothing that it does not need.

How long that takes is told by `tools/measure_startup.py`; here it is the modules that are counted, and no clock.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterable
from importlib import import_module
from operator import attrgetter
from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
from drivebus.cli import cli
from drivebus.cli.registry import GROUPS

LOADED = "import json, sys; print(json.dumps(sorted(before)), file=sys.stderr)"

SLOW = {
    "asyncio",
    "difflib",
    "email",
    "http",
    "json",
    "logging",
    "numpy",
    "pandas",
    "pathlib",
    "rich",
    "serial",
    "tomllib",
}
"""What would be noticed at every start, ours and others'. Some of them come with a command that needs them."""

STOPPED = """
import sys
import drivebus
stop = drivebus.Drive.stop

def told(drive, *args, **kwargs):
    global before
    before = set(sys.modules)
    stop(drive, *args, **kwargs)

drivebus.Drive.stop = told
from drivebus.cli import main
sys.argv[1:] = ["--port", "sim://gd350", "--profile", "gd350", "stop"]
try:
    main()
except SystemExit as done:
    assert not done.code
"""


def loaded(program: str) -> set[str]:
    """The modules that *program* had loaded when it set `before`."""
    done = subprocess.run([sys.executable, "-c", f"{program}\n{LOADED}"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stderr.splitlines()[-1]))


def ours(modules: Iterable[str], inside: str = "drivebus") -> set[str]:
    """The modules of *inside* among *modules*."""
    return {name for name in modules if name == inside or name.startswith(f"{inside}.")}


def slow(modules: Iterable[str]) -> set[str]:
    """What is slow among *modules*."""
    return {name for name in modules if name.partition(".")[0] in SLOW}


def test_importing_the_package_loads_next_to_nothing() -> None:
    modules = loaded("import sys, drivebus; before = set(sys.modules)")
    assert ours(modules) == {"drivebus", "drivebus.lazy_names"}
    assert not slow(modules)


def test_a_name_loads_what_it_stands_on() -> None:
    modules = loaded("import sys; from drivebus import State; before = set(sys.modules)")
    assert ours(modules) == {
        "drivebus",
        "drivebus.lazy_names",
        "drivebus.plain_annotations",
        "drivebus.values",
        "drivebus.values.states",
    }


def test_the_version_is_told_without_the_commands() -> None:
    program = "import sys; sys.argv[1:] = ['--version']; from drivebus.cli import main; main()"
    modules = loaded(f"{program}; before = set(sys.modules)")
    assert ours(modules) == {
        "drivebus",
        "drivebus._native",
        "drivebus.cli",
        "drivebus.lazy_names",
        "drivebus.plain_annotations",
    }
    assert "click" not in modules
    assert not slow(modules)


def test_the_version_is_that_of_the_whole_program() -> None:
    done = subprocess.run([sys.executable, "-m", "drivebus", "--version"], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, CliRunner().invoke(cli, ["--version"]).output, "")
    assert drivebus.__version__ in done.stdout


def test_a_stop_is_sent_before_anything_is_loaded_that_it_does_not_need() -> None:
    modules = loaded(STOPPED)
    assert not slow(modules)
    assert ours(modules, "drivebus.cli") == {
        "drivebus.cli",
        *(
            f"drivebus.cli.{name}"
            for name in (
                "app",
                "commands",
                "commands.motion",
                "drive_selection",
                "names",
                "option_order",
                "option_types",
                "each_drive",
                "present",
                "present.error_wording",
                "present.errors",
                "present.motors",
                "present.help_format",
                "present.output",
                "registry",
                "session",
                "suspension",
                "wrong_use",
            )
        ),
    }
    assert ours(modules, "drivebus.backup") == {"drivebus.backup", "drivebus.backup.drive_backup"}
    assert not ours(modules, "drivebus.aio") | ours(modules, "drivebus.doctor") | ours(modules, "drivebus.rtu")
    assert not modules & {f"drivebus.values.{name}" for name in ("control", "descriptions", "snapshots", "status")}
    assert "drivebus.line.device" not in modules


def test_a_port_that_is_named_loads_no_simulator() -> None:
    program = """
import sys
import drivebus
try:
    drivebus.Bus("/dev/none")
except drivebus.PortError:
    before = set(sys.modules)
"""
    assert "drivebus.sim" not in loaded(program)


@pytest.mark.parametrize("family", ["gd350", "vfd500", "acs355"])
def test_a_halt_finds_all_that_it_needs_loaded_with_the_first_drive(family: str) -> None:
    """A program that has no file left to open can still stop its motor."""
    program = f"""
import sys
import drivebus
with drivebus.Bus("sim://{family}?clock=virtual") as bus:
    drive = bus.drive(1, "{family}", unverified=True)
    begun = set(sys.modules)
    for halt in (drive.stop, drive.coast):
        halt()
    before = set(sys.modules) - begun
"""
    assert ours(loaded(program)) == set()


def test_a_motor_that_runs_is_stopped_without_another_module() -> None:
    program = """
import sys
import drivebus
with drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
    drive = bus.drive(1, "gd350")
    drive.prepare_control()
    with drive.running(10.0):
        begun = set(sys.modules)
        line.drive(1).trip("OL1")
    before = set(sys.modules) - begun
"""
    assert ours(loaded(program)) == set()


def test_the_table_of_commands_names_those_of_each_file() -> None:
    for files in GROUPS.values():
        for file, names in files.items():
            commands = import_module(f"drivebus.cli.{file}").COMMANDS
            assert names == tuple(command.name for command in commands), file
    folder = Path(import_module("drivebus.cli").__path__[0])
    places = {".".join(path.relative_to(folder).with_suffix("").parts): path for path in folder.rglob("*.py")}
    places = {name.removesuffix(".__init__"): path for name, path in places.items()}
    with_commands = {name for name, path in places.items() if "\nCOMMANDS = [" in path.read_text(encoding="utf-8")}
    assert with_commands == {file for files in GROUPS.values() for file in files}


@pytest.mark.parametrize("package", ["drivebus", "drivebus.backup", "drivebus.cli"])
def test_what_type_checkers_read_is_what_a_program_gets(package: str) -> None:
    module = import_module(package)
    read = dict(_read_by_type_checkers(Path(str(module.__file__))))
    assert set(read) == set(module.__all__) - {"main"}
    for name, home in read.items():
        assert getattr(module, name) is getattr(import_module(home), name), name
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nothing'"):
        attrgetter("nothing")(module)


def _read_by_type_checkers(path: Path) -> Iterable[tuple[str, str]]:
    """Each name, and the module that it is imported from, under `TYPE_CHECKING`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for line in node.body:
                assert isinstance(line, ast.ImportFrom)
                yield from ((alias.name, str(line.module)) for alias in line.names)
