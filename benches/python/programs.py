"""The C programs of benches/c: compiled when they are wanted, into the target folder, and run beside a measurement."""

from __future__ import annotations

import ctypes.util
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SOURCES = ROOT / "benches/c"
TARGET = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "bench-c"


@cache
def program(name: str, *options: str) -> Path:
    """`benches/c/NAME.c`, compiled with `cc -O2` unless *options* say otherwise."""
    TARGET.mkdir(parents=True, exist_ok=True)
    built, source = TARGET / "".join([name, *options]), SOURCES / f"{name}.c"
    newest = max(each.stat().st_mtime for each in [source, *SOURCES.glob("*.h")])
    if not built.exists() or built.stat().st_mtime < newest:
        command = ["cc", "-Wall", "-Wextra", *(options or ["-O2"]), "-o", str(built), str(source), "-ldl"]
        subprocess.run(command, check=True)
    return built


@contextmanager
def beside(name: str) -> Iterator[str]:
    """Runs a program that says one line when it is ready, and ends when its input does. Gives that line."""
    with subprocess.Popen([program(name)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        said = process.stdout.readline().strip()
        if not said:
            raise RuntimeError(f"{name} ended with {process.wait()}")
        try:
            yield said
        finally:
            process.stdin.close()


@cache
def libmodbus() -> str | None:
    """Where libmodbus is: unpacked by tools/debian_parts.sh, or installed."""
    for found in sorted((ROOT / ".tools").glob("usr/lib/*/libmodbus.so.5")):
        return str(found)
    return ctypes.util.find_library("modbus")
