"""Clients of one make in a process of their own: each reads again and again, and knows what is true.

    python -m tests.conformance.gateways.crowd_clients MAKE < ORDER

The order is JSON: where the gateway is, how many seconds, from which addresses of this machine the clients come (one
client each), and the questions: unit, address, and the words that stand there. The answer is JSON: how the reads ended,
and how many seconds they took together.
"""

from __future__ import annotations

import asyncio
import ctypes
import errno
import json
import logging
import os
import random
import re
import shutil
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..child import ROOT
from ..verdict import ERROR, RIGHT, WRONG
from .strict import NONE, Client

TIMEOUT = 5.0  # seconds of every client
PAUSE = 0.05  # after an error: what is refused at once is not asked a thousand times


class Question(NamedTuple):
    """What is asked, and what is true."""

    unit: int
    address: int
    words: list[int]


class Order(NamedTuple):
    """What the clients of one make do."""

    host: str
    port: int
    seconds: float
    sources: list[str]
    questions: list[Question]
    seed: int


Ask = Callable[[Question], str]
"""One read, and how it ended."""


def compared(words: Sequence[int], question: Question) -> str:
    return RIGHT if list(words) == question.words else WRONG


def in_threads(order: Order, make: Callable[[str], Ask]) -> Counter[str]:
    """One client in each thread; *make* connects one that comes from an address."""
    ends: Counter[str] = Counter()
    lock = threading.Lock()
    until = time.monotonic() + order.seconds

    def one(place: int) -> None:
        chance = random.Random(f"{order.seed} {place}")
        ask = make(order.sources[place])
        while time.monotonic() < until:
            end = ask(chance.choice(order.questions))
            with lock:
                ends[end] += 1
            if end != RIGHT:
                time.sleep(PAUSE)

    threads = [threading.Thread(target=one, args=(place,)) for place in range(len(order.sources))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return ends


def own(order: Order) -> Counter[str]:
    """The client that judges."""

    def make(source: str) -> Ask:
        client = Client(f"{order.host}:{order.port}", TIMEOUT, source)
        return lambda asked: client.read(asked.address, len(asked.words), asked.words, asked.unit).kind

    return in_threads(order, make)


def pymodbus(order: Order) -> Counter[str]:
    from pymodbus.client import ModbusTcpClient
    from pymodbus.exceptions import ConnectionException, ModbusException

    def make(source: str) -> Ask:
        there: Any = ModbusTcpClient(
            order.host, port=order.port, timeout=TIMEOUT, retries=0, source_address=(source, 0)
        )

        def ask(asked: Question) -> str:
            try:
                answer = there.read_holding_registers(asked.address, count=len(asked.words), device_id=asked.unit)
            except ConnectionException:
                return ERROR
            except ModbusException:
                there.close()
                return NONE
            return ERROR if answer.isError() else compared(answer.registers, asked)

        return ask

    return in_threads(order, make)


def pymodbus_async(order: Order) -> Counter[str]:
    from pymodbus.client import AsyncModbusTcpClient
    from pymodbus.exceptions import ConnectionException, ModbusException

    ends: Counter[str] = Counter()
    until = time.monotonic() + order.seconds

    async def one(place: int) -> None:
        chance = random.Random(f"{order.seed} {place}")
        source = (order.sources[place], 0)
        there = AsyncModbusTcpClient(order.host, port=order.port, timeout=TIMEOUT, retries=0, source_address=source)
        await there.connect()
        while time.monotonic() < until:
            asked = chance.choice(order.questions)
            try:
                answer = await there.read_holding_registers(asked.address, count=len(asked.words), device_id=asked.unit)
            except ConnectionException:
                end = ERROR
            except ModbusException:
                end = NONE
            else:
                end = ERROR if answer.isError() else compared(answer.registers, asked)
            ends[end] += 1
            if end != RIGHT:
                await asyncio.sleep(PAUSE)
        there.close()

    async def everyone() -> None:
        await asyncio.gather(*(one(place) for place in range(len(order.sources))))

    asyncio.run(everyone())
    return ends


def libmodbus_file() -> str | None:
    """What the dynamic loader takes for libmodbus: Debian's, unpacked by tools/debian_parts.sh, or the system's."""
    for found in (ROOT / ".tools/usr/lib").glob("*/libmodbus.so.5"):
        return str(found)
    try:
        ctypes.CDLL("libmodbus.so.5")
    except OSError:
        return None
    return "libmodbus.so.5"


def libmodbus(order: Order) -> Counter[str]:
    file = libmodbus_file()
    assert file is not None
    lib = ctypes.CDLL(file, use_errno=True)
    lib.modbus_new_tcp.restype = ctypes.c_void_p
    lib.modbus_new_tcp.argtypes = [ctypes.c_char_p, ctypes.c_int]
    for name in ("modbus_connect", "modbus_close"):
        getattr(lib, name).argtypes = [ctypes.c_void_p]
    lib.modbus_set_slave.argtypes = [ctypes.c_void_p, ctypes.c_int]
    lib.modbus_set_response_timeout.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32]
    lib.modbus_read_registers.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_void_p]

    def make(_source: str) -> Ask:
        there = lib.modbus_new_tcp(order.host.encode(), order.port)
        lib.modbus_set_response_timeout(there, int(TIMEOUT), 0)
        lib.modbus_connect(there)
        words = (ctypes.c_uint16 * 125)()

        def ask(asked: Question) -> str:
            lib.modbus_set_slave(there, asked.unit)
            count = lib.modbus_read_registers(there, asked.address, len(asked.words), words)
            if count >= 0:
                return compared(words[:count], asked)
            number = ctypes.get_errno()
            if number < LIBMODBUS:  # the connection's, and not what the gateway said
                lib.modbus_close(there)
                lib.modbus_connect(there)
            return NONE if number == errno.ETIMEDOUT else ERROR

        return ask

    return in_threads(order, make)


