"""The masters that are measured on one line: drivebus and its peers from Python, and two from C.

Each opens the port as its own documentation does, at 8N2 and with its own defaults, and reads holding registers again
and again. (8N2 has 11 bits a character as 8E1 has; a pseudo-terminal drops parity, and most then refuse to open it.)
Those from Python live in a process each (`python -m benches.python.masters NAME`), so that the processor time
is theirs alone; it takes orders as JSON lines and answers in kind.
"""

from __future__ import annotations

import asyncio
import ctypes.util
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Sequence
from importlib import metadata
from typing import Any, NamedTuple

from benches.python import programs

UNIT, ADDRESS = 1, 0x3000


class Order(NamedTuple):
    """What to do: on which line, how, and how long."""

    port: str
    baudrate: int
    paced: bool
    """Whether the line keeps the pace of the wire; if not, the silence is left out where that can be chosen."""
    character: float
    """Seconds of one character, 0 on a line that does not keep the pace."""
    silence: float
    words: int
    warm: int
    cycles: int
    limit: float
    """Seconds after which no further read begins."""


class Outcome(NamedTuple):
    """What came of it, in seconds."""

    cycles: int
    seconds: float
    median: float
    """Of the time from one call to the next."""
    cpu: float
    """Processor time of the whole process, user and system."""


Read = Callable[[], Sequence[int]]


def timed(read: Read, order: Order) -> Outcome:
    """Calls *read* in a tight loop."""
    for _ in range(order.warm):
        read()
    took: list[float] = []
    cpu = time.process_time()
    before = start = time.perf_counter()
    while len(took) < order.cycles and before - start < order.limit:
        read()
        after = time.perf_counter()
        took.append(after - before)
        before = after
    cpu = time.process_time() - cpu
    return Outcome(len(took), before - start, statistics.median(took), cpu)


async def timed_async(read: Callable[[], Awaitable[Sequence[int]]], order: Order) -> Outcome:
    """As `timed`, in a running event loop."""
    for _ in range(order.warm):
        await read()
    took: list[float] = []
    cpu = time.process_time()
    before = start = time.perf_counter()
    while len(took) < order.cycles and before - start < order.limit:
        await read()
        after = time.perf_counter()
        took.append(after - before)
        before = after
    cpu = time.process_time() - cpu
    return Outcome(len(took), before - start, statistics.median(took), cpu)


def checked(read: Read, order: Order) -> Read:
    """*read*, after it has once brought what was asked for."""
    words = list(read())
    assert len(words) == order.words, words
    return read


def drivebus(order: Order) -> Outcome:
    import drivebus

    silence = "spec" if order.paced else 0.0
    with drivebus.Bus(order.port, baudrate=order.baudrate, parity="N", stopbits=2, silence=silence) as bus:
        return timed(checked(lambda: bus.read(UNIT, ADDRESS, order.words), order), order)


def minimalmodbus(order: Order) -> Outcome:
    import minimalmodbus

    instrument = minimalmodbus.Instrument(order.port, UNIT)
    instrument.serial.baudrate = order.baudrate
    instrument.serial.stopbits = 2
    instrument.serial.timeout = 0.5
    return timed(checked(lambda: instrument.read_registers(ADDRESS, order.words), order), order)


def modbus_tk(order: Order) -> Outcome:
    import serial
    from modbus_tk import defines, modbus_rtu

    master = modbus_rtu.RtuMaster(serial.Serial(order.port, baudrate=order.baudrate, parity="N", stopbits=2))
    master.set_timeout(0.5)
    master.open()
    try:
        return timed(
            checked(lambda: master.execute(UNIT, defines.READ_HOLDING_REGISTERS, ADDRESS, order.words), order), order
        )
    finally:
        master.close()


def umodbus(order: Order) -> Outcome:
    import serial
    from umodbus.client.serial import rtu

    with serial.Serial(order.port, baudrate=order.baudrate, parity="N", stopbits=2, timeout=0.5) as port:

        def read() -> Sequence[int]:
            words: Sequence[int] = rtu.send_message(rtu.read_holding_registers(UNIT, ADDRESS, order.words), port)
            return words

        return timed(checked(read, order), order)


def pymodbus(order: Order) -> Outcome:
    from pymodbus.client import ModbusSerialClient

    client = ModbusSerialClient(order.port, baudrate=order.baudrate, parity="N", stopbits=2, timeout=0.5)
    assert client.connect()
    try:
        return timed(
            checked(lambda: client.read_holding_registers(ADDRESS, count=order.words, device_id=UNIT).registers, order),
            order,
        )
    finally:
        client.close()  # type: ignore[no-untyped-call]


