"""What Prometheus is told: base units, no values of a drive that is gone, and nothing twice."""

from __future__ import annotations

import socket
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from drivebus import PortError, Simulator
from drivebus.service import Service
from drivebus.sinks import DrivePicture, GatewayPicture, LinePicture, Picture, Prometheus
from drivebus.site import Site
from drivebus.spool import Layout

from .tcp_client import free_port, seen

UNITS = ("Hz", "kHz", "V", "A", "kW", "kWh", "%", "s", "ms", "h", "°C", "Ω", "mH", "Nm", "rpm", "", "raw", "odd/unit")
ALL = Layout("pump", "gd350", tuple(f"value{place}" for place in range(len(UNITS))), UNITS, (0,) * len(UNITS))
COUNTS = Layout("fan", "vfd500", ("external_count", "energy_total"), ("", ""), (0, 0))
ONE = Layout("fan", "vfd500", ("running_frequency",), ("Hz",), (2,))

Series = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def scraped(port: int) -> Series:
    """All series, each once."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=20) as answer:
        text = answer.read().decode()
    found: Series = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            key = (sample.name, tuple(sorted(sample.labels.items())))
            assert key not in found, key
            found[key] = sample.value
    return found


def series(name: str, **labels: str) -> tuple[str, tuple[tuple[str, str], ...]]:
    return name, tuple(sorted(labels.items()))


@pytest.fixture
def told() -> Iterator[tuple[list[Picture], Prometheus]]:
    pictures: list[Picture] = []
    prometheus = Prometheus("127.0.0.1:0", lambda: pictures[-1])
    yield pictures, prometheus
    prometheus.close()


def test_values_are_in_base_units(told: tuple[list[Picture], Prometheus]) -> None:
    pictures, prometheus = told
    drive = DrivePicture(1, ALL, 990.0, "", (2,) * len(UNITS))
    counts = {"requests": 7, "occupied": 1.5, "noise_idle": 3}
    gateway = GatewayPicture("127.0.0.1:1502", 2, {"answered": 5, "late": 1})
    pictures.append(Picture(1000.0, (LinePicture("hall", True, counts, (drive,), (gateway,)),), 12, 1))
    found = scraped(prometheus.port)
    where = {"line": "hall", "drive": "pump"}
    bases = [
        *[("hertz", 2), ("hertz", 2_000), ("volts", 2), ("amperes", 2), ("watts", 2_000), ("joules", 7.2e6)],
        *[("ratio", 0.02), ("seconds", 2), ("seconds", 0.002), ("seconds", 7_200), ("celsius", 2), ("ohms", 2)],
        *[("henries", 0.002), ("newton_meters", 2), ("rpm", 2), ("", 2), ("raw", 2), ("odd_unit", 2)],
    ]
    for place, (base, value) in enumerate(bases):
        title = f"drivebus_value{place}_{base}".rstrip("_")
        assert found[series(title, **where)] == pytest.approx(value), title
    assert found[series("drivebus_drive_up", **where)] == 1
    assert found[series("drivebus_sample_age_seconds", poll="1", **where)] == 10
    assert found[series("drivebus_line_requests_total", line="hall")] == 7
    assert found[series("drivebus_line_occupied_seconds_total", line="hall")] == 1.5
    at = {"line": "hall", "address": "127.0.0.1:1502"}
    assert found[series("drivebus_gateway_clients", **at)] == 2
    assert found[series("drivebus_gateway_requests_total", outcome="late", **at)] == 1
    assert (found[series("drivebus_spooled_samples_total")], found[series("drivebus_lost_samples_total")]) == (12, 1)


def test_what_is_gone_has_no_values_and_what_is_newer_counts(told: tuple[list[Picture], Prometheus]) -> None:
    pictures, prometheus = told
    where = {"line": "hall", "drive": "fan"}
    old, new = DrivePicture(1, ONE, 10.0, "", (50,)), DrivePicture(2, ONE, 20.0, "", (30.5,))
    pictures.append(Picture(21.0, (LinePicture("hall", True, {}, (new, old)),)))
    found = scraped(prometheus.port)
    assert found[series("drivebus_running_frequency_hertz", **where)] == 30.5
    assert found[series("drivebus_sample_age_seconds", poll="1", **where)] == 11
    assert found[series("drivebus_sample_age_seconds", poll="2", **where)] == 1
    gone = DrivePicture(2, ONE, 30.0, "unit 2: no answer", ())
    pictures.append(Picture(31.0, (LinePicture("hall", True, {}, (gone,)), LinePicture("yard", False, {}))))
    found = scraped(prometheus.port)
    assert series("drivebus_running_frequency_hertz", **where) not in found
    assert found[series("drivebus_drive_up", **where)] == 0
    assert found[series("drivebus_line_open", line="yard")] == 0


def test_what_one_poll_had_is_not_shown_when_the_drive_is_gone(told: tuple[list[Picture], Prometheus]) -> None:
    pictures, prometheus = told
    had, gone = DrivePicture(1, ONE, 10.0, "", (50,)), DrivePicture(2, ONE, 20.0, "unit 2: no answer", ())
    pictures.append(Picture(21.0, (LinePicture("hall", True, {}, (had, gone)),)))
    found = scraped(prometheus.port)
    assert not any(name.startswith("drivebus_running_frequency") for name, _ in found)


@pytest.mark.parametrize(
    ("state", "fault", "shown"), [("stopped", "", 0), ("fault", "OL1 (11): overload", 1), ("", "", None)]
)
def test_a_fault_is_told_where_one_can_be_seen(
    told: tuple[list[Picture], Prometheus], state: str, fault: str, shown: float | None
) -> None:
    pictures, prometheus = told
    drive = DrivePicture(1, ONE, 10.0, "", (50,), state, fault)
    pictures.append(Picture(11.0, (LinePicture("hall", True, {}, (drive,)),)))
    assert scraped(prometheus.port).get(series("drivebus_drive_in_fault", line="hall", drive="fan")) == shown


def test_a_name_that_ends_like_another_kind_of_metric(told: tuple[list[Picture], Prometheus]) -> None:
    pictures, prometheus = told
    pictures.append(Picture(11.0, (LinePicture("hall", True, {}, (DrivePicture(1, COUNTS, 10.0, "", (3, 4)),)),)))
    names = {name for name, _ in scraped(prometheus.port)}
    assert {"drivebus_external_count_value", "drivebus_energy_total_value"} <= names


def test_an_address_that_is_taken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, pytest.raises(PortError, match="nothing can listen there"):
        Prometheus(f"127.0.0.1:{server.getsockname()[1]}", lambda: Picture(0.0, ()))


def test_a_service_tells_of_its_drives(tmp_path: Path) -> None:
    """A unit that gives no values has its series ended, and the others go on."""
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator:
        port = free_port()
        file.write_text(
            f'[lines.hall]\nport = "{simulator.port}"\nbaud = 115200\n'
            '[drives.pump]\nline = "hall"\nunit = 1\nprofile = "gd350"\n'
            '[drives.fan]\nline = "hall"\nunit = 2\nprofile = "vfd500"\n'
            f'[[poll]]\ninterval = 0.1\n[prometheus]\naddress = "127.0.0.1:{port}"\n'
        )
        service = Service(Site.load(file), heard.append)
        serving = threading.Thread(target=service.run)
        serving.start()
        try:
            seen(lambda: any("metrics are at" in text for text in heard))
            values = [series("drivebus_input_state", line="hall", drive=name) for name in ("pump", "fan")]
            seen(lambda: all(each in scraped(port) for each in values))
            simulator.drive(1).refuse(asked="reads")
            seen(lambda: values[0] not in scraped(port))
            found = scraped(port)
            assert values[1] in found
            assert found[series("drivebus_drive_up", line="hall", drive="pump")] == 0
        finally:
            service.end()
            serving.join()
