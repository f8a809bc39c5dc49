"""Builds the documentation as a site: the pages of docs/, one page for each family, and the reference.

Everything comes from this repository. What is generated is written below `target/`, and nothing is fetched.
A warning of Sphinx ends the build.

usage: build_site.py [--rust FOLDER] [OUT]
"""

from __future__ import annotations

import argparse
import html
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from tools.absolute_links import ROOT, lasting
from tools.family_pages import ABOUT, family_page

import drivebus

DOCS = ROOT / "docs"
TARGET = ROOT / "target"
RUST = re.compile(r"^```rust[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!\w+:|#)([^)#\s]+)((?:#[^)\s]*)?)\)")
FETCHED = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=\"(?:https?:)?//[^>]*>")
IMPORTED = re.compile(r"(?:@import|url\()\s*[\"']?(?:https?:)?//[^;)]*")

Contents = list[tuple[str, list[str]]]
CONTENTS: Contents = [
    ("Begin", ["start", "installing", "recipes", "safety", "errors"]),
    ("Guides", ["commands", "python", "coming-from", "rust", "families", "not-in-the-list", "adapters"]),
    (
        "One thing at a time",
        ["record", "backup", "site", "sharing", "panel", "raw", "trials", "sniff", "trace", "logs", "discover"],
    ),
    ("Machines and tests", ["simulator", "linuxcnc", "profiles"]),
    ("Reference", ["reference/index"]),
    ("For developers", ["developers/index"]),
]
"""What the first page leads to, by heading. A page that is in no contents is an error of the build."""

CRATES = {
    "crates/drivebus": "drivebus",
    "crates/rtu": "drivebus_rtu",
    "crates/line": "drivebus_line",
    "crates/drives": "drivebus_drives",
    "crates/drive": "drivebus_drive",
    "crates/sim": "drivebus_sim",
}
"""What cargo doc calls the folder of each published crate."""

BELOW = {"families": "families", "reference/index": "reference", "developers/index": "developers"}
"""The pages that have contents of their own: those of a folder."""

REFERENCE: Contents = [
    ("Line and drive", ["Bus", "Drive", "Motor", "Poll", "Batch", "Sample", "ports", "SerialPort", "SerialFormat"]),
    ("What a drive tells", ["Status", "State", "Snapshot", "Look", "Fault", "Description", "Choice"]),
    ("What makes it obey", ["Control", "ControlItem", "ControlSource", "SetpointRange"]),
    (
        "Who is there",
        [
            "Found",
            "Identification",
            "DeviceIdentification",
            "search",
            "Search",
            "Located",
            "Settings",
            "Progress",
            "Discovery",
        ],
    ),
    ("Profiles", ["Profile", "profiles"]),
    ("Parameters in a file", ["Backup", "Diff", "Difference", "Restoration", "Restored"]),
    ("Recordings, other masters, figures", ["Recorder", "sniff", "Exchange", "Stats", "Link"]),
    ("Modbus TCP", ["Gateway", "Allow", "GatewayStats"]),
    ("Simulation", ["Simulator"]),
    ("Modules", ["doctor", "record", "rtu", "sim", "trial", "crc16"]),
    (
        "Errors",
        [
            "DrivebusError",
            "NotAllowed",
            "BadArgument",
            "NotReady",
            "BadLink",
            "Unverified",
            "WrongDrive",
            "QueueFull",
            "PortError",
            "NoAnswer",
            "BadAnswer",
            "CrcError",
            "Refused",
            "Unconfirmed",
            "NotReached",
            "NotStopped",
        ],
    ),
    ("Warnings", ["DrivebusWarning", "SharedCodeWarning", "StoreWarning"]),
]
"""Every public name, by what it is for: `check_names` holds this to `drivebus.__all__`."""

ASYNCIO = ("asyncio", ["drivebus.aio.Bus", "drivebus.aio.Drive"])
"""What is imported by itself."""


