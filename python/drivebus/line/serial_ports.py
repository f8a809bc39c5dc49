"""The serial ports of this machine, as pyserial finds them. Nothing is opened."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SerialPort", "ports"]


@dataclass(frozen=True)
class SerialPort:
    """A serial port of this machine. `drivebus.Bus` takes it as it is.

    Attributes:
        path: What the system calls it, such as `"/dev/ttyUSB0"` or `"COM3"`.
        description: What is plugged in there, in the words of the system; `"n/a"` where it does not know.
        serial_number: The adapter's own, where it has one.
        hardware: The adapter's ids and its place, such as `"USB VID:PID=0403:6001 SER=A1 LOCATION=1-2"`.
    """

    path: str
    description: str
    serial_number: str | None
    hardware: str

    def __str__(self) -> str:
        return self.path

    def __fspath__(self) -> str:
        return self.path


def ports() -> list[SerialPort]:
    """Lists the serial ports of this machine and the adapters that are plugged in. Nothing is opened or sent.

    A bus takes each of them as its port: `drivebus.Bus(drivebus.ports()[0])`.
    """
    from serial.tools import list_ports

    return [
        SerialPort(port.device, port.description, port.serial_number, port.hwid)
        for port in sorted(list_ports.comports())
    ]
