"""A plant that is made up, before which the page stands: what it was told is known, and what it says is an attack."""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from drivebus.sinks import DrivePicture, LinePicture, Picture
from drivebus.spool import Layout
from drivebus.web import Happened, Person, Shown, ShownDrive, Told, Web

from .page_plant import MARIA, OTTO, hash_of

EVIL = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>\x1b[2J\u202e"
LAYOUT = Layout("pump", "gd350", ("speed",), ("Hz",), (2,))
ALL = frozenset({"run", "setpoint", "reset", "stop", "coast"})


@dataclass
class Plant:
    """A plant that is made up, and what it was told."""

    url: str = ""
    port: int = 0
    orders: list[Told] = field(default_factory=list)
    stopped: list[tuple[str, str]] = field(default_factory=list)
    here: list[str] = field(default_factory=list)
    heard: list[str] = field(default_factory=list)
    looks: int = 0
    breaks: bool = False

    def look(self) -> Picture:
        self.looks += 1
        if self.breaks:
            raise RuntimeError("it broke")
        drive = DrivePicture(1, LAYOUT, time.time(), "", (50,), EVIL, EVIL)
        return Picture(time.time(), (LinePicture("hall", True, {}, (drive,), hints=(EVIL,)),))

    def order(self, told: Told) -> tuple[str, str]:
        self.orders.append(told)
        return ("refused", EVIL) if told.hz == 13 else ("done", "")

    def stop_all(self, person: str, address: str) -> dict[str, tuple[str, str]]:
        self.stopped.append((person, address))
        return {"pump": ("done", ""), "fan": ("not sent", "its line is away")}

    def shown(self) -> Shown:
        drives = [
            ShownDrive("pump", "hall", 1, EVIL, ALL, hold=150.0),
            ShownDrive("fan", "hall", 2, "", why_not=EVIL),
        ]
        return Shown(
            title="plant",
            drives={each.name: each for each in drives},
            people=[Person("maria", hash_of(MARIA), "command"), Person("otto", hash_of(OTTO))],
            look=self.look,
            events=lambda: [Happened(1.0, "pump", "fault", EVIL)],
            order=self.order,
            stop_all=self.stop_all,
            started=dict,
            here=self.here.append,
            tell=self.heard.append,
            dead_man=10.0,
        )

    @contextmanager
    def client(self, person: str = "", password: str = "") -> Iterator[httpx.Client]:
        """A browser of our own, logged in as *person* if there is one."""
        with httpx.Client(base_url=self.url, headers={"origin": self.url}, timeout=20) as client:
            if person:
                answer = client.post("/login", data={"name": person, "password": password})
                assert (answer.status_code, answer.headers["location"]) == (303, "/")
            yield client


@contextmanager
def made_up() -> Iterator[tuple[Plant, Web]]:
    """One with its page, until it is over."""
    plant = Plant()
    web = Web("127.0.0.1:0", (), None, plant.shown())
    plant.url, plant.port = f"http://127.0.0.1:{web.port}", web.port
    try:
        yield plant, web
    finally:
        web.close()
    assert not web.serves


def token_of(client: httpx.Client) -> str:
    found = re.search(r'data-token="([^"]+)"', client.get("/").text)
    assert found is not None
    return found[1]


def order(client: httpx.Client, token: str, place: int = 0, **fields: str) -> httpx.Response:
    """An order that a page gives now."""
    about = {"form_token": token, "drive": "pump", "number": f"{place:032x}", "seen": str(time.time())}
    return client.post("/order", data=about | fields, headers={"accept": "application/json"})


def make_certificate(chain: Path, key: Path) -> None:
    words = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    words += ["-keyout", str(key), "-out", str(chain), "-days", "2", "-subj", "/CN=localhost"]
    words += ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    subprocess.run(words, check=True, capture_output=True)
    key.chmod(0o600)
