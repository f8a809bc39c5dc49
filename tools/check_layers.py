"""Checks that imports point down only: rtu ← drives, line ← sim ← the door for Rust, and the extension module ← Python.

`check_layers.py` checks the work tree. `check_layers.py --self-test` breaks each rule once in a copy and expects
to be told so: a check that cannot fail checks nothing.
"""

from __future__ import annotations

import argparse
import ast
import functools
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Crates of ours that each crate may build with, at any depth.
CRATES: dict[str, set[str]] = {
    "rtu": set(),
    "drives": set(),
    "drive": {"rtu", "drives"},
    "line": {"rtu"},
    "sim": {"rtu", "drives", "line"},
    "drivebus": {"rtu", "drives", "drive", "line", "sim"},
    "python": {"rtu", "drives", "drive", "line", "sim"},
}

# The trait of `line`, what its methods speak of, and pseudo-terminals: all that `sim` may name.
LINE_TRAIT = {"Line", "LineClock", "PortError", "PortErrorKind", "pty"}

# The rooms of `line`, each on those before it.
LINE_ROOMS = [
    "line",
    "error",
    "by_unit",
    "device",
    "system",
    "turns",
    "trace",
    "options",
    "ask",
    "ports",
    "health",
    "share",
    "owner",
    "bus",
    "poll",
    "gateway",
]

_NO_WORLD = re.compile(
    r"\bstd::(?:net|thread|process)\b|\bstd::time::(?!Duration\b)|\bInstant::now\b|\bSystemTime\b|\bunsafe\b"
)

# What the pure crates must not know. Comments and strings do not count.
FORBIDDEN_IN_CRATE: dict[str, re.Pattern[str]] = {
    "rtu": re.compile(r"\b(?:std|alloc)::|\bextern\s+crate\b|\bunsafe\b|\blog::|println!"),
    "drives": _NO_WORLD,
    "drive": _NO_WORLD,
    "line": re.compile(r"\bunsafe\b"),
    "python": re.compile(r"\bunsafe\b"),
    "sim": re.compile(r"\bunsafe\b"),
    "drivebus": re.compile(r"\bunsafe\b"),
}

# The files with `unsafe`, which say why: two ioctls, what a forked child runs, a policy of the scheduler, and two
# socket options, that no crate offers in safe Rust.
UNSAFE_ALLOWED = {
    "crates/line/src/ports/tty/low_latency.rs",
    "crates/line/src/system/at_fork.rs",
    "crates/line/src/system/realtime.rs",
    "crates/line/src/ports/connection/unconfirmed.rs",
}

# The rooms of the Python package, from the ground up: each may import those of the rows above its own.
ROOMS: list[set[str]] = [
    {"advice", "plain_annotations"},
    {"end_signals", "errors", "latch", "lazy_names", "attribute_mapping", "tables"},
    {"values", "checks", "rtu"},
    {"strict_attributes", "look", "spool"},
    {"profile", "capture", "sinks"},
    {"sim", "web"},
    {"line"},
    {"identify", "site"},
    {"operations"},
    {"backup"},
    {"discovery"},
    {"motor", "watchdog", "poll"},
    {"drive"},
    {"bus"},
    {"line_search"},
    {"aio", "doctor", "gateway", "hal", "sniffer", "record", "trial"},
    {"plot", "service"},
    {"__init__"},
]

# Rooms that may import the compiled core.
ON_THE_CORE = {
    "rtu",
    "look",
    "profile",
    "capture",
    "sim",
    "line",
    "identify",
    "operations",
    "backup",
    "poll",
    "bus",
    "line_search",
    "aio",
    "gateway",
    "sniffer",
    "record",
    "__init__",
}

