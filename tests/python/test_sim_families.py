"""What the simulated drives of each family do on the line: expectations typed from their manuals.

Everything is asked in PDUs of ours, so that neither a profile nor an operation of the library can hide a mistake.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Refused, Simulator

FAMILIES = {
    1: "gd350",
    2: "gd35",
    3: "gd35-h1",
    4: "gd300",
    5: "gd600",
    6: "gd600-rectifier",
    7: "gd3000",
    8: "gd3000-rectifier",
    9: "vfd500",
    10: "chf100a",
    11: "chv100",
    12: "gd10",
    13: "gd20",
    14: "gd100",
    15: "gd200a",
    16: "ms300",
    17: "a1000",
    18: "saj8000m",
    19: "eds300",
    20: "sunfar-e300",
    21: "atv312",
    22: "v20",
    23: "acs355",
    24: "fc51",
    25: "wj200",
    26: "h100",
    27: "vfd-e",
    28: "yl620",
    29: "md500",
    30: "fr-d700",
    31: "acs580",
    32: "fc202",
    33: "atv12",
    34: "atv600",
    35: "j1000",
    36: "vf-s15",
    37: "huanyang-hy",
    38: "frenic",
    39: "optidrive-e3",
    40: "sj200",
    41: "e510",
    42: "gs2",
    43: "atv71",
    44: "atv320",
    45: "gs4",
    46: "cfw500",
    47: "vfd-b",
    48: "vacon10",
    49: "dc1",
    50: "smd",
    51: "nowforever",
    52: "f510",
    53: "starvert",
    54: "x200",
    55: "optidrive-p2",
}
UNIT = {family: unit for unit, family in FAMILIES.items()}
MODBUS = [family for family in UNIT if family != "huanyang-hy"]
"""The other one is silent on all that is asked here."""

GOODRIVE = {"P00.01": (0x0001, 2), "P00.02": (0x0002, 0), "P00.06": (0x0006, 8)}
"""What makes a Goodrive350 obey the bus."""

OBEYS = {
    **dict.fromkeys(("gd350", "gd35", "gd35-h1", "gd300", "gd10", "gd100", "gd200a"), tuple(GOODRIVE.values())),
    # The GD20 manual, p. 140, asks for P00.01 alone.
    **dict.fromkeys(("gd600", "gd3000", "gd20"), (GOODRIVE["P00.01"], GOODRIVE["P00.06"])),
    "vfd500": ((0x0002, 2),),
}
COMMAND = {family: 0x7000 if family == "vfd500" else 0x2000 for family in OBEYS}
CODES = {
    family: {"stop": 6, "coast": 5, "reset": 8} if family == "vfd500" else {"stop": 5, "coast": 6, "reset": 7}
    for family in OBEYS
}


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(FAMILIES, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator) as bus:
        yield bus


def pdu(function: int, *words: int) -> bytes:
    return bytes([function]) + b"".join(word.to_bytes(2, "big") for word in words)


def write(bus: Bus, family: str, address: int, word: int) -> None:
    request = pdu(0x06, address, word)
    assert bus.transact(UNIT[family], request) == request


def read(bus: Bus, family: str, address: int, count: int = 1) -> list[int]:
    answer = bus.transact(UNIT[family], pdu(0x03, address, count))
    return [int.from_bytes(answer[place : place + 2], "big") for place in range(2, len(answer), 2)]


def refusal(bus: Bus, family: str, request: bytes) -> int:
    with pytest.raises(Refused) as caught:
        bus.transact(UNIT[family], request)
    return caught.value.code


def obey(bus: Bus, family: str) -> None:
    """Sets the drive to obey the bus, and to 10.00 Hz."""
    for address, word in (*OBEYS[family], (COMMAND[family] + 1, 1_000)):
        write(bus, family, address, word)


def test_every_profile_has_a_simulated_drive() -> None:
    assert sorted(FAMILIES.values()) == sorted(drivebus.profiles())


def test_the_documentation_has_a_row_for_every_family() -> None:
    page = (Path(__file__).parents[2] / "docs" / "developers" / "simulator.md").read_text(encoding="utf-8")
    table = page.partition("## The families")[2].partition("\n## ")[0]
    named = [
        name for line in table.splitlines() if line.startswith("| `") for name in line.split("|")[1].split("`")[1::2]
    ]
    assert sorted(named) == sorted(FAMILIES.values())


def test_each_is_what_it_was_asked_for(simulator: Simulator) -> None:
    assert {unit: simulator.drive(unit).profile for unit in FAMILIES} == FAMILIES


def test_identification_is_the_family_s_own_or_refused(bus: Bus) -> None:
    codes = {"gd350": 0x01A0, "gd35": 0x0108, "gd35-h1": 0x0109, "gd300": 0x010A}
    # GD10 manual, p. 90; GD20 manual, p. 140; GD200A manual V2.6, p. 147.
    codes |= {"gd10": 0x010D, "gd20": 0x0106, "gd100": 0x010B, "gd200a": 0x0107}
    for family in MODBUS:
        if family in codes:
            assert read(bus, family, 0x2103) == [codes[family]]
        elif family in ("ms300", "vfd-e", "vfd-b", "gs2", "gs4"):  # its output frequency: manuals, pp. 799 and 4-126
            assert read(bus, family, 0x2103) == [0]
        elif family == "atv320":  # it refuses no read
            assert read(bus, family, 0x2103) == [0x8000]
        elif family == "eds300":  # 03H says that there is no such address: manual, p. 45
            assert refusal(bus, family, pdu(0x03, 0x2103, 1)) == 0x03
        else:
            assert refusal(bus, family, pdu(0x03, 0x2103, 1)) == 0x02, family


def test_bit_0_of_2101h_is_the_other_way_round_on_a_goodrive35(simulator: Simulator, bus: Bus) -> None:
    # Bits 11 and 10 are printed for Goodrive350 only.
    for family, ready, faulty in [("gd350", 0xC01, 0xC00), ("gd300", 1, 0), ("gd35", 0, 1), ("gd35-h1", 0, 1)]:
        assert read(bus, family, 0x2101) == [ready], family
        simulator.drive(UNIT[family]).trip(4)
        assert read(bus, family, 0x2101) == [faulty], family


def test_bit_0_of_2101h_is_the_bus_voltage_in_the_older_class(simulator: Simulator, bus: Bus) -> None:
    """GD10 manual, p. 88; GD200A manual, p. 147: a fault does not take the voltage away."""
    for family in ("gd10", "gd200a"):
        assert read(bus, family, 0x2101) == [1], family
        simulator.drive(UNIT[family]).trip(4)
        assert read(bus, family, 0x2101) == [1], family


def test_a_goodrive10_has_nothing_from_2004h_to_2009h(bus: Bus) -> None:
    """GD10 manual (manualshive 1058543), pp. 88 and 90, and (2085734), p. 101: what is left out or reserved."""
    for address in (*range(0x2004, 0x200A), 0x200C, 0x200E):
        assert refusal(bus, "gd10", pdu(0x06, address, 0)) == 0x02, f"{address:04X}"
    for address in (*range(0x300E, 0x3012), 0x3013):
        assert refusal(bus, "gd10", pdu(0x03, address, 1)) == 0x02, f"{address:04X}"
    assert refusal(bus, "gd20", pdu(0x03, 0x3011, 1)) == 0x02  # reserved: GD20 manual, p. 140


def test_what_a_goodrive200a_takes_in_2009h(bus: Bus) -> None:
    """GD200A manual, p. 147: bits 0 to 2."""
    write(bus, "gd200a", 0x2009, 7)
    assert refusal(bus, "gd200a", pdu(0x06, 0x2009, 8)) == 0x04


def test_a_goodrive100_does_not_show_its_last_command(bus: Bus) -> None:
    """GD100 manual, p. 167: 2000H is to be written."""
    assert refusal(bus, "gd100", pdu(0x03, 0x2000, 1)) == 0x02
    assert read(bus, "gd20", 0x2000)


def test_200ah_takes_ten_bits_on_a_goodrive350_and_nine_on_its_sisters(bus: Bus) -> None:
    for family, highest in [
        ("gd350", 0x3FF),
        *((sister, 0x1FF) for sister in ("gd35", "gd35-h1", "gd300", "gd10", "gd20", "gd100", "gd200a")),
    ]:
        write(bus, family, 0x200A, highest)
        assert refusal(bus, family, pdu(0x06, 0x200A, highest + 1)) == 0x04, family


@pytest.mark.parametrize("family", OBEYS)
def test_a_motor_runs_stops_coasts_and_is_reset_by_the_codes_of_its_family(
    simulator: Simulator, bus: Bus, family: str
) -> None:
    machine, command, codes = simulator.drive(UNIT[family]), COMMAND[family], CODES[family]
    obey(bus, family)
    write(bus, family, command, 1)
    simulator.advance(2.5)
    assert machine.state == "forward"
    assert machine.frequency == pytest.approx(10.0)
    write(bus, family, command, codes["stop"])
    simulator.advance(1.0)
    assert 0.0 < machine.frequency < 10.0
    simulator.advance(1.5)
    assert (machine.state, machine.speed) == ("stopped", 0.0)

    write(bus, family, command, 2)
    simulator.advance(2.5)
    assert machine.state == "reverse"
    assert machine.frequency == pytest.approx(-10.0)
    write(bus, family, command, codes["coast"])
    assert (machine.state, machine.frequency) == ("stopped", 0.0)
    assert machine.speed < 0.0

    machine.trip(4)
    write(bus, family, command, codes["stop"])
    assert (machine.state, machine.fault) == ("fault", 4)
    write(bus, family, command, codes["reset"])
    assert (machine.state, machine.fault) == ("stopped", 0)
    others = {unit: simulator.drive(unit) for unit in FAMILIES if FAMILIES[unit] != family}
    assert {unit for unit, other in others.items() if other.state != "stopped" or other.words_written} == set()


@pytest.mark.parametrize("family", OBEYS)
def test_unknown_codes_are_refused_and_do_nothing(simulator: Simulator, bus: Bus, family: str) -> None:
    obey(bus, family)
    unknown = (9, 10, 0xFFFF) if family == "vfd500" else (0, 9, 0xFFFF)
    for code in unknown:
        assert refusal(bus, family, pdu(0x06, COMMAND[family], code)) == 0x04
    assert simulator.drive(UNIT[family]).state == "stopped"


def test_what_is_meant_for_another_family_reaches_nothing(simulator: Simulator, bus: Bus) -> None:
    for family in OBEYS:
        obey(bus, family)
        foreign = 0x2000 if family == "vfd500" else 0x7000
        for code in range(10):
            assert refusal(bus, family, pdu(0x06, foreign, code)) == 0x02
        assert simulator.drive(UNIT[family]).state == "stopped"


def test_which_functions_there_are(bus: Bus) -> None:
    for family in MODBUS:
        unknown = 0x02 if family == "eds300" else 0x01  # manual, p. 45
        # Their manuals have 03H and 06H, some of them 10H, and no others.
        if family in (
            "chf100a",
            "ms300",
            "yl620",
            "md500",
            "saj8000m",
            "eds300",
            "sunfar-e300",
            "atv312",
            "atv12",
            "atv600",
            "atv320",
            "v20",
            "acs355",
            "fc51",
            "fc202",
            "h100",
            "vf-s15",
            "optidrive-e3",
            "optidrive-p2",
            "dc1",
            "gs2",
            "gs4",
            "cfw500",
            "vfd-b",
            "vacon10",
            "smd",
            "nowforever",
            "starvert",
        ):
            assert refusal(bus, family, pdu(0x08, 0, 0x12AB)) == unknown
        else:
            assert bus.transact(UNIT[family], pdu(0x08, 0, 0x12AB)) == pdu(0x08, 0, 0x12AB)
        # An H100, a Vacon 10, an SMD and a LS drive have 04H, and nothing there.
        nothing = 0x02 if family in ("h100", "vacon10", "smd", "starvert") else unknown
        assert refusal(bus, family, pdu(0x04, 0x2100, 1)) == nothing, family
    write_many = bytes.fromhex("10 2000 0001 02 0005")
    for family in ("gd3000", "gd3000-rectifier", "chf100a", "chv100"):
        assert refusal(bus, family, write_many) == 0x01, family
    for family in ("gd350", "gd35", "gd35-h1", "gd300", "gd600", "gd10", "gd20", "gd100", "gd200a"):
        assert bus.transact(UNIT[family], write_many) == bytes.fromhex("10 2000 0001")


def test_vfd500_refuses_with_its_five_codes(bus: Bus) -> None:
    obey(bus, "vfd500")
    for request, code in [
        (pdu(0x03, 0x7000, 1), 0x05),  # write only
        (pdu(0x03, 0x7001, 1), 0x05),
        (pdu(0x03, 0x1900, 2), 0x02),  # leaves group 25
        (pdu(0x03, 0x1B00, 17), 0x03),
        (pdu(0x06, 0x7001, 60_001), 0x04),
        (pdu(0x06, 0x1900, 0), 0x04),
    ]:
        assert refusal(bus, "vfd500", request) == code, request.hex()


@pytest.mark.parametrize(
    ("family", "address", "kept"),
    [
        ("gd350", 0x000B, True),
        ("gd350", 0x800B, False),
        ("gd35", 0x000B, True),
        ("gd300", 0x800B, False),
        ("gd10", 0x800B, False),
        ("gd20", 0x000B, True),
        ("gd20", 0x800B, False),
        ("gd100", 0x000B, True),
        ("gd100", 0x800B, False),
        ("gd200a", 0x000B, True),
        ("gd200a", 0x800B, False),
        ("gd600", 0x0114, True),
        ("gd3000", 0x0114, True),
        ("gd3000-rectifier", 0x0B04, True),
        ("vfd500", 0x0007, False),
        ("vfd500", 0x8007, True),
    ],
)
def test_what_a_write_wears_and_what_outlives_the_power(
    simulator: Simulator, bus: Bus, family: str, address: int, kept: bool
) -> None:
    machine, plain = simulator.drive(UNIT[family]), address & 0x7FFF
    [factory] = read(bus, family, plain)
    write(bus, family, address, 123)
    assert read(bus, family, plain) == [123]
    assert (machine.eeprom_writes, machine.eeprom_writes_of(plain)) == (int(kept), int(kept))
    machine.power_cycle()
    assert read(bus, family, plain) == [123 if kept else factory]
    machine.factory_reset()
    machine.power_cycle()
    assert read(bus, family, plain) == [factory]
    assert machine.eeprom_writes == int(kept)


@pytest.mark.parametrize("family", ["gd600", "gd600-rectifier", "gd3000", "gd3000-rectifier", "chf100a"])
def test_where_no_page_tells_of_ram_no_address_leads_there(bus: Bus, family: str) -> None:
    for address in (0x8001, 0x8114, 0x8B04, 0xA000):
        assert refusal(bus, family, pdu(0x06, address, 1)) == 0x02


def test_faults_are_those_of_the_family(simulator: Simulator, bus: Bus) -> None:
    where = {"gd350": 0x2102, "gd300": 0x2102, "gd600": 0x2102, "gd3000": 0x2102, "vfd500": 0x1900, "chf100a": 0x5000}
    where |= dict.fromkeys(("gd10", "gd20", "gd100", "gd200a"), 0x2102)
    for family, address in where.items():
        simulator.drive(UNIT[family]).trip(11)
        assert read(bus, family, address) == [11], family
    with pytest.raises(NotAllowed, match="vfd500 has no fault"):
        simulator.drive(UNIT["vfd500"]).trip("OL1")
    simulator.drive(UNIT["vfd500"]).trip("Er.485")
    assert read(bus, "vfd500", 0x1900) == [34]


def test_a_rectifier_feeds_and_has_no_load(simulator: Simulator, bus: Bus) -> None:
    for family in ("gd600-rectifier", "gd3000-rectifier"):
        machine = simulator.drive(UNIT[family])
        write(bus, family, 0x2000, 1)
        assert (machine.state, machine.frequency, read(bus, family, 0x2100)) == ("running", 0.0, [1])
        with pytest.raises(NotAllowed, match="drives no motor"):
            machine.load = 1.0
        for code in (2, 3, 4, 6, 8):
            assert refusal(bus, family, pdu(0x06, 0x2000, code)) == 0x04
        write(bus, family, 0x2000, 5)
        assert machine.state == "stopped"


def test_a_running_motor_takes_no_factory_settings(simulator: Simulator, bus: Bus) -> None:
    obey(bus, "vfd500")
    write(bus, "vfd500", 0x7000, 1)
    with pytest.raises(NotAllowed, match="unit 9 is running"):
        simulator.drive(UNIT["vfd500"]).factory_reset()
    assert read(bus, "vfd500", 0x0002) == [2]


def test_families_stand_in_a_port_too() -> None:
    with Bus("sim://1=gd350,2=vfd500,3=gd600?clock=virtual") as bus:
        assert bus.transact(1, pdu(0x03, 0x2103, 1)) == bytes.fromhex("03 02 01A0")
        assert bus.transact(2, pdu(0x03, 0x1900, 1)) == bytes.fromhex("03 02 0000")
        assert bus.transact(3, pdu(0x03, 0x2100, 1)) == bytes.fromhex("03 02 0003")
