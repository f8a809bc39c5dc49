"""Builds a program of somebody else's with the oldest versions that the published crates say they need, and runs it.

A bound says which versions work; whoever has an old one in a lock file gets just that. The bounds stand in the
workspace's Cargo.toml. Exit code 1 when one of them cannot be had or does not work.

usage: oldest_versions.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import tomli

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
CARGO = os.environ.get("CARGO", "cargo")
EXAMPLE = ROOT / "crates/drivebus/examples/three_families.rs"


def table(path: Path) -> dict[str, Any]:
    """A TOML file."""
    content: dict[str, Any] = tomli.loads(path.read_text(encoding="utf-8"))
    return content


def needed() -> set[str]:
    """What the published crates need on any system, by name."""
    manifests = [table(path) for path in ROOT.glob("crates/*/Cargo.toml")]
    published = [each for each in manifests if each["package"].get("publish", True)]
    parts = [part for each in published for part in (each, *each.get("target", {}).values())]
    return {name for part in parts for name in part.get("dependencies", {})}


def oldest(names: set[str]) -> dict[str, str]:
    """The lower bound of each that is not ours, with its three numbers."""
    bounds = table(ROOT / "Cargo.toml")["workspace"]["dependencies"]
    plain = {name: bounds[name] if isinstance(bounds[name], str) else bounds[name].get("version") for name in names}
    return {
        name: ".".join([*plain[name].split("."), "0", "0"][:3]) for name in sorted(names) if "path" not in bounds[name]
    }


def project(versions: dict[str, str]) -> Path:
    """A cargo project outside the workspace whose program uses drivebus, and which holds all else to these versions."""
    folder = TARGET / "oldest"
    shutil.rmtree(folder / "src", ignore_errors=True)
    (folder / "src").mkdir(parents=True)
    shutil.copy2(EXAMPLE, folder / "src/main.rs")
    (folder / "Cargo.lock").unlink(missing_ok=True)
    held = "".join(
        f'{name} = {{ version = "={version}", default-features = false }}\n' for name, version in versions.items()
    )
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "somebody"\nversion = "0.0.0"\nedition = "2024"\n\n[dependencies]\n'
        f"drivebus = {{ path = '{ROOT / 'crates/drivebus'}' }}\n{held}\n[workspace]\n",
        encoding="utf-8",
    )
    return folder


def main() -> None:
    """The command."""
    versions = oldest(needed())
    print("oldest versions:", ", ".join(f"{name} {version}" for name, version in versions.items()), flush=True)
    folder = project(versions)
    environment = {**os.environ, "CARGO_TARGET_DIR": str(folder / "target")}
    sys.exit(subprocess.run([CARGO, "run", "--quiet"], cwd=folder, env=environment).returncode)


if __name__ == "__main__":
    main()