# What uses drives as anybody does, by what is public, and all that it may import. `drivebus` is the public package
# itself.
USERS: dict[str, set[str]] = {
    "hal": {"drive", "errors", "look", "profile", "values", "watchdog"},
    "trial": {"advice", "checks", "drive", "errors", "look"},
    "plot": {"errors", "record"},
    "cli": {
        "advice",
        "backup",
        "capture",
        "drivebus",
        "hal",
        "end_signals",
        "latch",
        "lazy_names",
        "line",
        "tables",
        "plot",
        "record",
        "rtu",
        "sim",
        "service",
        "site",
        "sniffer",
        "trial",
        "web",
    },
    "__main__": {"cli"},
}

# What Python itself calls with an underscore, and means for everybody.
PYTHONS_OWN = {"sys._getframe", "os._exit"}

# Through so many classes of ours a class may inherit, errors aside.
MOST_ANCESTORS = 2

# The files of `operations`, each of which may import those before it.
OPERATIONS = [
    "by_name",
    "deferred_signals",
    "program_end",
    "drive_view",
    "in_parts",
    "said",
    "events",
    "other_words",
    "aim",
    "not_written",
    "explained",
    "glances",
    "seen",
    "kept",
    "core_calls",
    "raw_words",
    "unit_variants",
    "registers",
    "state",
    "not_kept",
    "parameters",
    "bus_control",
    "not_ready",
    "setpoints",
    "not_led_up",
    "not_commanded",
    "not_halted",
    "halting",
    "motion",
    "stop_all",
    "bit_words",
    "waiting",
    "last_will",
    "network_rights",
    "bus_timeout",
    "motor_block",
    "turning",
    "drive_base",
    "former_names",
]


def code_of(path: Path) -> str:
    """A Rust file without its comments, its strings, and its tests at the end; of one that is all tests, nothing."""
    if path.name == "tests.rs":
        return ""
    return _code_of(path.read_text(encoding="utf-8"))


@functools.cache
def _code_of(text: str) -> str:
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text)
    return text.partition("#[cfg(test)]")[0]


@functools.cache
def forbidden(code: str, pattern: re.Pattern[str]) -> tuple[str, ...]:
    """What of *code* the pattern finds."""
    return tuple(match[0] for match in pattern.finditer(code))


def package(crate: str) -> str:
    """What the crate in the folder *crate* is called."""
    return crate if crate == "drivebus" else f"drivebus-{crate}"


def tree(root: Path, crate: str) -> list[str]:
    """What `cargo tree` prints for *crate*: itself, and what it is built from."""
    manifests = (root / "Cargo.toml", *sorted(root.glob("crates/*/Cargo.toml")))
    return _tree(root, crate, "".join(path.read_text(encoding="utf-8") for path in manifests))


@functools.cache
def _tree(root: Path, crate: str, manifests: str) -> list[str]:  # noqa: ARG001 - of these it is made
    command = ["cargo", "tree", "-p", package(crate), "-e", "normal,build", "--prefix", "none"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"check_layers: {' '.join(command)} failed:\n{done.stderr}")
    return done.stdout.splitlines()


def crate_findings(root: Path) -> Iterator[str]:
    """Rules between crates, and what the pure ones must not know."""
    for crate, allowed in CRATES.items():
        lines = tree(root, crate)
        if crate == "rtu" and len(lines) != 1:
            yield f"crates/rtu: depends on nothing, but cargo tree prints {len(lines)} lines: {', '.join(lines[1:4])}"
        used = {match[1] or match[2] for line in lines[1:] if (match := re.match(r"drivebus-(\w+) |(drivebus) ", line))}
        for wrong in sorted(used - allowed - {crate}):
            yield f"crates/{crate}: must not use {package(wrong)}"

    for crate, pattern in FORBIDDEN_IN_CRATE.items():
        for path in sorted((root / "crates" / crate / "src").rglob("*.rs")):
            if path.relative_to(root).as_posix() in UNSAFE_ALLOWED:
                continue
            for wrong in forbidden(code_of(path), pattern):
                yield f"{path.relative_to(root)}: must not use `{wrong}`"
    if "#![no_std]" not in (root / "crates/rtu/src/lib.rs").read_text(encoding="utf-8"):
        yield "crates/rtu/src/lib.rs: lacks #![no_std]"
    if 'unsafe_code = "deny"' not in (root / "Cargo.toml").read_text(encoding="utf-8"):
        yield 'Cargo.toml: [workspace.lints.rust] lacks unsafe_code = "deny"'
    for crate in CRATES:
        if not re.search(r"\[lints\]\s+workspace = true", (root / "crates" / crate / "Cargo.toml").read_text("utf-8")):
            yield f"crates/{crate}/Cargo.toml: lacks [lints] workspace = true"

    for path in sorted((root / "crates/sim/src").rglob("*.rs")):
        for match in re.finditer(r"\bdrivebus_line\b(?:::(?:\{([^}]*)\}|(\w+)))?", code_of(path)):
            names = {name.split(" as ")[0].strip() for name in (match[1] or match[2] or "*").split(",")} - {""}
            for wrong in sorted(names - LINE_TRAIT):
                yield f"{path.relative_to(root)}: takes `{wrong}` of drivebus_line; its trait is {sorted(LINE_TRAIT)}"


