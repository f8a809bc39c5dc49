"""Prometheus: what the drives said last and how the lines do, for who comes and asks.

Values are in base units, as Prometheus wants them: hertz, seconds, watts, a ratio instead of per cent. A drive that
does not answer has no values; that it is gone, and how old each sample is, are series of their own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from drivebus.errors import NotAllowed, PortError
from drivebus.sinks.picture import DrivePicture, LinePicture, Picture

if TYPE_CHECKING:
    from prometheus_client.core import Metric

__all__ = ["Prometheus"]


class _Unit(NamedTuple):
    name: str
    factor: float


_BASE = {
    "Hz": _Unit("hertz", 1.0),
    "kHz": _Unit("hertz", 1e3),
    "V": _Unit("volts", 1.0),
    "A": _Unit("amperes", 1.0),
    "kW": _Unit("watts", 1e3),
    "kWh": _Unit("joules", 3.6e6),
    "%": _Unit("ratio", 0.01),
    "s": _Unit("seconds", 1.0),
    "ms": _Unit("seconds", 1e-3),
    "h": _Unit("seconds", 3600.0),
    "°C": _Unit("celsius", 1.0),
    "Ω": _Unit("ohms", 1.0),
    "mH": _Unit("henries", 1e-3),
    "Nm": _Unit("newton_meters", 1.0),
    "rpm": _Unit("rpm", 1.0),
}
"""The base unit of each unit that drives have. Revolutions a minute stay what every drive shows."""

_RESERVED = ("_total", "_count", "_sum", "_bucket", "_created", "_info")
"""How names may end of kinds of metrics that these are not."""

_COUNTS = {
    "requests": "Requests that went out, probes included.",
    "answers": "Right answers.",
    "refusals": "Exceptions of units.",
    "timeouts": "Requests without an answer in time.",
    "crc_errors": "Answers whose CRC was wrong.",
    "bad_answers": "Whole frames that could not be the answer.",
    "retries": "Requests sent once more.",
    "late_replies": "Answers that came when something else had been asked.",
    "noise_bytes": "Bytes that belong to no frame.",
    "reconnects": "How often the port was opened again.",
    "occupied": "Seconds that requests had the line.",
}
"""What is told of a line, by the names of `drivebus.Stats`."""


class Prometheus:
    """Answers scrapes at one address, until it is closed.

    Args:
        address: `host:port`. Whoever reaches it can read: there is no password.
        look: Gives how the plant is now. Any thread.

    Raises:
        NotAllowed: prometheus-client is not installed.
        PortError: It cannot listen there.
    """

    def __init__(self, address: str, look: Callable[[], Picture]) -> None:
        try:
            from prometheus_client import CollectorRegistry, start_http_server
        except ImportError:
            raise NotAllowed(
                "metrics need prometheus-client: pip install 'drivebus[prometheus]'; nothing was opened"
            ) from None
        registry = CollectorRegistry()
        registry.register(_Collector(look))
        host, _, port = address.rpartition(":")
        try:
            self._server, self._thread = start_http_server(int(port), host.strip("[]"), registry)
        except OSError as error:
            raise PortError(f"{address}: nothing can listen there: {error.strerror or error}") from None

    @property
    def port(self) -> int:
        """The port that it listens at."""
        return int(self._server.server_port)

    def close(self) -> None:
        """Listens no more."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Collector:
    """What is asked at each scrape."""

    def __init__(self, look: Callable[[], Picture]) -> None:
        self._look = look

    def describe(self) -> list[Any]:
        """Nothing is known before: what there is depends on the drives."""
        return []

    def collect(self) -> Iterator[Metric]:
        """All there is to tell now."""
        picture = self._look()
        families = _Families()
        for line in picture.lines:
            _tell_line(families, line)
            # What was asked last counts where two polls ask for the same.
            drives = sorted(line.drives, key=lambda drive: drive.time)
            last = {drive.layout.drive: drive for drive in drives}
            for drive in drives:
                _tell_asked(families, line.name, drive, picture.time)
                if not last[drive.layout.drive].missing:
                    _tell_values(families, line.name, drive)
            for drive in last.values():
                _tell_state(families, line.name, drive)
        families.count("drivebus_spooled_samples", "Samples that were kept for others.", {}, picture.spooled)
        families.count("drivebus_lost_samples", "Samples that gave way: file or disk was full.", {}, picture.lost)
        yield from families


