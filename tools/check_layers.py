"""Checks that imports point down only: rtu ← drives, line ← sim ← the door for Rust, and the extension module ← Python.

`check_layers.py` checks the work tree. `check_layers.py --self-test` breaks each rule once in a copy and expects
to be told so: a check that cannot fail checks nothing.
"""

from __future__ import annotations

import argparse
import ast
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
    "line": {"rtu"},
    "sim": {"rtu", "drives", "line"},
    "drivebus": {"rtu", "drives", "line", "sim"},
    "python": {"rtu", "drives", "line", "sim"},
}

# The trait of `line` and what its methods speak of: all that `sim` may name.
LINE_TRAIT = {"Line", "LineClock", "PortError", "PortErrorKind"}

# What the pure crates must not know. Comments and strings do not count.
FORBIDDEN_IN_CRATE: dict[str, re.Pattern[str]] = {
    "rtu": re.compile(r"\b(?:std|alloc)::|\bextern\s+crate\b|\bunsafe\b|\blog::|println!"),
    "drives": re.compile(
        r"\bstd::(?:net|thread|process)\b|\bstd::time::(?!Duration\b)|\bInstant::now\b|\bSystemTime\b|\bunsafe\b"
    ),
    "line": re.compile(r"\bunsafe\b"),
    "python": re.compile(r"\bunsafe\b"),
    "sim": re.compile(r"\bunsafe\b"),
    "drivebus": re.compile(r"\bunsafe\b"),
}

# The one file with `unsafe`, which says why: two ioctls that no crate offers.
UNSAFE_ALLOWED = "crates/line/src/tty/low_latency.rs"

# Modules of ours that each Python module may import. `drivebus` is the public package itself; `__init__` makes it.
# What speaks to a drive (`identity` to `drive`) knows a bus by its protocol only.
PYTHON: dict[str, set[str]] = {
    "errors": set(),
    "named": set(),
    "values": {"named"},
    "figures": {"named"},
    "checks": {"errors"},
    "protocols": {"figures", "values"},
    "rtu": {"_native", "errors"},
    "read_plan": {"_native", "values"},
    "profile": {"_native", "checks", "errors", "read_plan", "values"},
    "evidence": {"errors", "protocols"},
    "contradiction": {"identify", "profile", "protocols"},
    "identity": {"contradiction", "errors", "identify", "protocols"},
    "known": {"errors", "profile", "protocols", "rtu"},
    "registers": {"checks", "errors", "evidence", "identity", "known", "protocols", "values"},
    "looking": {"errors", "evidence", "protocols", "registers", "values"},
    "parameters": {"checks", "errors", "looking", "protocols", "values"},
    "control": {"checks", "errors", "evidence", "parameters", "values"},
    "setpoints": {"checks", "control", "errors", "values"},
    "falling": set(),
    "commanding": {"errors", "evidence", "falling", "looking", "setpoints", "values"},
    "motion": {"checks", "commanding", "errors", "falling", "looking", "safeguard", "values"},
    "terminals": {"checks", "commanding", "errors", "motion", "values"},
    "watchdog": {"at_once", "checks", "commanding", "errors", "evidence", "falling", "motion", "values"},
    "interruptions": set(),
    "safeguard": {"_native", "errors", "interruptions"},
    "at_once": {"figures", "protocols"},
    "backup": {"_native", "checks", "errors", "parameters", "profile", "protocols", "registers", "values"},
    "operations": {
        "backup",
        "checks",
        "commanding",
        "errors",
        "evidence",
        "looking",
        "protocols",
        "terminals",
        "values",
    },
    "moving": {"at_once", "errors", "operations", "protocols", "safeguard"},
    "drive": {"at_once", "moving", "operations", "protocols", "setpoints", "values", "watchdog"},
    "sim": {"_native", "checks", "errors", "profile"},
    "ports": {"_native", "checks", "errors", "profile", "sim"},
    "polling": {"_native", "checks", "errors", "profile", "read_plan", "values"},
    "poll": {"_native", "errors", "polling"},
    "opening": {"_native", "checks", "errors", "figures", "known", "ports", "sim"},
    "found": set(),
    "identify": {"errors", "found", "profile", "protocols"},
    "who": {"checks", "errors", "found", "identify", "profile", "protocols"},
    "bus": {
        "_native",
        "at_once",
        "checks",
        "drive",
        "errors",
        "figures",
        "found",
        "opening",
        "poll",
        "polling",
        "profile",
        "safeguard",
        "who",
    },
    "aio": {
        "_native",
        "at_once",
        "bus",
        "checks",
        "errors",
        "figures",
        "found",
        "motion",
        "moving",
        "opening",
        "operations",
        "polling",
        "profile",
        "safeguard",
        "setpoints",
        "watchdog",
        "who",
    },
    "doctor": {"_native", "bus", "checks", "drive", "errors", "found", "ports", "profile", "rtu", "sim", "values"},
    "__main__": {"cli"},
    "__init__": {
        "_native",
        "backup",
        "bus",
        "doctor",
        "drive",
        "errors",
        "figures",
        "found",
        "poll",
        "polling",
        "profile",
        "rtu",
        "sim",
        "values",
    },
    "cli": {"drivebus", "protocols", "rtu", "sim"},
}


