"""Checks that the repository stands alone: every path it names leads to something in it.

Looks at links of Markdown files and at every `../…` in any tracked text, and for folders of somebody's own machine.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

LINK = re.compile(r"\[[^\]]*\]\((?!\w+:|#)([^)#\s]+)")
UPWARDS = re.compile(r"(?<![\w/.])(?:\.\./)+[\w./-]*")
OWN_FOLDER = re.compile(r"(?<![\w.~])/(?:home|Users|root|work)/[\w.-]+")


def tracked(root: Path) -> list[Path]:
    """Every file that git knows or would take; links, binaries, and scripts of others that were packed are left out."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=root,
        check=True,
        capture_output=True,
        text=True,
    )
    names = [name for name in listed.stdout.split("\0") if name and not name.endswith(".min.js")]
    return [path for name in names if (path := root / name).is_file()]


def leads_nowhere(path: Path, target: str, root: Path) -> bool:
    """Whether *target*, named in *path*, is not there or lies outside of *root*."""
    crate = next((folder for folder in path.parents if (folder / "Cargo.toml").is_file()), path.parent)
    for base in {path.parent, crate}:
        place = (base / target).resolve()
        if place.is_relative_to(root) and place.exists():
            return False
    return True


def findings(path: Path, root: Path = ROOT) -> list[str]:
    """What is wrong in one file, each as `file:line: reason`."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return []
    where = path.relative_to(root)
    wrong = []
    for number, line in enumerate(text.splitlines(), start=1):
        targets = UPWARDS.findall(line)
        if path.suffix == ".md":
            targets += LINK.findall(line)
        wrong += [
            f"{where}:{number}: leads nowhere: {target}" for target in targets if leads_nowhere(path, target, root)
        ]
        wrong += [f"{where}:{number}: a folder of one machine: {found}" for found in OWN_FOLDER.findall(line)]
    return wrong


def main() -> int:
    """Prints every finding."""
    wrong = [
        finding for path in tracked(ROOT) if path.resolve() != Path(__file__).resolve() for finding in findings(path)
    ]
    for finding in wrong:
        print(finding, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
