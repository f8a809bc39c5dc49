"""Runs every example, Python and Rust, with no arguments and no hardware: an example that fails is a wrong document."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 120
"""How long an example may take. To compile it counts for nothing: that takes as long as the machine is busy."""


def package(folder: str) -> str:
    """What the crate in *folder* is called."""
    return folder if folder == "drivebus" else f"drivebus-{folder}"


def compile_all() -> None:
    """Compiles the examples in Rust, as each is run."""
    for name in sorted({package(path.parent.parent.name) for path in ROOT.glob("crates/*/examples/*.rs")}):
        subprocess.run(["cargo", "build", "--quiet", "--locked", "-p", name, "--examples"], cwd=ROOT, check=True)


def commands() -> list[list[str]]:
    """One command for each example."""
    python = [
        [sys.executable, "-W", "error", str(path.relative_to(ROOT))] for path in sorted(ROOT.glob("examples/*.py"))
    ]
    rust = [
        ["cargo", "run", "--quiet", "--locked", "-p", package(path.parent.parent.name), "--example", path.stem]
        for path in sorted(ROOT.glob("crates/*/examples/*.rs"))
    ]
    return python + rust


def main() -> int:
    """Runs them all; says which failed."""
    failed = 0
    compile_all()
    for command in commands():
        name = " ".join(command[-1:])
        try:
            done = subprocess.run(
                command,
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=SECONDS,
                check=False,
            )
            code, output = done.returncode, done.stdout + done.stderr
        except subprocess.TimeoutExpired:
            code, output = -1, f"did not end within {SECONDS} s"
        print(f"example {name}: {'ok' if code == 0 else f'FAILED ({code})'}", flush=True)
        if code != 0:
            failed += 1
            print(output, file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
