"""The tree of errors: whose fault, what came with it, and that it survives a process boundary."""

from __future__ import annotations

import copy
import pickle

import pytest

import drivebus

TREE = {
    drivebus.PortError: (drivebus.DrivebusError, OSError),
    drivebus.NoAnswer: (drivebus.DrivebusError, TimeoutError),
    drivebus.BadAnswer: (drivebus.DrivebusError,),
    drivebus.CrcError: (drivebus.BadAnswer,),
    drivebus.Refused: (drivebus.DrivebusError,),
    drivebus.Unconfirmed: (drivebus.DrivebusError,),
    drivebus.NotAllowed: (drivebus.DrivebusError, ValueError),
}


@pytest.mark.parametrize(("kind", "bases"), TREE.items(), ids=lambda each: getattr(each, "__name__", ""))
def test_the_tree_is_that_of_the_contract(
    kind: type[drivebus.DrivebusError], bases: tuple[type[BaseException], ...]
) -> None:
    assert kind.__bases__ == bases
    assert "Did the drive take it?" in (kind.__doc__ or "")


@pytest.mark.parametrize("kind", [drivebus.DrivebusError, *TREE])
def test_details_survive_pickle_and_copy(kind: type[drivebus.DrivebusError]) -> None:
    details = {"unit": 7, "request": b"\x07\x03", "raw": b"\x07\x83", "started": 1.5, "ended": 2.0}
    error = kind("asked 7, got nothing", **details)  # type: ignore[arg-type]
    for same in (error, pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(same) is kind
        assert str(same) == "asked 7, got nothing"
        assert {name: getattr(same, name) for name in details} == details


def test_details_are_empty_where_there_are_none() -> None:
    error = drivebus.NotAllowed("no")
    assert (error.unit, error.request, error.raw, error.started, error.ended) == (None, b"", b"", None, None)


def test_a_refusal_carries_its_code() -> None:
    error = drivebus.Refused(
        "no", unit=1, raw=b"\x01\x83\x02", code=2, name="illegal_address", meaning="no such address"
    )
    same = pickle.loads(pickle.dumps(error))
    assert (same.code, same.name, same.meaning, same.raw) == (2, "illegal_address", "no such address", error.raw)


def test_a_refusal_that_no_profile_names_is_that_of_the_specification() -> None:
    """No document at hand has the exceptions of a CHF100A. 02H: Modbus Application Protocol V1.1b3, section 7."""
    with drivebus.Bus("sim://1=chf100a?clock=virtual") as bus:
        drive = bus.drive(1, "chf100a")
        with pytest.raises(
            drivebus.Refused, match=r"02H, illegal_data_address: as in the Modbus specification"
        ) as error:
            drive.read_words(0x2100)
    assert (error.value.code, error.value.name) == (2, "illegal_data_address")
