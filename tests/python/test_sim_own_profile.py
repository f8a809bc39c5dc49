"""A profile of one's own on the simulated line: by its folder, its path or as a `Profile`, and what it may not lack."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import drivebus
from drivebus import Profile, State

PROFILES = Path(__file__).resolve().parent.parent.parent / "crates/sim/tests/profiles"
ACME = PROFILES / "acme"


@pytest.mark.parametrize("given", [ACME, str(ACME), Profile.load(ACME)], ids=["path", "text", "profile"])
def test_a_drive_of_its_profile_does_a_whole_job(given: Path | str | Profile) -> None:
    with (
        drivebus.Simulator({1: "gd350", 4: given}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        simulated = simulator.drive(4)
        assert (simulator.units, simulated.profile, simulator.drive(1).profile) == ([1, 4], "acme", "gd350")
        drive = bus.drive(4, profile=given, variants={"speed_unit": "Hz"})
        assert drive.read("model") == 0x7007
        drive.write("speed_unit", 1, store=True)
        drive.prepare_control()
        drive.run(hz=20.0, reverse=True)
        simulator.advance(5.0)
        assert drive.state() is State.REVERSE
        assert (simulated.state, simulated.frequency) == ("reverse", -20.0)
        assert drive.read("hz") == -20.0
        assert drive.read("output_current") > 0.5
        drive.stop()
        simulator.advance(5.0)
        assert simulated.state == "stopped"
        simulated.trip("OL1")
        fault = drive.fault()
        assert fault is not None
        assert (fault.code, fault.label) == (21, "Motor overload")
        assert drive.state() is State.FAULT
        drive.reset_fault()
        assert drive.read("last_alarm") == 21


def test_what_the_simulation_lacks_is_said_with_its_place() -> None:
    with pytest.raises(drivebus.NotAllowed) as refused:
        drivebus.Simulator({1: PROFILES / "bare"}, transport="process")
    said = str(refused.value).splitlines()
    assert said[0] == 'profile "bare" cannot be simulated; it lacks'
    assert "  profile.toml, [commands.codes]: neither run_forward nor run_reverse" in said
    assert all(re.match(r"  profile\.toml, \[[a-z.]+\]: ", line) for line in said[1:])


def test_the_profile_with_every_table_can_be_simulated() -> None:
    ex9 = Profile.load(PROFILES.parent.parent.parent.parent / "tests/vectors/profiles/ex9")
    with drivebus.Simulator({1: ex9}, transport="process", clock="virtual") as simulator:
        assert simulator.drive(1).state == "stopped"


@pytest.mark.parametrize(
    ("action", "state", "fault"), [("coast", "stopped", 0), ("stop", "stopped", 0), ("trip", "fault", 12)]
)
def test_a_silent_bus_has_a_trip_beside_a_coast(tmp_path: Path, action: str, state: str, fault: int) -> None:
    shutil.copytree(PROFILES.parent.parent.parent.parent / "tests/vectors/profiles/ex9", tmp_path / "ex9")
    rules = tmp_path / "ex9/profile.toml"
    said = rules.read_text(encoding="utf-8").replace("coast = 0\nstop = 3", "coast = 1\nstop = 3\ntrip = 0\nfault = 12")
    rules.write_text(said, encoding="utf-8")
    profile = Profile.load(tmp_path / "ex9")
    assert profile.watchdog is not None
    assert profile.watchdog.choices == ("coast", "stop", "trip")
    with drivebus.Simulator({1: profile}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
        drive = bus.drive(1, profile, unverified=True)
        drive.prepare_control()
        drive.run(hz=20.0)
        line.advance(10.0)
        watchdog = drive.watchdog(1.0, action)
        watchdog.__enter__()
        line.advance(20.0)
        assert (line.drive(1).state, line.drive(1).fault) == (state, fault)


def test_a_folder_that_is_no_sound_profile_is_refused_as_everywhere(tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text('name = "broken"\n', encoding="utf-8")
    with pytest.raises(drivebus.NotAllowed, match=r"profile\.toml"):
        drivebus.Simulator({1: tmp_path}, transport="process")
    with pytest.raises(drivebus.NotAllowed, match='no profile "gd35o" is shipped; the closest is "gd350"'):
        drivebus.Simulator({1: "gd35o"}, transport="process")
    with pytest.raises(drivebus.NotAllowed, match="is not a profile; give a name"):
        drivebus.Simulator({1: 350}, transport="process")  # type: ignore[dict-item]


def test_a_variant_of_a_shipped_profile_is_still_its_family() -> None:
    chosen = Profile.builtin("vfd500").with_variants({"speed_unit": "Hz"})
    with drivebus.Simulator({1: chosen}, transport="process", clock="virtual") as simulator:
        assert simulator.drive(1).register(0x1E0E) == 1


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a whole console")
def test_the_command_takes_a_folder(tmp_path: Path) -> None:
    (tmp_path / "ours").symlink_to(ACME)
    words = [sys.executable, "-m", "drivebus", "--json", "sim", "--units", "2=./ours,3=gd350"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as child:
        assert child.stdout is not None
        port = json.loads(child.stdout.readline())["port"]
        with drivebus.Bus(port) as bus:
            assert bus.drive(2, profile=ACME).read("model") == 0x7007
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=100)
    assert child.returncode == 0


def test_the_command_says_what_a_folder_lacks() -> None:
    words = [sys.executable, "-m", "drivebus", "sim", "--units", f"1={PROFILES / 'bare'}"]
    refused = subprocess.run(words, capture_output=True, text=True, check=False, timeout=100)
    assert refused.returncode == 2
    assert "[setpoints.frequency]: no register that sets the frequency" in refused.stderr
