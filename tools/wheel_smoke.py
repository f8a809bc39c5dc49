"""Installs the built wheel where no Rust is to be found, and uses it.

What a user gets is the wheel, not the work tree: this finds what was not packed, a missing dependency, and
a module that only loads on the machine that built it.
"""

from __future__ import annotations

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
]

PROGRAM = """
import drivebus
assert drivebus.crc16(b"123456789") == 0x4B37
with drivebus.Bus("sim://gd350") as bus:
    assert bus.read(1, 0x2100, 1) == [3], "a drive that was just switched on is stopped"
    print(bus.drive(1).status())
"""


def main() -> int:
    """Builds a fresh environment, installs the wheel, runs it."""
    wheels = sorted((ROOT / "dist").glob("drivebus-*.whl"))
    if len(wheels) != 1:
        print(f"wheel_smoke: expected one wheel in dist/, found {len(wheels)}: run `make wheel`", file=sys.stderr)
        return 1
    wheel = wheels[0]
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
        venv.create(home / "venv", with_pip=True)
        scripts = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
        env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "CARGO", "RUST"))}
        env["PATH"] = str(scripts)
        if shutil.which("cargo", path=env["PATH"]):
            print("wheel_smoke: cargo is on the path of the fresh environment", file=sys.stderr)
            return 1

        def run(*command: str) -> None:
            print("wheel_smoke: $", " ".join(command).replace(str(home), "…"), flush=True)
            subprocess.run(command, check=True, cwd=home, env=env, timeout=300)

        python = str(scripts / "python")
        run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:", str(wheel))
        run(str(scripts / "drivebus"), "--version")
        run(str(scripts / "drivebus"), "profiles")
        run(str(scripts / "drivebus"), "--port", "sim://gd350", "info")
        run(python, "-I", "-W", "error", "-c", PROGRAM)
    print(f"wheel_smoke: {wheel.name} works without a Rust toolchain")
    return 0


if __name__ == "__main__":
    sys.exit(main())
