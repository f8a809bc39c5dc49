"""Packages each crate that is published, and uses what was packaged, with the others packaged beside it.

A program of somebody else's, which is the one of the README of `drivebus` and runs and stops a motor of each of four
families, is built with the packages and run: as it comes, and with no feature but the simulator. Then the tests of each
package run. What a package leaves out shows here and not with who takes it. Exit code 1 where one fails.

usage: check_packages.py [--without-tests]
"""

from __future__ import annotations

import argparse
import os
import re
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
    manifest = f'[workspace]\nresolver = "3"\nmembers = {list(packages.values())}\n\n{patched(packages)}'
    (folder / "Cargo.toml").write_text(manifest, encoding="utf-8")
    shutil.copy2(ROOT / "Cargo.lock", folder)
    return folder


def patched(places: dict[str, str]) -> str:
    """What has cargo take each crate from its place, until the registry has it."""
    return "[patch.crates-io]\n" + "".join(f"{name} = {{ path = '{place}' }}\n" for name, place in places.items())


FEATURES = {"stranger": "", "stranger-sim": ', default-features = false, features = ["sim"]'}
"""What somebody else takes of `drivebus`, by the name of the project."""


def stranger(name: str, packages: Path, crates: dict[str, str]) -> Path:
    """A project outside of the workspace with the program of the README of `drivebus`, for what cargo finds for it."""
    folder = TARGET / name
    shutil.rmtree(folder / "src", ignore_errors=True)
    (folder / "src").mkdir(parents=True)
    (folder / "Cargo.lock").unlink(missing_ok=True)
    places = {name: str(packages / f"{name}-{version}") for name, version in crates.items()}
    program = re.search(r"^```rust\n(.*?)^```$", Path(places["drivebus"], "README.md").read_text("utf-8"), re.M | re.S)
    if program is None:
        sys.exit("check_packages: the README of the packed drivebus has no program")
    (folder / "src/main.rs").write_text(program[1], encoding="utf-8")
    (folder / "Cargo.toml").write_text(
        f'[package]\nname = "{name}"\nversion = "0.0.0"\nedition = "2024"\n\n[dependencies]\n'
        f'drivebus = {{ version = "={crates["drivebus"]}"{FEATURES[name]} }}\n\n{patched(places)}\n[workspace]\n',
        encoding="utf-8",
    )
    return folder


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description="Packages the published crates and uses the packages.")
    options.add_argument("--without-tests", action="store_true", help="only somebody else's program")
    asked = options.parse_args()
    crates = published()
    packages = unpacked(crates)
    environment = {**os.environ, "CARGO_TARGET_DIR": str(TARGET / "packages-target")}
    shown = {
        subprocess.run(
            [CARGO, "run", "--quiet"],
            cwd=stranger(name, packages, crates),
            env=environment,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout
        for name in FEATURES
    }
    if len(shown) > 1:
        sys.exit(f"check_packages: with other features the same program shows something else: {sorted(shown)}")
    shows = " · ".join(shown.pop().splitlines())
    print(f"{len(crates)} crates packaged; a stranger's program built with them shows {shows}", flush=True)
    if not asked.without_tests:
        sys.exit(subprocess.run([CARGO, "test", "--quiet", "--workspace"], cwd=packages, env=environment).returncode)


if __name__ == "__main__":
    main()
