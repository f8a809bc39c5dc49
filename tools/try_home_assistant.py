"""What a real Home Assistant shows of simulated drives, how soon it knows that one is gone, and whether it forgets it.

    python -m tools.try_home_assistant [--version 2025.4.4] [--python python3.13]

Home Assistant is installed by pip into `target/`, which takes ten minutes once; the rest takes two. It needs Mosquitto
(`sh tools/debian_parts.sh`), what the tests need, and a Python that this version of Home Assistant runs on. Of Home
Assistant's own, only the parts are loaded that drives need: there are no pages, and nothing is asked of the internet.
On a machine that is short of time, simulated drives answer late, and are rightly found gone.

`drivebus serve` has a line of several families. Each entity that it announces has to be there, with its device, unit,
classes and value. Motors run and stop by Home Assistant's buttons. A drive that falls silent, and all drives when the
service is killed, have to be unavailable within 30 s, and no other one. A drive that is taken out of the file has to
leave nothing. Prints what was seen and how many seconds it took; what is not seen in time ends the program with 1.
"""

from __future__ import annotations

import argparse
import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

from tests.python.mqtt_broker import Broker, Somebody, broker, somebody
from tests.python.plant_text import HALL, drive
from tools.real_home_assistant import WITHIN, HomeAssistant, Told, home_assistant, installed, soon

from drivebus import Bus, Simulator

VERSION = "2025.4.4"
LASTS = 5.0
"""Seconds for which the other drives are watched once one is unavailable."""
FAMILIES = {"pump": "gd350", "fan": "vfd500", "mixer": "ms300", "saw": "atv312"}
REMOVED = "fan"
HZ = 20.0
HERE = "drivebus/hall-1"
PLANT = """[[poll]]
interval = 1
[spool]
[mqtt]
host = "127.0.0.1"
port = {at}
gateway = "hall-1"
home_assistant = "homeassistant"
dead_man = 5.0
[[mqtt.allow]]
drives = {drives}
commands = ["run", "setpoint", "reset"]
"""


class Cable:
    """A way to a simulated line, on which some units are *off*: they hear nothing.

    A request comes in one piece: whoever sent it waits for its answer.
    """

    def __init__(self, to: str) -> None:
        host, _, port = to.removeprefix("socket://").rpartition(":")
        self._to = (host, int(port))
        self.off: set[int] = set()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._listening.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            client, _ = self._listening.accept()
            with client, socket.create_connection(self._to) as line, suppress(OSError):
                threading.Thread(target=self._bring_back, args=(line, client), daemon=True).start()
                with suppress(ConnectionError):
                    while request := client.recv(512):
                        if request[0] not in self.off:
                            line.sendall(request)
                # The thread that waits there would keep it open.
                line.shutdown(socket.SHUT_RDWR)

    def _bring_back(self, line: socket.socket, client: socket.socket) -> None:
        with suppress(OSError):
            while answer := line.recv(512):
                client.sendall(answer)


class Seen(NamedTuple):
    """All that takes part."""

    simulator: Simulator
    cable: Cable
    ear: Somebody
    home: HomeAssistant


def announced(ear: Somebody) -> dict[str, Told]:
    """What Home Assistant was told last, by the unique name of each entity."""
    kept = {message.topic: message.payload for message in list(ear.heard) if message.topic.endswith("/config")}
    told = [json.loads(payload) for payload in kept.values() if payload]
    return {each["unique_id"]: each for each in told}


def entities_of(seen: Seen, name: str) -> dict[str, str]:
    """The entities of a drive in Home Assistant, by what they are called there."""
    entities, devices = seen.home.lists()
    of = {each["id"]: each["name"] for each in devices.values()}
    return {each["original_name"]: each["entity_id"] for each in entities.values() if of[each["device_id"]] == name}


def mistakes(seen: Seen, names: Collection[str]) -> Iterator[str]:
    """Where Home Assistant does not have what it was told of these drives."""
    entities, devices = seen.home.lists()
    states, told = seen.home.states(), announced(seen.ear)
    yield from (f"{name} is there and was not announced" for name in set(entities) - set(told))
    if (found := sorted(each["name"] for each in devices.values())) != sorted(names):
        yield f"the devices are {found}"
    for name, each in told.items():
        if name not in entities:
            yield f"{name} is not there"
            continue
        device = devices.get(each["device"]["identifiers"][0], {})
        if entities[name]["device_id"] != device.get("id") or device["model"] != each["device"]["model"]:
            yield f"{name} is of another device"
        state = states.get(entities[name]["entity_id"], {"state": "unknown", "attributes": {}})
        for key in ("unit_of_measurement", "device_class", "state_class"):
            if state["attributes"].get(key) != each.get(key):
                yield f"{name} has as its {key} {state['attributes'].get(key)}"
        shown, said = state["state"], value_of(name, each, seen.ear)
        if "state_topic" in each and shown in ("unknown", "unavailable"):
            yield f"{name} has no value"
        elif said is not None and float(shown) != said:
            yield f"{name} is {shown}, not {said}"


def value_of(name: str, told: Told, ear: Somebody) -> float | None:
    """What the broker was told last of a value; None: the entity is none of a value."""
    state = ear.last(told["state_topic"]) if told.get("expire_after") else None
    found = state["values"].get(name.rpartition("-")[2]) if state else None
    return None if found is None else float(found)


def right(seen: Seen, names: Collection[str]) -> None:
    """Waits until Home Assistant has all that it was told of these drives; the program ends where it does not."""
    soon(
        "that the drives answer",
        lambda: all(seen.ear.last(f"{HERE}/{name}/availability") == "online" for name in names),
    )
    until = time.monotonic() + WITHIN
    while left := list(mistakes(seen, names)):
        if time.monotonic() > until:
            sys.exit("\n".join(left))


