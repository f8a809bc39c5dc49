"""What a row of a manual's table prints of the words of its register: in hexadecimal, as numbers, or bit by bit."""

from __future__ import annotations

import re
from collections.abc import Iterable

from drivebus.cli.manual_cells import TableRow

__all__ = ["prints_bits", "prints_words", "words_of"]

_HEX = re.compile(r"\b([0-9A-Fa-f]{1,4})[Hh]\b|\b0x([0-9A-Fa-f]{1,4})\b")
_NUMBER = re.compile(r"(?<![\w.+-])(\d{1,5})(?: ?[:=] ?| )(?=[A-Za-z])")
"""`1: forward`, `2 reverse`."""


def words_of(row: TableRow) -> set[int]:
    """The words that the row of a register prints; none where it has bits, or less than two numbers."""
    told = " ".join([row.label, *row.notes])
    words = {int(one or other, 16) for one, other in _HEX.findall(told)}
    numbers = {int(number) for number in _NUMBER.findall(told)}
    if words or row.bits:
        return words
    return numbers if len(numbers) > 1 else set()


def prints_words(row: TableRow, words: Iterable[int]) -> bool:
    """Whether a row prints each of *words*, or the bits that are 1 in them."""
    printed = words_of(row)
    bits = {bit for high, low in row.bits for bit in range(low, high + 1)}
    is_told = (word in printed or {bit for bit in range(16) if word >> bit & 1} <= bits for word in words)
    return bool(printed or bits) and all(is_told)


def prints_bits(row: TableRow, fields: Iterable[tuple[int, int]]) -> bool:
    """Whether a row prints each bit of *fields*, which have their highest and lowest one."""
    bits = {bit for high, low in row.bits for bit in range(low, high + 1)}
    return all(bit in bits for high, low in fields for bit in range(low, high + 1))
