"""Checks that no files of a Rust crate lead to each other in a ring: each can be read on top of those below it.

`check_rings.py` looks at the `src` of every crate. `check_rings.py --self-test` closes rings of each kind in a copy and
expects to be told so. `check_rings.py --count` prints how many files stand in rings.

What leads from one file to another is a path: `crate::…`, `super::…` or `self::…`, in a `use` or in the code, to the
file that holds its module. These lead nowhere:

- `mod child;`, by which a file says that another one belongs to it;
- what only tests see (`#[cfg(test)]`, and files that are declared so), and comments and strings;
- `lib.rs`, which lists what the crate shows;
- a path between a file and one that stands inside it (`bus` and `bus::call`): a room opens its files, they add to it.
  But a file inside that others lead to stands for itself, so a way through a room and back to it is a ring.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# A block that only tests see, up to what it is about.
TESTS = re.compile(r"#\[cfg\((?:test|all\(test\b[^\]]*)\)\]\s*(?:#\[[^\]]*\]\s*)*")
MODULE = re.compile(r"((?:#\[[^\n]*\]\s*)*)(?:pub(?:\([^)]*\))?\s+)?\bmod\s+(\w+)\s*([;{])")
PATH = re.compile(r"(?<![\w:])(?:\$?crate|self|super(?:::super)*)::")


def code_of(text: str) -> str:
    """Rust without comments, strings, characters, and what only tests see."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r'r(#*)".*?"\1|"(?:\\.|[^"\\])*"', '""', text, flags=re.DOTALL)
    text = re.sub(r"'(?:\\.[^']*|[^\\'])'", "' '", text)
    while found := TESTS.search(text):
        text = text[: found.start()] + text[end_of_item(text, found.end()) :]
    return text


def end_of_item(text: str, start: int) -> int:
    """Where the item that begins at *start* ends: behind its semicolon, or its block."""
    depth = 0
    for place in range(start, len(text)):
        depth += (text[place] in "{([") - (text[place] in "})]")
        if depth <= 0 and text[place] in ";}":
            return place + 1
    return len(text)


def files(source: Path) -> dict[str, list[Path]]:
    """Each module of a crate that has a file of its own, and its files: two where the platform decides."""
    found: dict[str, list[Path]] = {}
    todo = [("", source / "lib.rs")]
    while todo:
        name, path = todo.pop()
        found.setdefault(name, []).append(path)
        folder = path.parent if name == "" else path.parent / path.stem
        text = path.read_text(encoding="utf-8")
        kept = re.sub(r"//[^\n]*", "", text)
        while test := TESTS.search(kept):
            kept = kept[: test.start()] + kept[end_of_item(kept, test.end()) :]
        for attributes, child, kind in MODULE.findall(kept):
            if kind == ";":
                elsewhere = [path.parent / other for other in re.findall(r'path = "([^"]+)"', attributes)]
                places = [folder / f"{child}.rs", *elsewhere]
                todo += [(f"{name}::{child}".removeprefix("::"), place) for place in places if place.exists()]
    return found


def ends(text: str, place: int) -> Iterator[list[str]]:
    """The ends of the path, or of the tree of paths, that goes on at *place*."""
    here: list[str] = []
    while place < len(text):
        if word := re.compile(r"\s*(?:r#)?(\w+|\*)\s*").match(text, place):
            here.append(word[1])
            place = word.end()
            if not text.startswith("::", place):
                break
            place += 2
        elif brace := re.compile(r"\s*\{").match(text, place):
            last = end_of_item(text, brace.end() - 1)
            for branch in split(text[brace.end() : last - 1]):
                yield from ([*here, *end] for end in ends(branch, 0))
            return
        else:
            break
    yield here


def split(text: str) -> list[str]:
    """The parts of *text* between the commas that stand in no braces."""
    parts, depth = [""], 0
    for char in text:
        depth += (char == "{") - (char == "}")
        if char == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += char
    return [part for part in parts if part.strip()]


def rooms_inside(code: str) -> list[tuple[int, int, str]]:
    """The modules that are written inside of a file: where each begins and ends, and its name."""
    found = (match for match in MODULE.finditer(code) if match[3] == "{")
    return [(match.end(), end_of_item(code, match.end() - 1), match[2]) for match in found]


def used(name: str, code: str) -> Iterator[str]:
    """Each module that *code*, the file of the module *name*, names by a path, as it is written out in full."""
    inner = rooms_inside(code)
    for match in PATH.finditer(code):
        inside = [room for start, end, room in inner if start <= match.start() < end]
        here = [part for part in name.split("::") if part] + inside
        word = match[0].removeprefix("$")
        if word == "crate::":
            here = []
        elif word != "self::":
            here = here[: max(0, len(here) - word.count("super"))]
        for end in ends(code, match.end()):
            yield "::".join([*here, *end])


def graph_of(source: Path) -> dict[str, set[str]]:
    """Each module of the crate at *source* that has a file, and those that it leads to."""
    places = files(source)
    found: dict[str, set[str]] = {}
    for name, paths in places.items():
        if name == "":
            continue
        ways: set[str] = set()
        for path in paths:
            for full in used(name, code_of(path.read_text(encoding="utf-8"))):
                parts = full.split("::")
                heads = ("::".join(parts[:end]) for end in range(len(parts), 0, -1))
                ways.add(next((head for head in heads if head in places), ""))
        found[name] = {way for way in ways - {"", name} if not related(way, name)}
    return found


def related(one: str, other: str) -> bool:
    """Whether one of two modules stands inside the other."""
    return one.startswith(f"{other}::") or other.startswith(f"{one}::")


def rings(graph: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Groups each of whose members leads to every other: Tarjan's strongly connected components."""
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


def findings(root: Path) -> list[str]:
    """Each ring, in words."""
    sources = sorted((root / "crates").glob("*/src"))
    return [
        f"crates/{source.parent.name}: {len(ring)} files lead to each other: {', '.join(ring)}"
        for source in sources
        for ring in rings(graph_of(source))
    ]


# Each kind of path that closes a ring, put at the top of a file, and the files of which it makes one.
BREAKS: list[tuple[str, str, set[str]]] = [
    ("crates/rtu/src/crc.rs", "use crate::frame::Frame;\n", {"crc", "frame"}),
    ("crates/line/src/bus/port.rs", "use crate::bus::{call::Call, clock};\n", {"bus::call", "bus::port"}),
    ("crates/line/src/bus/no_sharing.rs", "use super::shared::Shared;\n", {"bus::shared", "bus::sharing"}),
    ("crates/line/src/share/failure.rs", "fn f(_: super::message::Told) {}\n", {"share::failure", "share::message"}),
    ("crates/python/src/errors.rs", "use crate::{bus::Bus, ending};\n", {"bus", "errors"}),
    ("crates/sim/src/wire.rs", "mod inner { use super::super::world::World; }\n", {"wire", "world"}),
]

# What closes none, put at the end of a file.
HARMLESS: list[tuple[str, str]] = [
    ("crates/rtu/src/crc.rs", '// use crate::frame::Frame;\nconst F: &str = "crate::frame::Frame";\n'),
    ("crates/rtu/src/crc.rs", "#[cfg(test)]\nmod more { use crate::frame::Frame; }\n"),
    ("crates/rtu/src/conversation/course.rs", "use crate::conversation::Conversation;\n"),
]


def self_test(root: Path) -> int:
    """Closes each ring in a copy; returns how many went unnoticed, or were seen where there is none."""
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="drivebus-rings-") as folder:
        place = Path(folder)
        shutil.copytree(root / "crates", place / "crates", ignore=shutil.ignore_patterns("target", "profiles"))
        for name, line, expected in BREAKS:
            path = place / name
            former = path.read_text(encoding="utf-8")
            code = re.search(r"^(?!//!).*$", former, re.MULTILINE)
            at = code.start() if code else 0
            path.write_text(former[:at] + line + former[at:], encoding="utf-8")
            noticed = any(
                expected <= set(ring) for source in place.glob("crates/*/src") for ring in rings(graph_of(source))
            )
            print(f"{'noticed' if noticed else 'UNNOTICED'}: {name}: {line.strip()}")
            wrong += not noticed
            path.write_text(former, encoding="utf-8")
        for name, line in HARMLESS:
            path = place / name
            former = path.read_text(encoding="utf-8")
            path.write_text(former + line, encoding="utf-8")
            seen = findings(place)
            print(f"{'SEEN, but is none' if seen else 'none'}: {name}: {line.strip()!r}")
            wrong += bool(seen)
            path.write_text(former, encoding="utf-8")
    return wrong


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--self-test", action="store_true", help="close rings in a copy and expect to be told")
    parser.add_argument("--count", action="store_true", help="print, for each crate, its files and those in rings")
    options = parser.parse_args()
    if options.self_test:
        return 1 if self_test(ROOT) else 0
    if options.count:
        for source in sorted((ROOT / "crates").glob("*/src")):
            graph = graph_of(source)
            sizes = [len(ring) for ring in rings(graph)]
            print(f"crates/{source.parent.name}: {len(graph)} files, rings of {sizes or 'none'}")
        return 0
    wrong = findings(ROOT)
    for finding in wrong:
        print(finding, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
