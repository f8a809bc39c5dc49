"""Each profile against the simulated drive of its family, whose behaviour is typed from the manuals a second time.

Where the two disagree, one of them has it wrong. What is sent is what the profile says; what came of it is asked of the
machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Profile, Refused, Simulator, tables

FAMILIES = [name for name in drivebus.profiles() if Profile.builtin(name).requests().protocol == "modbus"]
"""Those that are asked in frames of Modbus here; the other one is in `test_huanyang_hy`."""
RUN = ["gd350", "gd35", "gd35-h1", "gd300", "gd10", "gd20", "gd100", "gd200a", "gd600", "gd3000", "vfd500"]
"""Those whose motor the bus moves."""

VARIANTS = {
    "vfd500": {"speed_unit": "Hz"},
    "a1000": {"speed_unit": "Hz"},
    "j1000": {"speed_unit": "Hz"},
    "cfw500": {"base_frequency": "50 Hz"},
    "fc51": {"base_frequency": "50 Hz"},
    "fc202": {"base_frequency": "50 Hz"},
    "v20": {"base_frequency": "50 Hz"},
    "md500": {"max_frequency": "50 Hz"},
    "vacon10": {"max_frequency": "50 Hz"},
    "acs355": {"base_frequency": "50 Hz"},
    "acs580": {"base_frequency": "50 Hz"},
}
"""As they come from the factory: P30.14 is 1, o1-03 is 0; 3-03, P2000, F0-10, P3.2, 1105 and 46.02 are 50 Hz."""

READ_ONLY = {
    "vfd500": 0x04,
    "eds300": 0x05,
    **dict.fromkeys(
        [
            *("ms300", "vfd-e", "yl620", "saj8000m", "sunfar-e300", "fc51", "atv312", "v20", "acs355"),
            *("acs580", "atv12", "atv320", "atv600", "fc202", "wj200", "h100", "md500", "fr-d700", "vf-s15", "frenic"),
            "gs2",
            "gs4",
            "vfd-b",
            "optidrive-e3",
            "optidrive-p2",
            "dc1",
            "vacon10",
            "smd",
            "nowforever",
        ],
        0x02,
    ),
    **dict.fromkeys(["a1000", "j1000", "sj200", "x200"], 0x22),
    "e510": 0x05,
    "f510": 0x04,
    "cfw500": 0x03,
    "starvert": 0x14,
    # Its manual (1755863, p. 39) refuses a write of ETA so.
    "atv71": 0x04,
}
"""How a drive refuses a write to what can only be read, where it is not INVT's 07H."""
OUT_OF_RANGE = {
    **dict.fromkeys(
        [
            "ms300",
            "vfd-e",
            "yl620",
            "saj8000m",
            "sunfar-e300",
            "v20",
            "wj200",
            "h100",
            "md500",
            "fr-d700",
            "vf-s15",
            "frenic",
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
        ],
        0x03,
    ),
    **dict.fromkeys(["a1000", "j1000", "sj200", "x200"], 0x21),
}
"""And a value that is out of range, where it is not their 04H."""

NARROWER = {("frenic", "set_frequency")}
"""What takes a word below zero, by which the motor turns the other way: drivebus sends none."""

WITHOUT = {
    "atv600": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
    "optidrive-e3": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
    "optidrive-p2": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
    "atv320": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
    "vfd500": {"jog_stop"},
    "md500": {"jog_stop"},
    "frenic": {"coast", "jog_forward", "jog_reverse", "jog_stop"},
    "starvert": {"coast", "jog_forward", "jog_reverse", "jog_stop"},
    "smd": {"coast", "reset_fault", "jog_forward", "jog_reverse", "jog_stop"},
    "cfw500": {"jog_forward", "jog_reverse", "jog_stop"},
    "dc1": {"jog_forward", "jog_reverse", "jog_stop"},
    "nowforever": {"coast", "jog_forward", "jog_reverse", "jog_stop"},
    "fr-d700": {"coast", "reset_fault", "jog_forward", "jog_reverse", "jog_stop"},
    "fc51": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
    "fc202": {"run_reverse", "jog_forward", "jog_reverse", "jog_stop"},
}
"""The commands that a family does not have."""

PASSWORD = "P07.00"
COMMANDS = {
    # What becomes of a motor at standstill and of one that turns forward at 10 Hz: its state a second later, and Hz.
    "run_forward": (("forward", 5.0), ("forward", 10.0)),
    "run_reverse": (("reverse", -5.0), ("forward", 5.0)),
    "jog_forward": (("forward", 5.0), ("forward", 10.0)),
    "jog_reverse": (("reverse", -5.0), ("forward", 10.0)),
    "stop": (("stopped", 0.0), ("forward", 5.0)),
    "coast": (("stopped", 0.0), ("stopped", 0.0)),
    "reset_fault": (("stopped", 0.0), ("forward", 10.0)),
    "jog_stop": (("stopped", 0.0), ("forward", 10.0)),
}


