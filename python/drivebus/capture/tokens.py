r"""The numbers on a line that may be bytes, in each of the ways in which tools write them.

A reading takes a line and gives runs: rows of bytes with nothing between them but separators. What breaks a run is a
word, an equals sign, or a number that is no byte. Which of the bytes are a frame, this does not know.

| reading | takes |
| --- | --- |
| `hexadecimal` | `03`, `3`, `0x3`, `0x3000`, `$03`, `#03`, `03H`, `\x03`, `16#03#`, `&H03`; any number in a row |
| `quoted` | `"\x03\x030\0"`: text with escapes, as C, Python and strace write it |
| `decimal` | `3`, `003`, `-54` (bytes with a sign, as Java has them) |
| `bracketed` | `X(088)`: decimal in brackets behind the letter, as slsnif has it |
| `spelled` | `<ETX><ETX>0<NUL>`: letters, with names in brackets for what is none, as terminals show it |
| `octal` | `003` and words of six digits, as od writes them |
| `swapped` | words of four digits with the low byte first, as hexdump and od write them |
| `binary` | `00000011` |
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

__all__ = ["READINGS", "Reading", "Run"]


@dataclass(slots=True)
class Run:
    """A row of bytes on one line.

    Attributes:
        data: The bytes.
        spans: The columns of each, start and end; those of a longer number for each byte in it.
        styles: How each is written.
        gaps: What stands before each; empty before the first, and inside of a number.
    """

    data: bytearray = field(default_factory=bytearray)
    spans: list[tuple[int, int]] = field(default_factory=list)
    styles: list[str] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)

    def add(self, found: bytes, span: tuple[int, int], style: str, gap: str) -> None:
        """Takes the bytes of one number."""
        self.data += found
        self.spans += [span] * len(found)
        self.styles += [style] * len(found)
        self.gaps += [gap, *[""] * (len(found) - 1)]

    def cut(self, start: int, end: int) -> Run:
        """The bytes from *start* up to *end*."""
        gaps = self.gaps[start:end]
        return Run(self.data[start:end], self.spans[start:end], self.styles[start:end], ["", *gaps[1:]])


Reading = Callable[[str], list[Run]]

_EDGE, _END = "(?<![0-9a-z])", "(?![0-9a-z])"
_WORD = r"(?P<word>[^\W_]+)"
_HEX = re.compile(
    rf"\\x(?P<escaped>[0-9a-f]{{2}})|0x(?P<marked>(?:(?!0x)[0-9a-f])+){_END}|0x(?P<glued>[0-9a-f]{{2}})(?=0x)|"
    rf"{_EDGE}(?:\$|&h|16\#|\#|h'|x')(?P<before>[0-9a-f]+)\#?{_END}|"
    rf"{_EDGE}(?P<behind>(?:[0-9a-f]{{1,2}}h)+|(?:[0-9a-f]{{2}})+h){_END}|"
    rf"{_EDGE}(?P<plain>[0-9a-f]+){_END}|{_WORD}",
    re.IGNORECASE,
)
_DECIMAL = re.compile(rf"{_EDGE}(?P<number>(?:(?<![\w)])-)?[0-9]{{1,3}}){_END}|{_WORD}", re.IGNORECASE)
_OCTAL = re.compile(rf"{_EDGE}(?P<number>[0-7]{{3}}|[01][0-7]{{5}}){_END}|{_WORD}", re.IGNORECASE)
_SWAPPED = re.compile(rf"{_EDGE}(?P<number>[0-9a-f]{{4}}){_END}|{_WORD}", re.IGNORECASE)
_BRACKETED = re.compile(r"\((?P<number>[0-9]{3})\)")
_BINARY = re.compile(rf"{_EDGE}(?P<number>[01]{{8}}){_END}|{_WORD}", re.IGNORECASE)


def hexadecimal(line: str) -> list[Run]:
    """Bytes in hexadecimal, each with one or two digits, or several in a row."""
    return _runs(_HEX, line, _hex_value)


def _hex_value(kind: str, digits: str) -> tuple[bytes, str]:
    count = len(digits)
    if kind == "plain":
        if count <= 2:
            return bytes([int(digits, 16)]), f"plain{count}"
        # Half a byte behind others is what is left of one where the text was cut.
        return (b"", "") if count == 3 else (bytes.fromhex(digits[: count // 2 * 2]), "row")
    if kind == "behind":
        each = digits.lower().rstrip("h").split("h")
        return b"".join(_padded(one) for one in each), kind
    return _padded(digits), kind


def _padded(digits: str) -> bytes:
    if len(digits) % 2 and int(digits, 16) <= 0xFF:
        return bytes([int(digits, 16)])
    return bytes.fromhex(digits if len(digits) % 2 == 0 else f"0{digits}")


def decimal(line: str) -> list[Run]:
    """Bytes in decimal, with or without a sign."""
    return _runs(_DECIMAL, line, lambda _, digits: (_decimal_value(int(digits)), "decimal"))


def _decimal_value(value: int) -> bytes:
    return bytes([value & 0xFF]) if -128 <= value <= 0xFF else b""


def bracketed(line: str) -> list[Run]:
    """Bytes in decimal in brackets, whatever stands between them."""
    run = Run()
    for match in _BRACKETED.finditer(line):
        value = int(match["number"])
        if value <= 0xFF:
            run.add(bytes([value]), match.span(), "bracketed", "")
    return [run] if run.data else []


def octal(line: str) -> list[Run]:
    """Bytes in octal, or words of two with the low byte first."""
    return _runs(_OCTAL, line, lambda _, digits: (_octal_value(digits), f"octal{len(digits)}"))


def _octal_value(digits: str) -> bytes:
    value = int(digits, 8)
    if len(digits) == 6:
        return value.to_bytes(2, "little")
    return bytes([value]) if value <= 0xFF else b""


def swapped(line: str) -> list[Run]:
    """Words of two bytes in hexadecimal, the low byte first."""
    return _runs(_SWAPPED, line, lambda _, digits: (bytes.fromhex(digits)[::-1], "swapped"))


def binary(line: str) -> list[Run]:
    """Bytes in binary."""
    return _runs(_BINARY, line, lambda _, digits: (bytes([int(digits, 2)]), "binary"))


def _runs(pattern: re.Pattern[str], line: str, value: Callable[[str, str], tuple[bytes, str]]) -> list[Run]:
    runs, run, last = list[Run](), Run(), 0
    for match in pattern.finditer(line):
        kind = match.lastgroup or ""
        found, style = (b"", "") if kind == "word" else value(kind, match[kind])
        gap = line[last : match.start()] if run.data else ""
        if not found or "=" in gap:
            if run.data:
                runs.append(run)
            run, gap = Run(), ""
        if found:
            run.add(found, match.span(), style, gap)
        last = match.end()
    if run.data:
        runs.append(run)
    return runs


_LITERAL = re.compile(r"""(["'])(?P<inside>(?:\\.|(?!\1)[^\\])*)(?:\1|\\?$)""")
_BARE = re.compile(r"(?P<inside>[^\s\\=:>\])]*\\(?:x[0-9a-f]{2}|[0-7]{1,3}|[abtnvfre]).*)", re.IGNORECASE)
_ESCAPE = re.compile(r"\\(?:x([0-9a-fA-F]{1,2})|u00([0-9a-fA-F]{2})|([0-7]{1,3})|(.))|([^\\])", re.DOTALL)
_LETTERS = dict(zip("abtnvfre", (7, 8, 9, 10, 11, 12, 13, 27), strict=True))


def quoted(line: str) -> list[Run]:
    """Text in quotes that has escapes; without quotes all that follows the first escape."""
    found = list(_LITERAL.finditer(line)) or list(_BARE.finditer(line))
    return [run for match in found if "\\" in match["inside"] and (run := _unescaped(match)).data]


def _unescaped(match: re.Match[str]) -> Run:
    run, start = Run(), match.start("inside")
    for part in _ESCAPE.finditer(match["inside"]):
        in_hex, in_unicode, in_octal, letter, plain = part.groups()
        if in_hex or in_unicode:
            value = int(in_hex or in_unicode, 16)
        elif in_octal:
            value = int(in_octal, 8)
        else:
            value = _LETTERS.get(letter, ord(letter)) if letter else ord(plain)
        if value > 0xFF:
            break
        run.add(bytes([value]), (start + part.start(), start + part.end()), "quoted", "")
    return run


_NAMES = [
    "NUL",
    "SOH",
    "STX",
    "ETX",
    "EOT",
    "ENQ",
    "ACK",
    "BEL",
    "BS",
    "HT",
    "LF",
    "VT",
    "FF",
    "CR",
    "SO",
    "SI",
    "DLE",
    "DC1",
    "DC2",
    "DC3",
    "DC4",
    "NAK",
    "SYN",
    "ETB",
    "CAN",
    "EM",
    "SUB",
    "ESC",
    "FS",
    "GS",
    "RS",
    "US",
]
_SPELLS = re.compile(rf"<(?:{'|'.join(_NAMES)})>", re.IGNORECASE)
_SPELLED = re.compile(rf"<(?:(?P<name>{'|'.join(_NAMES)})|(?P<digits>[0-9A-F]{{2}}))>|(?P<letter>[^<])", re.IGNORECASE)


def spelled(line: str) -> list[Run]:
    """Letters, with names in brackets for what is none."""
    run = Run()
    for match in _SPELLED.finditer(line):
        if match["letter"] and ord(match["letter"]) <= 0xFF:
            run.add(bytes([ord(match["letter"])]), match.span(), "letter", "")
        elif match["name"]:
            run.add(bytes([_NAMES.index(match["name"].upper())]), match.span(), "spelled", "")
        elif match["digits"]:
            run.add(bytes([int(match["digits"], 16)]), match.span(), "spelled", "")
    return [run] if "spelled" in run.styles else []


READINGS: dict[str, Reading] = {
    "quoted": quoted,
    "hexadecimal": hexadecimal,
    "decimal": decimal,
    "bracketed": bracketed,
    "spelled": spelled,
    "octal": octal,
    "swapped": swapped,
    "binary": binary,
}
"""In the order in which they are tried: what one has found a frame in, the others are not asked of."""

MAY: dict[str, re.Pattern[str]] = {
    "quoted": re.compile(r"\\"),
    "hexadecimal": re.compile(r"[0-9a-f]", re.IGNORECASE),
    "decimal": re.compile(r"[0-9]"),
    "bracketed": _BRACKETED,
    "spelled": _SPELLS,
    "octal": re.compile(rf"{_EDGE}(?:[0-7]{{3}}|[01][0-7]{{5}}){_END}", re.IGNORECASE),
    "swapped": re.compile(rf"{_EDGE}[0-9a-f]{{4}}{_END}", re.IGNORECASE),
    "binary": re.compile(rf"{_EDGE}[01]{{8}}{_END}", re.IGNORECASE),
}
"""What a line has at least on which a reading finds anything: most lines have nothing for most readings."""