class _Families:
    """Metrics, each with its help and its labels. What is told again replaces what was told."""

    def __init__(self) -> None:
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        self._kinds = {"gauge": GaugeMetricFamily, "counter": CounterMetricFamily}
        self._known: dict[str, tuple[str, str, tuple[str, ...]]] = {}
        self._values: dict[str, dict[tuple[str, ...], float]] = {}

    def gauge(self, name: str, told: str, labels: dict[str, str], value: float) -> None:
        self._add("gauge", name, told, labels, value)

    def count(self, name: str, told: str, labels: dict[str, str], value: float) -> None:
        self._add("counter", name, told, labels, value)

    def _add(self, kind: str, name: str, told: str, labels: dict[str, str], value: float) -> None:
        self._known.setdefault(name, (kind, told, tuple(labels)))
        self._values.setdefault(name, {})[tuple(labels.values())] = value

    def __iter__(self) -> Iterator[Metric]:
        for name, (kind, told, labels) in self._known.items():
            family = self._kinds[kind](name, told, labels=labels)
            for which, value in self._values[name].items():
                family.add_metric(which, value)
            yield family


def _tell_line(families: _Families, line: LinePicture) -> None:
    where = {"line": line.name}
    families.gauge("drivebus_line_open", "Whether the port of the line is open.", where, float(line.open))
    for name, told in _COUNTS.items():
        if name in line.counts:
            title = "occupied_seconds" if name == "occupied" else name
            families.count(f"drivebus_line_{title}", told, where, line.counts[name])
    for gateway in line.gateways:
        at = {**where, "address": gateway.address}
        families.gauge("drivebus_gateway_clients", "Connections that are open.", at, gateway.clients)
        for outcome, number in gateway.requests.items():
            told = "Requests over the network, by what became of them."
            families.count("drivebus_gateway_requests", told, {**at, "outcome": outcome}, number)


def _tell_asked(families: _Families, line: str, drive: DrivePicture, now: float) -> None:
    where = {"line": line, "drive": drive.layout.drive}
    age = max(now - drive.time, 0.0)
    up = "Whether the drive answered when it was asked last."
    families.gauge("drivebus_drive_up", up, where, float(not drive.missing))
    asked = "How long ago the drive was asked, by poll."
    families.gauge("drivebus_sample_age_seconds", asked, {**where, "poll": str(drive.poll)}, age)


def _tell_state(families: _Families, line: str, drive: DrivePicture) -> None:
    if drive.state or drive.fault:
        where = {"line": line, "drive": drive.layout.drive}
        told = "Whether the drive is in a fault; of one that does not answer nothing is known."
        families.gauge("drivebus_drive_in_fault", told, where, float(bool(drive.fault)))


def _tell_values(families: _Families, line: str, drive: DrivePicture) -> None:
    layout = drive.layout
    where = {"line": line, "drive": layout.drive}
    for name, unit, value in zip(layout.names, layout.units, drive.values, strict=False):
        base = _BASE.get(unit, _Unit(_word(unit), 1.0))
        title = "_".join(part for part in ("drivebus", _word(name), base.name) if part)
        if title.endswith(_RESERVED):
            title += "_value"
        with suppress(OverflowError):
            families.gauge(title, f"{name} of a drive.", where, float(value) * base.factor)


def _word(text: str) -> str:
    """*text* as a part of a name: letters, digits and underscores."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