def check_names() -> None:
    """Each public name stands in the reference, once."""
    listed = sorted(name for _, names in REFERENCE for name in names)
    public = sorted(set(drivebus.__all__) - {"__version__"})
    if listed != public:
        differing = ", ".join(sorted(set(listed) ^ set(public))) or "a name twice"
        sys.exit(f"build_site.py: REFERENCE and drivebus.__all__ differ: {differing}")


def placed(path: Path) -> str | None:
    """Where a file of the repository stands in the site, or None where it does not."""
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    if path.is_relative_to(ABOUT) and path.name == "about.md":
        return f"families/{path.parent.name}.md"
    return None


def rewritten(text: str, path: Path, *, rust: bool = False) -> str:
    """The *text* of a page at *path*, with links as they lead in the site; *rust* where the crates' pages are in it."""
    here = placed(path)
    assert here is not None, path

    def lead(match: re.Match[str]) -> str:
        bang, shown, target, anchor = match.groups()
        meant = (path.parent / target).resolve()
        there = placed(meant)
        if there is not None:
            return f"{bang}[{shown}]({os.path.relpath(there, Path(here).parent)}{anchor})"
        source = meant.relative_to(ROOT).as_posix()
        if rust and (crate := source.removesuffix("/README.md")) in CRATES:
            # Nothing that Sphinx knows of: it stands beside what Sphinx makes.
            page = os.path.relpath(f"rust/{CRATES[crate]}/index.html", Path(here).parent)
            return f'<a href="{page}">{html.escape(shown.replace("`", ""))}</a>'
        return f"{bang}[{shown}]({lasting(target + anchor, path, ROOT, picture=bool(bang))})"

    return RUST.sub(as_shown, LINK.sub(lead, text))


def as_shown(block: re.Match[str]) -> str:
    """A block of Rust without the lines that only its test needs."""
    kept = [line for line in block[1].splitlines() if not re.match(r"#( |$)", line)]
    return "\n".join(["```rust", *kept, "```"])


def toctree(pages: Iterable[str], caption: str = "") -> str:
    """What Sphinx makes the contents from; on the page itself it shows nothing."""
    options = ":hidden:\n" + (f":caption: {caption}\n" if caption else "")
    return f"\n```{{toctree}}\n{options}\n" + "\n".join(pages) + "\n```\n"


def write_pages(source: Path, *, rust: bool) -> None:
    """The pages of docs/, and one for each family."""
    for path in sorted(DOCS.rglob("*")):
        if path.is_dir():
            continue
        there = source / path.relative_to(DOCS)
        there.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            there.write_text(rewritten(path.read_text(encoding="utf-8"), path, rust=rust), encoding="utf-8")
        else:
            shutil.copyfile(path, there)
    (source / "families").mkdir()
    for name in drivebus.profiles():
        page = rewritten(family_page(name), ABOUT / name / "about.md", rust=rust)
        (source / f"families/{name}.md").write_text(page, encoding="utf-8")


def write_reference(source: Path) -> None:
    """A page for each group of public names, from their docstrings."""
    for at, (title, names) in enumerate(REFERENCE):
        lines = [title, "=" * len(title), ""]
        for name in names:
            lines += [name, "-" * len(name), "", f".. {_directive(name)}:: drivebus.{name}"]
            if _directive(name) in ("autoclass", "automodule"):
                lines += ["   :members:", "   :member-order: bysource"]
            if _directive(name) == "automodule":
                elsewhere = [each for each in drivebus.__all__ if _is_same(getattr(drivebus, name), each)]
                lines += [f"   :exclude-members: {', '.join(elsewhere)}"] if elsewhere else []
            if isinstance(getattr(drivebus, name), type) and not issubclass(getattr(drivebus, name), BaseException):
                lines += ["   :inherited-members: str, int, tuple, dict, list"]
            lines += [""]
        (source / f"reference/api-{at:02}.rst").write_text("\n".join(lines), encoding="utf-8")

    title, names = ASYNCIO
    lines = [title, "=" * len(title), ""]
    for name in names:
        lines += [name, "-" * len(name), "", f".. autoclass:: {name}", "   :members:", "   :inherited-members:", ""]
    (source / f"reference/api-{len(REFERENCE):02}.rst").write_text("\n".join(lines), encoding="utf-8")


