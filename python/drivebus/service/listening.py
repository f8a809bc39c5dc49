"""What listens at an address of its own, as soon as that can be: a port that is taken is tried again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from drivebus.errors import DrivebusError

__all__ = ["Listening"]


class _Closes(Protocol):
    def close(self) -> None: ...


class Listening:
    """Something that listens at an address, as soon as that can be.

    Args:
        name: What people call it.
        where: What is told when it listens.
        listen: Listens, until what it returns is closed.
        tell: Hears in words what people should know.
    """

    def __init__(self, name: str, where: str, listen: Callable[[], _Closes], tell: Callable[[str], None]) -> None:
        self._name = name
        self._where = where
        self._listen = listen
        self._tell = tell
        self._open: _Closes | None = None
        self._why = ""

    def start(self) -> None:
        """Listens, or says why not."""
        self.turn()

    def turn(self) -> None:
        """Tries again, where it does not listen."""
        if self._open is not None:
            return
        try:
            self._open = self._listen()
        except DrivebusError as error:
            if str(error) != self._why:
                self._tell(f"{self._name}: {error}; tried again each second")
            self._why = str(error)
        else:
            self._why = ""
            self._tell(f"{self._name}: {self._where}")

    def close(self) -> None:
        """Listens no more."""
        if self._open is not None:
            self._open.close()
            self._open = None

    def status(self) -> dict[str, Any]:
        """Whether it listens, and why not."""
        return {"open": self._open is not None, "why": self._why}
