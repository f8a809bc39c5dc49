"""Compiles the published crates and the module of Python for Windows and macOS, as far as no linker is needed.

Warnings are errors, those of the tests too. Nothing is run: what compiles may still be wrong there. The first time
takes some minutes, in which the standard library is compiled.

usage: python -m tools.cross_check
"""

from __future__ import annotations

import subprocess
import sys

from tools import cross
from tools.settle_wheel import ROOT

SYSTEMS = ("x86_64-pc-windows-gnu", "aarch64-apple-darwin")
PUBLISHED = ("drivebus-rtu", "drivebus-line", "drivebus-drives", "drivebus-drive", "drivebus-sim", "drivebus")


def check(system: str) -> bool:
    """Whether all compiles for `system`."""
    environ = cross.environment(ROOT / "target" / "cross", from_source=True)
    # Of the crates here alone, and not of the standard library.
    environ |= {"CARGO_BUILD_WARNINGS": "deny", "CARGO_UNSTABLE_WARNINGS": "true"}
    cargo = [str(cross.SYSTEM / "bin" / "cargo"), "check", "--locked", "--quiet", "--target", system]
    crates = [word for crate in PUBLISHED for word in ("--package", crate)]
    commands = [[*cargo, *crates, "--all-targets"], [*cargo, "--package", "drivebus-python"]]
    return all(subprocess.run(command, cwd=ROOT, env=environ).returncode == 0 for command in commands)


def main() -> None:
    """The command."""
    cross.fetch()
    failed = [system for system in SYSTEMS if not check(system)]
    for system in SYSTEMS:
        print(f"cross_check: {system}: {'failed' if system in failed else 'compiles without a warning'}")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
