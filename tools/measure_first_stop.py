"""How late a stop is where the family is not known: each family named as each other one, on a port just opened.

Time is the simulated line's, so that each run gives the same. Counted is the first write that halts some family. Drives
that speak another protocol are left out, as are those without a motor.

    python -m tools.measure_first_stop
"""

from __future__ import annotations

import contextlib
import itertools
import statistics
from collections.abc import Iterator

from drivebus import Bus, DrivebusError, Profile, Simulator, profiles

LATE = 0.152
"""Seconds: what a stop took at most while only few families were known."""


def halts() -> set[tuple[int, int]]:
    """Address and word of what halts any family."""
    found: set[tuple[int, int]] = set()
    for profile in map(Profile.builtin, profiles()):
        for command in {"stop", "coast"} & set(profile.commands()):
            place, word = profile.command(command)
            found.add((place & 0xFFFF, word))
    return found


def first_halt(named: str, there: str, known: set[tuple[int, int]]) -> float | None:
    """Seconds from the call until the first frame that halts goes out; None where none does."""
    with Simulator({1: there}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        with contextlib.suppress(DrivebusError):
            bus.drive(1, named, unverified=True).stop()
        frames = [(time, frame) for time, who, frame in simulator.line.trace() if who == "master"]
    for time, frame in frames:
        address, word = int.from_bytes(frame[2:4], "big"), int.from_bytes(frame[-4:-2], "big")
        if frame[1] in (5, 6, 16) and (address, 1 if frame[1] == 5 and word else word) in known:
            return time - frames[0][0]
    return None


def pairs() -> Iterator[tuple[str, str]]:
    """Each two families that have a motor and speak Modbus."""
    having = [
        name
        for name in profiles()
        if Profile.builtin(name).kind == "inverter" and Profile.builtin(name).requests().protocol == "modbus"
    ]
    return itertools.permutations(having, 2)


def main() -> None:
    """Prints the figures."""
    known = halts()
    times = [first_halt(named, there, known) for named, there in pairs()]
    sent = [time for time in times if time is not None]
    late = sum(time > LATE for time in sent)
    print(f"{len(times)} pairs, a halt went out in {len(sent)}: {late} later than {LATE * 1000:.0f} ms")
    print(f"median {statistics.median(sent) * 1000:.0f} ms, latest {max(sent):.2f} s")


if __name__ == "__main__":
    main()
