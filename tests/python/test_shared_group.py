"""A port that a service serves to the users of a group: programs of real users, over a real pseudo-terminal."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import Simulator

from .tcp_client import seen

SERVICE, TECHNICIAN, STRANGER = 61001, 61002, 61003
"""Users that no system has."""
if sys.platform == "win32":
    GROUP, GROUP_NAME = 0, ""
else:
    import grp

    GROUP, GROUP_NAME = next((each.gr_gid, each.gr_name) for each in grp.getgrall() if each.gr_gid)

RUN, STOP = (0x2000, 1), (0x2000, 5)

needs_users = pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() != 0 or shutil.which("setpriv") is None,
    reason="only root can be other users",
)


def words_as(user: int, *groups: int) -> list[str]:
    """What a command begins with that runs as *user*. It may read what this one can: its Python may be anywhere."""
    who = [
        f"--reuid={user}",
        f"--regid={user}",
        f"--groups={','.join(map(str, groups))}" if groups else "--clear-groups",
    ]
    return ["setpriv", *who, "--inh-caps=-all,+dac_read_search", "--ambient-caps=+dac_read_search"]


SERVE = """
import sys, drivebus
with drivebus.Bus(sys.argv[1], baudrate=115200, group=int(sys.argv[2])) as bus:
    for note in bus.stats().notes:
        if "cannot use" in note:
            raise SystemExit(note)
    print("serves", flush=True)
    sys.stdin.read()
    print([(each["name"], each["here"]) for each in bus.stats().programs], bus.stats().wills, flush=True)
"""


class Plant:
    """A GD350 at a port of the service's user, ready to run, and the folder in which programs meet."""

    def __init__(self, stack: ExitStack) -> None:
        self.place = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="drivebus-group-")))
        self.place.chmod(0o755)
        (self.place / "run").mkdir()
        os.chown(self.place / "run", SERVICE, SERVICE)
        self.machine = self.place / "run" / "drivebus"
        self.simulator = stack.enter_context(Simulator({1: "gd350"}, transport="pty", baudrate=115200))
        with drivebus.Bus(self.simulator.port, baudrate=115200, share="never") as bus:
            drive = bus.drive(1, "gd350")
            drive.prepare_control()
            drive.write_setpoint(50.0)
        self.simulator.drive(1).take_writes()
        os.chown(self.simulator.port, SERVICE, SERVICE)
        Path(self.simulator.port).chmod(0o600)

    def start(self, user: int, groups: tuple[int, ...], *words: str) -> subprocess.Popen[str]:
        home = self.place / str(user)
        home.mkdir(exist_ok=True)
        os.chown(home, user, user)
        environment = {
            **os.environ,
            "HOME": str(home),
            "DRIVEBUS_MACHINE_DIR": str(self.machine),
            "XDG_STATE_HOME": str(home),
        }
        environment.pop("DRIVEBUS_RUNTIME_DIR", None)
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        line = [*words_as(user, *groups), sys.executable, *words]
        return subprocess.Popen(line, text=True, env=environment, **pipes)  # type: ignore[call-overload,no-any-return]

    @contextmanager
    def service(self) -> Iterator[subprocess.Popen[str]]:
        with self.start(SERVICE, (GROUP,), "-c", SERVE, self.simulator.port, str(GROUP)) as program:
            try:
                assert program.stdout is not None
                assert program.stderr is not None
                said = program.stdout.readline()
                assert said == "serves\n", said + program.stderr.read()
                yield program
            finally:
                program.kill()

    def command(self, user: int, groups: tuple[int, ...], *words: str) -> tuple[int, str]:
        line = ["-m", "drivebus", "--port", self.simulator.port, "--baud", "115200", "--profile", "gd350", *words]
        with self.start(user, groups, *line) as program:
            _, said = program.communicate()
            return program.returncode, said

    def written(self) -> list[tuple[int, int]]:
        return [write[1:] for write in self.simulator.drive(1).take_writes()]


@pytest.fixture
def plant() -> Iterator[Plant]:
    with ExitStack() as stack:
        yield Plant(stack)


@needs_users
def test_a_technician_of_the_group_stops_a_motor_through_the_service(plant: Plant) -> None:
    with plant.service() as service:
        status = plant.machine.stat()
        assert (status.st_uid, status.st_gid, stat.S_IMODE(status.st_mode)) == (SERVICE, GROUP, 0o3771)
        assert plant.command(SERVICE, (GROUP,), "run", "10", "-y")[0] == 0
        assert RUN in plant.written()
        code, said = plant.command(TECHNICIAN, (GROUP,), "stop")
        assert code == 0, said
        assert plant.written()[0] == STOP
        out, _ = service.communicate()
    assert f"of {TECHNICIAN}" in out


@needs_users
def test_one_outside_the_group_gets_words_and_nothing_goes_out(plant: Plant) -> None:
    with plant.service():
        before = plant.simulator.line.requests
        code, said = plant.command(STRANGER, (), "stop")
        assert code == 5, said
        assert f"served to the users of the group {GROUP_NAME}, and this one is not among them" in said
        assert plant.simulator.line.requests == before


