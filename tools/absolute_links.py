"""Makes relative links of Markdown files absolute: a package index has none of the files beside them.

In the repository links stay relative, so that they hold on every branch and in every copy. A release is built where
README.md went through here. Its links lead to the tag of the version, and so to the pages as they were then.

usage: absolute_links.py FILE...
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent

FENCE = re.compile(r"^ *(```|~~~)", re.MULTILINE)
ELSEWHERE = r"(?!\w+:|//)"
LINK = re.compile(rf"(?P<before>(?P<picture>!?)\[[^\]]*\]\(){ELSEWHERE}(?P<target>[^)\s]+)")
ATTRIBUTE = re.compile(rf'(?P<before>\b(?:href|(?P<picture>src|srcset))="){ELSEWHERE}(?P<target>[^"\s]+)')


class Project(NamedTuple):
    """What the workspace's Cargo.toml says of the project, and nothing else does."""

    version: str
    address: str


def project(root: Path = ROOT) -> Project:
    """The version and the address of the project in *root*."""
    package: dict[str, Any] = tomllib.loads((root / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]
    return Project(package["version"], package["repository"])


def lasting(target: str, page: Path, root: Path, picture: bool) -> str:
    """Where *target*, as named in *page*, is for whoever has no copy of the repository."""
    version, address = project(root)
    path, mark, place = target.partition("#")
    file = (page.parent / path).resolve() if path else page.resolve()
    kind = "raw" if picture else "tree" if file.is_dir() else "blob"
    return f"{address}/{kind}/v{version}/{file.relative_to(root).as_posix()}{mark}{place}"


def absolute(text: str, page: Path, root: Path = ROOT) -> str:
    """*text*, which is that of *page*, without relative links. What stands in code stays as it is."""

    def link(found: re.Match[str]) -> str:
        return found["before"] + lasting(found["target"], page, root, picture=bool(found["picture"]))

    lines, code = [], False
    for line in text.splitlines(keepends=True):
        if FENCE.match(line):
            code = not code
        lines.append(line if code else ATTRIBUTE.sub(link, LINK.sub(link, line)))
    return "".join(lines)


def main() -> None:
    """Changes each file that is named."""
    for name in sys.argv[1:]:
        page = Path(name).resolve()
        page.write_text(absolute(page.read_text(encoding="utf-8"), page), encoding="utf-8")


if __name__ == "__main__":
    main()
