"""CRC-16/MODBUS from Python, beside fastcrc, at sizes that occur. Run by `make bench`."""

from __future__ import annotations

import random
from collections.abc import Callable

import fastcrc
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import drivebus

Engine = Callable[[bytes], int]

ENGINES: dict[str, Engine] = {"drivebus": drivebus.crc16, "fastcrc": fastcrc.crc16.modbus}

# The bodies of an answer of one word and of a request, a whole request, the body of an answer of four words, a whole
# answer of sixteen, the longest body, and a capture.
SIZES = [5, 6, 8, 11, 37, 254, 65536]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("engine", ENGINES)
def test_crc(benchmark: BenchmarkFixture, engine: str, size: int) -> None:
    benchmark.group = f"crc16, {size} bytes"
    data = random.Random(size).randbytes(size)
    crc = benchmark(ENGINES[engine], data)
    assert {crc} == {other(data) for other in ENGINES.values()}
