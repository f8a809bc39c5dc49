"""Modbus TCP, served: programs that speak it read the units of a line through this one."""

from __future__ import annotations

from types import TracebackType
from typing import NamedTuple

from drivebus import _native, checks
from drivebus.bus import Bus
from drivebus.errors import BadArgument
from drivebus.latch import Latch
from drivebus.strict_attributes import known_only

__all__ = ["Gateway", "GatewayStats"]

MOST_WITHIN = 60.0
"""Seconds that an answer may take at most: a client is gone by then."""


class GatewayStats(NamedTuple):
    """What happened at a gateway so far.

    Attributes:
        clients: Connections that are open.
        let_in: Connections that were let in.
        cut_off: Connections that were ended here: what came was no request or came too slowly, or an answer was not
            taken.
        gave_way: Connections that gave way to others.
        requests: Requests.
        answered: Requests that were answered by what the unit said.
        refused: Requests that are not allowed.
        failed: Requests that were answered by an exception: of the unit, or because the line brought no answer of it.
        late: Requests that were answered by 0BH because their time was up.
        busy: Requests beyond the 16 that one connection may have on their way.
        together: Requests that were answered by the read that another one began.
    """

    clients: int
    let_in: int
    cut_off: int
    gave_way: int
    requests: int
    answered: int
    refused: int
    failed: int
    late: int
    busy: int
    together: int


@known_only
class Gateway:
    """A server for Modbus TCP before a bus: other programs read its units, in its queue. Until it is closed.

        with drivebus.Bus("/dev/ttyUSB0") as bus, drivebus.Gateway(bus, "127.0.0.1:1502") as gateway:
            gateway.wait()

    Each connection waits for the line like a program of its own, so that none keeps the others from it, and a stop goes
    before them all. Each answer belongs to its request, as for a program that uses the bus. Identical reads that wait
    are asked once: nothing older than its request is handed out.

    Only reads of the units 1 to 247 are carried out: 01H to 04H. Everything else is refused by 01H, and nothing of it
    is sent. 0AH: the port is away. 0BH: the unit did not answer within *answer_within*; what was not sent by then is
    taken back, as when the client hangs up. 06H: more than 16 requests of one connection are on their way, or the queue
    of the bus is full. Any other exception is the unit's own.

    At most 64 clients are connected, and 16 from one host; for one more, the one that has not asked for the longest
    gives way. One that sends no request of Modbus, or asks nothing for a minute, is cut off.

    Whoever can reach *address* can read. The line knows no passwords: leave it at 127.0.0.1, or keep strangers out of
    the network.

    Args:
        bus: The line. It stays the caller's to close; where it is closed, clients are told 0AH.
        address: `host:port`, such as `127.0.0.1:1502` or `[::1]:1502`. Port 0 takes one that is free.
        answer_within: Seconds until an answer goes out at the latest, 0.05..60.

    Raises:
        NotAllowed: An argument is wrong; nothing listens.
        PortError: It cannot listen there: the address is taken, not of this machine, or not permitted.
    """

    def __init__(self, bus: Bus, address: str, *, answer_within: float = 1.0) -> None:
        core = getattr(bus, "line", None)
        if not isinstance(core, _native.Bus):
            raise BadArgument(f"bus is {type(bus).__name__}, and has to be a drivebus.Bus")
        host, colon, port = str(address).rpartition(":")
        if not (host and colon and port.isdecimal() and int(port) <= 0xFFFF):
            raise BadArgument(f"address is {address!r}, and has to be host:port, such as 127.0.0.1:1502")
        within = checks.number("answer_within", answer_within, 0.05, MOST_WITHIN)
        self._native = _native.Gateway(core, address, within)
        self._over = Latch()

    @property
    def address(self) -> str:
        """Where it listens: `host:port`."""
        return self._native.address

    @property
    def stats(self) -> GatewayStats:
        """What has happened so far."""
        return GatewayStats(**self._native.stats())

    def told(self) -> list[str]:
        """What was refused or cut off since this was asked last, in words: the latest 256."""
        return self._native.take_told()

    def wait(self, timeout: float | None = None) -> None:
        """Waits until it is closed, for *timeout* seconds at most."""
        self._over.wait(timeout)

    def close(self) -> None:
        """Ends all connections, and listens no more. Closing again does nothing."""
        self._over.set()
        self._native.close()

    def __enter__(self) -> Gateway:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Gateway at {self.address}>"
