"""tools/build_site.py: every page and every public name has its place, and links lead to what is in the site."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tools import build_site, count_words
from tools.absolute_links import ROOT, project
from tools.build_site import BELOW, CONTENTS, DOCS, REFERENCE, foreign_files, placed, rewritten
from tools.family_pages import ABOUT

import drivebus

PAGES = [*sorted(DOCS.rglob("*.md")), *sorted(ABOUT.glob("*/about.md"))]
PLACES = {placed(page) for page in PAGES}


def test_each_page_stands_in_the_contents() -> None:
    """Once; those of a folder are in the contents of its first page."""
    listed = [page for _, pages in CONTENTS for page in pages]
    assert len(listed) == len(set(listed))
    folders = tuple(f"{folder}/" for folder in BELOW.values())
    alone = {place[:-3] for place in PLACES if place and not place.startswith(folders)} - {"index"}
    assert set(listed) - set(BELOW) == alone - set(BELOW)


def test_each_public_name_stands_in_the_reference() -> None:
    build_site.check_names()
    assert sorted({*drivebus.__all__} - {"__version__"}) == sorted(name for _, names in REFERENCE for name in names)


def test_each_family_has_what_is_written_of_it() -> None:
    assert {page.parent.name for page in PAGES if page.name == "about.md"} == set(drivebus.profiles())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_pages_of_the_site(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    here = placed(page)
    assert here is not None
    for _, _, target, _ in build_site.LINK.findall(rewritten(text, page)):
        there = (DOCS / here).parent.joinpath(target).resolve().relative_to(DOCS).as_posix()
        assert there in PLACES or (DOCS / there).is_file(), target


def test_a_link_out_of_the_site_leads_to_the_repository() -> None:
    page, up = DOCS / "index.md", ".."
    version, address = project()
    assert rewritten(f"[x]({up}/README.md#use)", page) == f"[x]({address}/blob/v{version}/README.md#use)"
    assert rewritten(f"[`x`]({up}/crates/rtu)", page) == f"[`x`]({address}/tree/v{version}/crates/rtu)"
    crate = '<a href="rust/drivebus/index.html">x</a>'
    assert rewritten(f"[`x`]({up}/crates/drivebus/README.md)", page, rust=True) == crate


def test_the_pages_for_users_stay_short() -> None:
    assert sum(count_words.by_page().values()) <= count_words.LIMIT
    page = "# A title\n\nFour [words](x.md) | here, `now`.\n\n   ```text\n   none of it\n   ```\n\nTwo more.\n"
    assert count_words.words(page) == 8


def test_a_file_from_elsewhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "own.html").write_text('<script src="_static/a.js"></script><a href="https://example.org">x</a>')
    assert foreign_files(tmp_path) == []
    (tmp_path / "other.html").write_text('<link rel="stylesheet" href="https://example.org/font.css">')
    (tmp_path / "font.css").write_text("@font-face { src: url(//example.org/a.woff2) }")
    assert [each.partition(":")[0] for each in foreign_files(tmp_path)] == ["font.css", "other.html"]
