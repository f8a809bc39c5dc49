"""drivebus alone through every row, with a unit that answers 08H and with one that is silent on it."""

from __future__ import annotations

import os

import pytest

if os.name == "nt":
    pytest.skip("no pty", allow_module_level=True)

from .play import play
from .rows import ROWS, Row

SILENT = pytest.mark.parametrize("silent_on_08", [False, True], ids=["08H", "no 08H"])


@SILENT
@pytest.mark.parametrize("row", ROWS, ids=[row.key for row in ROWS])
def test_the_truth_is_told_in_every_row(row: Row, silent_on_08: bool) -> None:
    result = play(row, "drivebus", mute=silent_on_08)
    assert result.verdict.keeps(row.must), result
    assert result.recovery.wrong == 0, result
    assert result.recovery.seconds is not None, result
