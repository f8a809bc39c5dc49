"""Faults on the simulated line: by rate, by script, by unplugging, on every kind of line."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import pytest

from drivebus import Bus, DrivebusError, NoAnswer, NotAllowed, PortError, Refused, Simulator
from drivebus.sim import FAULT_KINDS

from .conftest import TRANSPORTS

IDENTIFICATION = 0x2103
GD350 = 0x01A0
LINUX = pytest.mark.skipif(os.name != "posix" or not Path("/dev/pts").is_dir(), reason="no pty")


def test_the_kinds_are_those_of_the_documentation() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "simulator.md").read_text(encoding="utf-8")
    table = page.partition("### Faults by chance")[2]
    named = [line.split("`")[1] for line in table.splitlines() if line.startswith("| `")]
    assert named == list(FAULT_KINDS)


def test_a_script_hits_the_answers_it_names(simulator: Simulator, bus: Bus) -> None:
    bus.read(1, IDENTIFICATION)
    simulator.line.script([(1, "noise_before"), (2, "foreign"), (3, "delay"), (3, "noise_after")])
    assert [bus.read(1, IDENTIFICATION) for _ in range(4)] == [[GD350]] * 4
    counts = simulator.line.fault_counts()
    assert list(counts) == list(FAULT_KINDS)
    hit = {kind: count for kind, count in counts.items() if count}
    assert hit == {"noise_before": 1, "foreign": 1, "delay": 1, "noise_after": 1}


def test_a_script_says_the_bytes_too(virtual: Simulator) -> None:
    with Bus(virtual, timeout=0.1, retries=0) as bus:
        bus.read(1, IDENTIFICATION)
        virtual.line.script([(2, bytes.fromhex("01 83 06 C1 32")), (1, "split")])
        assert bus.read(1, IDENTIFICATION) == [GD350]
        with pytest.raises(Refused, match="06H"):
            bus.read(1, IDENTIFICATION)
        assert bus.read(1, IDENTIFICATION) == [GD350]


@pytest.mark.parametrize("transport", [each for each in TRANSPORTS if each != "tcp"])
def test_later_answers_pass_one_that_is_overtaken(transport: str) -> None:
    """Not over TCP, where others may be: there a read has the length that tells it apart."""
    clock = "virtual" if transport == "process" else "real"
    with Simulator({1: "gd350"}, transport=transport, clock=clock) as simulator:
        line = simulator.line
        with Bus(simulator, timeout=0.5, retries=0) as bus:
            assert bus.read(1, IDENTIFICATION) == [GD350]
            line.set_times(overtaken=(0.9, 0.9))
            line.script([(1, "overtaken")])
            with pytest.raises(NoAnswer):
                bus.read(1, 0x0E00, 2)
            for _ in range(10_000):
                with contextlib.suppress(DrivebusError):  # it may be spoken over
                    bus.read(1, IDENTIFICATION)
                sent = [(who, frame[:3].hex()) for _, who, frame in line.trace()]
                if ("unit", "010304") in sent:
                    break
        assert ("unit", "010302") in sent[sent.index(("master", "01030e")) : sent.index(("unit", "010304"))], sent
        assert line.fault_counts()["overtaken"] == 1


def test_what_is_lost_is_no_answer(simulator: Simulator, bus: Bus) -> None:
    bus.read(1, IDENTIFICATION)
    simulator.line.set_faults(silence=1.0)
    with pytest.raises(NoAnswer):
        bus.write(1, 0x000B, 77)
    assert simulator.drive(1).register(0x000B) == 77
    simulator.line.set_faults(deaf=1.0)
    with pytest.raises(NoAnswer):
        bus.read(1, IDENTIFICATION)
    assert simulator.line.faults == {"deaf": 1.0}
    simulator.line.clear()
    assert simulator.line.faults == {}
    assert bus.read(1, IDENTIFICATION) == [GD350]


@pytest.mark.parametrize("seed", range(3))
def test_whatever_happens_no_value_is_wrong(seed: int) -> None:
    rates = {"all": 0.03, "unplug": 0.01}
    with (
        Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual", seed=seed, faults=rates) as simulator,
        Bus(simulator, timeout=0.05) as bus,
    ):
        simulator.line.set_times(late=0.06, overtaken=(0.055, 0.2), replug=0.1)
        right = 0
        for number in range(1000):
            unit = 1 + number % 2
            try:
                assert bus.read(unit, 0x0E00, 2) == [unit, simulator.drive(unit).register(0x0E01)]
                right += 1
            except DrivebusError:
                pass
        assert right > 500
        assert all(simulator.line.fault_counts().values())


def test_the_same_seed_gives_the_same_run() -> None:
    def run(seed: int) -> tuple[list[tuple[float, str, bytes]], dict[str, int]]:
        with (
            Simulator({1: "gd350"}, transport="process", clock="virtual", seed=seed, faults={"all": 0.05}) as simulator,
            Bus(simulator, timeout=0.1, retries=0, echo="no") as bus,
        ):
            for _ in range(50):
                try:
                    bus.read(1, IDENTIFICATION)
                except DrivebusError:
                    break  # what follows is an echo with a word of nobody's choosing
            return simulator.line.trace(), simulator.line.fault_counts()

    assert run(1)[1] == run(1)[1]
    assert run(1)[0][1:] != run(2)[0][1:]


def test_an_adapter_that_echoes_is_lived_with(simulator: Simulator) -> None:
    simulator.line.echo = True
    assert simulator.line.echo
    with Bus(simulator, timeout=0.25, echo="yes") as bus:
        assert bus.read(1, IDENTIFICATION) == [GD350]
        bus.write(1, 0x000B, 55)
        assert bus.read(1, 0x000B) == [55]
        assert bus.stats().own_echoes >= 3


def test_an_adapter_that_echoes_is_found_out(virtual: Simulator) -> None:
    virtual.line.echo = True
    with Bus(virtual, timeout=0.25) as bus:
        bus.write(1, 0x000B, 55)
        assert bus.read(1, 0x000B) == [55]
        assert virtual.drive(1).take_writes()[-1][1:] == (0x000B, 55)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_an_unplugged_port_is_an_error_and_comes_back(transport: str) -> None:
    clock = "virtual" if transport == "process" else "real"
    with Simulator({1: "gd350"}, transport=transport, clock=clock) as simulator:
        with Bus(simulator, timeout=0.25) as bus:
            assert bus.read(1, IDENTIFICATION) == [GD350]
            simulator.line.unplug()
            assert not simulator.line.plugged
            with pytest.raises(PortError):
                bus.read(1, IDENTIFICATION)
        with pytest.raises(PortError):
            Bus(simulator)
        before = simulator.port
        simulator.line.replug()
        assert (simulator.port != before) == (transport == "pty")
        with Bus(simulator, timeout=0.25) as bus:
            assert bus.read(1, IDENTIFICATION) == [GD350]


@LINUX
def test_a_link_leads_to_the_port_whatever_its_name_is(tmp_path: Path) -> None:
    link = tmp_path / "drive"
    with Simulator({1: "gd350"}, link=link) as simulator:
        seen = set()
        for _ in range(20):
            seen.add(simulator.port)
            assert str(link.readlink()) == simulator.port
            with Bus(link, timeout=0.25) as bus:
                assert bus.read(1, IDENTIFICATION) == [GD350]
                simulator.line.unplug()
                with pytest.raises(PortError):
                    bus.read(1, IDENTIFICATION)
            simulator.line.replug()
        assert len(seen) > 1
    assert not link.is_symlink()


def test_drives_keep_account_of_what_they_took(simulator: Simulator, bus: Bus) -> None:
    bus.write(1, 0x000B, [5, 6])
    assert [(address, value) for _, address, value in simulator.drive(1).take_writes()] == [(0x000B, 5), (0x000C, 6)]
    assert simulator.drive(1).take_writes() == []
    assert simulator.drive(1).words_written == 2


def test_a_port_name_says_it_too() -> None:
    with Bus("sim://gd350?clock=virtual&seed=7&faults=0.02&late=0.5&echo=1", baudrate=115200) as bus:
        simulator = bus.simulator
        assert simulator is not None
        assert simulator.seed == 7
        assert simulator.line.echo
        expected = {kind: 0.02 for kind in FAULT_KINDS if kind != "unplug"} | {"late": 0.5}
        assert simulator.line.faults == expected


@pytest.mark.parametrize(
    ("faults", "transport", "said"),
    [
        ({"flipbit": 0.1}, "process", 'did you mean "flip_bit"'),
        ({"late": 1.5}, "process", "allowed is 0 to 1"),
        ({"late": "often"}, "process", "not a number"),
        ({"unplug": 0.1}, "tcp", 'needs transport "process"'),
    ],
)
def test_impossible_faults_are_refused(faults: dict[str, float], transport: str, said: str) -> None:
    with pytest.raises(NotAllowed, match=said):
        Simulator({1: "gd350"}, transport=transport, faults=faults)


def test_other_nonsense_is_refused(virtual: Simulator) -> None:
    for mistake in (
        lambda: virtual.line.set_faults(flipbit=0.1),
        lambda: virtual.line.set_faults(late=2.0),
        lambda: virtual.line.script([(0, "late")]),
        lambda: virtual.line.script([(1, "latest")]),
        lambda: virtual.line.script([(1, 2)]),  # type: ignore[list-item]
        lambda: virtual.line.script(7),  # type: ignore[arg-type]
        lambda: virtual.line.set_times(late=-1.0),
        lambda: virtual.line.set_times(overtaken=(-1.0, 1.0)),
        lambda: virtual.line.set_times(overtaken=(0.2, 0.1)),
        lambda: Simulator({1: "gd350"}, transport="tcp", link="there"),
        lambda: Bus("sim://gd350?clock=virtual&late=often"),
        lambda: Bus("sim://gd350?clock=virtual&latest=1"),
    ):
        with pytest.raises(NotAllowed):
            mistake()