def counts(seen: Seen) -> Told:
    """How much it is that Home Assistant has."""
    (entities, devices), told = seen.home.lists(), announced(seen.ear)
    values = sum(value_of(name, each, seen.ear) is not None for name, each in told.items())
    return {"devices": len(devices), "entities": len(entities), "values as the drives gave them": values}


def obeys(seen: Seen, name: str) -> float:
    """The seconds from the press of the button until a motor is at rest."""
    motor, entities = seen.simulator.drive(unit_of(name)), entities_of(seen, name)
    # There is none where a drive counts its setpoint in per cent.
    if "Setpoint" in entities:
        seen.home.order("number/set_value", entities["Setpoint"], value=HZ)
    seen.home.order("button/press", entities["Run forward"])
    soon(f"that {name} turns", lambda: motor.frequency >= (HZ if "Setpoint" in entities else HZ / 2) - 0.1)
    seen.home.order("button/press", entities["Stop"])
    return soon(f"that {name} stops", lambda: motor.state == "stopped")


def unplugged(seen: Seen, name: str) -> dict[str, float]:
    """How soon a drive that falls silent is unavailable, and no other one; and available when it is back."""
    entities = entities_of(seen, name)
    answers = entities.pop("Answers")

    def is_gone() -> bool:
        gone = seen.home.unavailable()
        assert gone <= {*entities.values()}, f"others are unavailable with {name}: {gone}"
        return len(gone) == len(entities)

    assert not seen.home.unavailable()
    seen.cable.off.add(unit_of(name))
    took = soon(f"that {name} is unavailable", is_gone)
    until = time.monotonic() + LASTS
    while time.monotonic() < until:
        assert is_gone()
    # This one says it.
    assert seen.home.states()[answers]["state"] == "off"
    seen.cable.off.clear()
    return {"unavailable": took, "back": soon(f"that {name} is back", lambda: not seen.home.unavailable())}


def killed(seen: Seen, service: subprocess.Popen[bytes]) -> float:
    """How soon all is unavailable when the service is killed."""
    entities = {each["entity_id"] for each in seen.home.lists()[0].values()}
    service.kill()
    return soon("that all is unavailable", lambda: seen.home.unavailable() >= entities)


def forgotten(seen: Seen, name: str, entities: Collection[str]) -> float:
    """How soon a drive that is in the file no more has neither its *entities* nor a device."""

    def is_gone() -> bool:
        listed, devices = seen.home.lists()
        left = {each["entity_id"] for each in listed.values()} | {*seen.home.states()}
        return left.isdisjoint(entities) and name not in {each["name"] for each in devices.values()}

    return soon(f"that {name} is forgotten", is_gone)


def unit_of(name: str) -> int:
    """Its address on the line."""
    return list(FAMILIES).index(name) + 1


def plant(seen: Seen, at: Broker, names: Collection[str]) -> str:
    """A `drivebus.toml` with these drives."""
    drives = "".join(drive(name, unit_of(name), FAMILIES[name], "unverified = true") for name in names)
    return HALL.format(port=seen.cable.port) + drives + PLANT.format(at=at.port, drives=json.dumps(list(names)))


def prepared(simulator: Simulator) -> None:
    """The drives are told at their commissioning that they are controlled over the line."""
    with Bus(simulator, baudrate=115200) as bus:
        for name, family in FAMILIES.items():
            motor = bus.drive(unit_of(name), family)
            motor.prepare_control(store=True, unverified=True)
            motor.write_setpoint(HZ / 2, unverified=True)


def tried(python: Path) -> Told:
    """All of it, one after the other."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "home").mkdir()
        units = {unit_of(name): family for name, family in FAMILIES.items()}
        simulator = stack.enter_context(Simulator(units, transport="tcp", baudrate=115200))
        prepared(simulator)
        at = stack.enter_context(broker(folder))
        ear = stack.enter_context(somebody(at))
        home = stack.enter_context(home_assistant(python, folder / "home"))
        home.use(at)
        seen = Seen(simulator, Cable(simulator.port), ear, home)
        file = folder / "drivebus.toml"
        words = [sys.executable, "-m", "drivebus", "--config", str(file), "serve"]

        def served(names: Collection[str]) -> subprocess.Popen[bytes]:
            file.write_text(plant(seen, at, names), encoding="utf-8")
            service = stack.enter_context(subprocess.Popen(words))
            stack.callback(service.terminate)
            return service

        service = served([*FAMILIES])
        right(seen, FAMILIES)
        found = counts(seen)
        found["stopped by the button after"] = {name: obeys(seen, name) for name in FAMILIES}
        found["silent"] = {name: unplugged(seen, name) for name in FAMILIES}
        found["all unavailable after kill -9"] = killed(seen, service)
        others = [name for name in FAMILIES if name != REMOVED]
        entities = entities_of(seen, REMOVED).values()
        served(others)
        found[f"{REMOVED} forgotten after"] = forgotten(seen, REMOVED, entities)
        right(seen, others)
        found["complaints"] = home.complaints()
    return found


def main() -> int:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--version", default=VERSION, help="of Home Assistant")
    options.add_argument("--python", default="python3.13", help="what it runs on")
    given = options.parse_args()
    found = tried(installed(given.version, given.python))
    print(json.dumps({"Home Assistant": given.version, **found}, indent=1))
    return int(bool(found["complaints"]))


if __name__ == "__main__":
    sys.exit(main())
