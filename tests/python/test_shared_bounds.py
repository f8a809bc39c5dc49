"""Several programs on one port, where one of them hangs, floods, does not read, or names the port otherwise.

Real processes, and a slave that keeps its own motor. Nothing waits without an end, and each wait ends with a word.
"""

from __future__ import annotations

import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, PortError

from .own_motor import OwnMotor, own_motor
from .test_forked_owner import command, program

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes as Linux has them")


@pytest.fixture
def motor() -> Iterator[OwnMotor]:
    with own_motor() as slave:
        yield slave


@pytest.fixture
def server() -> Iterator[OwnMotor]:
    with own_motor("tcp", "127.0.0.1") as slave:
        yield slave


RUNS = """
import signal
bus.drive(1, "gd350").run(hz=10.0)
print("running", flush=True)
signal.pause()
"""
HOLDS_THE_LINE = """
import logging, threading

class Hangs(logging.Handler):
    def emit(self, record):
        print("hangs", flush=True)
        threading.Event().wait()

logging.getLogger().addHandler(Hangs())
logging.getLogger().setLevel(logging.DEBUG)
bus.trace()
bus.read(1, 0x2103)
"""


def hold(process: subprocess.Popen[str]) -> None:
    """Stops it, as Ctrl-Z does; comes back when it stands."""
    process.send_signal(signal.SIGSTOP)
    os.waitpid(process.pid, os.WUNTRACED)


@pytest.mark.usefixtures("folder")
class TestAnOwnerThatSaysNothing:
    @pytest.mark.parametrize("what", ["read", "write", "stop"])
    def test_each_call_ends_and_names_it(self, motor: OwnMotor, what: str) -> None:
        calls = {
            "read": lambda bus: bus.read(1, 0x2103),
            "write": lambda bus: bus.write(1, 0x0400, 7),
            "stop": lambda bus: bus.drive(1, "gd350").stop(),
        }
        with program(RUNS, motor.port) as owner:
            assert owner.says() == "running"
            with Bus(motor.port, parity="N", timeout=0.3) as bus:
                bus.read(1, 0x2103)
                hold(owner.process)
                with pytest.raises(drivebus.DrivebusError, match=rf"process {owner.process.pid}\)"):
                    calls[what](bus)
                owner.process.send_signal(signal.SIGCONT)
                assert bus.read(1, 0x2103) == [0x01A0]

    def test_the_command_ends_too(self, motor: OwnMotor) -> None:
        with program(RUNS, motor.port) as owner:
            assert owner.says() == "running"
            hold(owner.process)
            done = command(motor.port, "--profile", "gd350", "stop")
            assert done.returncode != 0
            assert f"process {owner.process.pid}" in done.stderr

    def test_a_thread_that_holds_the_line_is_told_of(self, motor: OwnMotor) -> None:
        """The program lives and says so; the line in it does not go on."""
        with program(HOLDS_THE_LINE, motor.port) as owner:
            assert owner.says() == "hangs"
            with Bus(motor.port, parity="N", timeout=0.3) as bus, pytest.raises(PortError, match="does not go on"):
                bus.read(1, 0x2103)

    def test_a_long_wait_for_a_turn_is_no_silence(self, motor: OwnMotor) -> None:
        """A guest waits as long as the others' time-outs are, and longer than it would for one that says nothing."""
        asks = 'print("asks", flush=True)\ntry:\n    bus.read(9, 0x2100)\nexcept drivebus.NoAnswer:\n    pass\n'
        with program(asks, motor.port, timeout=2.5) as owner:
            assert owner.says() == "asks"
            motor.until(lambda event: event.get("unit") == 9)
            with Bus(motor.port, parity="N", timeout=0.3) as bus:
                assert bus.read(1, 0x2103) == [0x01A0]

    def test_who_listens_and_is_no_program_of_ours_is_told_of(self, folder: Path, server: OwnMotor) -> None:
        with Bus(server.port, parity="N") as bus:
            bus.read(1, 0x2103)
            [path] = folder.glob("*.sock")
        with socket.socket(socket.AF_UNIX) as foreign:
            foreign.bind(str(path))
            foreign.listen()
            with pytest.raises(PortError, match="said nothing"):
                Bus(server.port, parity="N")


