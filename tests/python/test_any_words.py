"""Whatever words a unit answers, and however it fails: a drive of any family gives a value or an error of this package.

The line is a stand-in that answers at random from a seed, so that words come which no simulated drive would say.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import pytest

import drivebus
from drivebus import BadAnswer, Drive, Link, NoAnswer, PortError, Profile, Refused

SEEDS = range(12)
EVERYTHING: list[Callable[[Drive], object]] = [
    lambda drive: str(drive.status()),
    lambda drive: drive.state(),
    lambda drive: drive.look(),
    lambda drive: drive.fault(),
    lambda drive: drive.fault_history(),
    lambda drive: drive.monitor(),
    lambda drive: drive.run(5.0, confirm=0.1),
    lambda drive: drive.run(reverse=True, confirm=0.1),
    lambda drive: drive.jog(confirm=0.1),
    lambda drive: drive.stop(confirm=0.1),
    lambda drive: drive.coast(confirm=0.1),
    lambda drive: drive.jog_stop(confirm=0.1),
    lambda drive: drive.reset_fault(confirm=0.1),
    lambda drive: drive.wait_for_speed(timeout=0.1),
    lambda drive: drive.wait_until_stopped(timeout=0.1),
    lambda drive: str(drive.check_control()),
    lambda drive: drive.prepare_control(store=True),
    lambda drive: drive.write_setpoint(5.0),
    lambda drive: drive.setpoint,
    lambda drive: drive.inputs(),
    lambda drive: drive.outputs(),
    lambda drive: drive.set_virtual_inputs(S1=True),
    lambda drive: drive.set_virtual_outputs(DO1=True),
    lambda drive: drive.special_control(motor=2),
    lambda drive: drive.write_setpoint(5.0, "torque"),
    lambda drive: drive.write_setpoint(5.0, "pid"),
    lambda drive: drive.write("P00.03", 50.0),
    lambda drive: drive.write("P00.11", 5.0, store=True),
    lambda drive: drive.ping(),
]


class AnyAnswer:
    """A bus whose only unit says anything."""

    reconnects = 0
    closed = False

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._clock = 0.0

    def now(self) -> float:
        return self._clock

    def sleep(self, seconds: float, /) -> None:
        self._clock += seconds

    def link(self, _: int, /) -> Link:
        return Link(10, 10)

    def read(self, _: int, __: int, count: int = 1, /, **___: Any) -> list[int]:
        self._fail(0.15)
        return [self._random.choice([0, 1, 2, 3, 4, 5, self._random.randrange(0x10000), 0xFFFF]) for _ in range(count)]

    def read_stamped(self, unit: int, address: int, count: int = 1, /, **_: Any) -> tuple[list[int], float, float]:
        return self.read(unit, address, count), self._clock, self._clock

    def write(self, _: int, __: int, ___: int | Sequence[int], /, **____: Any) -> None:
        self._fail(0.2)

    def _fail(self, share: float) -> None:
        if self._random.random() < share:
            code = self._random.choice([0, 1, 2, 5, 9, 255])
            raise self._random.choice(
                [
                    Refused("refused", code=code),
                    NoAnswer("silent", started=1.0),
                    BadAnswer("noise", started=1.0),
                    PortError("gone"),
                ]
            )


@pytest.mark.filterwarnings("ignore::drivebus.StoreWarning")
@pytest.mark.parametrize("unverified", [False, True])
@pytest.mark.parametrize("family", drivebus.profiles())
def test_nothing_but_values_and_errors_of_ours(family: str, unverified: bool) -> None:
    ended = []
    for seed in SEEDS:
        drive = Drive(AnyAnswer(seed), 1, Profile.builtin(family), unverified=unverified)
        for ask in EVERYTHING:
            try:
                ask(drive)
                ended.append("well")
            except drivebus.DrivebusError as error:
                ended.append(type(error).__name__)
    assert "well" in ended
