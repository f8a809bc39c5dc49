"""Measures how the source is laid out: how flat, how deep, how far names reach, and where it goes round.

`python -m tools.measure_house` prints the figures. What must hold is checked by `tools/check_layers.py` and
`tools/check_rings.py`; these are the figures behind it.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterable, Mapping

from tools.check_layers import ROOT, ancestors, borrowed, imports
from tools.check_rings import graph_of, rings

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
    python = modules()
    private = Counter(name for path in PACKAGE.rglob("*.py") for _, name in borrowed(path.read_text(encoding="utf-8")))
    towers = {f"{path.relative_to(PACKAGE)}: {name}": depth for path, name, depth in ancestors(PACKAGE)}
    deepest = max(towers, key=lambda name: towers[name])
    lines = {path: len(ast.unparse(ast.parse(path.read_text("utf-8"))).splitlines()) for path in PACKAGE.rglob("*.py")}
    print(f".py files at the top of python/drivebus: {len(list(PACKAGE.glob('*.py')))}, in all {len(lines)}")
    print(f"deepest own inheritance: {towers[deepest]} ({deepest})")
    print(f"private names used outside their file: {len(private)} {sorted(private)}")
    print(f"longest import chain by file: {longest_chain(python)}")
    print(f"import circles in Python: {rings(python)}")
    print(f"files at the top of crates/line/src: {len(list(LINE.glob('*.rs')))}, in all {len(graph_of(LINE))}")
    for source in sorted((ROOT / "crates").glob("*/src")):
        print(f"rings among files of crates/{source.parent.name}: {rings(graph_of(source))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
