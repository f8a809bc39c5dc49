"""A plant with a page, for tests and pictures: simulated drives, a service in a thread, and who may log in."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import drivebus
from drivebus import Simulator
from drivebus.service import Service
from drivebus.web import hashed

from .plant_text import HALL, drive, served
from .tcp_client import free_port, seen

MARIA, OTTO = "correct horse battery", "only looking on"
"""Passwords: of who may order, and of who looks."""
PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2)
    + drive("meter", 3, "gd350", "read_only = true")
    + drive("ghost", 9, "gd350", "read_only = true")
    + """[share]
audit = "audit.jsonl"
[[poll]]
interval = {interval}
[spool]
[web]
address = "127.0.0.1:{web}"
dead_man = {dead_man}
[[people]]
name = "maria"
password = "{maria}"
role = "command"
[[people]]
name = "otto"
password = "{otto}"
role = "look"
"""
)

FORWARD, REVERSE, STOP, COAST = 1, 2, 5, 6
_CONTROL = 0x2000


@functools.cache
def hash_of(password: str) -> str:
    """Its hash: slow to make, so it is made once."""
    return hashed(password)


@dataclass
class PagePlant:
    """A plant that runs.

    Attributes:
        url: Where its page is.
        simulator: Its drives.
        service: What serves it.
        heard: What it told.
        folder: Where its file is.
    """

    url: str
    simulator: Simulator
    service: Service
    folder: Path
    heard: list[str] = field(default_factory=list)

    def told(self, unit: int = 1) -> list[int]:
        """The commands that a drive was given."""
        return [value for _, address, value in self.simulator.drive(unit).writes() if address == _CONTROL]


@contextmanager
def page_plant(folder: Path, interval: float = 0.2, dead_man: object = 60, more: str = "") -> Iterator[PagePlant]:
    """Two drives that obey the bus, one that may only be read, and one that is not there."""
    file = folder / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "gd350", 3: "gd350"}, transport="tcp", baudrate=115200) as simulator:
        with drivebus.Bus(simulator.port, baudrate=115200) as bus:
            for unit in (1, 2):
                motor = bus.drive(unit, "gd350")
                motor.prepare_control()
                motor.write({"P00.11": 0.5, "P00.12": 0.5})
        port = free_port()
        people = {"maria": hash_of(MARIA), "otto": hash_of(OTTO)}
        text = PLANT.format(port=simulator.port, web=port, interval=interval, dead_man=dead_man, **people)
        file.write_text(text + more)
        with served(file, heard) as service:
            seen(lambda: any("the page is at" in text for text in heard))
            yield PagePlant(f"http://127.0.0.1:{port}", simulator, service, folder, heard)