COILS = 0x01
"""What stands above the address of a coil; the function that reads it."""


class Bench:
    """One drive of a family, and its profile."""

    def __init__(self, family: str) -> None:
        profile = Profile.builtin(family)
        self.profile = profile.with_variants(VARIANTS.get(family, {}))
        self.simulator = Simulator({1: family}, transport="process", clock="virtual")
        self.bus = Bus(self.simulator)
        self.machine = self.simulator.drive(1)
        if family == "smd":
            # It is locked from when its power comes.
            self.write(0x0030, 0)

    def close(self) -> None:
        self.bus.close()
        self.simulator.close()

    def write(self, place: int, word: int) -> None:
        address, data = (place & 0xFFFF).to_bytes(2, "big"), word.to_bytes(2, "big")
        request = bytes([0x06]) + address + data
        if place >> 16 == COILS:
            request = bytes([0x05]) + address + bytes([0xFF * word, 0])
        elif 0x06 not in self.profile.functions and 0x10 in self.profile.functions:
            request = bytes([0x10]) + address + bytes([0, 1, 2]) + data
        self.bus.transact(1, request)

    def read(self, place: int, count: int = 1) -> list[int]:
        function = place >> 16 or 0x03
        answer = self.bus.transact(
            1, bytes([function]) + (place & 0xFFFF).to_bytes(2, "big") + count.to_bytes(2, "big")
        )
        if function == COILS:
            return [answer[2] >> bit & 1 for bit in range(count)]
        return [int.from_bytes(answer[place : place + 2], "big") for place in range(2, len(answer), 2)]

    def refusal(self, address: int, word: int) -> int:
        with pytest.raises(Refused) as caught:
            self.write(address, word)
        return caught.value.code

    def show(self, role: str) -> int:
        """The word that has this role."""
        name = self.profile.role(role)
        assert name is not None
        address = self.profile.describe(name).place
        assert address is not None
        return self.read(address)[0]

    def obey(self) -> None:
        """As the profile says it is made to obey the bus, at 10 Hz."""
        for setting in self.profile.control():
            address = self.profile.describe(setting["code"]).address
            assert address is not None
            self.write(address, setting["value"])
        setpoint = self.profile.role("setpoints.frequency")
        assert setpoint is not None
        address = self.profile.describe(setpoint).address
        assert address is not None
        self.write(address, self.profile.encode(setpoint, 10.0))

    def command(self, name: str, seconds: float) -> None:
        self.write(*self.profile.command(name))
        self.simulator.advance(seconds)


@pytest.fixture
def bench(family: str) -> Iterator[Bench]:
    with closing(Bench(family)) as bench:
        yield bench


@pytest.mark.parametrize("family", FAMILIES)
def test_every_row_that_can_be_read_is_answered(bench: Bench) -> None:
    for name in bench.profile.names():
        row = bench.profile.describe(name)
        if row.address is None:
            continue
        if row.access == "wo":
            continue
        assert row.place is not None
        assert len(bench.read(row.place, row.words)) == row.words, name


@pytest.mark.parametrize("family", FAMILIES)
def test_every_register_has_the_range_that_the_drive_has(bench: Bench) -> None:
    commands = bench.profile.command_registers()
    for name in bench.profile.names():
        row = bench.profile.describe(name)
        bound = row.low_from or row.high_from or row.variant or row.low is None or row.high is None
        if row.kind != "register" or row.place is None or row.access == "ro" or row.place in commands or bound:
            continue
        if (bench.profile.name, name) in NARROWER:
            continue
        low, high = bench.profile.encode(name, row.low), bench.profile.encode(name, row.high)
        for word in (low, high):
            bench.write(row.place, word)
        if row.table == "coil":  # 05H says on or off, and nothing else
            continue
        below = [(low - 1) & 0xFFFF] if low or row.signed else []
        above = [high + 1] if high < 0xFFFF else []
        for word in (*below, *above):
            refused = OUT_OF_RANGE.get(bench.profile.name, 0x04)
            assert bench.refusal(row.place, word) == refused, f"{name} {word:04X}"


@pytest.mark.parametrize("family", FAMILIES)
def test_what_can_only_be_read_cannot_be_written(bench: Bench) -> None:
    for name in bench.profile.names():
        row = bench.profile.describe(name)
        # No function writes an input register, and what is a state as it is read may be a command as it is written.
        if row.access == "ro" and row.place is not None and tables.split(row.place)[0] != "input":
            if bench.profile.is_command(row.place):
                continue
            assert bench.refusal(row.place, 1) == READ_ONLY.get(bench.profile.name, 0x07), name


