"""Makes everything that a release uploads, but the upload, and uses it as a stranger would.

What is released is a commit, so all of it is made in a fresh clone of HEAD: the crates, the sdist, and from the sdist
the wheel, in an empty folder. Exit code 1 at the first thing that is wrong. The archives stay in target/release-check.

usage: python -m tools.release_check
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import venv
import zipfile
from pathlib import Path

from tools.absolute_links import ROOT, project

FOLDER = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release-check"
TREE = FOLDER / "tree"
ARCHIVES = FOLDER / "archives"

# What a stranger has: nothing that says which interpreter is ours.
OURS = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PYO3"))}
# One target folder for every run and both builds: what the project needs is compiled once.
BUILT = {**OURS, "CARGO_TARGET_DIR": str(FOLDER / "target")}


def tell(what: str) -> None:
    """A line for whoever waits, or reads the log."""
    print(f"release_check: {time.strftime('%H:%M:%S')} {what}", flush=True)


def run(*command: object, at: Path, env: dict[str, str] = OURS) -> str:
    """Runs *command*; what it printed is shown only where it fails."""
    done = subprocess.run([str(word) for word in command], cwd=at, env=env, capture_output=True, text=True)
    if done.returncode != 0:
        print(done.stdout[-5000:], done.stderr[-5000:], sep="\n", file=sys.stderr)
        sys.exit(f"release_check: exit code {done.returncode} of {' '.join(map(str, command))}")
    return done.stdout


def cloned() -> None:
    """Lays out HEAD, with a README whose links hold anywhere."""
    changed = run("git", "status", "--porcelain", at=ROOT).splitlines()
    if changed:
        tell(f"{len(changed)} changes that are not committed are left out")
    for folder in (TREE, ARCHIVES):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    run("git", "clone", "--quiet", ROOT, TREE, at=FOLDER)
    run(sys.executable, "tools/absolute_links.py", "README.md", at=TREE)


def tagged() -> None:
    """Sees that a tag of this commit names its version, and that the changelog then has the day."""
    version = project(TREE).version
    tags = run("git", "tag", "--points-at", "HEAD", "--list", "v[0-9]*", at=TREE).split()
    if tags not in ([], [f"v{version}"]):
        sys.exit(f"release_check: this commit is tagged {' and '.join(tags)}, and its version is {version}")
    dated = re.compile(rf"^## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d$", re.MULTILINE)
    if tags and not dated.search((TREE / "CHANGELOG.md").read_text(encoding="utf-8")):
        sys.exit(f"release_check: CHANGELOG.md does not have the day of {version}: ## [{version}] - YYYY-MM-DD")


def crates() -> list[Path]:
    """Packs the crates, and has a program of somebody else's use them."""
    printed = run(sys.executable, "tools/check_packages.py", "--without-tests", at=TREE, env=BUILT)
    tell(printed.splitlines()[-1])
    return sorted((FOLDER / "target/package").glob(f"*-{project(TREE).version}.crate"))


def sdist() -> Path:
    """The source distribution."""
    run(sys.executable, "-m", "maturin", "sdist", "--out", ARCHIVES, at=TREE, env=BUILT)
    (archive,) = ARCHIVES.glob("*.tar.gz")
    return archive


def wheel(source: Path) -> Path:
    """The wheel that pip makes of *source* where nothing else of the project is."""
    with tempfile.TemporaryDirectory(prefix="drivebus-sdist-") as empty:
        run(
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--no-deps",
            "--wheel-dir",
            ARCHIVES,
            source,
            at=Path(empty),
            env=BUILT,
        )
    (archive,) = ARCHIVES.glob("*.whl")
    return archive


def whole(archive: Path) -> None:
    """Sees that the wheel has each file of the package, and no other but the compiled one."""
    with zipfile.ZipFile(archive) as packed:
        held = {name for name in packed.namelist() if name.startswith("drivebus/")}
    known = set(run("git", "ls-files", "drivebus", at=TREE / "python").splitlines())
    wrong = sorted(name for name in held ^ known if not name.startswith("drivebus/_native."))
    if wrong:
        sys.exit(f"release_check: {archive.name} and python/drivebus do not have the same files: {', '.join(wrong)}")


def demo(archive: Path) -> str:
    """The last line of `drivebus demo` where only the wheel was installed."""
    with tempfile.TemporaryDirectory(prefix="drivebus-installed-") as folder:
        home = Path(folder)
        venv.create(home / "venv", with_pip=True)
        scripts = home / "venv" / ("Scripts" if os.name == "nt" else "bin")
        run(scripts / "python", "-m", "pip", "install", "--quiet", "--only-binary=:all:", archive, at=home)
        version = run(scripts / "drivebus", "--version", at=home).strip()
        printed = run(scripts / "drivebus", "demo", at=home)
    return f"{version}; drivebus demo: exit code 0, {len(printed.splitlines())} lines"


def main() -> None:
    """Everything, in the order of what fails soonest."""
    cloned()
    tell(f"drivebus {project(TREE).version} of {run('git', 'rev-parse', '--short', 'HEAD', at=TREE).strip()}")
    tagged()
    source = sdist()
    tell(f"sdist: {source.name}, {source.stat().st_size} bytes")
    packed = crates()
    built = wheel(source)
    tell(f"wheel from the sdist, in an empty folder: {built.name}, {built.stat().st_size} bytes")
    whole(built)
    run(sys.executable, "-m", "twine", "check", "--strict", source, built, at=FOLDER)
    tell("twine check --strict: passed")
    print(run(sys.executable, "-m", "tools.check_archives", source, built, *packed, at=TREE), end="", flush=True)
    run(sys.executable, "-m", "tools.check_archives", "--self-test", source, built, *packed, at=TREE)
    tell("each rule for archives, broken once in a copy: noticed")
    tell(f"the wheel, installed where nothing else is: {demo(built)}")
    tell("everything passed")


if __name__ == "__main__":
    main()