def _directive(name: str) -> str:
    what = getattr(drivebus, name)
    return "autoclass" if isinstance(what, type) else "autofunction" if callable(what) else "automodule"


def _is_same(module: object, name: str) -> bool:
    """Whether *name* of a module is what the package has by that name, and so has its place already."""
    return getattr(module, name, module) is getattr(drivebus, name)


def write_contents(source: Path) -> None:
    """The contents, behind the pages that have some."""
    with (source / "index.md").open("a", encoding="utf-8") as page:
        page.writelines(toctree(pages, caption) for caption, pages in CONTENTS)
    for name, folder in BELOW.items():
        index = source / f"{name}.md"
        found = [*sorted((source / folder).glob("*.rst")), *sorted((source / folder).glob("*.md"))]
        pages = [os.path.relpath(path, index.parent)[: -len(path.suffix)] for path in found if path != index]
        with index.open("a", encoding="utf-8") as page:
            page.write(toctree(pages))


WEIGHTS = {"": 10.0, "families": 5.0, "reference": 0.0, "developers": -5.0}
"""What a hit of the search is worth by the folder of its page. A word in a heading is worth 15, one in the text 5."""

SCORER = """
var Scorer = {
  score: ([page, , , , score]) => score + (WEIGHTS[page] ?? 0),
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
"""
"""The values of Sphinx's own scorer, and the weight of the page."""


def weights(source: Path) -> dict[str, float]:
    """What each page adds to a hit. Of pages of one kind, those that the contents name first come first."""
    pages = [page for _, listed in CONTENTS for page in listed]
    pages += [f"families/{name}" for name in drivebus.profiles()]
    found = [path.relative_to(source).with_suffix("").as_posix() for path in sorted(source.rglob("*"))]
    pages += [page for page in found if page not in pages]
    return {page: WEIGHTS.get(page.rpartition("/")[0], 0.0) - at / 1000 for at, page in enumerate(pages)}


def write_scorer(source: Path) -> None:
    """What the search sorts its hits by."""
    (source / "scorer.js").write_text(f"const WEIGHTS = {json.dumps(weights(source))};{SCORER}", encoding="utf-8")


def foreign_files(site: Path) -> list[str]:
    """What pages of the *site* would fetch from elsewhere: there must be nothing."""
    found = []
    for page in sorted(site.rglob("*")):
        if page.suffix == ".html":
            found += [f"{page.name}: {tag}" for tag in FETCHED.findall(page.read_text(encoding="utf-8"))]
        elif page.suffix == ".css":
            found += [f"{page.name}: {rule}" for rule in IMPORTED.findall(page.read_text(encoding="utf-8"))]
    return found


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description="Builds the documentation as a site.")
    parser.add_argument("out", nargs="?", type=Path, default=TARGET / "site", help="where the site goes")
    parser.add_argument("--rust", type=Path, help="what cargo doc has made, to stand at rust/ in the site")
    options = parser.parse_args()
    check_names()
    source = TARGET / "site-source"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    write_pages(source, rust=options.rust is not None)
    write_reference(source)
    write_contents(source)
    write_scorer(source)
    shutil.rmtree(options.out, ignore_errors=True)
    doctrees = TARGET / "site-doctrees"
    shutil.rmtree(doctrees, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", str(doctrees)]
    ended = subprocess.run([*command, str(source), str(options.out)], check=False).returncode
    foreign = foreign_files(options.out)
    for each in foreign:
        print(f"build_site.py: not a file of ours: {each}", file=sys.stderr)
    ended = ended or int(bool(foreign))
    if ended == 0 and options.rust is not None:
        shutil.copytree(options.rust, options.out / "rust", dirs_exist_ok=True)
    if ended == 0:
        print(f"{options.out}/index.html")
    return ended


if __name__ == "__main__":
    sys.exit(main())
