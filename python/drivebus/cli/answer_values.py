"""What an answer says of a drive: words, bits, places, steps. What may mean two things is not taken."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import TypeVar

from drivebus.cli.manual_cells import SCALES, place_of
from drivebus.cli.profile_answers import Bits
from drivebus.cli.wrong_use import WrongUse

__all__ = [
    "bits",
    "code",
    "command_word",
    "faults",
    "functions",
    "line",
    "new",
    "place",
    "plain",
    "speed",
    "step",
    "two_numbers",
    "word",
]

T = TypeVar("T")


def code(text: str) -> str:
    """The code of a parameter, as the keypad shows it."""
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,15}", text) is None:
        raise WrongUse(f'"{text}" is no code of a parameter, such as P00.03 or F0-10')
    return text


def plain(text: str) -> str:
    """Text that says something, in one line."""
    said = " ".join(text.split())
    if not said:
        raise WrongUse("this is needed")
    return said


def place(text: str) -> tuple[str, int]:
    """Table and address of a register, where they can be read in one way only."""
    plain = text.lower().replace(" ", "")
    is_hex = plain.startswith("0x") or plain.endswith("h") or re.search("[a-f]", plain) is not None
    found = place_of(text, "hex") if is_hex else place_of(text, "40001")
    if found is None:
        both = f": it may be {plain}H, or {int(plain)} as 0x{int(plain):04X}" if re.fullmatch(r"\d{1,4}", plain) else ""
        raise WrongUse(
            f'"{text}" is no name of the tables and no address{both}. '
            "Write 2000H, 0x2000, or 48193 for the 8193rd register"
        )
    return found


def word(text: str) -> int:
    """A word in decimal, or in hexadecimal with its sign."""
    found = re.fullmatch(r"0x([0-9a-f]{1,4})|([0-9a-f]{1,4})h|(0|[1-9]\d{0,4})", text.lower())
    if found is None or (found[3] and int(found[3]) > 0xFFFF):
        raise WrongUse(f'"{text}" is no word from 0 to 65535: write 18, 12H or 0x12')
    return int(found[3]) if found[3] else int(found[1] or found[2], 16)


def new(known: Mapping[str, T], read: Callable[[str], T]) -> Callable[[str], T]:
    """What reads a thing that means one thing only."""

    def read_new(text: str) -> T:
        answer = read(text)
        other = next((name for name, value in known.items() if value == answer), None)
        if other is not None:
            raise WrongUse(f"{text} is {other.replace('_', ' ')} already")
        return answer

    return read_new


def bits(text: str) -> Bits:
    """Fields of a word and their values, `0=1, 4-3=2`."""
    found: dict[tuple[int, int], int] = {}
    for part in filter(None, re.split(r"[, ]+", text)):
        said = re.fullmatch(r"(?:bit)?(\d{1,2})(?:-(\d{1,2}))?=(\d{1,16})", part.lower())
        if said is None:
            raise WrongUse(f'"{part}" is no bit and what it is, such as 0=1, or 4-3=2 for two of them')
        ends = sorted((int(said[1]), int(said[2] or said[1])), reverse=True)
        width = ends[0] - ends[1] + 1
        # As many digits of 0 and 1 as there are bits are these bits: in decimal they would not fit.
        is_binary = len(said[3]) == width and set(said[3]) <= {"0", "1"}
        value = int(said[3], 2 if is_binary else 10)
        if ends[0] > 15 or value >> width:
            raise WrongUse(f'"{part}": a word has the bits 0 to 15, and {said[3]} does not fit in that')
        found[ends[0], ends[1]] = value
    return found


def step(text: str, unit: str) -> Fraction:
    """What one count is, in *unit*."""
    said = re.fullmatch(rf"(\d*[.,]?\d+) ?{unit.lower()}", text.lower())
    found = Fraction(said[1].replace(",", ".")) if said else Fraction(0)
    if not found or 1 / found not in SCALES:
        raise WrongUse(f'"{text}" is no 1, 0.1, 0.01 or 0.001 {unit}, such as 0.01 {unit}')
    return found


def speed(text: str) -> Fraction | tuple[int, str]:
    """What one count is; or how many counts are a parameter, by its code, which may follow."""
    share = re.fullmatch(r"(\d*[.,]?\d+) ?%.*", text)
    part = Fraction(share[1].replace(",", ".")) if share else Fraction(0)
    whole = re.fullmatch(r"(\d{2,5}) ?= ?(.+)", text)
    counts = 100 / part if part else Fraction(whole[1]) if whole else None
    if counts is None:
        return step(text, "Hz")
    if counts.denominator != 1 or counts > 0xFFFF:
        raise WrongUse(f'"{text}" is no 1 to 65535 counts: write 10000 = P00.03, or 0.01 %')
    of = whole[2].strip() if whole else ""
    return int(counts), "" if "%" in of else of


def two_numbers(text: str) -> tuple[float, float]:
    """The lowest and the highest value of something."""
    found = [float(each) for each in re.findall(r"\d+(?:\.\d+)?", text)]
    if len(found) != 2 or not 0 <= found[0] < found[1]:
        raise WrongUse(f'"{text}" is no lowest and highest value, such as 10 400')
    return found[0], found[1]


def line(text: str) -> tuple[int, str, int]:
    """Speed, format and unit of a line."""
    said = re.fullmatch(r"(\d{3,6})[ ,]+(8-?[neo]-?[12])[ ,]+(\d{1,3})", text.lower())
    if said is None or not 1 <= int(said[3]) <= 247:
        raise WrongUse(f'"{text}" is no speed, format and unit, such as 9600 8N1 1')
    return int(said[1]), said[2].replace("-", "").upper(), int(said[3])


def command_word(text: str) -> int:
    """A word, or the bits that are 1 in it: `bit 0 and bit 2`, `bits 0, 2`."""
    if re.fullmatch(r"bits? ?\d{1,2}((,| |\+|&|and)+(bit)? ?\d{1,2})*", text.lower()) is None:
        try:
            return word(text)
        except WrongUse as error:
            raise WrongUse(f"{error}, or bits 0, 2") from None
    numbers = {int(number) for number in re.findall(r"\d+", text)}
    if max(numbers) > 15:
        raise WrongUse(f'"{text}": a word has the bits 0 to 15')
    return sum(1 << number for number in numbers)


def functions(text: str) -> list[int]:
    """The functions that write words."""
    known = {"6": 6, "06": 6, "16": 16, "10h": 16}
    said = {part for part in re.split(r"[, ]+|and", text.lower().replace("both", "6, 16")) if part}
    if not said or not said <= set(known):
        raise WrongUse(f'"{text}" is neither 6, 16 nor "6, 16"')
    return sorted({known[part] for part in said})


_FAULT = re.compile(r"(\d{1,5})[ :=,;.\t]+(\S.*)")
_MNEMONIC = re.compile(r"(?=\S*[A-Z])[\w.-]*[A-Z.\d][\w.-]*")


def faults(text: str) -> list[tuple[int, str, str]]:
    """Number, code on the keypad and meaning of each fault: `1 E.OC overcurrent`.

    Several in a line are divided by three blanks. What does not begin with a number is passed over.
    """
    found: dict[int, tuple[int, str, str]] = {}
    for piece in re.split(r"\n|\t(?=\d)| {3,}(?=\d)", text):
        said = _FAULT.fullmatch(piece.strip().replace('"', ""))
        if said is None or int(said[1]) > 0xFFFF:
            continue
        first, _, rest = re.sub(r"[,;\t ]+", " ", said[2]).strip().partition(" ")
        is_code = bool(rest) and _MNEMONIC.fullmatch(first) is not None
        label = rest if is_code else f"{first} {rest}".strip()
        found.setdefault(int(said[1]), (int(said[1]), first if is_code else "", label))
    codes = [code for _, code, _ in found.values()]
    if len(codes) > 1 and not codes[0] and all(codes[1:]):
        # The number of a chapter, with its title.
        del found[next(iter(found))]
    if not found:
        raise WrongUse("no line of it begins with the number of a fault, such as 1 OC overcurrent")
    return list(found.values())
