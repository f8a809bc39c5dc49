"""What a release is called, and where the project lives, stands in the workspace's Cargo.toml and is repeated nowhere.

Where a format cannot refer to it (a dependency on a crate of ours, the links of pyproject.toml), the two are compared.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import tomli
from tools import cross_check
from tools.absolute_links import ROOT, absolute, project

import drivebus

VERSION, ADDRESS = project()

MEASURED = {"benches/RESULTS.md", "docs/developers/conformance.md"}
"""Pages that say which version was measured."""
MAY_SAY = {"Cargo.toml", "Cargo.lock", "CHANGELOG.md", *MEASURED}


def table(name: str) -> dict[str, Any]:
    """A TOML file of the project."""
    return tomli.loads((ROOT / name).read_text(encoding="utf-8"))


def texts() -> dict[str, str]:
    """Every text that git knows."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    found = {}
    for name in filter(None, listed.split("\0")):
        if (path := ROOT / name).is_file() and not name.startswith("fuzz/corpus/"):
            try:
                found[name] = path.read_text(encoding="utf-8")
            except UnicodeDecodeError:
                continue
    return found


def test_the_version_stands_in_one_place() -> None:
    version = re.compile(rf"(?<![\d.]){re.escape(VERSION)}(?![\d.]\d)")
    assert {name for name, text in texts().items() if version.search(text)} <= MAY_SAY
    assert table("pyproject.toml")["project"]["dynamic"] == ["version"]
    assert drivebus.__version__ == VERSION


def test_crates_of_ours_ask_for_one_another_at_this_version() -> None:
    bounds = table("Cargo.toml")["workspace"]["dependencies"].values()
    ours = [bound["version"] for bound in bounds if isinstance(bound, dict) and "path" in bound]
    assert ours, "crates of ours need one another"
    assert set(ours) == {VERSION}


@pytest.mark.parametrize("manifest", sorted(ROOT.glob("crates/*/Cargo.toml")), ids=lambda path: path.parent.name)
def test_each_crate_takes_what_all_have_from_the_workspace(manifest: Path) -> None:
    package = table(str(manifest.relative_to(ROOT)))["package"]
    shared = {"version", "edition", "rust-version", "license", "repository", "authors", "keywords"}
    assert {key for key in shared if package.get(key) != {"workspace": True}} == set()


def test_what_make_publishes_is_what_may_be_published() -> None:
    manifests = [table(str(path.relative_to(ROOT)))["package"] for path in ROOT.glob("crates/*/Cargo.toml")]
    published = {each["name"] for each in manifests if each.get("publish", True)}
    named = re.search(r"^PUBLISHED := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert named is not None
    assert set(named[1].split()) == published
    assert set(cross_check.PUBLISHED) == published


def test_the_newest_entry_of_the_changelog_is_this_version() -> None:
    entries = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert next(entry for entry in entries if entry != "Unreleased") == VERSION


def test_every_address_of_the_project_is_the_one() -> None:
    urls = table("pyproject.toml")["project"]["urls"]
    assert urls["Source"] == ADDRESS
    citation = re.search(r"^repository-code: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert citation is not None
    assert citation[1] == ADDRESS
    pages = {name: re.findall(r"https://[\w.]+/[\w-]+/drivebus\b[^\s)\"]*", text) for name, text in texts().items()}
    named = {(name, url) for name, found in pages.items() for url in (*found, *urls.values())}
    assert {(name, url) for name, url in named if not f"{url}/".startswith(f"{ADDRESS}/")} == set()


def test_links_become_absolute_and_code_stays() -> None:
    page = ROOT / "README.md"
    text = (
        "[a](docs/safety.md#sent) ![b](docs/pictures/panel.svg) [c](crates/rtu) [d](#safety) [e](https://a.example/x)\n"
        "```\n[f](docs/safety.md)\n```\n"
        '<img src="docs/pictures/panel.svg">\n'
    )
    assert absolute(text, page) == (
        f"[a]({ADDRESS}/blob/v{VERSION}/docs/safety.md#sent) ![b]({ADDRESS}/raw/v{VERSION}/docs/pictures/panel.svg)"
        f" [c]({ADDRESS}/tree/v{VERSION}/crates/rtu) [d]({ADDRESS}/blob/v{VERSION}/README.md#safety)"
        " [e](https://a.example/x)\n"
        "```\n[f](docs/safety.md)\n```\n"
        f'<img src="{ADDRESS}/raw/v{VERSION}/docs/pictures/panel.svg">\n'
    )


@pytest.mark.parametrize("page", sorted(ROOT.glob("crates/*/README.md")), ids=lambda path: path.parent.name)
def test_pages_of_crates_have_no_links_that_hold_only_here(page: Path) -> None:
    """A crate's page is shown by its registry and by rustdoc, and is packed as it is."""
    text = page.read_text(encoding="utf-8")
    assert absolute(text, page) == text
