"""Characters bit by bit: what a UART sends, and what another one that is set otherwise makes of it.

After the datasheet of the 16550: a start bit (0), the data with the lowest bit first, parity if there is one, stop bits
(1). A receiver looks for one stop bit. Where that is 0 it takes it for the next start bit (`resync`), or waits for the
line to be at rest and fall again.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Format", "received", "sent"]


@dataclass(frozen=True)
class Format:
    """Such as 8E1: `of("8E1")`."""

    data: int
    parity: str
    stop: int

    @classmethod
    def of(cls, text: str) -> Format:
        return cls(int(text[0]), text[1], int(text[2]))

    @property
    def has_parity(self) -> bool:
        return self.parity != "N"


def sent(data: bytes, line: Format, pause: int = 0) -> list[int]:
    """The bits of *data*, a bit time each, with *pause* bits of rest behind each character, and rest around all."""
    bits = [1] * 12
    for byte in data:
        low = [byte >> at & 1 for at in range(line.data)]
        parity = [] if not line.has_parity else [sum(low) % 2 ^ (line.parity == "O")]
        bits += [0, *low, *parity, *[1] * (line.stop + pause)]
    return bits + [1] * 12


def received(bits: list[int], line: Format, resync: bool = True) -> bytes:
    """The bytes that a receiver finds in *bits*, whatever their parity and stop bits are: as a driver without INPCK."""
    found, at = bytearray(), 0
    while at < len(bits):
        if bits[at] == 1:
            at += 1
            continue
        end = at + 1 + line.data + line.has_parity
        if end >= len(bits):
            break
        found.append(sum(bit << place for place, bit in enumerate(bits[at + 1 : at + 1 + line.data])))
        if bits[end] == 1 or resync:
            at = end if bits[end] == 0 else end + 1
        else:
            while end < len(bits) and bits[end] == 0:
                end += 1
            at = end
    return bytes(found)