def room_findings(root: Path) -> Iterator[str]:
    """Rules between the rooms of `line`. Tests may look anywhere."""
    source = root / "crates/line/src"
    for path in sorted(source.rglob("*.rs")):
        room = path.relative_to(source).with_suffix("").parts[0]
        if room in ("lib", "nobody") or path.stem == "tests":
            continue
        if room not in LINE_ROOMS:
            yield f"{path.relative_to(root)}: which rooms may it use? Say so in tools/check_layers.py"
            continue
        below = LINE_ROOMS[: LINE_ROOMS.index(room) + 1]
        for match in re.finditer(r"\bcrate::(\w+|\{)", code_of(path)):
            if match[1] in LINE_ROOMS and match[1] not in below:
                yield f"{path.relative_to(root)}: {room} must not use {match[1]}"
            elif match[1] not in LINE_ROOMS:
                yield f"{path.relative_to(root)}: names `{match[0]}`, and not the room it comes from"


@functools.cache
def nodes_of(text: str) -> tuple[ast.AST, ...]:
    """All that is in a Python file: parsed once, however many rules look at it."""
    return tuple(ast.walk(ast.parse(text)))


@functools.cache
def imports_of(text: str) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """The imports of a Python file."""
    return tuple(node for node in nodes_of(text) if isinstance(node, (ast.Import, ast.ImportFrom)))


