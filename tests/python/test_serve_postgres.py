"""A service that sends what its drives say to a real PostgreSQL: nothing is missing there, whatever ends in between."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from drivebus import Simulator
from drivebus.errors import NotAllowed
from drivebus.service import Service, check
from drivebus.site import Site
from drivebus.spool import Spool

from .plant_text import HALL, drive
from .postgres_server import ROOT, Server, server
from .tcp_client import seen

PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2, "vfd500")
    + drive("ghost", 3)
    + """[[poll]]
interval = 0.1
heartbeat = 1
[spool]
[postgres]
conninfo = "{conninfo}"
gateway = "hall 1"
"""
)


@pytest.fixture(scope="module")
def postgres() -> Iterator[Server]:
    with server() as made:
        yield made


def test_what_drives_say_is_in_the_database_once(tmp_path: Path, postgres: Server) -> None:
    """Though the server dies meanwhile, and the service is started again."""
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator:
        file.write_text(PLANT.format(port=simulator.port, conninfo=postgres.conninfo))
        for turn in range(2):
            service = Service(Site.load(file), heard.append)
            serving = threading.Thread(target=service.run)
            serving.start()
            try:
                before = service.picture().spooled
                seen(lambda s=service, b=before: s.picture().spooled > b + 20)  # type: ignore[misc]
                if turn == 0:
                    postgres.stop_at_once()
                    seen(lambda: any("no samples reach PostgreSQL" in text for text in heard))
                    postgres.start()
                seen(lambda s=service: is_all_in(s))  # type: ignore[misc]
            finally:
                service.end()
                serving.join()
    assert any("samples reach PostgreSQL again" in text for text in heard)
    # What was kept in the last second is sent by whoever has the spool next.
    service = Service(Site.load(file), heard.append)
    serving = threading.Thread(target=service.run)
    serving.start()
    seen(lambda: is_all_in(service))
    service.end()
    serving.join()
    with Spool(tmp_path / "drivebus-spool", 1 << 30, heard.append) as spool, closing(spool.reader("test")) as reader:
        found = reader.after(0, 100_000)
    kept = [(each.epoch, each.seq, each.layout.drive, each.missing) for each in found]
    events = {
        (each.epoch, each.seq, each.layout.drive, each.layout.event, each.missing)
        for each in found
        if each.layout.event
    }
    told = postgres.ask("SELECT epoch, seq, subject, kind, text FROM drivebus.event WHERE gateway = 'hall 1'")
    assert len(set(told)) == len(told)
    assert set(told) <= events
    assert {("hall", "open"), ("ghost", "gone")} <= {(subject, kind) for _, _, subject, kind, _ in told}
    rows: list[tuple[object, ...]] = []
    for table in ("gd350", "vfd500"):
        rows += postgres.ask(f"SELECT epoch, seq, drive, missing FROM drivebus.{table} WHERE gateway = 'hall 1'")
    known = {(epoch, seq, drive, missing or "") for epoch, seq, drive, missing in rows}
    assert len(known) == len(rows)
    # The last service went on polling after all was in.
    assert known <= set(kept)
    assert len(known) > 40
    assert {drive for _, _, drive, _ in known} == {"pump", "fan", "ghost"}
    voltages = postgres.ask("SELECT DISTINCT bus_voltage FROM drivebus.gd350 WHERE drive = 'pump' AND missing IS NULL")
    assert voltages == [(537.0,)]


def is_all_in(service: Service) -> bool:
    """Whether the database has what was spooled a moment ago."""
    status = service.status()["outlets"]["postgres"]
    return bool(status["connected"] and status["delivered"] and not status["behind"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[spool]\n", "", "samples wait in a spool until the database has them: say [spool]"),
        ('gateway = "hall 1"\n', "", "postgres has no gateway"),
        ("conninfo", "conninf", 'did you mean "conninfo"'),
        ('gateway = "hall 1"\n', 'gateway = "hall 1"\npassword_file = "none"\n', "none"),
        ("dbname=postgres", "dbname=postgres password=secret", "password"),
    ],
)
def test_a_mistake_is_told_and_no_secret_with_it(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = tmp_path / "drivebus.toml"
    text = PLANT.format(port="sim://gd350", conninfo="host=/nowhere dbname=postgres")
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(NotAllowed) as caught:
        check(Site.load(file))
    assert said in str(caught.value)
    assert "secret" not in str(caught.value)


def asked_by_grafana() -> Iterator[tuple[str, str]]:
    """Each question of the dashboard by its title, with what Grafana puts for its variables."""
    board = json.loads((ROOT / "examples/grafana/postgres.json").read_text(encoding="utf-8"))
    told = [(each["name"], each["query"]) for each in board["templating"]["list"] if each["type"] == "query"]
    told += [(panel["title"], target["rawSql"]) for panel in board["panels"] for target in panel["targets"]]
    put = {
        "$__timeFilter(time)": "time BETWEEN now() - INTERVAL '1 hour' AND now()",
        "$gateway": "hall 1",
        "($drive)": "('pump','fan','ghost')",
        "($name)": "('fault_code')",
    }
    for title, question in told:
        for variable, value in put.items():
            question = question.replace(variable, value)
        assert "$" not in question
        yield title, question


def test_the_dashboard_shows_what_is_in(tmp_path: Path, postgres: Server) -> None:
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator:
        file.write_text(PLANT.format(port=simulator.port, conninfo=postgres.conninfo))
        service = Service(Site.load(file), heard.append)
        serving = threading.Thread(target=service.run)
        serving.start()
        seen(lambda: service.status()["outlets"]["postgres"]["delivered"] > 10)
        service.end()
        serving.join()
    shown = {title: postgres.ask(question) for title, question in asked_by_grafana()}
    assert shown["gateway"] == [("hall 1",)]
    assert shown["drive"] == [("fan",), ("pump",)]
    assert ("bus_voltage",) in shown["name"]
    assert {row[1] for row in shown["Values"]} == {"pump fault_code", "fan fault_code"}
    assert {drive: age < 3_600 for drive, _, age in shown["Told last"]} == {"fan": True, "pump": True}
    assert {row[1:3] for row in shown["Events"]} >= {("hall", "open"), ("ghost", "gone")}
