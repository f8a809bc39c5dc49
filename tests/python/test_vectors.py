"""The shared vectors of `tests/vectors`, through the Python API. Rust runs the same files in `tests/rust`.

The format is explained in `tests/vectors/README.md`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import tomli

import drivebus

FOLDER = Path(__file__).resolve().parent.parent / "vectors"
FAMILIES = ["gd350", "gd20", "gd600", "gd3000", "vfd500", "starvert"]

Fields = dict[str, Any]


class Vector(NamedTuple):
    """One frame of a worked example."""

    what: str
    wire: bytes  # as it should be
    printed: bytes  # as the manual has it
    fields: Fields
    asked: Fields | None  # what an answer answers; None for a request
    foreign: bool

    @property
    def misprinted(self) -> bool:
        return self.printed != self.wire


def load(name: str) -> dict[str, Any]:
    return tomli.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))


def vector(family: str, exchange: Fields, frame: Fields, asked: Fields | None) -> Vector:
    right = bytes.fromhex(frame["right"] if "printed" in frame else frame["wire"])
    return Vector(
        what=f"{family}: {exchange['what']}",
        wire=right,
        printed=bytes.fromhex(frame["printed"]) if "printed" in frame else right,
        fields=frame["fields"],
        asked=asked,
        foreign=frame.get("foreign", False),
    )


def vectors() -> Iterator[Vector]:
    for family in FAMILIES:
        file = load(family)
        for exchange in file["exchange"]:
            request, answer = exchange.get("request"), exchange.get("answer")
            if request:
                yield vector(family, exchange, request, None)
            if answer:
                yield vector(family, exchange, answer, request["fields"] if request else exchange["asked"])
        for template in file.get("template", []):
            yield vector(family, template, {"wire": template["filled"], "fields": template["fields"]}, None)


VECTORS = list(vectors())
REQUESTS = [each for each in VECTORS if each.asked is None]
ANSWERS = [each for each in VECTORS if each.asked is not None]
MISPRINTS = [each for each in VECTORS if each.misprinted]


def of(several: list[Vector]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("vector", several, ids=lambda each: each.what)


def encode(fields: Fields) -> bytes:
    """The request frame that *fields* describe."""
    unit = fields["unit"]
    if fields["kind"] == "read":
        return drivebus.rtu.encode_read(unit, fields["address"], fields["count"])
    if fields["kind"] == "write":
        return drivebus.rtu.encode_write(unit, fields["address"], fields["value"])
    if fields["kind"] == "write_many":
        return drivebus.rtu.encode_write(unit, fields["address"], fields["words"])
    assert fields["kind"] == "echo"
    return drivebus.rtu.encode_echo(unit, fields["data"])


def test_every_worked_example_is_here() -> None:
    counts = [len(file["exchange"]) + len(file.get("template", [])) for file in map(load, FAMILIES)]
    assert counts == [15, 2, 8, 7, 13, 2]
    assert len(MISPRINTS) == 5


@pytest.mark.parametrize("entry", load("crc")["crc"], ids=lambda entry: str(entry["what"]))
def test_crc(entry: Fields) -> None:
    data = bytes.fromhex(entry["data"])
    for kind in (bytes, bytearray, memoryview):
        assert drivebus.crc16(kind(data)) == entry["crc"]
    assert entry["crc"].to_bytes(2, "little") == bytes.fromhex(entry["wire"])


@of(REQUESTS)
def test_requests_encode(vector: Vector) -> None:
    assert encode(vector.fields) == vector.wire


@of(REQUESTS)
def test_requests_say_whether_they_write(vector: Vector) -> None:
    pdu = vector.wire[1:-2]
    writes = vector.fields["kind"] in ("write", "write_many")
    assert (drivebus.rtu.is_write(pdu), drivebus.rtu.only_reads(pdu)) == (writes, not writes)


@pytest.mark.parametrize(
    ("pdu", "reads"),
    [("2B 0E 01 00", True), ("11", True), ("08 00 04 00 00", False), ("41", False), ("83 02", False), ("", False)],
)
def test_of_what_nobody_knows_it_is_taken_for_a_write(pdu: str, reads: bool) -> None:
    request = bytes.fromhex(pdu)
    assert (drivebus.rtu.is_write(request), drivebus.rtu.only_reads(request)) == (not reads, reads)


@of(VECTORS)
def test_frames_decode(vector: Vector) -> None:
    decoded = drivebus.rtu.decode(vector.wire)
    assert {name: getattr(decoded, name) for name in vector.fields} == vector.fields
    assert decoded.crc == int.from_bytes(vector.wire[-2:], "little")


@of([each for each in ANSWERS if not each.foreign and each.fields["kind"] != "exception"])
def test_answers_decode(vector: Vector) -> None:
    assert vector.asked is not None
    assert drivebus.rtu.decode_answer(encode(vector.asked), vector.wire) == vector.fields.get("words")


@of([each for each in ANSWERS if each.fields["kind"] == "exception"])
def test_exceptions_are_refusals(vector: Vector) -> None:
    assert vector.asked is not None
    with pytest.raises(drivebus.Refused) as refused:
        drivebus.rtu.decode_answer(encode(vector.asked), vector.wire)
    assert refused.value.code == vector.fields["code"]
    assert refused.value.unit == vector.fields["unit"]
    assert refused.value.raw == vector.wire


@of([each for each in ANSWERS if each.foreign])
def test_a_foreign_answer_is_no_answer(vector: Vector) -> None:
    assert vector.asked is not None
    with pytest.raises(drivebus.BadAnswer) as bad:
        drivebus.rtu.decode_answer(encode(vector.asked), vector.wire)
    assert not isinstance(bad.value, drivebus.CrcError)


@of(MISPRINTS)
def test_misprints_are_refused_and_both_values_named(vector: Vector) -> None:
    asked = encode(vector.asked or {"kind": "read", "unit": 1, "address": 0, "count": 1})
    for decode in (drivebus.rtu.decode, lambda frame: drivebus.rtu.decode_answer(asked, frame)):
        with pytest.raises(drivebus.CrcError) as error:
            decode(vector.printed)
        for crc in (vector.printed[-2:], vector.wire[-2:]):
            assert crc.hex(" ").upper() in str(error.value)
        assert error.value.raw == vector.printed


@of(VECTORS)
def test_one_flipped_bit_is_never_a_frame(vector: Vector) -> None:
    for bit in range(8 * len(vector.wire)):
        spoilt = bytearray(vector.wire)
        spoilt[bit // 8] ^= 1 << bit % 8
        with pytest.raises(drivebus.CrcError):
            drivebus.rtu.decode(spoilt)


def framed(pdu: str) -> bytes:
    body = bytes([1]) + bytes.fromhex(pdu)
    return body + drivebus.crc16(body).to_bytes(2, "little")


FUNCTIONS = load("functions")["function"]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda each: str(each["what"]))
def test_a_right_answer_of_any_function_is_taken(function: Fields) -> None:
    assert drivebus.rtu.decode_answer(framed(function["request"]), framed(function["answer"])) == function.get("values")


@pytest.mark.parametrize(
    ("request_pdu", "wrong"),
    [(each["request"], wrong) for each in FUNCTIONS for wrong in each["wrong"]],
    ids=lambda each: str(each),
)
def test_no_answer_that_the_specification_excludes_is_taken(request_pdu: str, wrong: str) -> None:
    with pytest.raises(drivebus.BadAnswer) as bad:
        drivebus.rtu.decode_answer(framed(request_pdu), framed(wrong))
    assert not isinstance(bad.value, drivebus.CrcError)
    assert bad.value.raw == framed(wrong)