def imports(path: Path, package: Path) -> Iterator[tuple[int, list[str]]]:
    """Each module of ours that *path* imports: its names below the package, or `drivebus` for the package."""
    here = list(path.relative_to(package).with_suffix("").parts)
    for node in imports_of(path.read_text(encoding="utf-8")):
        dotted = [alias.name for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = ["drivebus", *here][: len(here) + 1 - node.level]
                base = ".".join([*above, *([base] if base else [])])
            dotted = [f"{base}.{name}" for name in dotted]
        for name in dotted:
            first, *rest = name.split(".")
            if first == "drivebus":
                yield node.lineno, rest if rest and is_module(package, rest[0]) else ["drivebus"]


def is_module(package: Path, name: str) -> bool:
    """Whether *name* is a module or package of ours, compiled or not."""
    return any((package / candidate).exists() for candidate in (f"{name}.py", f"{name}.pyi", name))


def allowed(room: str) -> set[str] | None:
    """What the files of *room* may import; None for a room that nobody has placed."""
    if room in USERS:
        return USERS[room]
    below: set[str] = set()
    for row in ROOMS:
        if room in row:
            return below | ({"_native"} if room in ON_THE_CORE else set())
        below |= row
    return None


def python_findings(root: Path) -> Iterator[str]:
    """Rules between the rooms of the Python package, between the files of `operations`, and for `cli/present`."""
    package = root / "python/drivebus"
    for path in sorted(package.rglob("*.py")):
        room, *inside = path.relative_to(package).with_suffix("").parts
        may = allowed(room)
        if may is None:
            yield f"{path.relative_to(root)}: where is its place? Say so in tools/check_layers.py"
            may = set()
        for line, [used, *file] in imports(path, package):
            if used != room and used not in may:
                yield f"{path.relative_to(root)}:{line}: {room} must not import {used}"
            if room == used == "cli" and inside[0] == "present" and file[:1] != ["present"]:
                yield f"{path.relative_to(root)}:{line}: present must not import {'.'.join(file)}"
            if room == used == "operations" and inside != ["__init__"] and file:
                known = [name for name in (inside[0], file[0]) if name not in OPERATIONS]
                if known:
                    yield f"{path.relative_to(root)}: where in operations is {known[0]}? tools/check_layers.py says it"
                elif OPERATIONS.index(file[0]) >= OPERATIONS.index(inside[0]):
                    yield f"{path.relative_to(root)}:{line}: {inside[0]} must not import {file[0]}"


def command_findings(root: Path) -> Iterator[str]:
    """A command makes a result; for whom it is shown, `cli/present` knows."""
    cli = root / "python/drivebus/cli"
    for path in (*sorted(cli.glob("commands/*.py")), *sorted(cli.glob("sim/*.py"))):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr == "as_json":
                yield f"{path.relative_to(root)}:{node.lineno}: present decides what --json shows, not a command"


def own_names(nodes: tuple[ast.AST, ...]) -> set[str]:
    """The names with an underscore that a file defines: functions, classes, variables, attributes and slots."""
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value)  # in __slots__
    return {name for name in names if is_private(name)}


def is_private(name: str) -> bool:
    """Whether *name* has an underscore for what is nobody else's; those of a named tuple have it for another reason."""
    return (
        name.startswith("_")
        and not name.startswith("__")
        and name not in {"_", "_replace", "_asdict", "_fields", "_make"}
    )


@functools.cache
def borrowed(text: str) -> tuple[tuple[int, str], ...]:
    """Each name with an underscore that a file uses and does not define, with its line: it belongs to another file."""
    here, found = nodes_of(text), []
    own = own_names(here)
    for node in here:
        if isinstance(node, ast.Attribute) and is_private(node.attr) and node.attr not in own:
            if ast.unparse(node) not in PYTHONS_OWN:
                found.append((node.lineno, node.attr))
        elif isinstance(node, ast.ImportFrom):
            private = (alias.name for alias in node.names if is_private(alias.name) and alias.name != "_native")
            found.extend((node.lineno, name) for name in private)
    return tuple(found)


