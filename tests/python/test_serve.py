"""`drivebus serve`: the file it takes, and a service over a real pseudo-terminal, ended in every way."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymodbus.client import ModbusSerialClient

from drivebus import Simulator
from drivebus.spool import Spool

from .conftest import NO_PTY
from .tcp_client import answer, free_port, request, seen

RUN, STOP, LOOK = b"\x06\x20\x00\x00\x01", b"\x06\x20\x00\x00\x05", b"\x03\x21\x03\x00\x01"

PLANT = """\
[lines.hall]
port = "{port}"
baud = 115200

[drives.pump1]
line = "hall"
unit = 1
profile = "gd350"

[drives.pump2]
line = "hall"
unit = 2

[drives.heater]
line = "hall"
unit = 3
profile = "gd3000-rectifier"

[groups]
pumps = ["pump1", "pump2"]

[share]
audit = "audit.jsonl"

[[share.tcp]]
address = "127.0.0.1:{tcp}"
dead_man = 60
answer_within = 20

[[share.tcp.allow]]
networks = ["127.0.0.0/8"]
drives = ["pump1"]
commands = ["run", "setpoint"]

[[share.tcp.allow]]

[[share.pty]]
path = "{folder}/plc"

[[share.pty.allow]]
drives = ["pump1"]
"""


def serve(file: Path, *words: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "drivebus", "--config", str(file), "serve", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload,no-any-return]


def file_of(folder: Path, port: object = "sim://gd350", tcp: int = 1502) -> Path:
    file = folder / "drivebus.toml"
    file.write_text(PLANT.format(port=port, tcp=tcp, folder=folder))
    return file


def test_a_file_without_mistakes(tmp_path: Path) -> None:
    done = serve(file_of(tmp_path), "--check")
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 line, 2 gateways: no mistake" in done.stdout


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ('commands = ["run", "setpoint"]', 'commands = ["rum"]', 33, 'did you mean "run"'),
        ('commands = ["run", "setpoint"]', 'write = ["P00.99"]', 33, "P00.99"),
        ('commands = ["run", "setpoint"]', 'write = ["control_command"]', 33, "takes commands"),
        ('commands = ["run", "setpoint"]', "functions = [6]", 33, "need what may be written"),
        ('commands = ["run", "setpoint"]', "functions = [23]", 33, "1 to 6, 15 and 16"),
        ('commands = ["run", "setpoint"]', 'command = ["run"]', 33, 'did you mean "commands"'),
        ("dead_man = 60\n", "", 25, '"pump1", and nothing says what becomes of it'),
        ("dead_man = 60", "dead_man = true", 27, 'neither "off" nor seconds'),
        ("answer_within = 20", "answer_within = 99", 28, "not a number from 0.05 to 60"),
        ('address = "127.0.0.1:1502"', 'address = "127.0.0.1"', 26, "not an address and a port"),
        ('address = "127.0.0.1:1502"', "", 25, "has no address"),
        ('["127.0.0.0/8"]', '["127.0.0.1/8"]', 31, "host bits set"),
        ('drives = ["pump1"]', 'drives = ["pump3"]', 32, 'there is no drive or group "pump3"'),
        ('drives = ["pump1"]', 'drives = ["pumps"]', 32, '"pump2" has no profile'),
        ('drives = ["pump1"]', 'drives = ["heater"]', 33, "no command or setpoint of"),
        ('drives = ["pump1"]', "units = [7]", 32, "knows no commands"),
        ('drives = ["pump1"]\n', "", 30, "drives that are named"),
        ("[[share.tcp.allow]]\n", "[share.tcp.allow]\n", 35, "not TOML"),
        ('audit = "audit.jsonl"', "audit = 3", 23, "not a text"),
        ('audit = "audit.jsonl"', 'audits = "a"', 23, 'did you mean "audit"'),
        ('path = "/', 'path = "', 38, 'not a path that begins with "/"'),
        ("[[share.pty.allow]]\n", '[[share.pty.allow]]\nnetworks = ["::1"]\n', 41, '"networks"'),
        ('address = "127', 'line = "yard"\naddress = "127', 26, 'there is no line "yard"'),
    ],
)
def test_a_mistake_is_named_with_its_line_and_nothing_starts(
    tmp_path: Path, old: str, new: str, line: int, said: str
) -> None:
    file = file_of(tmp_path)
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    for words in (["--check"], []):
        done = serve(file, *words)
        assert done.returncode == 2
        assert any(f"{file}:{line}: " in told and said in told for told in done.stderr.splitlines()), done.stderr
    assert not (tmp_path / "audit.jsonl").exists()


@contextmanager
def plant(folder: Path) -> Iterator[tuple[Simulator, Path, int, dict[str, str]]]:
    """A GD350 over a pseudo-terminal, ready to run at 50 Hz, and a file that serves it."""
    (folder / "run").mkdir(mode=0o700)
    environment = {**os.environ, "DRIVEBUS_RUNTIME_DIR": str(folder / "run")}
    tcp = free_port()
    with Simulator({1: "gd350"}, transport="pty", baudrate=115200) as simulator:
        file = file_of(folder, simulator.port, tcp)
        for words in (["prepare", "-y"], ["write", "set_frequency=50"]):
            done = command(file, environment, *words)
            assert done.returncode == 0, done.stderr
        simulator.drive(1).take_writes()
        yield simulator, file, tcp, environment


def command(file: Path, environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "drivebus", "--config", str(file), "-d", "pump1", *words]
    return subprocess.run(line, capture_output=True, text=True, check=False, env=environment)


@contextmanager
def service(file: Path, environment: dict[str, str], *words: str) -> Iterator[subprocess.Popen[str]]:
    line = [sys.executable, "-m", "drivebus", "--config", str(file), "serve", *words]
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=environment) as program:
        try:
            assert program.stderr is not None
            told = program.stderr.readline()
            assert "is served at 127.0.0.1:" in told, told + program.stderr.read()
            yield program
        finally:
            program.kill()


def ask(client: socket.socket, pdu: bytes) -> bytes:
    client.sendall(request(1, 1, pdu))
    return answer(client)[2]


@NO_PTY
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_its_end_halts_what_clients_set_in_motion(tmp_path: Path, number: int) -> None:
    with plant(tmp_path) as (simulator, file, tcp, environment):
        with (
            service(file, environment) as program,
            socket.create_connection(("127.0.0.1", tcp), timeout=20) as client,
        ):
            assert ask(client, RUN) == RUN
            program.send_signal(number)
            assert program.wait() == 0
            assert program.stderr is not None
            told_last = program.stderr.read()
            assert "is cut off as the gateway closes: the motor is halted" in told_last
            assert "unit 1 took the halt" in told_last
        seen(lambda: simulator.drive(1).state == "stopped")
        assert [write[1:] for write in simulator.drive(1).take_writes()] == [(0x2000, 1), (0x2000, 5)]
        assert not list((tmp_path / "run").glob("serve-*"))
        told = [json.loads(line) for line in (tmp_path / "audit.jsonl").read_text().splitlines()]
        assert [line.get("outcome") or line["halted"] for line in told] == ["done", "is cut off as the gateway closes"]


@NO_PTY
def test_killed_and_started_again(tmp_path: Path) -> None:
    """The next one halts the motor, and what was written stands in the audit."""
    with plant(tmp_path) as (simulator, file, tcp, environment):
        with (
            service(file, environment) as program,
            socket.create_connection(("127.0.0.1", tcp), timeout=20) as client,
        ):
            assert ask(client, RUN) == RUN
            seen(lambda: bool((tmp_path / "audit.jsonl").stat().st_size))
            program.kill()
            program.wait()
        assert [json.loads(line)["outcome"] for line in (tmp_path / "audit.jsonl").read_text().splitlines()] == ["done"]
        assert simulator.drive(1).state == "forward"
        with service(file, environment):
            seen(lambda: simulator.drive(1).state == "stopped")


@NO_PTY
def test_other_programs_use_the_line_through_it(tmp_path: Path) -> None:
    with (
        plant(tmp_path) as (simulator, file, tcp, environment),
        service(file, environment),
        socket.create_connection(("127.0.0.1", tcp), timeout=20) as client,
    ):
        assert ask(client, RUN) == RUN
        assert command(file, environment, "stop").returncode == 0
        seen(lambda: simulator.drive(1).state == "stopped")
        assert ask(client, LOOK) == b"\x03\x02\x01\xa0"


@NO_PTY
def test_its_status(tmp_path: Path) -> None:
    with plant(tmp_path) as (_, file, tcp, environment):
        nobody = serve(file, "--status", env=environment)
        assert nobody.returncode == 2
        assert "no service of" in nobody.stderr
        with service(file, environment), socket.create_connection(("127.0.0.1", tcp), timeout=20) as client:
            assert ask(client, LOOK) == b"\x03\x02\x01\xa0"

            def status() -> dict[str, object]:
                done = subprocess.run(
                    [sys.executable, "-m", "drivebus", "--json", "--config", str(file), "serve", "--status"],
                    capture_output=True,
                    text=True,
                    check=True,
                    env=environment,
                )
                return json.loads(done.stdout)["lines"]["hall"]["gateways"][f"127.0.0.1:{tcp}"]  # type: ignore[no-any-return]

            seen(lambda: status()["answered"] == 1)
            assert status()["clients"] == 1
            shown = serve(file, "--status", env=environment).stdout
            assert "1 client, 1 request: 1 answered" in shown
            assert f"client 127.0.0.1:{client.getsockname()[1]}, 1 request, 1 answered" in shown
            assert f"{file.parent}/plc, 0 clients, 0 requests" in shown
            assert re.search(r"hall: \S+, \d+% occupied, \d+ requests", shown)


POLLED = """
[[poll]]
drives = ["pump1"]
interval = 0.02
heartbeat = 1

