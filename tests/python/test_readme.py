"""The Python code of README.md and docs/ runs as it stands, and the pages name the commands that exist.

Ports of real hardware and the real-time simulator are replaced by a simulated drive in virtual time: nobody waits.
"""

from __future__ import annotations

import logging
import re
import subprocess
import sys
from pathlib import Path

import pytest

import drivebus
from drivebus.cli import cli

ROOT = Path(__file__).resolve().parent.parent.parent
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "crates/drives/profiles").glob("*/about.md")),
]

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"\bdrivebus\.(?!toml|cli|hal\b|com\b)[a-z]+\.[A-Za-z]\w+")
PORT = re.compile(r'"(?:sim://gd350|/dev/ttyUSB\d)"')


def blocks() -> list[object]:
    """Each Python block, known by its page and line."""
    found: list[object] = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in BLOCK.finditer(text):
            line = text.count("\n", 0, match.start(1)) + 1
            found.append(pytest.param(match[1], id=f"{page.relative_to(ROOT)}:{line}"))
    return found


@pytest.mark.parametrize("block", blocks())
def test_python_blocks_run(
    block: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        exec(compile(PORT.sub('"sim://gd350?clock=virtual"', block), "<page>", "exec"), {"__name__": "page"})
    finally:
        logging.getLogger("drivebus").setLevel(logging.NOTSET)
    assert capsys.readouterr().out, "a block shows something"


def test_names_of_the_pages_are_there_after_a_plain_import() -> None:
    """A page that names `drivebus.record.read` means it: nothing else has to be imported, but asyncio's face."""
    pages = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    paths = sorted(path for path in set(NAME.findall(pages)) if not path.startswith("drivebus.aio"))
    assert {"drivebus.record.read", "drivebus.doctor.examine", "drivebus.rtu.decode"} <= set(paths)
    for path in paths:
        asked = subprocess.run(
            [sys.executable, "-c", f"import drivebus; {path}"], capture_output=True, text=True, check=False
        )
        assert asked.returncode == 0, f"{path}: {asked.stderr}"


def test_the_readme_is_the_first_block() -> None:
    """The ten lines that run, without the blank one."""
    first = BLOCK.search((ROOT / "README.md").read_text(encoding="utf-8"))
    assert first is not None
    assert len([line for line in first[1].splitlines() if line.strip()]) <= 10


def test_cli_page_names_every_command() -> None:
    page = (ROOT / "docs/commands.md").read_text(encoding="utf-8").partition("\n## ")[0]
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    named = {word for row in rows for word in re.findall(r"`([a-z]+)", row)}
    assert named == set(cli.commands)


def test_api_page_names_what_there_is() -> None:
    page = (ROOT / "docs/reference/python.md").read_text(encoding="utf-8")
    for section, owner in (("## Bus", drivebus.Bus), ("## Drive", drivebus.Drive)):
        part = page.partition(section)[2].partition("\n## ")[0]
        for row in (line.split("|")[1] for line in part.splitlines() if line.startswith("| `")):
            for name in re.findall(r"`([a-z_]+)[`(]", row):
                assert hasattr(owner, name), f"{section}: {name}"
