"""A real Home Assistant: installed by pip, started as if for the first time, and asked over its own interfaces.

Only those of its parts are loaded that MQTT needs: there are no pages, and nothing is asked of the internet.
"""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import Request, urlopen

from tests.python.mqtt_broker import Broker

ROOT = Path(__file__).resolve().parent.parent
WITHIN = 30.0
"""Seconds within which all has to be seen."""
PARTS = ("api", "config", "onboarding", "websocket_api")
RUN = """
import sys
from homeassistant import __main__, bootstrap
bootstrap.DEFAULT_INTEGRATIONS = bootstrap.CRITICAL_INTEGRATIONS = set()
sys.exit(__main__.main())
"""
"""A Home Assistant without what it loads unasked: its pages would be a download of their own."""
LIST = """
import asyncio, json, sys, aiohttp
async def main(url, token):
    async with aiohttp.ClientSession() as session, session.ws_connect(url, max_msg_size=0) as socket:
        await socket.receive_json()
        await socket.send_json({"type": "auth", "access_token": token})
        await socket.receive_json()
        found = []
        for number, kind in enumerate(("entity", "device"), 1):
            await socket.send_json({"id": number, "type": f"config/{kind}_registry/list"})
            found.append((await socket.receive_json())["result"])
        print(json.dumps(found))
asyncio.run(main(*sys.argv[1:]))
"""
"""Its lists of entities and devices are told over a WebSocket alone."""
COMPLAINS = re.compile(
    r" (?:WARNING|ERROR) \(.*?\) \[homeassistant\.components\.(?:mqtt|sensor|binary_sensor|button|number)\b.*"
)

Told = dict[str, Any]


def soon(what: str, condition: Callable[[], object], within: float = WITHIN) -> float:
    """The seconds until *condition* holds; the program ends where it does not in time."""
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > within:
            sys.exit(f"it was not seen within {within:.0f} s {what}")
        time.sleep(0.05)
    return round(time.monotonic() - began, 1)


def installed(version: str, python: str) -> Path:
    """The Python of an environment of its own that has that Home Assistant."""
    folder = ROOT / f"target/home-assistant-{version}"
    own, done = folder / "bin/python", folder / "installed"
    if not done.exists():
        subprocess.run([python, "-m", "venv", "--clear", folder], check=True)
        install: list[str | Path] = [own, "-m", "pip", "install", "--quiet"]
        subprocess.run([*install, f"homeassistant=={version}"], check=True)
        subprocess.run([*install, *needed(folder)], check=True)
        done.touch()
    return own


def needed(folder: Path) -> list[str]:
    """What the parts that are loaded need beside Home Assistant itself, as their manifests say it."""
    components = next(folder.glob("lib/python*/site-packages/homeassistant/components"))
    # The form of MQTT also offers a broker that its supervisor would bring.
    parts, needs = {*PARTS, "mqtt", "hassio"}, set[str]()
    while more := [json.loads((components / part / "manifest.json").read_text(encoding="utf-8")) for part in parts]:
        needs.update(*(manifest.get("requirements", []) for manifest in more))
        parts = {part for manifest in more for part in manifest.get("dependencies", [])}
    return sorted(needs)


@contextmanager
def home_assistant(python: Path, folder: Path) -> Iterator[HomeAssistant]:
    """A Home Assistant that was never started before, with a user; *python* has it, and its files are in *folder*."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    file, log = folder / "configuration.yaml", folder / "log"
    parts = "".join(f"{part}:\n" for part in PARTS)
    file.write_text(f"http:\n  server_host: 127.0.0.1\n  server_port: {port}\n{parts}", encoding="utf-8")
    words: list[str | Path] = [python, "-c", RUN, "--config", folder, "--skip-pip", "--log-no-color"]
    with log.open("wb") as out, subprocess.Popen(words, stdout=out, stderr=out) as process:
        try:
            yield HomeAssistant(f"127.0.0.1:{port}", python, log)
        except SystemExit:
            print(log.read_text(encoding="utf-8")[-3000:], file=sys.stderr)
            raise
        finally:
            process.terminate()


class HomeAssistant:
    """What a Home Assistant answers that was just started.

    Args:
        at: Its host and port.
        python: The Python that has it.
        log: Where it writes down what it does.
    """

    def __init__(self, at: str, python: Path, log: Path) -> None:
        self._at, self._python, self._log, self._token = at, python, log, ""
        soon("that Home Assistant starts", self._is_there, 120)
        me = f"http://{at}/"
        who = {"name": "me", "username": "me", "password": "none at all", "client_id": me, "language": "en"}
        code = self.ask("api/onboarding/users", who)["auth_code"]
        form = urlencode({"grant_type": "authorization_code", "code": code, "client_id": me}).encode()
        self._token = self._asked("auth/token", form, "application/x-www-form-urlencoded")["access_token"]
        soon("that it has started", lambda: self.ask("api/config")["state"] == "RUNNING", 120)

    def _is_there(self) -> bool:
        with suppress(OSError):
            return bool(self.ask("api/onboarding"))
        return False

    def ask(self, path: str, told: object = None) -> Any:
        """What it answers there, to JSON where it is *told* some."""
        return self._asked(path, None if told is None else json.dumps(told).encode(), "application/json")

    def _asked(self, path: str, body: bytes | None, kind: str) -> Any:
        headers = {"Content-Type": kind, **({"Authorization": f"Bearer {self._token}"} if self._token else {})}
        try:
            with urlopen(Request(f"http://{self._at}/{path}", body, headers), timeout=30) as answer:
                return json.load(answer)
        except HTTPError as error:
            sys.exit(f"Home Assistant at {path}: {error}: {error.read().decode()}")

    def use(self, at: Broker) -> None:
        """It is told of a broker, as a person tells it."""
        flow = self.ask("api/config/config_entries/flow", {"handler": "mqtt"})
        form: Told = {"broker": "127.0.0.1", "port": at.port}
        # Newer ones have a part of the form that is folded away, and may not be left out.
        if any(each["name"] == "other_settings" for each in flow["data_schema"]):
            form["other_settings"] = {"set_client_cert": False, "set_ca_cert": "off"}
        made = self.ask(f"api/config/config_entries/flow/{flow['flow_id']}", form)
        assert made["type"] == "create_entry", made

    def lists(self) -> tuple[dict[str, Told], dict[str, Told]]:
        """The entities that it has over MQTT, by their unique names, and the devices of these by theirs."""
        words: list[str | Path] = [self._python, "-c", LIST, f"ws://{self._at}/api/websocket", self._token]
        entities, devices = json.loads(subprocess.run(words, check=True, capture_output=True).stdout)
        return (
            {each["unique_id"]: each for each in entities if each["platform"] == "mqtt"},
            {name: each for each in devices for kind, name in each["identifiers"] if kind == "mqtt"},
        )

    def states(self) -> dict[str, Told]:
        """What each entity says now, by its name."""
        return {each["entity_id"]: each for each in self.ask("api/states")}

    def unavailable(self) -> set[str]:
        """The entities that it shows as unavailable."""
        return {name for name, each in self.states().items() if each["state"] == "unavailable"}

    def order(self, service: str, entity: str, **more: object) -> None:
        """A person presses or types something at *entity*."""
        self.ask(f"api/services/{service}", {"entity_id": entity, **more})

    def complaints(self) -> list[str]:
        """What it wrote down of drives that it did not like."""
        return sorted(set(COMPLAINS.findall(self._log.read_text(encoding="utf-8"))))