@pytest.mark.parametrize("family", [*RUN, "fc51", "fc202"])
@pytest.mark.parametrize("command", COMMANDS)
def test_what_a_profile_calls_a_command_is_what_the_drive_does(bench: Bench, command: str) -> None:
    if command not in bench.profile.commands():
        assert command in WITHOUT[bench.profile.name]
        return
    from_standstill, from_ten = COMMANDS[command]
    bench.obey()
    bench.command(command, 1.0)
    assert (bench.machine.state, round(bench.machine.frequency, 1)) == from_standstill

    with closing(Bench(bench.profile.name)) as bench:
        bench.obey()
        bench.command("run_forward", 3.0)
        bench.command(command, 1.0)
        # An exchange takes its time too: some 15 ms, which are less than 0.1 Hz.
        assert bench.machine.state == from_ten[0]
        assert bench.machine.frequency == pytest.approx(from_ten[1], abs=0.1)


@pytest.mark.parametrize("family", [*RUN, "fc51", "fc202"])
def test_a_coasting_motor_turns_on_and_a_stopped_one_is_slowed_down(bench: Bench) -> None:
    bench.obey()
    bench.command("run_forward", 3.0)
    bench.command("coast", 0.1)
    assert bench.machine.frequency == 0.0
    assert bench.machine.speed > 100.0


@pytest.mark.parametrize("family", RUN)
def test_state_frequency_and_fault_are_where_the_profile_says(bench: Bench) -> None:
    profile, machine = bench.profile, bench.machine
    bench.obey()
    for command, state in [("run_forward", "forward"), ("run_reverse", "reverse"), ("coast", "stopped")]:
        bench.command(command, 5.0)
        assert (profile.state(bench.show("state")), machine.state) == (state, state)
        hertz = profile.decode(profile.role("frequency") or "", bench.show("frequency"))
        assert hertz == pytest.approx(abs(machine.frequency))
    setpoint = profile.role("setpoint") or ""
    assert profile.decode(setpoint, bench.show("setpoint")) == 10.0
    assert bench.show("fault") == 0
    machine.trip(11)
    assert (profile.state(bench.show("state")), bench.show("fault")) == ("fault", 11)
    bench.command("reset_fault", 0.0)
    assert (profile.state(bench.show("state")), bench.show("fault")) == ("stopped", 0)


@pytest.mark.parametrize("family", FAMILIES)
def test_memory_is_reached_where_the_profile_says(bench: Bench) -> None:
    profile, machine = bench.profile, bench.machine
    shown = [profile.describe(name) for name in profile.names()]
    kept = [row for row in shown if row.code and row.address is not None and row.writable and row.code != PASSWORD]
    for row in kept:
        assert row.address is not None
        [word] = bench.read(row.address)
        worn = machine.eeprom_writes_of(row.address)
        bench.write(profile.address(row.name, store=True), word)
        memory = profile.memory()
        if memory is not None and memory.store_register is not None:
            assert machine.eeprom_writes_of(row.address) == worn, "it stays in RAM until all is stored"
            continue
        assert machine.eeprom_writes_of(row.address) == worn + 1, row.name
        try:
            address = profile.address(row.name, store=False)
        except NotAllowed:
            assert profile.memory() is None, row.name
        else:
            bench.write(address, word)
            assert machine.eeprom_writes_of(row.address) == worn + 1, row.name


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_is_known_by_what_its_profile_says(bench: Bench, family: str) -> None:
    profile = bench.profile
    if profile.identification_address is not None and not profile.name.startswith("ch"):
        [code] = bench.read(profile.identification_address)
        assert profile.identifies(code) == profile.name
    for address in (profile.signature() or {}).get("answers", []):
        bench.read(address)
    for address in (profile.signature() or {}).get("refuses", []):
        if profile.requests().absent is None or family == "atv71":
            with pytest.raises(Refused):
                bench.read(address)
        else:
            assert bench.read(address) == [profile.requests().absent]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_functions_of_the_profile_are_there(bench: Bench) -> None:
    requests = {
        0x01: "01 0000 0001",
        0x05: "05 2100 FF00",
        0x03: "03 2100 0001",
        0x04: "04 2100 0001",
        0x06: "06 2100 0001",
        0x08: "08 0000 12AB",
        0x10: "10 2100 0001 02 0001",
    }
    refused = []
    for function in bench.profile.functions:
        try:
            bench.bus.transact(1, bytes.fromhex(requests[function]))
        except Refused as error:
            refused.append((function, error.code))
    assert [function for function, code in refused if code == 0x01] == []


@pytest.mark.parametrize("family", drivebus.profiles())
def test_what_a_family_tells_is_frozen_and_has_its_attributes_as_keys(family: str) -> None:
    profile = Profile.builtin(family)
    told: list[Any] = [profile.requests(), profile.serial(), profile.memory(), *profile.control()]
    told += [*profile.variants().values(), *profile.start_sequence(), *profile.identifications()]
    for fact in filter(None, told):
        for name, value in fact.items():
            assert getattr(fact, name) == fact[name] == value
            with pytest.raises(AttributeError):
                setattr(fact, name, None)
        with pytest.raises(KeyError):
            fact["nothing"]
        assert {**fact} == dict(zip(fact, fact.values(), strict=True))
