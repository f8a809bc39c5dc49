"""A host of Sparkplug B that believes nothing: it reads messages by Google's own protocol buffers, and complains.

The definition is that of the Sparkplug specification 3.0.0, section 6.4.3, as far as drives need it.
"""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

_TYPES = {"bool": 8, "double": 1, "float": 2, "message": 11, "string": 9, "uint32": 13, "uint64": 4, "bytes": 12}
_DEFINED = """
PropertyValue: 1 uint32 type, 2 bool is_null, 3 uint32 int_value, 4 uint64 long_value, 5 float float_value,
  6 double double_value, 7 bool boolean_value, 8 string string_value
PropertySet: 1 string* keys, 2 PropertyValue* values
Metric: 1 string name, 2 uint64 alias, 3 uint64 timestamp, 4 uint32 datatype, 5 bool is_historical, 6 bool is_transient,
  7 bool is_null, 9 PropertySet properties, 10 uint32 int_value, 11 uint64 long_value, 12 float float_value,
  13 double double_value, 14 bool boolean_value, 15 string string_value
Payload: 1 uint64 timestamp, 2 Metric* metrics, 3 uint64 seq, 4 string uuid, 5 bytes body
"""


def _payload_class() -> Any:
    file = descriptor_pb2.FileDescriptorProto(name="sparkplug_b.proto", package="sparkplug", syntax="proto2")
    for line in _DEFINED.replace("\n  ", " ").strip().splitlines():
        name, fields = line.split(": ")
        message = file.message_type.add(name=name)
        for each in fields.split(", "):
            number, kind, called = each.split()
            field = message.field.add(name=called, number=int(number), label=3 if kind.endswith("*") else 1)
            kind = kind.rstrip("*")
            field.type = _TYPES.get(kind, _TYPES["message"])  # type: ignore[assignment]
            if kind not in _TYPES:
                field.type_name = f".sparkplug.{kind}"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("sparkplug.Payload"))


PayloadB = _payload_class()
VALUE = {4: "long_value", 10: "double_value", 11: "boolean_value", 12: "string_value"}


def value_of(metric: Any) -> Any:
    """Its value, as its data type says; None where it says that there is none."""
    if metric.is_null:
        return None
    value = getattr(metric, VALUE[metric.datatype])
    return value - (1 << 64) if metric.datatype == 4 and value >= 1 << 63 else value


class Host:
    """What a host knows of one edge node, from its messages alone.

    Attributes:
        values: The present ones, by device (the node's own under an empty name) and metric.
        times: When each was measured, in milliseconds.
        historical: All that was told of the past: device, time, and the values by name.
        told: As `historical`, of the present: births and data.
    """

    def __init__(self) -> None:
        self.values: dict[str, dict[str, Any]] = {}
        self.times: dict[str, dict[str, int]] = {}
        self.historical: list[tuple[str, int, dict[str, Any]]] = []
        self.told: list[tuple[str, int, dict[str, Any]]] = []
        self._types: dict[str, dict[str, int]] = {}
        self._seq: int | None = None
        self._bd_seq: int | None = None

    def takes(self, topic: str, payload: bytes) -> None:
        """One message came. What no host can make sense of fails the test."""
        namespace, _, kind, _, *rest = topic.split("/")
        device = rest[0] if rest else ""
        assert namespace == "spBv1.0"
        read = PayloadB.FromString(payload)
        if kind == "NDEATH":
            assert [each.name for each in read.metrics] == ["bdSeq"]
            if self._bd_seq == value_of(read.metrics[0]):
                self._forget()
            return
        if kind == "NBIRTH":
            assert read.seq == 0
            self._forget()
            self._bd_seq = next(value_of(each) for each in read.metrics if each.name == "bdSeq")
            assert any(each.name == "Node Control/Rebirth" and value_of(each) is False for each in read.metrics)
        else:
            assert self._seq is not None, f"{kind} of a node that is not born"
            assert read.seq == (self._seq + 1) % 256, f"{kind} has seq {read.seq} behind {self._seq}"
        self._seq = read.seq
        if kind in ("NBIRTH", "DBIRTH"):
            self._types[device] = {each.name: each.datatype for each in read.metrics}
            self.values[device], self.times[device] = {}, {}
        elif kind == "DDEATH":
            assert device in self.values, "the death of a device that is not there"
            del self.values[device], self.times[device]
            return
        assert device in self.values, f"{kind} of {device}, which is not born"
        self._takes_metrics(device, read.metrics)

    def _takes_metrics(self, device: str, metrics: Any) -> None:
        past: dict[int, dict[str, Any]] = {}
        present: dict[int, dict[str, Any]] = {}
        for each in metrics:
            assert self._types[device].get(each.name) == each.datatype, f"{each.name} is not as it was born"
            if each.is_historical:
                past.setdefault(each.timestamp, {})[each.name] = value_of(each)
                continue
            self.values[device][each.name] = value_of(each)
            self.times[device][each.name] = each.timestamp
            present.setdefault(each.timestamp, {})[each.name] = value_of(each)
        self.historical += [(device, at, values) for at, values in past.items()]
        self.told += [(device, at, values) for at, values in present.items()]

    def _forget(self) -> None:
        self.values.clear()
        self.times.clear()
        self._types.clear()
        self._seq = None
