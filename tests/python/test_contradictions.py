"""Options that contradict each other, or the port they are for: `NotAllowed` before anything opens."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import serial
from click.testing import CliRunner

import drivebus.aio
import drivebus.doctor
from drivebus import Bus, NotAllowed, Simulator
from drivebus.cli import cli

SIM = "sim://gd350?clock=virtual"
RS485 = {"mode": "rts"}


@pytest.fixture
def nothing_opens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever would open a port fails the test."""

    def opened(*_: Any, **__: Any) -> None:
        pytest.fail("something was opened")

    monkeypatch.setattr(serial, "serial_for_url", opened)
    monkeypatch.setattr("drivebus.sim.first_served", opened)


def refused(message: str, port: object, **options: Any) -> None:
    with pytest.raises(NotAllowed, match=message):
        Bus(port, **options)
    with pytest.raises(NotAllowed, match=message):
        asyncio.run(drivebus.aio.Bus.open(port, **options))


@pytest.mark.usefixtures("nothing_opens")
@pytest.mark.parametrize(
    "port", ["spy:///dev/null", "loop://", "rfc2217://127.0.0.1:1", SIM, "socket://x:1", "tcp://x"]
)
@pytest.mark.parametrize("rs485", [RS485, {"mode": "odd"}, {}], ids=str)
def test_the_direction_is_switched_of_a_serial_port_only(port: str, rs485: dict[str, Any]) -> None:
    refused("rs485 is for a serial port given by its path", port, rs485=rs485)


def test_the_direction_of_what_is_open_is_its_owners(virtual: Simulator) -> None:
    refused("rs485 is for a serial port given by its path", virtual, rs485=RS485)


@pytest.mark.usefixtures("nothing_opens")
def test_modbus_tcp_hands_nothing_back() -> None:
    refused('echo "yes".*tcp://', "tcp://127.0.0.1:1", echo="yes")


@pytest.mark.usefixtures("nothing_opens")
@pytest.mark.parametrize(
    "options",
    [
        {"rs485": {"mode": "rts", "delay_before_ms": True}},
        {"rs485": {"delay_after_ms": True}},
        {"silence": True},
        {"stopbits": True},
        {"baudrate": True},
    ],
    ids=str,
)
def test_true_is_no_number(options: dict[str, Any]) -> None:
    refused("True", "/dev/drivebus-is-not-here", **options)


@pytest.mark.usefixtures("nothing_opens")
@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("sim://gd350?seed=1&seed=2", "seed.*twice"),
        ("sim://gd350?clock=virtual&clock=real", "clock.*twice"),
        ("sim://gd350?late=0.1&late=0.2", "late.*twice"),
        ("sim://gd350?faults=0.1&faults=0.1", "faults.*twice"),
    ],
)
def test_a_simulator_is_told_each_thing_once(url: str, message: str) -> None:
    refused(message, url)


@pytest.mark.usefixtures("nothing_opens")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"strict_silence": "no"}, 'strict_silence "no" .*True'),
        ({"echo": "no"}, 'echo "no" .*True'),
        ({"echo": None}, "echo None .*True"),
        ({"faults": [1]}, r"faults \[1\] .*mapping"),
        ({"faults": "late"}, 'faults "late" .*mapping'),
        ({"faults": {"late": True}}, "late True"),
        ({"clock": "virtual"}, '"process"'),
        ({"clock": "virtual", "transport": "pty"}, '"process"'),
        ({"link": "somewhere", "transport": "tcp"}, '"pty"'),
        ({"link": "somewhere", "transport": "process"}, '"pty"'),
        ({"faults": {"unplug": 0.1}}, '"process"'),
    ],
    ids=str,
)
def test_a_simulation_that_cannot_be(options: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(NotAllowed, match=message):
        Simulator({1: "gd350"}, **options)
    assert not list(tmp_path.iterdir())


CALLS: list[tuple[Callable[[Bus], object], str]] = [
    (lambda bus: bus.read(1, 0x2100, urgent="no"), 'urgent "no" .*True'),  # type: ignore[arg-type]
    (lambda bus: bus.read(1, 0x2100, verify=1), "verify 1 .*True"),  # type: ignore[arg-type]
    (lambda bus: bus.read_stamped(1, 0x2100, verify=None), "verify None .*True"),  # type: ignore[arg-type]
    (lambda bus: bus.write(1, 0x000B, 20, urgent="no"), 'urgent "no" .*True'),  # type: ignore[arg-type]
    (lambda bus: bus.drive(1, trust_profile=True), "trust_profile.*profile"),
    (lambda bus: bus.drive(1, "gd350", trust_profile="no"), 'trust_profile "no" .*True'),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "message"), CALLS, ids=lambda each: each if isinstance(each, str) else "")
def test_what_is_wrong_in_a_call_is_named_and_nothing_is_sent(
    virtual: Simulator, virtual_bus: Bus, call: Callable[[Any], Any], message: str
) -> None:
    async def awaited() -> None:
        async with drivebus.aio.Bus(virtual) as bus:
            await call(bus)

    before = virtual.line.requests
    with pytest.raises(NotAllowed, match=message):
        call(virtual_bus)
    with pytest.raises(NotAllowed, match=message):
        asyncio.run(awaited())
    assert virtual.line.requests == before


def test_the_doctor_is_told_so_before_it_looks() -> None:
    for options in ({"full": "no"}, {"listen": float("nan")}, {"echoes": 0}, {"unit": 0}):
        with pytest.raises(NotAllowed):
            next(drivebus.doctor.examine("/dev/drivebus-is-not-here", **options))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", SIM, "--trust-profile", "info"], "--profile"),
        (["--profile", "gd350", "faults", "--all", "OL1"], "--all"),
        (["sim", "--fault", "late=0.1", "--fault", "late=0.2"], "twice"),
        (["sim", "--link", "x", "--transport", "tcp"], "pty"),
        (["--port", "tcp://x", "--rs485", "rts", "info"], "rs485"),
        (["--port", SIM, "--rs485", "kernel", "info"], "rs485"),
        (["--variant", "a=b", "--variant", "a=c", "--port", SIM, "info"], "twice"),
        (["profiles", "new", "x", "--like", "gd350", "--overlay", "gd350"], "--overlay"),
        (["diff", "factory", "factory"], "itself"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, list) else "",
)
def test_the_command_line_ends_with_2(words: list[str], said: str) -> None:
    done = CliRunner().invoke(cli, words)
    assert (done.exit_code, said in done.stderr) == (2, True), done.output