HOLD = """
import sys, drivebus
with drivebus.Bus(sys.argv[1], baudrate=115200) as bus, bus.drive(1, "gd350").running(30):
    print("runs", flush=True)
    sys.stdin.read()
"""


@needs_users
def test_a_program_of_the_group_that_is_killed_has_its_motor_halted_by_the_service(plant: Plant) -> None:
    with plant.service():
        with plant.start(TECHNICIAN, (GROUP,), "-c", HOLD, plant.simulator.port) as program:
            assert program.stdout is not None
            assert program.stderr is not None
            said = program.stdout.readline()
            assert said == "runs\n", program.stderr.read()
            [paper] = plant.machine.glob("*.will")
            status = paper.stat()
            assert (status.st_uid, status.st_gid, stat.S_IMODE(status.st_mode)) == (TECHNICIAN, GROUP, 0o660)
            program.send_signal(signal.SIGKILL)
            program.wait()
        seen(lambda: plant.simulator.drive(1).state == "stopped")
        assert STOP in plant.written()
        seen(lambda: not list(plant.machine.glob("*.will")))


@needs_users
def test_where_the_service_is_killed_the_next_one_halts_what_a_program_of_the_group_ran(plant: Plant) -> None:
    with plant.service() as service, plant.start(TECHNICIAN, (GROUP,), "-c", HOLD, plant.simulator.port) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "runs\n"
        service.send_signal(signal.SIGKILL)
        service.wait()
        program.send_signal(signal.SIGKILL)
        program.wait()
    with plant.service():
        seen(lambda: plant.simulator.drive(1).state == "stopped")


@needs_users
def test_nobody_of_the_group_has_the_service_touch_what_is_elsewhere(plant: Plant) -> None:
    """Wills and a lock that lead to a file of the service's, by both kinds of links, and one that waits."""
    with plant.service():
        [lock] = plant.machine.glob("*.lock")
    precious = plant.place / "run" / "precious"
    precious.write_text("do not touch")
    os.chown(precious, SERVICE, SERVICE)
    lock.unlink()
    lock.symlink_to(plant.place / "run" / "made")
    (plant.machine / f"{lock.stem}.1-1-0.will").symlink_to(precious)
    (plant.machine / f"{lock.stem}.1-1-1.will").hardlink_to(precious)
    os.mkfifo(plant.machine / f"{lock.stem}.1-1-2.will", 0o660)
    os.chown(plant.machine / f"{lock.stem}.1-1-2.will", TECHNICIAN, GROUP)
    with plant.service():
        assert plant.command(TECHNICIAN, (GROUP,), "stop")[0] == 0
    assert precious.read_text() == "do not touch"
    assert not (plant.place / "run" / "made").exists()


@needs_users
def test_a_folder_of_somebody_else_is_not_served_in_nor_asked(plant: Plant) -> None:
    plant.machine.mkdir()
    plant.machine.chmod(0o3771)
    os.chown(plant.machine, STRANGER, GROUP)
    with plant.start(SERVICE, (GROUP,), "-c", SERVE, plant.simulator.port, str(GROUP)) as service:
        _, said = service.communicate("")
    assert service.returncode == 1
    assert "is not a folder of this user's" in said


@needs_users
def test_a_socket_of_somebody_else_in_the_folder_is_not_asked(plant: Plant) -> None:
    """The technician's program does not obey a door that another member of the group put there."""
    with plant.service():
        [socket] = plant.machine.glob("*.sock")
    # The service is killed, and its door stands: nobody of the group can put it away.
    line = [*words_as(STRANGER, GROUP), "rm", "-f", str(socket)]
    assert subprocess.run(line, check=False, capture_output=True).returncode == 1
    socket.unlink()
    listen = f"""
import os, socket, sys
door = socket.socket(socket.AF_UNIX)
door.bind({str(socket)!r})
os.chmod({str(socket)!r}, 0o666)
door.listen()
print("listens", flush=True)
print(door.accept()[0].recv(100), flush=True)
sys.stdin.read()
"""
    with plant.start(STRANGER, (GROUP,), "-c", listen) as rogue:
        assert rogue.stdout is not None
        assert rogue.stdout.readline() == "listens\n"
        code, said = plant.command(TECHNICIAN, (GROUP,), "stop")
        assert code == 5
        assert "is not of the user whose folder that is" in said or "ermission" in said
        assert rogue.stdout.readline() == "b''\n"
        rogue.kill()


@pytest.mark.skipif(sys.platform == "win32", reason="told otherwise there")
@pytest.mark.parametrize("group", ["no such group here", -1, 2**40, b"x"])
def test_a_group_that_is_none_is_told_before_anything_is_opened(group: object) -> None:
    with pytest.raises(drivebus.BadArgument, match="is none of this system"):
        drivebus.Bus("/dev/nowhere", group=group)  # type: ignore[arg-type]


@needs_users
def test_a_service_goes_through_a_program_of_its_own_user_that_has_the_port(plant: Plant) -> None:
    """A serial server does not say that it is taken: two masters would talk at once."""
    with plant.start(
        SERVICE, (GROUP,), "-c", SERVE.replace(", group=int(sys.argv[2])", ""), plant.simulator.port
    ) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "serves\n"
        with plant.service():
            out, _ = first.communicate()
    assert "python" in out
