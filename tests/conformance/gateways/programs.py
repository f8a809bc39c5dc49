"""The gateways: where each is had, which version that is, what is set, and the process that serves a port with it.

`start_ours` is the one place that says how drivebus's own is started.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from ..child import ROOT

SPEED = 19_200
TIMEOUT = 0.5
"""Seconds that each gateway waits for an answer of the line: what drivebus takes, which has no option for it."""

WRITTEN = list(range(20_000, 20_100))
"""Registers that clients write."""

OUR_SETTINGS = """\
[lines.measured]
port = "{port}"
format = "8N1"
baud = {baudrate}
[[share.tcp]]
address = "{address}"
[[share.tcp.allow]]
[[share.tcp.allow]]
units = [1]
write = {written}
"""

STARTS = 30.0  # seconds until it listens, at most
HOST = "127.0.0.1"
RELAY = ROOT / ".tools/modbus-relay"
"""Where tools/modbus_relay.sh puts it."""

Words = Callable[[Path, str, int, Path], Sequence[str]]
"""The command that serves a port at HOST:PORT at a speed; the folder is for files of its own."""


class NotToBeHad(Exception):
    """This gateway is not on this machine."""


class DidNotStart(Exception):
    """This gateway is here, and does not listen."""


@dataclass(frozen=True)
class Gateway:
    """One gateway of the table."""

    title: str
    settings: str
    """How it is used, and what it does by default."""
    version: Callable[[], str]
    """Raises `NotToBeHad`."""
    words: Words

    @contextlib.contextmanager
    def before(self, port: Path, baudrate: int = SPEED) -> Iterator[str]:
        """Runs it before the line at *port*, and yields its HOST:PORT."""
        address = f"{HOST}:{free_port()}"
        with tempfile.TemporaryDirectory() as folder:
            # In a folder of its own: one writes logs to where it is.
            process = subprocess.Popen(
                self.words(port, address, baudrate, Path(folder)),
                cwd=folder,
                env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            try:
                _listens(process, address)
                yield address
            finally:
                process.kill()
                process.wait()


def start_ours(port: Path, address: str, baudrate: int, folder: Path) -> Sequence[str]:
    """The command that starts drivebus's gateway, which lets clients read, and write to some registers of unit 1."""
    file = folder / "drivebus.toml"
    values = {"port": port, "address": address, "baudrate": baudrate, "written": WRITTEN}
    file.write_text(OUR_SETTINGS.format(**values), encoding="utf-8")
    return [sys.executable, "-m", "drivebus", "--config", str(file), "serve"]


def _listens(process: subprocess.Popen[bytes], address: str) -> None:
    host, _, number = address.rpartition(":")
    until = time.monotonic() + STARTS
    while process.poll() is None and time.monotonic() < until:
        with contextlib.suppress(OSError), socket.create_connection((host, int(number)), timeout=1.0):
            return
        time.sleep(0.02)
    raise DidNotStart(f"it ended with {process.poll()}" if process.poll() is not None else f"not within {STARTS:.0f} s")


def free_port() -> int:
    with socket.create_server((HOST, 0)) as server:
        number: int = server.getsockname()[1]
    return number


def _installed(distribution: str, module: str) -> Callable[[], str]:
    def version() -> str:
        if importlib.util.find_spec(module) is None:
            raise NotToBeHad(f"{distribution} is not installed")
        return metadata.version(distribution)

    return version


def _ours() -> str:
    import drivebus

    return drivebus.__version__


# --- modbus-relay ------------------------------------------------------------------------------------------


def _relay() -> list[str]:
    """The program, beside what keeps its requests on a pseudo-terminal: flush_input.c says why."""
    program, beside = RELAY / "bin/modbus-relay", RELAY / "flush_input.so"
    if not (program.exists() and beside.exists()):
        raise NotToBeHad("tools/modbus_relay.sh could not build it")
    return ["env", f"LD_PRELOAD={beside}", str(program)]


def _relay_version() -> str:
    said = subprocess.run([*_relay(), "--version"], capture_output=True, text=True, timeout=10).stdout.split()
    return said[-1] if said else "?"


RELAY_SETTINGS = """\
tcp: {{bind_addr: "{host}", bind_port: {number}, keep_alive: "60s"}}
rtu:
  device: "{port}"
  baud_rate: {baudrate}
  data_bits: 8
  parity: "none"
  stop_bits: "one"
  flush_after_write: true
  rts_type: "none"
  rts_delay_us: 0
  transaction_timeout: "5s"
  serial_timeout: "{milliseconds}ms"
  max_frame_size: 256
http: {{enabled: false, bind_addr: "{host}", bind_port: {number}, metrics_enabled: false}}
logging:
  log_dir: "logs"
  trace_frames: false
  level: "info"
  format: "pretty"
  include_location: false
  thread_ids: false
  thread_names: true
connection:
  max_connections: 100
  idle_timeout: "60s"
  error_timeout: "300s"
  connect_timeout: "5s"
  per_ip_limits: 10
  backoff: {{initial_interval: "100ms", max_interval: "30s", multiplier: 2.0, max_retries: 5}}
"""


def _start_relay(port: Path, address: str, baudrate: int, folder: Path) -> Sequence[str]:
    host, _, number = address.rpartition(":")
    file = folder / "settings.yaml"
    values = {"port": port, "host": host, "number": number, "baudrate": baudrate}
    file.write_text(RELAY_SETTINGS.format(milliseconds=round(TIMEOUT * 1e3), **values), encoding="utf-8")
    return [*_relay(), "--config", str(file)]


# --- those in Python ---------------------------------------------------------------------------------------


def _start_mbtcp(port: Path, address: str, baudrate: int, _folder: Path) -> Sequence[str]:
    host, _, number = address.rpartition(":")
    there = ["--host", host, "--port", number, "--baudrate", str(baudrate), "--timeout", str(TIMEOUT)]
    return [sys.executable, "-m", "pyModbusTCP.tools", "tcp2rtu", *there, str(port)]


def _start_forwarder(port: Path, address: str, baudrate: int, _folder: Path) -> Sequence[str]:
    module = f"{__package__}.forwarder"
    return [sys.executable, "-m", module, str(port), address, str(baudrate), str(TIMEOUT)]


OURS = Gateway(
    "drivebus",
    "`drivebus serve` with `[[share.tcp]]`: all may read, and write to 100 registers; a read is repeated twice after "
    "silence; an answer goes out within 1 s",
    _ours,
    start_ours,
)

GATEWAYS: Sequence[Gateway] = (
    OURS,
    Gateway(
        "modbus-relay",
        f"`modbus-relay --config FILE`, `serial_timeout` {round(TIMEOUT * 1e3)} ms, which it waits for three times; it "
        "repeats nothing; `flush_input.c` keeps its requests on a pseudo-terminal",
        _relay_version,
        _start_relay,
    ),
    Gateway(
        "pyModbusTCP-cli",
        f"`mbtcp-tcp2rtu --timeout {TIMEOUT}`; it repeats nothing; at most two requests of a host wait",
        _installed("pyModbusTCP-cli", "pyModbusTCP"),
        _start_mbtcp,
    ),
    Gateway(
        "pymodbus",
        "`ModbusTcpServer` before `AsyncModbusSerialClient`, as in `tests/conformance/gateways/forwarder.py`; it "
        "repeats every request three times",
        _installed("pymodbus", "pymodbus"),
        _start_forwarder,
    ),
)
