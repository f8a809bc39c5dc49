"""Measures how the source is laid out: how flat, how deep, how far names reach, and where it goes round.

`python -m tools.measure_house` prints the figures. What must hold is checked by `tools/check_layers.py`; these are the
figures behind it.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping

from tools.check_layers import ROOT, ancestors, borrowed, imports

PACKAGE = ROOT / "python" / "drivebus"
LINE = ROOT / "crates" / "line" / "src"


def modules() -> dict[str, set[str]]:
    """Each file of the package, and those that it imports."""
    names = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}
    found: dict[str, set[str]] = {}
    for name, path in names.items():
        typed = only_for_types(ast.parse(path.read_text(encoding="utf-8")))
        asked = [dotted for line, dotted in imports(path, PACKAGE) if line not in typed]
        used = {".".join(dotted[:end]) for dotted in asked for end in range(1, len(dotted) + 1)}
        found[name] = {one for one in used if one in names and one != name}
    return found


def only_for_types(tree: ast.AST) -> set[int]:
    """The lines of a file that no interpreter carries out."""
    blocks = [node for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)]
    return {line for block in blocks for line in range(block.lineno, (block.end_lineno or block.lineno) + 1)}


def rust_files() -> dict[str, set[str]]:
    """Each file of `crates/line`, and those that its `use` lines name."""
    paths = [
        path for path in LINE.rglob("*.rs") if path.name not in ("lib.rs", "tests.rs") and path.parts[-2] != "tests"
    ]
    places = {"::".join(path.relative_to(LINE).with_suffix("").parts).removesuffix("::mod"): path for path in paths}
    found: dict[str, set[str]] = {}
    for name, path in places.items():
        code = re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
        code = re.split(r"#\[cfg\((?:test|all\(test)\b", code)[0]
        used: set[str] = set()
        for match in re.finditer(r"\b(?:crate|super)::((?:\w+::)*)", code):
            parts = match[1].strip(":").split("::")
            if match[0].startswith("super"):
                parts = [*name.split("::")[:-1], *parts]
            used |= {"::".join(parts[:end]) for end in range(1, len(parts) + 1)}
        # A room names its own files, and they it: so is Rust's tree of modules made.
        found[name] = {one for one in used if one in places and one != name and not related(one, name)}
    return found


def related(one: str, other: str) -> bool:
    """Whether one of two modules stands inside the other."""
    return one.startswith(f"{other}::") or other.startswith(f"{one}::")


def rings(graph: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Groups of files each of which leads to every other: Tarjan's strongly connected components."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        number[node] = low[node] = len(number)
        stack.append(node)
        for other in graph[node]:
            if other not in number:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], number[other])
        if low[node] == number[node]:
            ring = [stack.pop()]
            while ring[-1] != node:
                ring.append(stack.pop())
            if len(ring) > 1:
                found.append(sorted(ring))

    for node in graph:
        if node not in number:
            visit(node)
    return found


def longest_chain(graph: Mapping[str, Iterable[str]]) -> int:
    """How many files the longest way of imports goes through."""
    known: dict[str, int] = {}

    def chain(node: str) -> int:
        if node not in known:
            known[node] = 1  # where it goes round, once is enough
            known[node] = 1 + max(map(chain, graph[node]), default=0)
        return known[node]

    return max(map(chain, graph))


def main() -> int:
    """The command."""
    sys.setrecursionlimit(10_000)
    python, rust = modules(), rust_files()
    private = Counter(name for path in PACKAGE.rglob("*.py") for _, name in borrowed(path))
    towers = {f"{path.relative_to(PACKAGE)}: {name}": depth for path, name, depth in ancestors(PACKAGE)}
    deepest = max(towers, key=lambda name: towers[name])
    lines = {path: len(ast.unparse(ast.parse(path.read_text("utf-8"))).splitlines()) for path in PACKAGE.rglob("*.py")}
    print(f".py files at the top of python/drivebus: {len(list(PACKAGE.glob('*.py')))}, in all {len(lines)}")
    print(f"deepest own inheritance: {towers[deepest]} ({deepest})")
    print(f"private names used outside their file: {len(private)} {sorted(private)}")
    print(f"longest import chain by file: {longest_chain(python)}")
    print(f"import circles in Python: {rings(python)}")
    print(f"files at the top of crates/line/src: {len(list(LINE.glob('*.rs')))}, in all {len(rust)}")
    print(f"rings among files of crates/line: {rings(rust)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
