"""Installs the built wheel where no Rust is to be found, and uses it.

What a user gets is the wheel, not the work tree: this finds what was not packed, a missing dependency, and
a module that only loads on the machine that built it.

usage: wheel_smoke.py [WHEEL [--tag TAG --under COMMAND …]]

    WHEEL      the wheel; without it the only one in dist/
    --tag      what the wheel is for, where that is not this system, as pip knows it
    --under    a Python 3.11 of that system, and what runs it here
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

MUST_HOLD = [
    "drivebus/py.typed",
    "drivebus/_native.pyi",
    "licenses/LICENSE-MIT",
    "licenses/LICENSE-APACHE",
    "licenses/LICENSES-THIRD-PARTY.txt",
]

PROGRAM = """
import drivebus
assert drivebus.crc16(b"123456789") == 0x4B37
with drivebus.Bus("sim://gd350") as bus:
    assert bus.read(1, 0x2100, 1) == [3], "a drive that was just switched on is stopped"
    print(bus.drive(1).status())
"""


def install(wheel: Path, home: Path) -> list[list[str]]:
    """Installs `wheel` into a fresh environment: how the command is called there, and how its Python."""
    venv.create(home / "venv", with_pip=True)
    scripts = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
    pip = [str(scripts / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run(home, *pip, "--only-binary=:all:", str(wheel))
    return [[str(scripts / "drivebus")], [str(scripts / "python"), "-I"]]


def install_elsewhere(wheel: Path, home: Path, tag: str, under: list[str]) -> list[list[str]]:
    """As `install`, for a Python that runs `under` a command, and has no pip: this one's takes what that one would."""
    there = ["--target", str(home), "--platform", tag, "--python-version", "3.11", "--implementation", "cp"]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run(home, *pip, *there, "--only-binary=:all:", str(wheel))
    return [[*under, "-m", "drivebus"], under]


def run(home: Path, *command: str) -> None:
    """Runs it in `home`, where no Rust is found."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "CARGO", "RUST"))}
    env["PATH"] = str(home / "venv" / ("Scripts" if os.name == "nt" else "bin"))
    if shutil.which("cargo", path=env["PATH"]):
        raise SystemExit("wheel_smoke: cargo is on the path of the fresh environment")
    print("wheel_smoke: $", " ".join(command).replace(str(home), "…"), flush=True)
    subprocess.run(command, check=True, cwd=home, env=env, timeout=300)


def main() -> int:
    """Builds a fresh environment, installs the wheel, runs it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", nargs="?", type=Path)
    parser.add_argument("--tag")
    parser.add_argument("--under", nargs=argparse.REMAINDER)
    given = parser.parse_args()
    wheels = [given.wheel] if given.wheel else sorted((ROOT / "dist").glob("drivebus-*.whl"))
    if len(wheels) != 1:
        print(f"wheel_smoke: expected one wheel in dist/, found {len(wheels)}: run `make wheel`", file=sys.stderr)
        return 1
    wheel = wheels[0].resolve()
    if "-cp310-abi3-" not in wheel.name:
        print(f"wheel_smoke: {wheel.name} is not an abi3 wheel for CPython 3.10 and up", file=sys.stderr)
        return 1
    with zipfile.ZipFile(wheel) as archive:
        held = archive.namelist()
    for suffix in MUST_HOLD:
        if not any(name.endswith(suffix) for name in held):
            print(f"wheel_smoke: {wheel.name} lacks {suffix}", file=sys.stderr)
            return 1

    with tempfile.TemporaryDirectory(prefix="drivebus-wheel-") as folder:
        home = Path(folder)
        drivebus, python = (
            install_elsewhere(wheel, home, given.tag, given.under) if given.under else install(wheel, home)
        )
        run(home, *drivebus, "--version")
        run(home, *drivebus, "profiles")
        run(home, *drivebus, "--port", "sim://gd350", "info")
        run(home, *python, "-W", "error", "-c", PROGRAM)
        # For this system, the tests run it.
        if given.under:
            run(home, *drivebus, "demo")
    print(f"wheel_smoke: {wheel.name} works without a Rust toolchain")
    return 0


if __name__ == "__main__":
    sys.exit(main())
