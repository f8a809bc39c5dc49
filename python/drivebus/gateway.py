"""Modbus TCP, served: programs that speak it use the units of a line through this one, as far as they may."""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, NamedTuple

from drivebus import _native, checks
from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.errors import BadArgument
from drivebus.latch import Latch
from drivebus.operations import network_rights
from drivebus.operations.drive_base import unit_of
from drivebus.strict_attributes import known_only

__all__ = ["Allow", "Gateway", "GatewayStats"]

MOST_WITHIN = 60.0
"""Seconds that an answer may take at most: a client is gone by then."""

DEAD_MAN = (0.1, 3600.0)
"""Seconds of silence after which a motor may be halted."""

FRAMINGS = ("tcp", "rtu")

_Rule = tuple[list[str], list[int], list[int], list[network_rights.Writable]]


@dataclass(frozen=True)
class Allow:
    """What clients of some networks may do to some units. Without any, all may read.

        Allow(networks=["192.168.7.0/24"], drives=[pump], commands=["run", "setpoint"], write=["P00.11"])

    Attributes:
        networks: Whose: addresses, or networks such as `"192.168.7.0/24"`. None: everybody who reaches the gateway.
        drives: Drives of its bus, or the addresses of units that are none: 1..247, and 0 (all at once) or 248..255
            where they are meant. None: every unit from 1 to 247.
        functions: Function codes of 1..6, 15 and 16. None: the reads, and the writes where any is named here.
        write: What may be written: registers and parameters of the drives by name or code, and holding registers of
            other units by address, 0..0xFFFF.
        commands: What drives may be told: `"run"`, `"jog"`, `"reset"`, `"setpoint"`, or one of the family's
            `Profile.commands()` or `Profile.setpoint_names()`. Who may write anything to a drive may stop it.
    """

    networks: Sequence[str] = ()
    drives: Sequence[Drive | int] = ()
    functions: Sequence[int] | None = None
    write: Sequence[str | int] = ()
    commands: Sequence[str] = ()


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
        given_up: Requests of RTU whose client asked the next one instead of waiting. They are not answered, and what
            was not sent of them was taken back.
        busy: Requests beyond the 16 that one connection may have on their way.
        together: Requests that were answered by the read that another one began.
        written: Writes that went out and were not refused by their unit.
        halted: Motors that were halted for a client that was gone or silent.
        unaudited: Writes that stand in no audit, though they should: the disk did not follow.
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
    given_up: int
    busy: int
    together: int
    written: int
    halted: int
    unaudited: int


@known_only
class Gateway:
    """A server for Modbus TCP before a bus: other programs use its units, in its queue. Until it is closed.

        with drivebus.Bus("/dev/ttyUSB0") as bus, drivebus.Gateway(bus, "127.0.0.1:1502") as gateway:
            gateway.wait()

    Each connection waits for the line like a program of its own, so that none keeps the others from it, and a stop goes
    before them all. Each answer belongs to its request, as for a program that uses the bus. Identical reads that wait
    are asked once: nothing older than its request is handed out.

    Only reads of the units 1 to 247 are carried out (01H to 04H), and what *allow* allows. Everything else is refused
    by 01H, and nothing of it is sent. 0AH: the port is away. 0BH: the unit did not answer within *answer_within*; what
    was not sent by then is taken back, as when the client hangs up, and of a write that was sent nobody knows whether
    it was done. 06H: more than 16 requests of one connection are on their way, or the queue of the bus is full. Any
    other exception is the unit's own.

    A write is sent once. The unit is asked before who it is, once for each time that the port was opened, and a value
    that is replaced is read for the audit. A stop goes before all that waits. A parameter that wears the drive's memory
    may be written five times, and then once in 100 minutes.

    At most 64 clients are connected, and 16 from one host; for one more, the one that has not asked for the longest
    gives way. One that sends no request of Modbus, or asks nothing for a minute, is cut off.

    Whoever can reach *address* can read. The line knows no passwords: leave it at 127.0.0.1, or keep strangers out of
    the network.

    Args:
        bus: The line. It stays the caller's to close; where it is closed, clients are told 0AH.
        address: `host:port`, such as `127.0.0.1:1502` or `[::1]:1502`. Port 0 takes one that is free. Or a path that
            begins with `/`: a link to a pseudo-terminal, for programs of this computer that know serial ports alone.
            They open it as one, without parity, and speak RTU. One has it open at a time, of this user or of the bus's
            group, and rules for networks see it at 127.0.0.1. A link to a pseudo-terminal that is there is replaced.
            Linux only.
        framing: `"tcp"` is Modbus TCP. `"rtu"` is RTU over TCP, as on a line: who asks again is answered for that
            alone, and what is for all units is not answered.
        answer_within: Seconds until an answer goes out at the latest, 0.05..60.
        allow: What clients may do. Empty: all may read. Drives that answer are asked who they are.
        dead_man: Seconds, 0.1..3600: a motor is halted when the client that set it in motion has hung up, or has asked
            nothing for so long after an answer. `"off"`: it runs on. Has to be said where clients may move a motor.
        audit: The file to which each write of a client is appended: a line of JSON with the time, the client, the unit,
            the registers by name, the old and the new words, and the outcome. It is put aside at 10 MB; nine are kept.

    Raises:
        NotAllowed: An argument is wrong, or a drive says that it is another one; nothing listens.
        PortError: It cannot listen there: the address is taken, not of this machine, or not permitted. Or the audit
            cannot be written.
    """

    def __init__(
        self,
        bus: Bus,
        address: str | os.PathLike[str],
        *,
        framing: Literal["tcp", "rtu"] = "tcp",
        answer_within: float = 1.0,
        allow: Sequence[Allow] = (),
        dead_man: float | Literal["off"] | None = None,
        audit: str | os.PathLike[str] | None = None,
    ) -> None:
        core = getattr(bus, "line", None)
        if not isinstance(core, _native.Bus):
            raise BadArgument(f"bus is {type(bus).__name__}, and has to be a drivebus.Bus")
        within = checks.number("answer_within", answer_within, 0.05, MOST_WITHIN)
        rules = [rule for each in allow for rule in _rules(each, bus)]
        silence = None if dead_man in (None, "off") else checks.number("dead_man", dead_man, *DEAD_MAN)
        if dead_man is None and any(network_rights.moves(writes) for _, _, _, writes in rules):
            raise BadArgument(
                "clients may move a motor, and nothing says what becomes of it when they are gone: say dead_man, "
                'seconds after which it is halted, or "off" if it shall run on. Nothing listens'
            )
        self._native = _native.Gateway(
            core,
            _address(address),
            within,
            rtu=checks.one_of("framing", framing, FRAMINGS) == "rtu",
            rules=rules,
            units=list(_halts(allow)),
            dead_man=silence,
            audit=None if audit is None else checks.path("audit", audit),
        )
        self._over = Latch()

    @property
    def address(self) -> str:
        """Where it listens: `host:port`, or the path of the link to its pseudo-terminal."""
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


