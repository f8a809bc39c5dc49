"""Packages each crate that is published, and runs its tests from what was packaged, with the others packaged beside it.

What a package leaves out shows here and not with who takes it. Exit code 1 when a test fails.

usage: check_packages.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import tomli

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
CARGO = os.environ.get("CARGO", "cargo")


def published() -> dict[str, str]:
    """The names of the published crates, and the version that they have."""
    table: dict[str, Any] = tomli.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    bounds, version = table["dependencies"], table["package"]["version"]
    return {name: version for name, bound in bounds.items() if isinstance(bound, dict) and "path" in bound}


def unpacked(crates: dict[str, str]) -> Path:
    """A workspace of its own with each package in it."""
    names = [word for name in crates for word in ("--package", name)]
    subprocess.run([CARGO, "package", "--locked", "--allow-dirty", "--no-verify", *names], cwd=ROOT, check=True)
    folder = TARGET / "packages"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    packages = {name: f"{name}-{version}" for name, version in crates.items()}
    for package in packages.values():
        with tarfile.open(TARGET / f"package/{package}.crate") as crate:
            crate.extractall(folder, filter="data")
    # Each shall find the other as it was packaged.
    patches = "".join(f"{name} = {{ path = '{package}' }}\n" for name, package in packages.items())
    manifest = f'[workspace]\nresolver = "3"\nmembers = {list(packages.values())}\n\n[patch.crates-io]\n{patches}'
    (folder / "Cargo.toml").write_text(manifest, encoding="utf-8")
    shutil.copy2(ROOT / "Cargo.lock", folder)
    return folder


def main() -> None:
    """The command."""
    folder = unpacked(published())
    environment = {**os.environ, "CARGO_TARGET_DIR": str(TARGET / "packages-target")}
    sys.exit(subprocess.run([CARGO, "test", "--quiet", "--workspace"], cwd=folder, env=environment).returncode)


if __name__ == "__main__":
    main()
