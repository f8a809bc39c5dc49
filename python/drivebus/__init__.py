"""Control and watch variable-frequency drives over RS-485.

    import drivebus

    with drivebus.Bus("sim://gd350") as bus:        # or "/dev/ttyUSB0", "COM3", "socket://host:port"
        drive = bus.drive(1)
        drive.prepare_control()
        with drive.running(hz=10.0):
            drive.wait_for_speed(timeout=30)
            print(drive.status(), drive.monitor("output_current"))

This is not a safety function. An emergency stop is a wire.
"""

import sys

if sys.version_info < (3, 10):  # noqa: UP036 - pip refuses these, a folder that was copied does not
    raise ImportError(
        f"drivebus needs Python 3.10 or newer; this is {sys.version.split()[0]}, so start your program with another "
        f"one than {sys.executable}"
    )

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus import doctor, record, rtu, sim, trial
    from drivebus._native import SerialFormat, __version__, crc16
    from drivebus.backup import Backup, Diff, Difference, Restoration, Restored
    from drivebus.bus import Bus
    from drivebus.discovery import Discovery
    from drivebus.drive import Drive
    from drivebus.errors import (
        BadAnswer,
        BadArgument,
        BadLink,
        CrcError,
        DrivebusError,
        DrivebusWarning,
        NoAnswer,
        NotAllowed,
        NotReached,
        NotReady,
        NotStopped,
        PortError,
        QueueFull,
        Refused,
        SharedCodeWarning,
        StoreWarning,
        Unconfirmed,
        Unverified,
        WrongDrive,
    )
    from drivebus.gateway import Allow, Gateway, GatewayStats
    from drivebus.identify.results import Found, Identification
    from drivebus.line.device import DeviceIdentification
    from drivebus.line.poll_samples import Batch, Sample
    from drivebus.line.serial_ports import SerialPort, ports
    from drivebus.line.stats import Link, Stats
    from drivebus.line_search import Located, Progress, Search, Settings, search
    from drivebus.look import Look
    from drivebus.motor import Motor
    from drivebus.operations.setpoints import SetpointRange
    from drivebus.poll import Poll
    from drivebus.profile import Profile, profiles
    from drivebus.record import Recorder
    from drivebus.sim import Simulator
    from drivebus.sniffer import Exchange, sniff
    from drivebus.values import (
        Choice,
        Control,
        ControlItem,
        ControlSource,
        Description,
        Fault,
        Snapshot,
        State,
        Status,
    )

__all__ = [
    "Allow",
    "Backup",
    "BadAnswer",
    "BadArgument",
    "BadLink",
    "Batch",
    "Bus",
    "Choice",
    "Control",
    "ControlItem",
    "ControlSource",
    "CrcError",
    "Description",
    "DeviceIdentification",
    "Diff",
    "Difference",
    "Discovery",
    "Drive",
    "DrivebusError",
    "DrivebusWarning",
    "Exchange",
    "Fault",
    "Found",
    "Gateway",
    "GatewayStats",
    "Identification",
    "Link",
    "Located",
    "Look",
    "Motor",
    "NoAnswer",
    "NotAllowed",
    "NotReached",
    "NotReady",
    "NotStopped",
    "Poll",
    "PortError",
    "Profile",
    "Progress",
    "QueueFull",
    "Recorder",
    "Refused",
    "Restoration",
    "Restored",
    "Sample",
    "Search",
    "SerialFormat",
    "SerialPort",
    "SetpointRange",
    "Settings",
    "SharedCodeWarning",
    "Simulator",
    "Snapshot",
    "State",
    "Stats",
    "Status",
    "StoreWarning",
    "Unconfirmed",
    "Unverified",
    "WrongDrive",
    "__version__",
    "crc16",
    "doctor",
    "ports",
    "profiles",
    "record",
    "rtu",
    "search",
    "sim",
    "sniff",
    "trial",
]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "_native": ("SerialFormat", "__version__", "crc16"),
            "backup": ("Backup", "Diff", "Difference", "Restoration", "Restored"),
            "bus": ("Bus",),
            "discovery": ("Discovery",),
            "drive": ("Drive",),
            "gateway": ("Allow", "Gateway", "GatewayStats"),
            "errors": (
                "BadAnswer",
                "BadArgument",
                "BadLink",
                "CrcError",
                "DrivebusError",
                "DrivebusWarning",
                "NoAnswer",
                "NotAllowed",
                "NotReached",
                "NotReady",
                "NotStopped",
                "PortError",
                "QueueFull",
                "Refused",
                "SharedCodeWarning",
                "StoreWarning",
                "Unconfirmed",
                "Unverified",
                "WrongDrive",
            ),
            "identify.results": ("Found", "Identification"),
            "line.device": ("DeviceIdentification",),
            "line.serial_ports": ("SerialPort", "ports"),
            "line.poll_samples": ("Batch", "Sample"),
            "line.stats": ("Link", "Stats"),
            "look": ("Look",),
            "motor": ("Motor",),
            "operations.setpoints": ("SetpointRange",),
            "poll": ("Poll",),
            "record": ("Recorder",),
            "profile": ("Profile", "profiles"),
            "line_search": ("Located", "Progress", "Search", "Settings", "search"),
            "sim": ("Simulator",),
            "sniffer": ("Exchange", "sniff"),
            "values": (
                "Choice",
                "Control",
                "ControlItem",
                "ControlSource",
                "Description",
                "Fault",
                "Snapshot",
                "State",
                "Status",
            ),
        },
        modules=("_native", "doctor", "record", "rtu", "sim", "trial"),
    )


def __dir__() -> list[str]:
    """The public names; how the package is cut into modules is its own affair."""
    return sorted(__all__)
