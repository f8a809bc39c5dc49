"""Writes LICENSES-THIRD-PARTY.txt: the crates that are linked into the wheels, and files of others that lie in them.

    python -m tools.third_party [--check]

    --check   changes nothing; the exit code is 1 when the file is not what it would be

The texts of their licences stand there, too, each once. Macros, which only the compiler runs, are not linked in.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from tools.settle_wheel import ROOT

FILE = ROOT / "LICENSES-THIRD-PARTY.txt"
# Crates differ by the system, and hardly by the processor.
SYSTEMS = (
    "x86_64-unknown-linux-gnu",
    "armv7-unknown-linux-gnueabihf",
    "x86_64-unknown-linux-musl",
    "x86_64-pc-windows-gnu",
    "aarch64-apple-darwin",
)
NAMES = ("licen", "copying", "copyright", "notice", "unlicense")
VENDORED = {
    "dygraphs 2.2.1": ("MIT", ROOT / "python/drivebus/web/static/dygraphs.txt", "The licence is the MIT licence:")
}
"""Files of others: their licence, and where its text stands, behind which line."""
LINE = "=" * 80
HEAD = """\
drivebus itself is under the licences in LICENSE-MIT and LICENSE-APACHE.

Its wheels have the following works of others in them, for which we thank their authors. Not every wheel has each.

The standard library of Rust, by the Rust project contributors, is under the MIT licence or the Apache licence 2.0.
Their texts are below too. It has parts of others, which https://github.com/rust-lang/rust names in its COPYRIGHT.

What compilers add of their own: libunwind of LLVM, under the Apache licence 2.0 with the LLVM exception, whose text is
below too; in wheels for Windows the runtime of MinGW-w64, which https://www.mingw-w64.org lets everybody pass on, and
libgcc of GCC, under its Runtime Library Exception.
"""


def linked() -> dict[str, str]:
    """The crates that are linked in, as `name version`, with what they say is their licence."""
    found: dict[str, str] = {}
    for system in SYSTEMS:
        tree = ["cargo", "tree", "--locked", "--package", "drivebus-python", "--target", system]
        tree += ["--edges", "normal,no-proc-macro", "--prefix", "none", "--no-dedupe", "--format", "{p}|{l}"]
        for line in subprocess.run(tree, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines():
            crate, licence = line.split("|")
            name, version, *_where = crate.split()
            if not name.startswith("drivebus"):
                found[f"{name} {version.removeprefix('v')}"] = licence
    return dict(sorted(found.items()))


def folders() -> dict[str, Path]:
    """Where the sources of each crate are."""
    metadata = ["cargo", "metadata", "--locked", "--format-version", "1"]
    told = json.loads(subprocess.run(metadata, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
    return {f"{each['name']} {each['version']}": Path(each["manifest_path"]).parent for each in told["packages"]}


def text() -> str:
    """What the file holds."""
    crates, places = linked(), folders()
    texts: dict[str, list[str]] = {}
    for crate in crates:
        files = sorted(
            path for path in places[crate].iterdir() if path.is_file() and path.name.lower().startswith(NAMES)
        )
        if not files:
            raise SystemExit(f"third_party: {crate} has no text of its licence: {crates[crate]}")
        for path in files:
            lines = path.read_text(encoding="utf-8").strip().splitlines()
            texts.setdefault("\n".join(line.rstrip() for line in lines), []).append(crate)
    works = dict(crates)
    for work, (licence, path, behind) in VENDORED.items():
        works[work] = licence
        texts.setdefault(path.read_text(encoding="utf-8").partition(behind)[2].strip(), []).append(work)
    works = dict(sorted(works.items()))
    parts = [HEAD, "\n".join(f"- {work}: {licence}" for work, licence in works.items()) + "\n"]
    parts += [f"{LINE}\n{', '.join(dict.fromkeys(whose))}\n{LINE}\n\n{licence}\n" for licence, whose in texts.items()]
    return "\n".join(parts)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    is_check = parser.parse_args().check
    new = text()
    if is_check and (not FILE.is_file() or FILE.read_text(encoding="utf-8") != new):
        sys.exit(f"third_party: {FILE.name} is old; write it anew by: python -m tools.third_party")
    if not is_check:
        FILE.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
