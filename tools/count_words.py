"""Counts the words of the pages for users: what stands in docs/, without its folders for reference and developers.

Words are those of the prose and of tables that people write: no blocks of code, no generated tables, no addresses of
links. Too many end the command with 1.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
LIMIT = 15_000

NO_PROSE = re.compile(
    r"^ *(?P<fence>```|~~~).*?^ *(?P=fence) *$|<!-- table: kept .*?<!-- end of the table -->|(?<=\])\([^)]*\)",
    re.MULTILINE | re.DOTALL,
)


def words(page: str) -> int:
    """How many words of prose a *page* has: what holds a letter or a digit."""
    return sum(any(sign.isalnum() for sign in word) for word in NO_PROSE.sub("", page).split())


def by_page() -> dict[str, int]:
    """The words of each page for users."""
    return {path.stem: words(path.read_text(encoding="utf-8")) for path in sorted(DOCS.glob("*.md"))}


def main() -> int:
    """The command."""
    counted = by_page()
    total = sum(counted.values())
    for page, count in counted.items():
        print(f"{count:6}  {page}")
    print(f"{total:6}  words for users, of {LIMIT} at most")
    return int(total > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
