"""Measures what sharing a port costs, and what becomes of it when programs die or crowd it.

    python tools/measure_sharing.py extra  [--reads 5000]
    python tools/measure_sharing.py kills  [--kills 50]
    python tools/measure_sharing.py crowd  [--seconds 3600] [--rate 0.02]

    extra  the time of a read by the program that has the port and by one that comes in through it, in turns, from a
           unit that answers at once
    kills  the program that has the port is killed (-9) at a random moment, again and again, while two others read and
           write: until when they are served, what is wrong, and what was written twice
    crowd  eight programs of mixed kinds on a line that damages, loses and delays answers; and how much of the wire they
           use together, beside one program alone, without faults

All programs are real ones, on a pseudo-terminal. The exit code is 1 where something was wrong or done twice. For Linux.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import multiprocessing
import os
import random
import statistics
import struct
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection

from drivebus import Bus, DrivebusError, Simulator, aio, crc16
from drivebus.sim import FAULT_KINDS

SPAWN = multiprocessing.get_context("spawn")
BAUD, OWN_BAUD = 115_200, 19_200
UNITS = range(1, 5)
IDENTIFICATION, GD350 = 0x2103, 0x01A0
PLACE, IN_RAM = 0x000B, 0x8000


def open_bus(port: str, baud: int, **how: object) -> Bus:
    """The bus of one program."""
    return Bus(port, baudrate=baud, parity="N", **how)  # type: ignore[arg-type]  # as the caller has it


# ----------------------------------------------------------------------------------------------- what a read costs more


def _answer_at_once(near: int) -> None:
    """A unit that answers each read of one word as soon as it has come."""
    tty.setraw(near)
    body = bytes([1, 3, 2, 0, 7])
    answer = body + struct.pack("<H", crc16(body))
    came = b""
    while True:
        came += os.read(near, 256)
        while len(came) >= 8:
            request, came = came[:8], came[8:]
            os.write(near, request if request[1] == 8 else answer)


def _read_in_turns(port: str, reads: int, told: Connection) -> None:
    with open_bus(port, BAUD, timeout=1.0) as bus:
        told.send("open")
        while told.recv():
            told.send(_times(bus, reads))


def _times(bus: Bus, reads: int) -> list[float]:
    times = []
    for _ in range(reads):
        began = time.perf_counter()
        bus.read(1, 0x2100)
        times.append(time.perf_counter() - began)
    return times


def extra(reads: int) -> int:
    """Prints what a read through another program takes more."""
    far, near = os.openpty()
    tty.setraw(near)
    unit = multiprocessing.get_context("fork").Process(target=_answer_at_once, args=(far,), daemon=True)
    unit.start()
    port = os.ttyname(near)
    rounds = 10
    with open_bus(port, BAUD, timeout=1.0) as bus:
        ours, theirs = SPAWN.Pipe()
        guest = SPAWN.Process(target=_read_in_turns, args=(port, reads // rounds, theirs), daemon=True)
        guest.start()
        ours.recv()
        differences, own, through = [], [], []
        for _ in range(rounds):
            alone = statistics.median(_times(bus, reads // rounds))
            ours.send(True)
            shared = statistics.median(ours.recv())
            own.append(alone)
            through.append(shared)
            differences.append(shared - alone)
        ours.send(False)
        guest.join()
    unit.kill()
    print(
        f"a read, median of {reads // rounds}, {rounds} rounds in turns: by the program that has the port "
        f"{statistics.median(own) * 1e6:.0f} us, through it {statistics.median(through) * 1e6:.0f} us; "
        f"extra {statistics.median(differences) * 1e6:.0f} us ({min(differences) * 1e6:.0f} to "
        f"{max(differences) * 1e6:.0f})"
    )
    return 0


# ---------------------------------------------------------------------------------------- the program with it is killed


def _own(port: str, told: Connection) -> None:
    with open_bus(port, BAUD, timeout=1.0) as bus:
        told.send("open")
        while True:
            bus.read(3, IDENTIFICATION)


def kills(count: int, seed: int = 13) -> int:
    """Prints what becomes of a port whose program is killed."""
    chance = random.Random(seed)
    values = iter(range(1, 65_000))
    confirmed: set[int] = set()
    unknown: set[int] = set()
    wrong, gaps = 0, []
    with Simulator(dict.fromkeys(UNITS, "gd350"), transport="pty", baudrate=BAUD, parity="N") as line:
        for _ in range(count):
            ours, theirs = SPAWN.Pipe()
            owner = SPAWN.Process(target=_own, args=(line.port, theirs), daemon=True)
            owner.start()
            ours.recv()
            with open_bus(line.port, BAUD, timeout=1.0) as reading, open_bus(line.port, BAUD, timeout=1.0) as writing:
                ended, killed = threading.Event(), [0.0]
                served: dict[str, float] = {}

                def note(who: str, killed: list[float] = killed, served: dict[str, float] = served) -> None:
                    if killed[0] and who not in served:
                        served[who] = time.perf_counter() - killed[0]

                def read(
                    bus: Bus = reading, ended: threading.Event = ended, note: Callable[[str], None] = note
                ) -> None:
                    nonlocal wrong
                    while not ended.is_set():
                        with contextlib.suppress(DrivebusError):
                            wrong += bus.read(1, IDENTIFICATION) != [GD350]
                            note("read")

                def write(
                    bus: Bus = writing, ended: threading.Event = ended, note: Callable[[str], None] = note
                ) -> None:
                    while not ended.is_set():
                        value = next(values)
                        try:
                            bus.write(2, IN_RAM | PLACE, value)
                            confirmed.add(value)
                            note("write")
                        except DrivebusError:
                            unknown.add(value)

                threads = [threading.Thread(target=read), threading.Thread(target=write)]
                for thread in threads:
                    thread.start()
                time.sleep(chance.uniform(0.05, 0.4))
                killed[0] = time.perf_counter()
                owner.kill()
                while len(served) < len(threads):
                    time.sleep(0.001)
                ended.set()
                for thread in threads:
                    thread.join()
                gaps.append(max(served.values()))
            owner.join()
        taken = [value for _, address, value in line.drive(2).writes() if address == IN_RAM | PLACE]
    twice = len(taken) - len(set(taken))
    lost = len(confirmed - set(taken)) + len(set(taken) - confirmed - unknown)
    print(
        f"{count} kills: {len(confirmed)} writes confirmed, {len(unknown)} unknown; {wrong} wrong values, {twice} "
        f"written twice, {lost} confirmed and not taken; all served again after {statistics.median(gaps) * 1e3:.0f} ms "
        f"(median), {max(gaps) * 1e3:.0f} ms at the longest"
    )
    return 1 if wrong or twice or lost else 0


# ------------------------------------------------------------------------------------------------------------ the crowd


def _reads(bus: Bus, ended: Callable[[], bool]) -> tuple[int, int]:
    right = wrong = 0
    while not ended():
        for unit in UNITS:
            with contextlib.suppress(DrivebusError):
                wrong += bus.read(unit, IDENTIFICATION) != [GD350]
                right += 1
    return right, wrong


def _writes(unit: int) -> Callable[[Bus, Callable[[], bool]], tuple[int, int]]:
    """Writes rising values to a register of its own, and reads which it has: one that may have been taken."""

    def work(bus: Bus, ended: Callable[[], bool]) -> tuple[int, int]:
        right = wrong = 0
        possible, value = {_value(bus, unit)}, 0
        while not ended():
            value = value % 60_000 + 1
            try:
                bus.write(unit, IN_RAM | PLACE, value)
                possible = {value}
            except DrivebusError as error:
                if error.started is not None:
                    possible.add(value)
            with contextlib.suppress(DrivebusError):
                [shown] = bus.read(unit, PLACE)
                wrong += shown not in possible
                possible = {shown} if shown in possible else possible
                right += 1
        return right, wrong

    return work


def _value(bus: Bus, unit: int) -> int:
    while True:
        with contextlib.suppress(DrivebusError):
            return bus.read(unit, PLACE, verify=True)[0]


def _polls(bus: Bus, ended: Callable[[], bool]) -> tuple[int, int]:
    right = wrong = 0
    with bus.poll({unit: [(IDENTIFICATION, 1)] for unit in UNITS}) as poll:
        for sample in poll:
            if not sample.missing:
                right += 1
                wrong += list(sample.values()) != [GD350]
            if ended():
                return right, wrong
    return right, wrong


async def _awaits(port: str, baud: int, ended: Callable[[], bool]) -> tuple[int, int]:
    right = wrong = 0

    async def one(bus: aio.Bus, unit: int) -> None:
        nonlocal right, wrong
        while not ended():
            with contextlib.suppress(DrivebusError):
                wrong += await bus.read(unit, IDENTIFICATION) != [GD350]
                right += 1

    async with aio.Bus(port, baudrate=baud, parity="N") as bus:
        await asyncio.gather(*(one(bus, unit) for unit in UNITS))
    return right, wrong


def _program(kind: str, unit: int, port: str, baud: int, seconds: float, told: Connection) -> None:
    end = time.monotonic() + seconds

    def ended() -> bool:
        return time.monotonic() >= end

    if kind == "awaits":
        told.send(asyncio.run(_awaits(port, baud, ended)))
        return
    works = {"reads": _reads, "polls": _polls, "writes": _writes(unit)}
    with open_bus(port, baud) as bus:
        told.send(works[kind](bus, ended))


KINDS = (("reads", 0), ("reads", 0), ("polls", 0), ("awaits", 0), *(("writes", unit) for unit in UNITS))


@contextlib.contextmanager
def _line(rate: float) -> Iterator[Simulator]:
    faults = dict.fromkeys((kind for kind in _known_faults() if rate), rate)
    settings = {"baudrate": OWN_BAUD, "parity": "N"}
    with Simulator(dict.fromkeys(UNITS, "gd350"), transport="pty", faults=faults, **settings) as line:  # type: ignore[arg-type]
        yield line


def _known_faults() -> tuple[str, ...]:
    return tuple(kind for kind in FAULT_KINDS if kind != "unplug")


def _together(
    line: Simulator, kinds: tuple[tuple[str, int], ...], seconds: float
) -> tuple[list[tuple[int, int]], float]:
    """What each program had right and wrong, and how many requests a second went out."""
    pipes, programs = [], []
    for kind, unit in kinds:
        ours, theirs = SPAWN.Pipe()
        program = SPAWN.Process(target=_program, args=(kind, unit, line.port, OWN_BAUD, seconds, theirs), daemon=True)
        program.start()
        pipes.append(ours)
        programs.append(program)
    time.sleep(seconds / 4)
    before, began = line.line.requests, time.monotonic()
    time.sleep(seconds / 2)
    rate = (line.line.requests - before) / (time.monotonic() - began)
    results = [pipe.recv() for pipe in pipes]
    for program in programs:
        program.join()
    return results, rate


def crowd(seconds: float, rate: float) -> int:
    """Prints what eight programs have on one line."""
    with _line(0.0) as line:
        alone = _together(line, (("reads", 0),), min(seconds, 40.0))[1]
        crowded = _together(line, (("reads", 0),) * 8, min(seconds, 40.0))[1]
    print(
        f"no faults: {alone:.2f} requests a second by one program, {crowded:.2f} by eight: {crowded / alone:.2%}",
        flush=True,
    )
    with _line(rate) as line:
        results, requests = _together(line, KINDS, seconds)
        doubled = 0
        for unit in UNITS:
            taken = [value for _, address, value in line.drive(unit).writes() if address == IN_RAM | PLACE]
            doubled += sum(one == other for one, other in itertools.pairwise(taken))
    for (kind, unit), (right, wrong) in zip(KINDS, results, strict=True):
        print(f"  {kind}{f' unit {unit}' if unit else '':8} {right} right, {wrong} wrong")
    wrong = sum(wrong for _, wrong in results)
    right = sum(right for right, _ in results)
    print(
        f"{seconds:.0f} s, {len(_known_faults())} faults at {rate:.0%} each, eight programs: {right} right, "
        f"{wrong} wrong, {doubled} done twice, {requests:.1f} requests a second"
    )
    return 1 if wrong or doubled else 0


def main() -> int:
    """Measures what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["extra", "kills", "crowd"])
    parser.add_argument("--reads", type=int, default=5_000)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=3_600.0)
    parser.add_argument("--rate", type=float, default=0.02)
    given = parser.parse_args()
    match given.what:
        case "extra":
            return extra(given.reads)
        case "kills":
            return kills(given.kills)
        case _:
            return crowd(given.seconds, given.rate)


if __name__ == "__main__":
    sys.exit(main())
