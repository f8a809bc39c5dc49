"""Payloads of Sparkplug B are what Google's protocol buffers read and write; bytes that are none are told."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("google.protobuf")

from drivebus.sinks.sparkplug_node import REBIRTH, wants_rebirth
from drivebus.sinks.sparkplug_payload import Metric, Payload, PayloadError

from .sparkplug_host import PayloadB, value_of

TIMES = st.integers(0, 2**63)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(),
)
METRICS = st.builds(Metric, st.text(), VALUES, TIMES, st.booleans(), st.text(max_size=5))
PAYLOADS = st.builds(Payload, TIMES, st.lists(METRICS, max_size=8).map(tuple), st.none() | st.integers(0, 255))


@given(PAYLOADS)
def test_what_is_written_is_what_protocol_buffers_read(payload: Payload) -> None:
    read = PayloadB.FromString(payload.packed())
    assert read.timestamp == payload.time
    assert (read.seq if read.HasField("seq") else None) == payload.seq
    found = [(each.name, value_of(each), each.timestamp, each.is_historical) for each in read.metrics]
    assert found == [(each.name, each.value, each.time, each.is_historical) for each in payload.metrics]
    assert [list(each.properties.keys) for each in read.metrics] == [
        ["engUnit"] if each.unit else [] for each in payload.metrics
    ]
    units = ["".join(value.string_value for value in each.properties.values) for each in read.metrics]
    assert units == [each.unit for each in payload.metrics]


@given(PAYLOADS)
def test_what_protocol_buffers_write_is_what_is_read(payload: Payload) -> None:
    read = Payload.read(PayloadB.FromString(payload.packed()).SerializeToString())
    assert (read.time, read.seq) == (payload.time, payload.seq)
    assert [(each.name, each.value, each.time) for each in read.metrics] == [
        (each.name, each.value, each.time) for each in payload.metrics
    ]


@given(st.binary(max_size=60))
def test_bytes_that_are_no_payload_are_told(packed: bytes) -> None:
    with suppress(PayloadError):
        Payload.read(packed)
    wants_rebirth(packed)


@pytest.mark.parametrize("value", [True, False, None, 1, "true"])
def test_a_host_asks_for_a_rebirth_by_true_alone(value: Any) -> None:
    assert wants_rebirth(Payload(0, [Metric("other", True, 0), Metric(REBIRTH, value, 0)], None).packed()) is (
        value is True
    )