@functools.cache
def classes(text: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """The classes of a file, each with its bases; one that is imported by its whole name."""
    imported = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in imports_of(text)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    found = []
    for node in nodes_of(text):
        if isinstance(node, ast.ClassDef):
            named = (ast.unparse(base).partition("[")[0] for base in node.bases)
            found.append((node.name, tuple(imported.get(base, base) for base in named)))
    return tuple(found)


def ancestors(package: Path) -> Iterator[tuple[Path, str, int]]:
    """Each class of ours, and through how many of ours it inherits; errors and warnings aside."""
    bases: dict[str, list[str]] = {}
    where: dict[str, tuple[Path, str]] = {}
    for path in sorted(package.rglob("*.py")):
        module = ".".join(["drivebus", *path.relative_to(package).with_suffix("").parts])
        for name, named in classes(path.read_text(encoding="utf-8")):
            bases[f"{module}.{name}"] = [base if "." in base else f"{module}.{base}" for base in named]
            where[f"{module}.{name}"] = (path, name)

    def depth(name: str) -> int:
        return max((1 + depth(base) for base in bases[name] if base in bases), default=0)

    for name, (path, shown) in where.items():
        if path != package / "errors.py":
            yield path, shown, depth(name)


def habit_findings(root: Path) -> Iterator[str]:
    """Rules for every file of the Python package: what is private stays so, and nothing is a tower."""
    package = root / "python/drivebus"
    for path in sorted(package.rglob("*.py")):
        for line, name in borrowed(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(root)}:{line}: {name} belongs to another file"
    for path, name, depth in ancestors(package):
        if depth > MOST_ANCESTORS:
            yield f"{path.relative_to(root)}: {name} inherits through {depth} classes of ours; {MOST_ANCESTORS} at most"


def findings(root: Path) -> list[str]:
    """Everything that is wrong."""
    return [
        *crate_findings(root),
        *room_findings(root),
        *python_findings(root),
        *command_findings(root),
        *habit_findings(root),
    ]


# For manifests.
HEAD = "[dependencies]"
A_DEPENDENCY = "\n[dependencies]\nserde.workspace = true\n"

# Each rule broken once: file, what is replaced (None: put at the end), by what, and a part of the expected finding.
BREAKS: list[tuple[str, str | None, str, str]] = [
    ("crates/rtu/Cargo.toml", None, A_DEPENDENCY, "crates/rtu: depends on nothing"),
    ("crates/rtu/Cargo.toml", None, A_DEPENDENCY.replace("[", "[build-"), "crates/rtu: depends on nothing"),
    ("crates/rtu/src/lib.rs", "#![no_std]", "", "lacks #![no_std]"),
    ("crates/rtu/src/crc.rs", "//!", "use std::time::Instant;\n//!", "rtu/src/crc.rs: must not use `std::`"),
    ("crates/rtu/src/crc.rs", "//!", "unsafe fn f() {}\n//!", "rtu/src/crc.rs: must not use `unsafe`"),
    ("crates/rtu/Cargo.toml", "[lints]\nworkspace = true", "", "crates/rtu/Cargo.toml: lacks [lints]"),
    ("Cargo.toml", 'unsafe_code = "deny"', 'unsafe_code = "warn"', "Cargo.toml: [workspace.lints.rust] lacks"),
    ("crates/line/src/ports/tty.rs", "//!", "unsafe fn f() {}\n//!", "line/src/ports/tty.rs: must not use `unsafe`"),
    (
        "crates/drives/Cargo.toml",
        HEAD,
        f"{HEAD}\ndrivebus-rtu.workspace = true",
        "crates/drives: must not use drivebus-rtu",
    ),
    (
        "crates/drives/src/lib.rs",
        "//!",
        "use std::thread::sleep;\n//!",
        "drives/src/lib.rs: must not use `std::thread`",
    ),
    (
        "crates/drive/src/rule.rs",
        "//!",
        "use std::time::Instant;\n//!",
        "drive/src/rule.rs: must not use `std::time::`",
    ),
    (
        "crates/drive/Cargo.toml",
        HEAD,
        f"{HEAD}\ndrivebus-line.workspace = true",
        "crates/drive: must not use drivebus-line",
    ),
    (
        "crates/line/Cargo.toml",
        HEAD,
        f"{HEAD}\ndrivebus-drives.workspace = true",
        "crates/line: must not use drivebus-drives",
    ),
    (
        "crates/drivebus/Cargo.toml",
        HEAD,
        f'{HEAD}\ndrivebus-python = {{ path = "../python" }}',
        "crates/drivebus: must not use drivebus-python",
    ),
    ("crates/drivebus/src/lib.rs", "//!", "unsafe fn f() {}\n//!", "drivebus/src/lib.rs: must not use `unsafe`"),
    ("crates/sim/src/lib.rs", "//!", "use drivebus_line::{Line, Bus};\n//!", "takes `Bus` of drivebus_line"),
    ("crates/sim/src/lib.rs", "//!", "use drivebus_line as line;\n//!", "takes `*` of drivebus_line"),
    ("crates/line/src/turns/queue.rs", "use crate::", "use crate::bus::Bus;\nuse crate::", "turns must not use bus"),
    ("crates/line/src/error.rs", "use crate::", "use crate::Bus;\nuse crate::", "names `crate::Bus`, and not the room"),
    ("crates/line/src/new.rs", None, "\nuse crate::bus::Bus;\n", "new.rs: which rooms may it use"),
    ("python/drivebus/errors.py", None, "\nfrom drivebus import _native\n", "errors must not import _native"),
    ("python/drivebus/profile/plan.py", None, "\nfrom drivebus.bus import Bus\n", "profile must not import bus"),
    ("python/drivebus/drive.py", None, "\nfrom ._native import crc16\n", "drive must not import _native"),
    ("python/drivebus/drive.py", None, "\nfrom .bus import Bus\n", "drive must not import bus"),
    (
        "python/drivebus/operations/by_name.py",
        None,
        "\nfrom drivebus import Bus\n",
        "operations must not import drivebus",
    ),
    (
        "python/drivebus/operations/by_name.py",
        None,
        "\nfrom . import motion\n",
        "by_name must not import motion",
    ),
    ("python/drivebus/operations/new.py", None, "\nfrom . import motion\n", "where in operations is new"),
    ("python/drivebus/drive.py", None, "\nprint(Drive.run._wrapped)\n", "_wrapped belongs to another file"),
    ("python/drivebus/poll.py", None, "\nfrom drivebus.bus import _hidden\n", "_hidden belongs to another file"),
    ("python/drivebus/aio/drive.py", None, "\nclass A(Drive): ...\n", "A inherits through 3 classes"),
    ("python/drivebus/bus.py", None, "\nimport drivebus.cli\n", "bus must not import cli"),
    (
        "python/drivebus/hal/motor.py",
        None,
        "\nfrom drivebus.operations import motion\n",
        "hal must not import operations",
    ),
    ("python/drivebus/new.py", None, "\nimport drivebus\n", "new.py: where is its place"),
    ("python/drivebus/cli/__init__.py", None, "\nimport drivebus._native\n", "cli must not import _native"),
    (
        "python/drivebus/cli/present/motors.py",
        None,
        "\nfrom drivebus.cli.session import Session\n",
        "present must not import session",
    ),
    (
        "python/drivebus/cli/commands/monitor.py",
        None,
        "\n\ndef _is_for_a_program(session: Session) -> bool:\n    return session.out.as_json\n",
        "present decides what --json shows, not a command",
    ),
]


def copy(root: Path, to: Path) -> None:
    """The parts of the work tree that the rules are about."""
    to.mkdir(parents=True)
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy(root / name, to / name)
    for name in (
        "crates",
        "python",
        "tests/rust",
        "tests/soak",
        "tests/model",
        "tests/schedules",
        "benches/rust",
        "fuzz",
    ):
        ignored = shutil.ignore_patterns("__pycache__", "target", "*.so", "corpus")
        shutil.copytree(root / name, to / name, ignore=ignored)


def self_test(root: Path) -> int:
    """Breaks each rule once in a copy; returns how many breaks went unnoticed."""
    unnoticed = 0
    with tempfile.TemporaryDirectory(prefix="drivebus-layers-") as folder:
        place = Path(folder) / "copy"
        copy(root, place)
        for name, old, new, expected in BREAKS:
            path = place / name
            former = path.read_text(encoding="utf-8") if path.exists() else None
            text = '""""""\n' if former is None else former
            if old is not None and old not in text:
                raise SystemExit(f"check_layers: self-test is out of date: {name} does not hold {old!r}")
            path.write_text(text + new if old is None else text.replace(old, new, 1), encoding="utf-8")
            noticed = any(expected in finding for finding in findings(place))
            print(f"{'noticed' if noticed else 'UNNOTICED'}: {expected}")
            unnoticed += not noticed
            if former is None:
                path.unlink()
            else:
                path.write_text(former, encoding="utf-8")
    return unnoticed


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--self-test", action="store_true", help="break each rule once in a copy and expect to be told")
    if parser.parse_args().self_test:
        return 1 if self_test(ROOT) else 0
    wrong = findings(ROOT)
    for finding in wrong:
        print(finding, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