def code_of(path: Path) -> str:
    """A Rust file without its comments, its strings, and its tests at the end."""
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text)
    return text.partition("#[cfg(test)]")[0]


def package(crate: str) -> str:
    """What the crate in the folder *crate* is called."""
    return crate if crate == "drivebus" else f"drivebus-{crate}"


def tree(root: Path, crate: str) -> list[str]:
    """What `cargo tree` prints for *crate*: itself, and what it is built from."""
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
            if path == root / UNSAFE_ALLOWED:
                continue
            for match in pattern.finditer(code_of(path)):
                yield f"{path.relative_to(root)}: must not use `{match[0]}`"
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


def imports(path: Path, package: Path) -> Iterator[tuple[int, str]]:
    """Each module of ours that *path* imports: its first name below the package, or `drivebus` for the package."""
    here = list(path.relative_to(package).with_suffix("").parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
        if not isinstance(node, (ast.Import, ast.ImportFrom)):
            continue
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
                yield node.lineno, rest[0] if rest and is_module(package, rest[0]) else "drivebus"


def is_module(package: Path, name: str) -> bool:
    """Whether *name* is a module or package of ours, compiled or not."""
    return any((package / candidate).exists() for candidate in (f"{name}.py", f"{name}.pyi", name))


def python_findings(root: Path) -> Iterator[str]:
    """Rules between the modules of the Python package."""
    package = root / "python/drivebus"
    for path in sorted(package.rglob("*.py")):
        module = path.relative_to(package).with_suffix("").parts[0]
        if module not in PYTHON:
            yield f"{path.relative_to(root)}: which modules may it import? Say so in tools/check_layers.py"
        for line, used in imports(path, package):
            if used == module:
                continue
            if used not in PYTHON.get(module, set()):
                yield f"{path.relative_to(root)}:{line}: {module} must not import {used}"


def findings(root: Path) -> list[str]:
    """Everything that is wrong."""
    return [*crate_findings(root), *python_findings(root)]


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
    ("crates/line/src/tty.rs", "//!", "unsafe fn f() {}\n//!", "line/src/tty.rs: must not use `unsafe`"),
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
    ("python/drivebus/errors.py", None, "\nfrom drivebus import _native\n", "errors must not import _native"),
    ("python/drivebus/profile.py", None, "\nfrom .bus import Bus\n", "profile must not import bus"),
    ("python/drivebus/drive.py", None, "\nfrom ._native import crc16\n", "drive must not import _native"),
    ("python/drivebus/drive.py", None, "\nfrom .bus import Bus\n", "drive must not import bus"),
    ("python/drivebus/registers.py", None, "\nfrom drivebus import Bus\n", "registers must not import drivebus"),
    ("python/drivebus/bus.py", None, "\nimport drivebus.cli\n", "bus must not import cli"),
    ("python/drivebus/new.py", None, "\nimport drivebus\n", "new.py: which modules may it import"),
    ("python/drivebus/cli/__init__.py", None, "\nimport drivebus._native\n", "cli must not import _native"),
]


def copy(root: Path, to: Path) -> None:
    """The parts of the work tree that the rules are about."""
    to.mkdir(parents=True)
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy(root / name, to / name)
    for name in ("crates", "python", "tests/rust", "tests/soak", "tests/model", "benches/rust", "fuzz"):
        ignored = shutil.ignore_patterns("__pycache__", "target", "*.so", "corpus")
        shutil.copytree(root / name, to / name, ignore=ignored)


def self_test(root: Path) -> int:
    """Breaks each rule once in a copy; returns how many breaks went unnoticed."""
    unnoticed = 0
    with tempfile.TemporaryDirectory(prefix="drivebus-layers-") as folder:
        for number, (name, old, new, expected) in enumerate(BREAKS):
            place = Path(folder) / str(number)
            copy(root, place)
            path = place / name
            text = path.read_text(encoding="utf-8") if path.exists() else '""""""\n'
            if old is not None and old not in text:
                raise SystemExit(f"check_layers: self-test is out of date: {name} does not hold {old!r}")
            path.write_text(text + new if old is None else text.replace(old, new, 1), encoding="utf-8")
            noticed = any(expected in finding for finding in findings(place))
            print(f"{'noticed' if noticed else 'UNNOTICED'}: {expected}")
            unnoticed += not noticed
            shutil.rmtree(place)
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
