"""Other people's clients at a gateway: mbpoll, and in it libmodbus, by Modbus TCP and at a pseudo-terminal.

Expected words come from the drive's manual: state word 3 = stopped, identification 01A0H.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

from drivebus import Bus, Gateway, Simulator

STATE, COMMAND = 0x2100, 0x2000


def test_mbpoll_reads_and_may_not_write(mbpoll: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        Bus(simulator) as bus,
        Gateway(bus, "127.0.0.1:0") as gateway,
    ):
        host, port = gateway.address.rsplit(":", 1)
        known = ["-m", "tcp", "-p", port, "-a", 1, "-0", "-t", "4", "-1", "-o", 10]
        done = mbpoll(*known, "-r", STATE, "-c", 4, host)
        assert done.returncode == 0, done.stdout + done.stderr
        words = [int(word) for word in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]
        assert (words[0], words[2], words[3]) == (3, 0, 0x01A0)
        assert "Illegal function" in mbpoll(*known, "-r", COMMAND, host, 1).stderr
        assert simulator.drive(1).words_written == 0
        assert gateway.stats.refused == 1


def test_mbpoll_takes_a_pseudo_terminal_for_the_line(
    mbpoll: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    link = tmp_path / "plc"
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as simulator,
        Bus(simulator) as bus,
        Gateway(bus, link) as gateway,
    ):
        known = ["-m", "rtu", "-b", 19200, "-P", "none", "-0", "-t", "4", "-1", "-o", 10]
        for _ in range(5):
            done = mbpoll(*known, "-a", 1, "-r", STATE, "-c", 4, link)
            assert done.returncode == 0, done.stdout + done.stderr
            words = [int(word) for word in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]
            assert (words[0], words[2], words[3]) == (3, 0, 0x01A0)
        assert "Illegal function" in mbpoll(*known, "-a", 2, "-r", COMMAND, link, 1).stderr
        assert simulator.drive(2).words_written == 0
        assert (gateway.stats.let_in, gateway.stats.cut_off) == (6, 0)