class TestOneMeetingPlace:
    @pytest.mark.parametrize("owner_has_it", [True, False])
    def test_whatever_the_environment(
        self, motor: OwnMotor, monkeypatch: pytest.MonkeyPatch, owner_has_it: bool, tmp_path: Path
    ) -> None:
        def set_it(is_set: bool) -> None:
            monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
            if is_set:
                monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

        monkeypatch.delenv("DRIVEBUS_RUNTIME_DIR", raising=False)
        set_it(owner_has_it)
        with program(RUNS, motor.port) as owner:
            assert owner.says() == "running"
            set_it(not owner_has_it)
            before = len(motor.events)
            done = command(motor.port, "--profile", "gd350", "stop")
            assert done.returncode == 0, done.stderr
            motor.is_halted(since=before)

    @pytest.mark.skipif(os.geteuid() != 0, reason="only root may make such places")
    @pytest.mark.parametrize("walls", [["--pid", "--fork", "--mount-proc"], ["--mount"]], ids=["processes", "/tmp"])
    def test_from_a_place_of_its_own(self, motor: OwnMotor, monkeypatch: pytest.MonkeyPatch, walls: list[str]) -> None:
        """As a container has: processes of its own; or as a service has: a `/tmp` of its own."""
        monkeypatch.delenv("DRIVEBUS_RUNTIME_DIR", raising=False)
        inside = [
            sys.executable,
            "-m",
            "drivebus",
            "--port",
            motor.port,
            "--format",
            "8N1",
            "--profile",
            "gd350",
            "stop",
        ]
        if "--mount" in walls:
            inside = ["sh", "-c", 'mount -t tmpfs none /tmp && exec "$@"', "sh", *inside]
        if subprocess.run(["unshare", *walls, "true"], capture_output=True, check=False).returncode:
            pytest.skip("this machine makes no such places")
        with program(RUNS, motor.port) as owner:
            assert owner.says() == "running"
            before = len(motor.events)
            done = subprocess.run(["unshare", *walls, *inside], capture_output=True, text=True, timeout=60, check=False)
            assert done.returncode == 0, done.stderr
            motor.is_halted(since=before)


@pytest.mark.usefixtures("folder")
def test_a_server_is_one_under_all_its_names(server: OwnMotor) -> None:
    """Every register holds its address: a wrong value shows itself."""
    port = server.port.rpartition(":")[2]
    with Bus(server.port, parity="N") as first, Bus(f"socket://localhost:{port}", parity="N") as second:
        for _ in range(50):
            assert first.read(1, 0x0456) == [0x0456]
            assert second.read(1, 0x0457) == [0x0457]
        assert any("has the port" in note for note in second.stats()["notes"])
    assert max(event["clients"] for event in server.events if "clients" in event) == 1


GREETING = b"drivebus share \x09\x04test\x80\x96\x01\x08N\x01\x00"
"""postcard: a string with its length, 19200 in sevens of bits, three bytes, and that it is for no stop."""


def come_in(path: Path) -> tuple[socket.socket, bytes]:
    guest = socket.socket(socket.AF_UNIX)
    guest.connect(str(path))
    guest.sendall(struct.pack("<I", len(GREETING)) + GREETING)
    head = guest.recv(4, socket.MSG_WAITALL)
    return guest, guest.recv(struct.unpack("<I", head)[0], socket.MSG_WAITALL)


FLOODS = """
import os, signal, sys
from pathlib import Path
from tests.python.test_shared_bounds import come_in
held = [come_in(Path(sys.argv[3])) for _ in range(128)]
print(sum(answer[0] == 0 for _, answer in held), flush=True)
signal.pause()
"""


def test_a_flood_of_connections_sends_no_first_call_and_no_stop_away(folder: Path, motor: OwnMotor) -> None:
    with program(RUNS, motor.port) as owner:
        assert owner.says() == "running"
        [path] = folder.glob("*.sock")
        floods = [
            subprocess.Popen(
                [sys.executable, "-c", FLOODS, "-", "-", str(path)],
                stdout=subprocess.PIPE,
                text=True,
                cwd=Path(__file__).parents[2],
            )
            for _ in range(5)
        ]
        try:
            let_in = [int(flood.stdout.readline()) for flood in floods if flood.stdout]
            assert 500 <= sum(let_in) < 640
            with Bus(motor.port, parity="N", timeout=0.3) as bus:
                assert bus.read(1, 0x2103) == [0x01A0]
            before = len(motor.events)
            done = command(motor.port, "--profile", "gd350", "stop")
            assert done.returncode == 0, done.stderr
            motor.is_halted(since=before)
        finally:
            for flood in floods:
                flood.kill()
                flood.communicate()


LISTENS = """
def hear(at, sent, data):
    if data:
        print("hears", flush=True)
    return b"\\x03\\x04\\x56" in data

bus._core().overhear(hear)
print(*bus.stats()["notes"], sep=" | ", flush=True)
"""


@pytest.mark.usefixtures("folder")
def test_who_listens_and_does_not_read_holds_up_nobody(motor: OwnMotor) -> None:
    """What it missed is counted and told; nobody waited for it, since all of it would have come otherwise."""
    with Bus(motor.port, parity="N", timeout=3.0) as bus, program(LISTENS, motor.port) as guest:
        drive = bus.drive(1, "gd350")
        drive.run(hz=10.0)
        while not guest.has_said_more():
            bus.read(1, 0x2103)
        assert guest.says() == "hears"
        hold(guest.process)
        # Far more than the system keeps for it.
        for _ in range(3_000):
            bus.read(1, 0x2103)
        before = len(motor.events)
        drive.stop()
        motor.is_halted(since=before)
        guest.process.send_signal(signal.SIGCONT)
        said = "hears"
        while said == "hears":
            bus.read(1, 0x0456)
            while guest.has_said_more() and said == "hears":
                said = guest.says()
    assert "pieces of what went over the line were not heard" in said