[[poll]]
drives = ["pump1", "ghost"]
registers = ["running_frequency"]
interval = 0.5

[poll.band]
running_frequency = 20

[drives.ghost]
line = "hall"
unit = 9
profile = "gd350"

[spool]
"""


SPARSE = ("running_frequency", "status_word_1", "fault_code")
"""What the second poll asks: what it names, and what tells state and fault."""


@NO_PTY
def test_what_drives_say_waits_in_the_spool(tmp_path: Path) -> None:
    """Also while a client runs the motor; what is not new stays out, and a drive that is away is told."""
    with plant(tmp_path) as (_, file, tcp, environment):
        file.write_text(file.read_text() + POLLED)
        checked = serve(file, "--check", env=environment).stdout
        assert re.search(r"the spool holds \d+ hours of samples", checked)
        with (
            service(file, environment),
            socket.create_connection(("127.0.0.1", tcp), timeout=20) as client,
        ):
            # What it did before it was asked first is nothing new.
            seen(lambda: "pump1, asked" in serve(file, "--status", env=environment).stdout)
            assert ask(client, RUN) == RUN
            shown = ""

            def has_enough() -> bool:
                nonlocal shown
                shown = serve(file, "--status", env=environment).stdout
                samples = re.search(r"spool: (\d+) samples, 0 lost", shown)
                return samples is not None and int(samples[1]) > 60

            seen(has_enough)
            assert re.search(r"pump1, asked \d+\.\d s ago\n", shown)
            assert re.search(r"ghost, asked \d+\.\d s ago: unit 9, read", shown)
        with Spool(tmp_path / "drivebus-spool", 1 << 30, print) as spool:
            samples = spool.reader("test").after(0, 10_000)
        # A busy machine may answer a read too late: that sample holds its reason, and no values.
        monitor = [each for each in samples if len(each.layout.names) > len(SPARSE) and each.values]
        frequency = [each.values[0] for each in samples if each.layout.names == SPARSE and each.values]
        speed = monitor[0].layout.names.index("running_frequency")
        assert [each.values[speed] for each in monitor] == sorted(each.values[speed] for each in monitor)
        assert len({each.values[speed] for each in monitor}) > 20
        assert 1 <= len(frequency) <= 4
        gone = [each for each in samples if each.layout.drive == "ghost" and not each.layout.event]
        assert gone
        told = [(each.layout.drive, each.layout.event, each.missing) for each in samples if each.layout.event]
        assert told[0][:2] == ("hall", "open")
        assert {("ghost", "gone"), ("pump1", "state")} <= {each[:2] for each in told}
        assert next(text for subject, kind, text in told if kind == "state") == "stopped, now forward"
        assert all(each.missing.startswith("unit 9, read") and not each.values for each in gone)


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ('drives = ["pump1"]\ninterval', 'drives = ["pump7"]\ninterval', 2, 'there is no drive or group "pump7"'),
        ('drives = ["pump1"]\ninterval', 'drives = ["pumps"]\ninterval', 2, '"pump2" has no profile'),
        ("interval = 0.02", "interval = 0", 3, "not a number from 0.01"),
        ("heartbeat = 1", "beat = 1", 4, '"beat" is not known here'),
        ('["running_frequency"]', '["runing_frequency"]', 8, 'the closest is "running_frequency"'),
        ("running_frequency = 20", "output_current = 1", 11, "is not asked for output_current, which has a band"),
        ("running_frequency = 20", "running_frequency = -1", 11, "not a number from 0 to"),
        ("[spool]\n", "[spool]\nsize_mb = 1\n", 20, "not a whole number from 10"),
    ],
)
def test_a_mistake_in_a_poll(tmp_path: Path, old: str, new: str, line: int, said: str) -> None:
    file = file_of(tmp_path)
    before = file.read_text()
    assert old in POLLED
    file.write_text(before + POLLED.replace(old, new, 1))
    done = serve(file, "--check")
    assert done.returncode == 2
    at = before.count("\n") + 1 + line
    assert any(told.startswith(f"{file}:{at}: ") and said in told for told in done.stderr.splitlines()), done.stderr


@NO_PTY
def test_a_program_that_knows_serial_ports_alone(tmp_path: Path) -> None:
    with (
        plant(tmp_path) as (_, file, _, environment),
        service(file, environment),
        ModbusSerialClient(str(tmp_path / "plc"), timeout=20, retries=0) as master,
    ):
        assert master.read_holding_registers(0x2103, device_id=1).registers == [0x01A0]
        assert master.write_register(0x2000, 1, device_id=1).exception_code == 1


@NO_PTY
def test_a_line_that_is_away_is_waited_for_and_the_others_are_served(tmp_path: Path) -> None:
    with plant(tmp_path) as (simulator, file, tcp, environment):
        away = tmp_path / "port"
        text = file.read_text().replace(simulator.port, str(away))
        file.write_text(text)
        line = [sys.executable, "-m", "drivebus", "--config", str(file), "serve"]
        with subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=environment) as program:
            assert program.stderr is not None
            assert "tried again each second" in program.stderr.readline()
            away.symlink_to(simulator.port)
            assert "is served at" in program.stderr.readline()
            with socket.create_connection(("127.0.0.1", tcp), timeout=20) as client:
                assert ask(client, LOOK) == b"\x03\x02\x01\xa0"
            program.terminate()


@NO_PTY
def test_what_systemd_is_told(tmp_path: Path) -> None:
    """Ready when it serves, signs of life while the line goes on, and its end."""
    with plant(tmp_path) as (_, file, _, environment), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60)
        environment |= {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "400000"}
        environment.pop("WATCHDOG_PID", None)
        with service(file, environment) as program:
            assert manager.recv(100) == b"READY=1"
            assert [manager.recv(100) for _ in range(3)] == [b"WATCHDOG=1"] * 3
            program.terminate()
            program.wait()
        told = b"WATCHDOG=1"
        while told == b"WATCHDOG=1":
            told = manager.recv(100)
        assert told == b"STOPPING=1"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd")
def test_the_unit_of_the_manual(tmp_path: Path) -> None:
    """As it is printed, with a program that is here: systemd finds nothing wrong with it."""
    page = (Path(__file__).parents[2] / "docs" / "reference" / "service.md").read_text()
    unit = page.partition("```ini\n")[2].partition("```")[0]
    assert "/opt/drivebus/bin/drivebus" in unit
    place = tmp_path / "drivebus.service"
    place.write_text(unit.replace("/opt/drivebus/bin/drivebus", "/bin/true"))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(place)], capture_output=True, text=True, check=False
    )
    assert [line for line in done.stderr.splitlines() if "drivebus.service" in line] == []
    assert done.returncode == 0, done.stderr


def test_what_the_unit_of_the_manual_starts_again(tmp_path: Path) -> None:
    """However often, and not for a mistake in the file. systemd knows a kind of port once its module is loaded."""
    page = (Path(__file__).parents[2] / "docs" / "reference" / "service.md").read_text()
    unit = page.partition("```ini\n")[2].partition("```")[0].splitlines()
    assert "Restart=always" in unit
    assert "StartLimitIntervalSec=0" in unit[: unit.index("[Service]")]
    assert str(serve(tmp_path / "none.toml").returncode) in said(unit, "RestartPreventExitStatus")
    modules = {"char-ttyUSB": "modprobe@usbserial.service", "char-ttyACM": "modprobe@cdc_acm.service"}
    kinds = {line.split("=")[1].split()[0] for line in unit if line.startswith("DeviceAllow=")}
    for module in (modules[kind] for kind in kinds if kind in modules):
        assert module in said(unit, "After")
        assert module in said(unit, "Wants")


def said(unit: list[str], key: str) -> list[str]:
    return [word for line in unit if line.startswith(f"{key}=") for word in line.partition("=")[2].split()]


def test_the_file_of_the_manual(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "service.md").read_text()
    file = tmp_path / "drivebus.toml"
    file.write_text(page.partition("```toml\n")[2].partition("```")[0])
    done = serve(file, "--check")
    assert (done.returncode, done.stderr) == (0, "")
