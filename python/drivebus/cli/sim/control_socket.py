"""Where a simulation that runs and the window that gives it orders meet: a socket in this user's run-time folder.

One line of JSON goes each way, then the connection is closed. A line that is too long, comes too slowly or is not an
order is answered in words, and changes nothing.
"""

from __future__ import annotations

import json
import os
import socket
import socketserver
import struct
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import drivebus
from drivebus.cli.present.error_wording import in_commands
from drivebus.line.runtime_folder import run_time_folder

__all__ = ["Order", "ask", "open_to_orders", "running"]

Order = Mapping[str, Any]

_LONGEST = 4_096
"""Bytes of the longest line."""

_PATIENCE = 2.0
"""Seconds that the other side may take."""

_AT_ONCE = 8
"""Who may talk at the same time; others are sent away."""


_FAMILY: Any = getattr(socket, "AF_UNIX", None)
"""Where Python has none, as on Windows, `run_time_folder` refuses before any is asked for."""


class _Server(socketserver.ThreadingMixIn, socketserver.TCPServer):
    address_family = _FAMILY
    daemon_threads = True
    block_on_close = False
    request_queue_size = 4 * _AT_ONCE

    def __init__(self, path: Path, obey: Callable[[Order], Order]) -> None:
        self.obey = obey
        self.room = threading.BoundedSemaphore(_AT_ONCE)
        address: Any = str(path)
        super().__init__(address, _Visit)
        path.chmod(0o600)

    def verify_request(self, request: Any, client_address: Any) -> bool:  # noqa: ARG002 - the base class names it
        """Whether there is room for one more, in the order in which they came; who is sent away is told why."""
        if self.room.acquire(blocking=False):
            return True
        with suppress(OSError):
            request.sendall(_line({"error": f"{_AT_ONCE} others talk to this simulation; try again"}))
        return False

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serves one visitor, and makes room for the next."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Nothing: a visitor that went amid its order is no news for the window of the simulation."""


class _Visit(socketserver.StreamRequestHandler):
    timeout = _PATIENCE
    server: _Server

    def handle(self) -> None:
        """Takes one order and says what came of it."""
        # Who does not wait for the answer has gone.
        with suppress(OSError):
            self.wfile.write(_line(self._answer()))

    def _answer(self) -> Order:
        if not _is_own(self.connection):
            return {"error": "this simulation is another user's"}
        try:
            line = self.rfile.readline(_LONGEST + 1)
        except OSError:
            return {"error": f"no whole order came within {_PATIENCE:g} s"}
        if len(line) > _LONGEST:
            return {"error": f"an order has at most {_LONGEST} bytes"}
        try:
            order = json.loads(line)
        except (ValueError, RecursionError):
            return {"error": "this is not an order: it is not one line of JSON"}
        if not isinstance(order, dict):
            return {"error": "this is not an order: it is not a JSON object"}
        try:
            return self.server.obey(order)
        except drivebus.DrivebusError as error:
            return {"error": in_commands(error)}


def _line(answer: Order) -> bytes:
    return json.dumps(answer).encode() + b"\n"


def _is_own(connection: socket.socket) -> bool:
    """Whether this user's program, or the administrator's, is at the other end. The folder keeps others out already."""
    if sys.platform == "win32" or not hasattr(socket, "SO_PEERCRED"):
        return True
    told = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    _, user, _ = struct.unpack("3i", told)
    return user in (os.geteuid(), 0)


@contextmanager
def open_to_orders(obey: Callable[[Order], Order]) -> Iterator[None]:
    """A block during which *obey* is given what other windows order; its answer, or its error's text, goes back.

    Raises:
        drivebus.NotAllowed: There is no place to meet.
    """
    path = run_time_folder() / f"sim-{os.getpid()}.sock"
    # One of that name is of a program that ended long ago, with the same number.
    path.unlink(missing_ok=True)
    server = _Server(path, obey)
    thread = threading.Thread(target=server.serve_forever, name="drivebus-sim-orders", daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        path.unlink(missing_ok=True)


def running() -> dict[Path, Order]:
    """The simulations of this user that take orders: where each is met, and what it says of itself.

    Raises:
        drivebus.NotAllowed: There is no place to meet.
    """
    found = {}
    for path in sorted(run_time_folder().glob("sim-*.sock")):
        try:
            found[path] = ask(path, {"order": "about"})
        except ConnectionRefusedError:
            # It was killed; nobody else will remove this.
            path.unlink(missing_ok=True)
        except (OSError, drivebus.DrivebusError):
            continue  # it ends right now, or is no simulation that this version understands
    return found


def ask(path: Path, order: Order) -> Order:
    """What the simulation at *path* answers to *order*.

    Raises:
        drivebus.NotAllowed: It refuses; nothing was changed.
        OSError: It is gone, or does not answer.
    """
    with socket.socket(_FAMILY) as connection:
        connection.settimeout(_PATIENCE)
        connection.connect(str(path))
        connection.sendall(json.dumps(order).encode() + b"\n")
        with connection.makefile("rb") as answers:
            line = answers.readline(1 << 20)
    try:
        answer = json.loads(line)
    except ValueError:
        answer = None
    if not isinstance(answer, dict):
        raise drivebus.NotAllowed(f"what is at {path} does not answer like a simulation")
    if "error" in answer:
        raise drivebus.NotAllowed(str(answer["error"]))
    return answer
