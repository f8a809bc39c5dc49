"""drivebus as the master of other people's slaves. Register *a* of each holds *a*, so a wrong answer shows at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

import drivebus

HELD = 0x400  # registers each slave has


@pytest.fixture(params=["pymodbus", "libmodbus"])
def slave(
    request: pytest.FixtureRequest, wire: tuple[str, str], serve: Callable[..., str]
) -> Iterator[tuple[str, drivebus.Bus]]:
    """Whose slave it is, and a bus to it."""
    ours, theirs = wire
    arguments = [request.getfixturevalue("libmodbus")] if request.param == "libmodbus" else []
    serve(f"{request.param}_server", theirs, *arguments)
    with drivebus.Bus(ours, baudrate=19200, parity="N", timeout=2) as bus:
        yield request.param, bus


def test_reads(slave: tuple[str, drivebus.Bus]) -> None:
    _, bus = slave
    for address, count in [(0, 1), (100, 10), (0x200, 125), (HELD - 1, 1)]:
        assert bus.read(1, address, count) == list(range(address, address + count))


def test_writes(slave: tuple[str, drivebus.Bus]) -> None:
    _, bus = slave
    bus.write(1, 100, 0xFFFF)
    bus.write(1, 101, [0, 0x1234, 0x8000])
    assert bus.read(1, 99, 6) == [99, 0xFFFF, 0, 0x1234, 0x8000, 104]
    bus.write(1, 0x200, list(range(123)))
    assert bus.read(1, 0x200, 125) == [*range(123), 0x200 + 123, 0x200 + 124]


def test_refusals(slave: tuple[str, drivebus.Bus]) -> None:
    _, bus = slave
    with pytest.raises(drivebus.Refused) as refused:
        bus.read(1, HELD, 1)
    assert refused.value.code == 2
    with pytest.raises(drivebus.Refused) as refused:
        bus.write(1, HELD - 1, [1, 2])
    assert refused.value.code == 2
    assert bus.read(1, HELD - 1, 1) == [HELD - 1]


def test_any_other_function(slave: tuple[str, drivebus.Bus]) -> None:
    # 16H, mask write: AND 00F2H, OR 0025H on 0012H gives 0017H (Modbus Application Protocol V1.1b3, §6.16).
    _, bus = slave
    pdu = bytes.fromhex("16 00 12 00 F2 00 25")
    assert bus.transact(1, pdu, len(pdu)) == pdu
    assert bus.read(1, 0x12, 1) == [0x17]


def test_who_made_it(slave: tuple[str, drivebus.Bus]) -> None:
    whose, bus = slave
    if whose == "libmodbus":  # it finds no end of a request of a function that it does not know, and says nothing
        with pytest.raises(drivebus.NoAnswer):
            bus.device_identification(1)
        return
    device = bus.device_identification(1)
    assert (device.vendor, device.product_code, device.revision) == ("pymodbus", "PM", "3.x")
    assert (device.product_name, device.model_name, device.application_name) == ("a slave of others", None, None)
    assert (device.objects[0x80], device.objects[0x90]) == (b"@" * 120, b"P" * 120)
    assert (device.conformity, device.complete) == (0x83, True)
    assert str(device) == "unit 1: pymodbus, a slave of others, PM, 3.x"
    # One alone, and one that it has not.
    assert bus.transact(1, b"\x2b\x0e\x04\x02") == b"\x2b\x0e\x04\x83\x00\x00\x01\x02\x033.x"
    with pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, b"\x2b\x0e\x04\x05")
    assert refused.value.code == 2


def test_what_it_is_in_its_own_words(slave: tuple[str, drivebus.Bus]) -> None:
    whose, bus = slave
    said = b"pymodbus-PM-3.x\xff" if whose == "pymodbus" else b"LMB"
    answer = bus.transact(1, b"\x11")
    assert (answer[0], answer[1]) == (0x11, len(answer) - 2)
    assert answer[2:].startswith(said) or said in answer[2:]


def test_words_are_written_and_read_at_once(slave: tuple[str, drivebus.Bus]) -> None:
    _, bus = slave
    pdu = bytes.fromhex("17 0020 0003 0021 0001 02 1234")
    assert bus.transact(1, pdu) == bytes.fromhex("17 06 0020 1234 0022")


def test_loop_back(slave: tuple[str, drivebus.Bus]) -> None:
    whose, bus = slave
    if whose == "libmodbus":
        # It knows no function 08H, and stays silent where it should refuse.
        with pytest.raises(drivebus.NoAnswer):
            bus.echo(1, 0x12AB)
    else:
        assert bus.echo(1, 0x12AB) > 0.0
    assert bus.read(1, 7, 1) == [7]


def test_a_unit_that_is_not_there(slave: tuple[str, drivebus.Bus]) -> None:
    whose, bus = slave
    # pymodbus answers for units that it is not, with a refusal.
    with pytest.raises(drivebus.Refused if whose == "pymodbus" else drivebus.NoAnswer):
        bus.read(9, 0, 1)
    assert bus.read(1, 7, 1) == [7]
