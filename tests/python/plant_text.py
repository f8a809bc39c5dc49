"""The text of a `drivebus.toml` for tests, and a service of what it says."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivebus.service import Service
from drivebus.site import Site

__all__ = ["HALL", "drive", "served"]

HALL = """
[lines.hall]
port = "{port}"
baud = 115200
"""


def drive(name: str, unit: int, profile: str = "gd350", *more: str) -> str:
    """A drive on that line, with *more* keys of its own."""
    told = [f"[drives.{name}]", 'line = "hall"', f"unit = {unit}", f'profile = "{profile}"', *more]
    return "\n".join(told) + "\n"


@contextmanager
def served(file: Path, heard: list[str]) -> Iterator[Service]:
    """A service of what *file* says, until the test has ended; what it tells is *heard*."""
    service = Service(Site.load(file), heard.append)
    serving = threading.Thread(target=service.run)
    serving.start()
    try:
        yield service
    finally:
        service.end()
        serving.join()
