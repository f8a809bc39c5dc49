"""Logs of other tools give the frames that are in them, whichever form they have, and nothing that is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tomli

from drivebus._native import judge
from drivebus.capture import Captured
from drivebus.capture.encoding import decoded
from drivebus.capture.text import heard

ROOT = Path(__file__).resolve().parents[2]
VECTORS: list[dict[str, Any]] = tomli.loads((ROOT / "tests/vectors/logs.toml").read_text(encoding="utf-8"))["tool"]


def shown(frame: Captured) -> str:
    """*frame* as the vectors write it."""
    sign = "!" if not frame.is_frame else {True: ">", False: "<", None: "?"}[frame.asks]
    return f"{sign} {frame.data.hex(' ').upper()}"


@pytest.mark.parametrize("tool", VECTORS, ids=[tool["name"] for tool in VECTORS])
def test_a_log_of_another_tool_gives_its_frames(tool: dict[str, Any]) -> None:
    found, remarks = heard(tool["text"])
    given = [shown(frame) for frame in found if frame.is_frame or not tool.get("besides")]
    assert given == tool["gives"]
    for part in tool.get("remarks", []):
        assert any(part in remark for remark in remarks), remarks


def test_the_page_lists_what_is_tried() -> None:
    page = (
        (ROOT / "docs/developers/log-forms.md")
        .read_text(encoding="utf-8")
        .partition("| tool | form | after |\n| --- | --- | --- |\n")[2]
    )
    assert page.splitlines() == [f"| {tool['name']} | {tool['form']} | {tool['source']} |" for tool in VECTORS]
    assert len(VECTORS) >= 30


@pytest.mark.parametrize("tool", VECTORS, ids=[tool["name"] for tool in VECTORS])
def test_a_damaged_log_gives_no_frame_that_was_not_in_it(tool: dict[str, Any]) -> None:
    data = tool["text"].encode()
    given = {line[2:] for line in tool["gives"]}
    for at in range(0, len(data), 5):
        for damaged in (data[:at], data[:at] + bytes([data[at] ^ 1 << at % 7]) + data[at + 1 :], data[at:]):
            for frame in heard(decoded(damaged))[0]:
                # Modbus TCP has no CRC by which damage would be noticed.
                if frame.is_frame and "Modbus TCP" not in str(tool.get("remarks")):
                    assert shown(frame)[2:] in given or judge(frame.data)[2] is not None
