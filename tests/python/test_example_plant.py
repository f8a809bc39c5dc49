"""The plant of the README: its file has no mistake, and its page opens."""

from __future__ import annotations

import urllib.request
from pathlib import Path

import pytest

pytest.importorskip("starlette")


from .plant_text import served
from .tcp_client import free_port, seen

ROOT = Path(__file__).resolve().parent.parent.parent
DRIVES = {"pump1", "pump2", "fan", "conveyor"}


def test_its_page_opens_and_its_drives_answer(tmp_path: Path) -> None:
    text = (ROOT / "examples/plant.toml").read_text(encoding="utf-8")
    free = {}
    for port in ("8080", "1502"):
        free[port] = free_port()
        assert f'"127.0.0.1:{port}"' in text
        text = text.replace(f'"127.0.0.1:{port}"', f'"127.0.0.1:{free[port]}"')
    file = tmp_path / "drivebus.toml"
    file.write_text(text, encoding="utf-8")
    heard: list[str] = []
    with served(file, heard) as service:
        seen(lambda: any("page" in each for each in heard))
        with urllib.request.urlopen(f"http://127.0.0.1:{free['8080']}/login", timeout=20) as answer:
            shown = answer.read().decode()
        assert "password" in shown
        seen(lambda: {each.layout.drive for line in service.picture().lines for each in line.drives} == DRIVES)
        assert all(not each.missing for line in service.picture().lines for each in line.drives)
