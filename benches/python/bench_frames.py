"""Encoding a read request and decoding its answer, beside other ways to do it from Python. Run by `make bench`.

The others are measured by what their own clients call to build a request and to take an answer apart, without a line.
`struct + fastcrc` is the least that Python code can do: it checks the CRC, the unit and the function.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import ClassVar

import fastcrc
import minimalmodbus
import pytest
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest
from pytest_benchmark.fixture import BenchmarkFixture

import drivebus

UNIT, ADDRESS = 1, 0x3000
COUNTS = [1, 4, 16, 125]


def frame(body: bytes) -> bytes:
    """A body with its CRC."""
    return body + struct.pack("<H", fastcrc.crc16.modbus(body))


def request_for(count: int) -> bytes:
    return frame(struct.pack(">BBHH", UNIT, 3, ADDRESS, count))


def answer_for(count: int) -> bytes:
    return frame(struct.pack(f">BBB{count}H", UNIT, 3, 2 * count, *range(count)))


class Drivebus:
    @staticmethod
    def encode(count: int) -> bytes:
        return drivebus.rtu.encode_read(UNIT, ADDRESS, count)

    @staticmethod
    def decode(request: bytes, answer: bytes) -> list[int] | None:
        return drivebus.rtu.decode_answer(request, answer)


class Struct:
    """As fast as it goes: formats made beforehand, and no more names looked up than needed."""

    head = struct.Struct(">BBHH")
    words: ClassVar = {count: struct.Struct(f">3x{count}H2x") for count in COUNTS}
    crc = staticmethod(fastcrc.crc16.modbus)

    @classmethod
    def encode(cls, count: int) -> bytes:
        body = cls.head.pack(UNIT, 3, ADDRESS, count)
        return body + cls.crc(body).to_bytes(2, "little")

    @classmethod
    def decode(cls, request: bytes, answer: bytes) -> list[int]:
        # The CRC of a frame with its CRC is 0.
        if cls.crc(answer) or answer[:2] != request[:2] or answer[2] != 2 * request[5]:
            raise ValueError(answer)
        return list(cls.words[request[5]].unpack(answer))


class Pymodbus:
    framer = FramerRTU(DecodePDU(False))

    @classmethod
    def encode(cls, count: int) -> bytes:
        return cls.framer.buildFrame(ReadHoldingRegistersRequest(address=ADDRESS, count=count, dev_id=UNIT))

    @classmethod
    def decode(cls, _request: bytes, answer: bytes) -> list[int]:
        _, pdu = cls.framer.handleFrame(answer, UNIT, 0)
        assert pdu is not None
        return list(pdu.registers)


class Minimalmodbus:
    @staticmethod
    def encode(count: int) -> bytes:
        payload = minimalmodbus._create_payload(
            3, ADDRESS, None, 0, count, 0, False, 0, minimalmodbus._Payloadformat.REGISTERS
        )
        return bytes(minimalmodbus._embed_payload(UNIT, minimalmodbus.MODE_RTU, 3, payload))

    @staticmethod
    def decode(_request: bytes, answer: bytes) -> list[int]:
        payload = minimalmodbus._extract_payload(answer, UNIT, minimalmodbus.MODE_RTU, 3)
        count = (len(answer) - 5) // 2
        words = minimalmodbus._parse_payload(
            payload, 3, ADDRESS, None, 0, count, 0, False, 0, minimalmodbus._Payloadformat.REGISTERS
        )
        return list(words)


Encode = Callable[[int], bytes]
Decode = Callable[[bytes, bytes], "list[int] | None"]

ENCODERS: dict[str, Encode] = {
    "drivebus": Drivebus.encode,
    "struct + fastcrc": Struct.encode,
    "pymodbus": Pymodbus.encode,
    "minimalmodbus": Minimalmodbus.encode,
}
DECODERS: dict[str, Decode] = {
    "drivebus": Drivebus.decode,
    "struct + fastcrc": Struct.decode,
    "pymodbus": Pymodbus.decode,
    "minimalmodbus": Minimalmodbus.decode,
}


@pytest.mark.parametrize("engine", ENCODERS)
def test_encode_read(benchmark: BenchmarkFixture, engine: str) -> None:
    benchmark.group = "encode a read request"
    assert benchmark(ENCODERS[engine], 16) == request_for(16)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("engine", DECODERS)
def test_decode_answer(benchmark: BenchmarkFixture, engine: str, count: int) -> None:
    benchmark.group = f"decode an answer of {count} words"
    words = benchmark(DECODERS[engine], request_for(count), answer_for(count))
    assert words == list(range(count))
