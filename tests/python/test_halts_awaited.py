"""No awaited halt of a family starts, reverses or sets anything in another: see `test_halts_of_other_families`."""

from __future__ import annotations

import pytest

from .matrix import FAMILIES
from .matrix_ways import blocks_begun, tried


@pytest.mark.parametrize("family", FAMILIES)
def test_no_awaited_halt_starts_reverses_or_sets_anything(family: str) -> None:
    tried(family, "asyncio")


def test_awaited_blocks_do_begin_by_another_name() -> None:
    assert blocks_begun("asyncio").total() >= 50