def _address(given: str | os.PathLike[str]) -> str:
    address = str(given)
    host, colon, port = address.rpartition(":")
    if not (address.startswith("/") or (host and colon and port.isdecimal() and int(port) <= 0xFFFF)):
        raise BadArgument(
            f"address is {address!r}, and has to be host:port, such as 127.0.0.1:1502, or a path that begins with /"
        )
    return address


def _rules(allow: Allow, bus: Bus) -> Iterator[_Rule]:
    """What *allow* says: a rule for each drive, in whose words the writes are, and one for the other units."""
    if not isinstance(allow, Allow):
        raise BadArgument(f"allow takes drivebus.Allow, and was given {checks.shown(allow)}")
    networks = [_network(text) for text in _listed("networks", allow.networks)]
    drives = [each for each in _listed("drives", allow.drives) if isinstance(each, Drive)]
    units = [checks.whole("unit", each, 0, 255) for each in allow.drives if not isinstance(each, Drive)]
    write, commands = _listed("write", allow.write), _listed("commands", allow.commands)
    functions = _functions(allow, bool(write or commands))
    if (write or commands) and not allow.drives:
        raise BadArgument("what may be written is said of drives that are named: which are they? Nothing listens")
    if commands and units:
        raise BadArgument(
            f"unit {units[0]} is no drive that is known, and commands are those of a family: give the drive"
        )
    if any(function in network_rights.WRITES for function in functions) and not (write or commands):
        raise BadArgument("functions that write need what may be written, and nothing is named")
    for drive in drives:
        if drive.bus is not bus:
            raise BadArgument(f"unit {drive.unit} is a drive of another bus")
        unit = unit_of(drive)
        if write or commands:
            network_rights.is_what_it_should_be(unit)
        yield networks, [drive.unit], functions, network_rights.of_drive(unit.evidence, write, commands)
    for number in units:
        yield networks, [number], functions, network_rights.of_unit(number, write)
    if not allow.drives:
        yield networks, [], functions, []


def _halts(allow: Sequence[Allow]) -> Iterator[network_rights.Halts]:
    """How the drives are halted that clients may write to."""
    known: set[int] = set()
    for each in allow:
        for drive in each.drives if each.write or each.commands else ():
            if isinstance(drive, Drive) and drive.unit not in known:
                known.add(drive.unit)
                halts = network_rights.halts_of(unit_of(drive))
                if not halts.ways and network_rights.moves(
                    network_rights.of_drive(unit_of(drive).evidence, (), each.commands)
                ):
                    raise BadArgument(
                        f"nothing is known that halts {drive.profile.title}, so no client may move it; nothing listens",
                        unit=drive.unit,
                    )
                yield halts


def _functions(allow: Allow, writes: bool) -> list[int]:
    if allow.functions is None:
        return [*network_rights.READS, *(network_rights.WRITES if writes else ())]
    allowed = {*network_rights.READS, *network_rights.WRITES}
    functions = [checks.whole("function", each, 1, 16) for each in _listed("functions", allow.functions)]
    for function in functions:
        if function not in allowed:
            raise BadArgument(
                f"function {function} cannot be allowed; allowed are {', '.join(map(str, sorted(allowed)))}"
            )
    return functions


def _network(text: object) -> str:
    try:
        return str(ipaddress.ip_network(str(text)))
    except ValueError as error:
        raise BadArgument(f"{checks.shown(text)} is no address and no network: {error}") from None


def _listed(what: str, given: object) -> list[object]:
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise BadArgument(f"{what} is a list, and was given {checks.shown(given)}")
    return list(given)
