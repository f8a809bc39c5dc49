"""What a simulator is served by where nothing is said: a pseudo-terminal, else TCP, else nothing but this process."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, DrivebusWarning, NotAllowed, PortError, Simulator, sim

HIDDEN = "mount --bind /dev/null /dev/ptmx"
"""What takes the pseudo-terminals away from the programs of one mount namespace."""


def without_terminals(*words: str) -> list[str]:
    return ["unshare", "--map-root-user", "--mount", "sh", "-c", f'{HIDDEN} && exec "$@"', "sh", sys.executable, *words]


def may_hide() -> bool:
    if shutil.which("unshare") is None or not Path("/dev/ptmx").exists():
        return False
    done = subprocess.run(without_terminals("-c", ""), capture_output=True, check=False)
    return done.returncode == 0


needs_a_namespace = pytest.mark.skipif(not may_hide(), reason="no mount namespace of one's own here")


def refusing(*refused: str) -> Callable[[str], str]:
    """What opens any transport but those *refused*."""

    def opens(transport: str) -> str:
        if transport in refused:
            raise PortError(f"no {transport} here")
        return transport

    return opens


@pytest.mark.parametrize(
    ("refused", "served", "said"),
    [
        ((), "pty", []),
        (("pty",), "tcp", ["no pty here", "TCP"]),
        (("pty", "tcp"), "process", ["no pty here", "no tcp here", "in this process only"]),
    ],
    ids=str,
)
def test_the_first_that_can_be_had_is_taken_and_what_could_not_is_said(
    refused: tuple[str, ...], served: str, said: list[str]
) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert sim.first_served(("pty", "tcp", "process"), refusing(*refused)) == (served, served)
    assert len(caught) == bool(refused)
    for warning in caught:
        assert issubclass(warning.category, DrivebusWarning)
        assert all(word in str(warning.message) for word in said)


def test_where_nothing_can_be_had_the_last_reason_is_raised() -> None:
    with pytest.raises(PortError, match="no pty here"):
        sim.first_served(("pty",), refusing("pty"))


def test_what_is_asked_for_by_name_is_not_replaced(tmp_path: Path) -> None:
    for transport in ("pty", "tcp", "process"):
        try:
            with Simulator({1: "gd350"}, transport=transport) as simulator:
                assert simulator.transport == transport
        except (NotAllowed, PortError):
            assert sys.platform != "linux"
    # A link leads to a pseudo-terminal: nothing else is what was meant.
    with pytest.raises(PortError):
        Simulator({1: "gd350"}, link=tmp_path / "nowhere" / "drive")


def test_wrong_arguments_are_no_reason_to_look_further() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for arguments in ({"fifo": 0}, {"seed": -1}, {"faults": {"odd": 1.0}}, {"transport": "radio"}):
            with pytest.raises(NotAllowed):
                Simulator({1: "gd350"}, **arguments)


@needs_a_namespace
def test_a_simulator_without_pseudo_terminals_is_served_over_tcp() -> None:
    text = (
        "import drivebus, warnings\n"
        "warnings.simplefilter('always')\n"
        "with drivebus.Simulator({1: 'gd350'}) as simulator, drivebus.Bus(simulator) as bus:\n"
        "    print(simulator.transport, simulator.port, bus.read(1, 0x2103))\n"
    )
    done = subprocess.run(without_terminals("-c", text), capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.startswith("tcp socket://127.0.0.1:"), done.stderr
    assert "[416]" in done.stdout
    assert "no pseudo-terminal" in done.stderr


@needs_a_namespace
def test_drivebus_sim_without_pseudo_terminals_serves_tcp() -> None:
    words = without_terminals("-m", "drivebus", "--json", "sim")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        line = child.stdout.readline()
        child.terminate()
        _, told = child.communicate(timeout=60)
        assert json.loads(line or "{}").get("port", told).startswith("socket://127.0.0.1:")
        assert "Warning: no pseudo-terminal" in told


@needs_a_namespace
def test_drivebus_sim_does_not_replace_what_was_asked_for(tmp_path: Path) -> None:
    for words in (["--transport", "pty"], ["--link", str(tmp_path / "drive")]):
        done = subprocess.run(
            without_terminals("-m", "drivebus", "sim", *words), capture_output=True, text=True, check=False, timeout=60
        )
        assert done.returncode == 5, done.stdout
        assert "pty" in done.stderr


def test_drivebus_sim_serves_other_programs_or_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    from drivebus.cli import cli

    monkeypatch.setattr(sim, "SERVED", ("process",))
    done = CliRunner().invoke(cli, ["sim"])
    assert done.exit_code == 5
    assert "no other program" in done.stderr


def test_the_demonstration_runs_in_its_own_process_if_it_must(monkeypatch: pytest.MonkeyPatch) -> None:
    from drivebus.cli import demonstration
    from drivebus.cli.present.output import Output

    seen: list[tuple[str, bool]] = []

    class Job:
        def __init__(self, _out: Output, simulator: Simulator, bus: Bus) -> None:
            seen.append((simulator.transport, bus.read(1, 0x2103) == [0x01A0]))

        def whole(self) -> None:
            pass

    monkeypatch.setattr(demonstration, "_Job", Job)
    for served in (("process",), ("tcp", "process")):
        monkeypatch.setattr(sim, "SERVED", served)
        demonstration.run(Output(as_json=True))
    assert [right for _, right in seen] == [True, True]
    assert seen[0][0] == "process"


@needs_a_namespace
def test_the_demonstration_without_pseudo_terminals_hangs_on_tcp() -> None:
    words = without_terminals("-m", "drivebus", "--json", "demo")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        first, found = child.stdout.readline(), child.stdout.readline()
        child.terminate()
        _, told = child.communicate(timeout=60)
    assert "socket://127.0.0.1:" in first, told
    assert json.loads(found)["family"] == "gd350"
    assert "Warning: no pseudo-terminal" in told


def test_in_virtual_time_nothing_is_served_that_was_not_asked_for() -> None:
    with pytest.raises(NotAllowed, match='"process"'):
        Simulator({1: "gd350"}, clock="virtual")
    with drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        assert simulator.transport == "process"