def pymodbus_async(order: Order) -> Outcome:
    from pymodbus.client import AsyncModbusSerialClient

    async def run() -> Outcome:
        client = AsyncModbusSerialClient(order.port, baudrate=order.baudrate, parity="N", stopbits=2, timeout=0.5)
        assert await client.connect()

        async def read() -> Sequence[int]:
            answer = await client.read_holding_registers(ADDRESS, count=order.words, device_id=UNIT)
            return answer.registers

        assert len(await read()) == order.words
        try:
            return await timed_async(read, order)
        finally:
            client.close()

    return asyncio.run(run())


def tmodbus(order: Order) -> Outcome:
    import serialx  # noqa: F401 - tmodbus imports it while it opens a port, and would count that against its time-out
    from tmodbus import create_async_rtu_client

    async def run() -> Outcome:
        client = create_async_rtu_client(
            order.port, unit_id=UNIT, timeout=0.5, baudrate=order.baudrate, parity="N", stopbits=2
        )
        await client.connect()

        async def read() -> Sequence[int]:
            words: Sequence[int] = await client.read_holding_registers(ADDRESS, order.words)
            return words

        assert len(await read()) == order.words
        try:
            return await timed_async(read, order)
        finally:
            await client.disconnect()

    return asyncio.run(run())


def pylibmodbus(order: Order) -> Outcome:
    library = programs.libmodbus()
    if library is None:
        raise ImportError("libmodbus.so.5 is missing: `make interop-parts`")
    ctypes.util.find_library = lambda name: library if name == "modbus" else None  # it looks for a development file
    from pylibmodbus import ModbusRtu

    master = ModbusRtu(order.port.encode(), order.baudrate, b"N", 8, 2)
    master.connect()
    master.set_slave(UNIT)
    try:
        return timed(checked(lambda: master.read_registers(ADDRESS, order.words), order), order)
    finally:
        master.close()


class FromPython(NamedTuple):
    """How a library is called, and what pip calls it."""

    run: Callable[[Order], Outcome]
    distribution: str


PYTHON = {
    "drivebus": FromPython(drivebus, "drivebus"),
    "minimalmodbus": FromPython(minimalmodbus, "minimalmodbus"),
    "pylibmodbus": FromPython(pylibmodbus, "pylibmodbus"),
    "modbus-tk": FromPython(modbus_tk, "modbus-tk"),
    "uModbus": FromPython(umodbus, "uModbus"),
    "tmodbus": FromPython(tmodbus, "tmodbus"),
    "pymodbus": FromPython(pymodbus, "pymodbus"),
    "pymodbus-async": FromPython(pymodbus_async, "pymodbus"),
}
NAMES = ["c", "drivebus", "libmodbus", *[name for name in PYTHON if name != "drivebus"]]


class Absent(Exception):
    """A master is not installed here."""


class Worker:
    """A master in its own process. `absent` says why it cannot take part."""

    def __init__(self, name: str) -> None:
        self._process: subprocess.Popen[str] | None = None
        if name in PYTHON:
            try:
                self.version = metadata.version(PYTHON[name].distribution)
            except metadata.PackageNotFoundError:
                raise Absent(f"{name} is not installed") from None
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        elif name == "libmodbus" and programs.libmodbus() is None:
            raise Absent("libmodbus.so.5 is missing: `make interop-parts`")
        self.name = name

    def run(self, order: Order) -> Outcome:
        """Carries out *order*."""
        if self._process is None:
            done = subprocess.run(self._command(order), stdout=subprocess.PIPE, text=True, check=True)
            return Outcome(**json.loads(done.stdout))
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order._asdict()) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.name} ended with {self._process.wait()}")
        return Outcome(**json.loads(line))

    def _command(self, order: Order) -> list[str]:
        limits: list[object] = [ADDRESS, order.words, order.warm, order.cycles, max(1, round(order.limit))]
        how: list[object]
        if self.name == "c":
            how = [programs.program("master"), order.port, round(1e9 * order.character), round(1e9 * order.silence)]
        else:
            how = [programs.program("libmodbus"), programs.libmodbus(), order.port, order.baudrate]
        return [str(each) for each in [*how, *limits]]

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.communicate()


def main() -> None:
    """A worker's own process."""
    master = PYTHON[sys.argv[1]].run
    for line in sys.stdin:
        given: dict[str, Any] = json.loads(line)
        print(json.dumps(master(Order(**given))._asdict()), flush=True)


if __name__ == "__main__":
    main()
