"""What a capture file holds: serial lines first; where it has none, Modbus in TCP; and what was left out, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain

from drivebus.capture import links, network
from drivebus.capture.frame import Captured
from drivebus.capture.modbus_tcp import Found, found_in
from drivebus.capture.packets import Interface, Packet
from drivebus.capture.serial_line import SerialLine
from drivebus.checks import counted
from drivebus.errors import BadArgument
from drivebus.rtu import is_frame

__all__ = ["Contents"]

_SERIAL = "captures of a serial line have link type 252 (upper PDU), 250 (RTAC serial) or 147 to 162 (user)"


class Contents:
    """The packets of a capture, sorted by what they were captured on. *name* is that of the file."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._lines: dict[Interface, SerialLine] = {}
        self._network = network.Network(lambda connection: found_in(connection, 0) is not None)
        self._others: Counter[Interface] = Counter()
        self._count = self._cut = 0

    def take(self, packet: Packet) -> None:
        """Takes the next packet."""
        interface = packet.interface
        if links.is_serial(interface.link):
            if interface not in self._lines:
                self._lines[interface] = SerialLine(interface)
            self._lines[interface].take(self._count, packet)
        else:
            self._others[interface] += 1
            if interface.link in network.LINKS:
                self._cut += packet.is_cut
                self._network.take(self._count, packet)
        self._count += 1

    def frames(self, say: Callable[[str], object], broken: Exception | None = None) -> Iterator[Captured]:
        """The frames, line by line; *say* is given what is to be known of them.

        Args:
            say: Is given a line each.
            broken: Why the file was not read to its end, which is told by whoever read it.

        Raises:
            NotAllowed: There are none; what is there instead is told.
        """
        frames = list(self._of_serial_lines(say) if self._lines else self._of_servers(say))
        yield from frames
        if broken is None and not any(is_frame(frame.data) for frame in frames):
            raise BadArgument(self._without())

    def _of_serial_lines(self, say: Callable[[str], object]) -> Iterator[Captured]:
        for interface, count in self._others.items():
            say(
                f"{self._name}: interface {_called(interface)} is left out with {counted(count, 'packet')}: "
                f"{links.named(interface.link)} is no serial line."
            )
        lines = list(self._lines.values())
        if len(lines) == 2 and lines[0].joins(lines[1]):
            sides = " and ".join(_called(line.interface) for line in lines)
            say(f"{self._name}: interfaces {sides} are taken for the two sides of one line.")
            del lines[1]
        for line in lines:
            name = _called(line.interface) if len(lines) > 1 else ""
            told = [counted(count, event) for event, count in line.events.items()]
            told += [f"{counted(line.cut, 'packet')} that it cut short"] if line.cut else []
            if told:
                say(f"{self._name}{name and f', interface {name}'}: the capture tells of {', '.join(told)}.")
            yield from line.frames(name)

    def _of_servers(self, say: Callable[[str], object]) -> Iterator[Captured]:
        by_server: dict[str, list[Found]] = {}
        for connection in self._network.connections():
            found = found_in(connection, len(by_server.get(connection.place, ())))
            if found is not None:
                by_server.setdefault(connection.place, []).append(found)
        if by_server and self._cut:
            say(f"{self._name}: the capture tells of {counted(self._cut, 'packet')} that it cut short.")
        for place, all_found in by_server.items():
            kinds = sorted({found.kind for found in all_found})
            frames = list(chain.from_iterable(found.frames for found in all_found))
            with_crc = " Frames are shown as on a serial line, with a CRC." if "Modbus TCP" in kinds else ""
            say(
                f"{self._name} is of a network: {' and '.join(kinds)}, server {place}, "
                f"{counted(len(all_found), 'connection')}.{with_crc}"
            )
            mismatched = sum(found.mismatched for found in all_found)
            if mismatched:
                answers = counted(mismatched, "answer")
                say(f"{self._name}: nothing was asked with the transaction number of {answers} of {place}.")
            yield from (frames if len(by_server) > 1 else [replace(frame, line="") for frame in frames])

    def _without(self) -> str:
        """What the file holds, which has no frame."""
        if self._lines:
            return f"{self._name} holds no frame: no bytes in its {counted(self._count, 'packet')} match a CRC"
        if not self._count:
            return f"{self._name} holds no frame: it has no packets"
        by_link: Counter[int] = Counter()
        for interface, count in self._others.items():
            by_link[interface.link] += count
        kinds = ", ".join(links.named(link) for link in sorted(by_link))
        told = f"{self._name} is a capture of {kinds}, which is not a serial line"
        if by_link.keys() & links.USB:
            told += "; what a USB adapter and its driver say to each other is not read: capture at the port itself"
        if by_link.keys() & network.LINKS:
            told += "; neither Modbus TCP nor RTU over TCP is found in it"
            if self._cut:
                told += f" ({counted(self._cut, 'packet')} cut short by the capture)"
            if self._network.datagrams:
                datagrams = counted(self._network.datagrams, "packet")
                told += f"; UDP is not read, of which {datagrams} went to or from port 502"
        return f"{told}; {_SERIAL}"


def _called(interface: Interface) -> str:
    """The interface by its number in the file and its name."""
    return f"{interface.number}{f' ({interface.name})' if interface.name else ''}"
