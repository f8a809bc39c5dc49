"""Where CPython has no pseudo-terminals, Unix sockets, fork and SIGHUP, the rest works, and what does not says so."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import drivebus

_AS_ON_WINDOWS = Path(__file__).with_name("as_on_windows.py")
_COMMAND = "from drivebus.cli import main; import sys; sys.argv[0] = 'drivebus'; main()"


def words_of(code: str, *arguments: str) -> list[str]:
    return [sys.executable, str(_AS_ON_WINDOWS), code, *arguments]


def executed(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words_of(code, *arguments), capture_output=True, text=True, timeout=300)


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return executed(_COMMAND, *arguments)


def test_it_is_taken_away() -> None:
    code = "import os, socket, sys\nprint(sys.platform, hasattr(os, 'fork'), hasattr(socket, 'AF_UNIX'))\nimport pty"
    ended = executed(code)
    assert ended.stdout == "win32 False False\n"
    assert "ModuleNotFoundError" in ended.stderr


def test_every_module_loads() -> None:
    """Also those that a command loads only when it needs them, except where a library looks at the system."""
    code = (
        "import drivebus, importlib, pkgutil\n"
        "left_out = ('.panel', 'matplotlib', '.postgres_', '.mqtt_link', '.mqtt_client', '.sparkplug_session', "
        "'.web.', 'service.page', '__main__')\n"
        "for each in pkgutil.walk_packages(drivebus.__path__, 'drivebus.'):\n"
        "    if not any(name in each.name for name in left_out):\n"
        "        importlib.import_module(each.name)\n"
        "print('loaded')"
    )
    ended = executed(code)
    assert (ended.stdout, ended.stderr) == ("loaded\n", "")


def test_a_simulated_drive_does_its_whole_job() -> None:
    ended = run("demo")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "drivebus --port COM3 scan" in ended.stdout


def test_drives_are_simulated_over_tcp_and_take_no_orders() -> None:
    with subprocess.Popen(
        words_of(_COMMAND, "sim", "--transport", "tcp"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        try:
            port = child.stdout.readline().strip()
            assert port.startswith("socket://127.0.0.1:")
            with drivebus.Bus(port, share="never") as bus:
                assert bus.read(1, 0x2100, 1) == [3]
            assert "Unix socket" in child.stderr.readline()
        finally:
            child.kill()
        assert "sim ctl" not in child.stdout.read()


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["sim", "ctl", "trip", "1", "OL1"], 2, "Python has none on this system"),
        (["sniff"], 2, "drivebus sniff COM3"),
        (["panel"], 2, "the panel needs a terminal"),
        (["-p", "sim://gd350", "status"], 0, "stopped"),
    ],
)
def test_what_cannot_work_says_so(arguments: list[str], code: int, told: str) -> None:
    ended = run(*arguments)
    assert ended.returncode == code, ended.stderr
    assert told in ended.stdout + ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_capture_is_replayed_over_tcp() -> None:
    code = (
        "import drivebus\n"
        "from drivebus.sniffer import Exchange\n"
        "from drivebus.sniffer.replay import Replay\n"
        "def framed(body):\n"
        "    return body + drivebus.crc16(body).to_bytes(2, 'little')\n"
        "request, answer = framed(bytes.fromhex('010321000010')), framed(bytes.fromhex('010320' + 16 * '0539'))\n"
        "heard = Exchange(1, request, answer, time=0.0, gap=None, turnaround=0.004, error=None)\n"
        "with Replay([heard], drivebus.SerialFormat()) as units, drivebus.Bus(units.port, share='never') as bus:\n"
        "    print(units.port[:12], bus.read(1, 0x2100, 1))\n"
    )
    ended = executed(code)
    assert (ended.stdout, ended.stderr) == ("socket://127 [1337]\n", "")
