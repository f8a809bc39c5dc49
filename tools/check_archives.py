"""Checks what is about to be published, archive by archive: sdist, wheels and crates.

Each holds both licences and the version, and the links of its description hold on the page of a package index. A wheel
and an sdist name the project's address, and classifiers that exist. A crate has what its registry asks for. Exit code 1
with a line for each finding. `--self-test` breaks each rule once in a copy and expects to be told so.

usage: python -m tools.check_archives [--self-test] ARCHIVE...
"""

from __future__ import annotations

import email
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from subprocess import run
from typing import Any

import tomli
from tools.absolute_links import ROOT, Project, project
from trove_classifiers import classifiers

LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
LINKS = {"Source", "Documentation", "Changelog", "Issues"}
"""What a page of the package index shall link to."""
CRATE = ("description", "license", "repository", "readme", "keywords", "categories", "rust-version")
LONGEST = 10 * 1024 * 1024
"""Of an archive, in bytes; the registry of crates takes no longer ones."""
METADATA = (".dist-info/METADATA", "/PKG-INFO")


class Links(HTMLParser):
    """Where a page leads, the pictures it shows, and the places in it that a link may lead to."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keeps addresses and places."""
        if tag in ("a", "img", "source"):
            self.targets += [value or "" for name, value in attrs if name in ("href", "src", "srcset")]
        self.places |= {f"#{value}" for name, value in attrs if name == "id"}


def shown(markdown: str) -> list[str]:
    """Where the page that a package index makes of *markdown* leads.

    Both indexes read GFM and clean the HTML alike, so one renderer speaks for both.
    """
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "README.md"
        page.write_text(markdown, encoding="utf-8")
        html = run([sys.executable, "-m", "readme_renderer", page], check=True, capture_output=True, text=True).stdout
    links = Links()
    links.feed(html)
    return [target for target in links.targets if target not in links.places]


def lost(markdown: str, ours: Project, root: Path = ROOT) -> Iterator[str]:
    """The links of *markdown* that lead nowhere from the page of a package index."""
    if not markdown.strip():
        yield "has no description"
        return
    for target in shown(markdown):
        if not target.startswith("https://"):
            yield f"a link that holds only in the repository: {target}"
        elif target.startswith(f"{ours.address}/"):
            kind, _, rest = target.removeprefix(f"{ours.address}/").partition("/")
            tag, _, path = rest.partition("#")[0].partition("/")
            if kind in ("blob", "tree", "raw") and not (tag == f"v{ours.version}" and (root / path).exists()):
                yield f"a link to what the tag does not have: {target}"


def python_findings(files: dict[str, bytes], ours: Project) -> Iterator[str]:
    """What is wrong with an sdist or a wheel."""
    name = next((name for name in sorted(files, key=len) if name.endswith(METADATA)), None)
    if name is None:
        yield "has no metadata"
        return
    about = email.message_from_string(files[name].decode())
    for key, wanted in {"Version": ours.version, "License-Expression": "MIT OR Apache-2.0"}.items():
        if about[key] != wanted:
            yield f"{key} is {about[key]}, not {wanted}"
    urls = dict(str(url).split(", ", 1) for url in about.get_all("Project-URL", []))
    yield from (f"names no {link}" for link in sorted(LINKS - set(urls)))
    yield from (
        f"{link} leads elsewhere: {url}" for link, url in urls.items() if not f"{url}/".startswith(f"{ours.address}/")
    )
    yield from (f"no such classifier: {each}" for each in sorted(set(about.get_all("Classifier", [])) - classifiers))
    yield from lost(str(about.get_payload()), ours)


def crate_findings(files: dict[str, bytes], ours: Project) -> Iterator[str]:
    """What is wrong with a crate."""
    tops = {name.partition("/")[0] for name in files}
    manifest: dict[str, Any] = tomli.loads(files[f"{min(tops)}/Cargo.toml"].decode())["package"]
    yield from (f"says no {key}" for key in CRATE if not manifest.get(key))
    for key, wanted in {"version": ours.version, "repository": ours.address}.items():
        if manifest.get(key) != wanted:
            yield f"{key} is {manifest.get(key)}, not {wanted}"
    # The registry's own bounds.
    yield from (f"more than five {key}" for key in ("keywords", "categories") if len(manifest.get(key, [])) > 5)
    yield from lost(files.get(f"{min(tops)}/{manifest.get('readme')}", b"").decode(), ours)


def content(archive: Path) -> dict[str, bytes]:
    """Every file of *archive*."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            return {name: wheel.read(name) for name in wheel.namelist()}
    with tarfile.open(archive) as packed:
        return {each.name: file.read() for each in packed if (file := packed.extractfile(each)) is not None}


def findings(files: dict[str, bytes], ours: Project) -> Iterator[str]:
    """What is wrong with an archive of *files*, a sentence each."""
    for licence in LICENCES:
        text = (ROOT / licence).read_bytes()
        if not any(name.endswith(f"/{licence}") and held == text for name, held in files.items()):
            yield f"lacks the text of {licence}"
    yield from (crate_findings if is_crate(files) else python_findings)(files, ours)


def is_crate(files: dict[str, bytes]) -> bool:
    """Whether *files* are those of a crate; cargo keeps the manifest that somebody wrote beside the one it made."""
    return any(name.endswith("/Cargo.toml.orig") for name in files)


def broken(files: dict[str, bytes], ours: Project) -> Iterator[tuple[str, dict[str, bytes]]]:
    """*files* with one rule broken, each with what shall be said of it."""
    facts, page = ("/Cargo.toml", "/README.md") if is_crate(files) else (METADATA, METADATA)

    def changed(where: str | tuple[str, ...], change: Callable[[bytes], bytes]) -> dict[str, bytes]:
        return {name: change(held) if name.endswith(where) else held for name, held in files.items()}

    yield "lacks the text", {name: held for name, held in files.items() if not name.endswith(LICENCES)}
    yield "only in the repository", changed(page, lambda held: held + b"\n[a](docs/a.md)\n")
    yield "the tag does not have", changed(page, lambda held: held + f"\n[a]({ours.address}/blob/main/a)\n".encode())
    yield f"not {ours.version}", changed(facts, lambda held: held.replace(ours.version.encode(), b"0.0.0"))
    yield "https://a.example", changed(facts, lambda held: held.replace(ours.address.encode(), b"https://a.example"))


def self_test(archives: list[Path], ours: Project) -> int:
    """Breaks each rule in each archive; prints what was not noticed."""
    missed = 0
    for archive in archives:
        for said, files in broken(content(archive), ours):
            if not any(said in finding for finding in findings(files, ours)):
                missed += 1
                print(f"check_archives: {archive.name}: not noticed: {said}", file=sys.stderr)
    return 1 if missed else 0


def main() -> int:
    """Prints a line for each archive, and one for each finding."""
    names = sys.argv[1:]
    archives, ours, wrong = [Path(name) for name in names if name != "--self-test"], project(), 0
    if "--self-test" in names:
        return self_test(archives, ours)
    for archive in archives:
        found = list(findings(content(archive), ours))
        if archive.stat().st_size > LONGEST:
            found.append(f"is longer than {LONGEST} bytes")
        wrong += len(found)
        print(f"check_archives: {archive.name}: {'ok' if not found else f'{len(found)} wrong'}", flush=True)
        for finding in found:
            print(f"    {finding}", file=sys.stderr, flush=True)
    return 1 if wrong or not archives else 0


if __name__ == "__main__":
    sys.exit(main())