LIBMODBUS = 112345678
"""Where its own error numbers begin (modbus.h, MODBUS_ENOBASE)."""


def mbpoll_file() -> str | None:
    return shutil.which("mbpoll", path=os.pathsep.join([str(ROOT / ".tools/usr/bin"), os.environ.get("PATH", "")]))


def mbpoll(order: Order) -> Counter[str]:
    """Starts anew for each read."""
    file = mbpoll_file()
    assert file is not None
    folders = [str(folder) for folder in (ROOT / ".tools/usr/lib").glob("*")]
    env = {**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(folders)}

    def ask(asked: Question) -> str:
        line = f"-m tcp -p {order.port} -a {asked.unit} -0 -t 4 -1 -o {TIMEOUT:.0f} -r {asked.address}"
        words = [file, *line.split(), "-c", str(len(asked.words)), order.host]
        done = subprocess.run(words, env=env, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
        if done.returncode == 0:
            return compared([int(word) for word in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)], asked)
        return NONE if "timed out" in done.stderr else ERROR

    return in_threads(order, lambda _source: ask)


def tokio_modbus_file() -> Path | None:
    """What cargo makes of benches/rust/crowd.rs."""
    file = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/examples/crowd"
    return file if file.exists() else None


def tokio_modbus(order: Order) -> Counter[str]:
    file = tokio_modbus_file()
    assert file is not None
    questions = [question._asdict() for question in order.questions]
    given = json.dumps({**order._asdict(), "questions": questions, "timeout": TIMEOUT, "pause": PAUSE})
    return Counter(json.loads(subprocess.run([file], input=given, capture_output=True, text=True, check=True).stdout))


MAKES: dict[str, Callable[[Order], Counter[str]]] = {
    "strict": own,
    "pymodbus": pymodbus,
    "pymodbus, asyncio": pymodbus_async,
    "libmodbus": libmodbus,
    "mbpoll": mbpoll,
    "tokio-modbus": tokio_modbus,
}


def here() -> list[str]:
    """The makes that this machine has."""
    lacking: dict[str, Callable[[], object]] = {
        "libmodbus": libmodbus_file,
        "mbpoll": mbpoll_file,
        "tokio-modbus": tokio_modbus_file,
    }
    return [make for make in MAKES if make not in lacking or lacking[make]() is not None]


def main() -> None:
    """One order from standard input."""
    logging.disable()
    given = json.loads(sys.stdin.read())
    questions = [Question(*each) for each in given.pop("questions")]
    order = Order(**given, questions=questions)
    began = time.monotonic()
    ends = MAKES[sys.argv[1]](order)
    print(json.dumps({"ends": ends, "seconds": time.monotonic() - began}))


if __name__ == "__main__":
    main()
