"""The tree of errors: whose fault, what came with it, and that it survives a process boundary."""

from __future__ import annotations

import copy
import errno
import os
import pickle
import subprocess
import sys

import pytest

import drivebus
import drivebus.aio

from .odd_slave import good, on_a_terminal

TREE = {
    drivebus.PortError: (drivebus.DrivebusError, OSError),
    drivebus.NoAnswer: (drivebus.DrivebusError, TimeoutError),
    drivebus.BadAnswer: (drivebus.DrivebusError,),
    drivebus.CrcError: (drivebus.BadAnswer,),
    drivebus.Refused: (drivebus.DrivebusError,),
    drivebus.Unconfirmed: (drivebus.DrivebusError,),
    drivebus.NotReached: (drivebus.Unconfirmed, TimeoutError),
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


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals")
class TestNumbersOfTheSystem:
    """`PortError.errno`: which trouble it is, where a program shall not read the words."""

    def test_no_such_port(self) -> None:
        with pytest.raises(drivebus.PortError) as error:
            drivebus.Bus("/dev/ttyUSB250")
        assert error.value.errno == errno.ENOENT

    def test_a_port_that_another_has(self) -> None:
        with on_a_terminal(good) as path, drivebus.Bus(path, share="never"):
            code = f"import drivebus; drivebus.Bus({path!r}, share='never')"
            code = f"try:\n {code}\nexcept OSError as error:\n print(error.errno)"
            told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert int(told.stdout) == errno.EBUSY

    def test_what_is_no_serial_port(self) -> None:
        with pytest.raises(drivebus.PortError) as error:
            drivebus.Bus("/dev/null")
        assert error.value.errno == errno.EINVAL

    def test_a_port_that_was_pulled_out(self) -> None:
        master, slave = os.openpty()
        with drivebus.Bus(os.ttyname(slave), parity="N", share="never", retries=0) as bus:
            os.close(slave)
            os.close(master)
            with pytest.raises(drivebus.PortError) as error:
                bus.read(1, 0)
        assert error.value.errno == errno.ENODEV

    def test_a_bus_that_was_closed(self) -> None:
        with drivebus.Bus("sim://gd350?clock=virtual") as bus:
            pass
        with pytest.raises(drivebus.PortError) as error:
            bus.read(1, 0)
        assert error.value.errno == errno.EBADF

    def test_what_is_not_open_yet(self) -> None:
        with pytest.raises(drivebus.PortError) as error:
            drivebus.aio.Bus("sim://gd350?clock=virtual").now()
        assert error.value.errno == errno.EBADF

    def test_they_survive_pickle_and_copy_and_stay_out_of_the_words(self) -> None:
        error = drivebus.PortError("/dev/ttyUSB0: gone", errno=errno.ENODEV, unit=3)
        for same in (error, pickle.loads(pickle.dumps(error)), copy.copy(error)):
            assert (same.errno, same.unit, str(same)) == (errno.ENODEV, 3, "/dev/ttyUSB0: gone")


def test_what_was_waited_for_in_vain_is_a_time_out() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        drive = bus.drive(1)
        for timeout in (0.5, 0.0):
            with pytest.raises(TimeoutError, match="within") as error:
                drive.wait_for_speed(30.0, timeout=timeout)
            assert isinstance(error.value, drivebus.NotReached)


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
