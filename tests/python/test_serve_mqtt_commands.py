"""Commands through a real Mosquitto: those of now reach the drive, all others are told and nothing is sent."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from drivebus import Bus, Simulator
from drivebus.service import Service
from drivebus.sim import SimulatedDrive
from drivebus.site import Site

from .mqtt_broker import Broker, Somebody, Way, broker, somebody
from .plant_text import HALL, drive
from .tcp_client import seen

PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2)
    + """[[poll]]
interval = 0.2
registers = ["running_frequency"]
[spool]
[mqtt]
host = "127.0.0.1"
port = {at}
gateway = "hall"
dead_man = {dead_man}
[[mqtt.allow]]
drives = ["pump"]
commands = ["run", "setpoint", "reset"]
"""
)
HERE = "drivebus/hall"


class Plant(NamedTuple):
    """A service of two drives at a broker, one of which may be told something."""

    pump: SimulatedDrive
    fan: SimulatedDrive
    at: Broker
    way: Way
    ear: Somebody
    told: list[str]
    file: Path

    def order(self, what: str, *, drive: str = "pump", age: float = 0.0, **said: Any) -> dict[str, Any]:
        """Orders *what*, and the answer to it."""
        said = {"time": time.time() - age, **said}
        return self.say(what, said, drive=drive)

    def say(self, what: str, said: object, *, drive: str = "pump", **told: Any) -> dict[str, Any]:
        """Says *said* where orders are heard, and the answer to it."""
        before = len(self.answers())
        self.ear.say(f"{HERE}/{drive}/cmd/{what}", said, **told)
        seen(lambda: len(self.answers()) > before)
        return self.answers()[-1]

    def mend(self) -> None:
        """Returns when the service is at the broker again, and hears."""
        times = self.ear.at(f"{HERE}/availability").count("online")
        self.way.mend()
        seen(lambda: self.ear.at(f"{HERE}/availability").count("online") > times)
        assert any("can be used again" in text for text in self.told)

    def answers(self) -> list[dict[str, Any]]:
        """All answers, in their order."""
        return [json.loads(each.payload) for each in list(self.ear.heard) if each.topic.endswith("/result")]


@contextmanager
def plant(folder: Path, dead_man: str = "30") -> Iterator[Plant]:
    file = folder / "drivebus.toml"
    told: list[str] = []
    with (
        Simulator({1: "gd350", 2: "gd350"}, transport="tcp", baudrate=115200) as simulator,
        broker(folder) as at,
        closing(Way(at.port)) as way,
        somebody(at) as ear,
    ):
        with Bus(simulator.port, share="never") as bus:
            for unit in (1, 2):
                bus.drive(unit, "gd350").prepare_control(setpoint="frequency")
                simulator.drive(unit).take_writes()
        file.write_text(PLANT.format(port=simulator.port, at=way.port, dead_man=dead_man))
        with serving(file, told):
            seen(lambda: ear.last(f"{HERE}/pump/availability") == "online")
            yield Plant(simulator.drive(1), simulator.drive(2), at, way, ear, told, file)


@contextmanager
def serving(file: Path, told: list[str]) -> Iterator[None]:
    service = Service(Site.load(file), told.append)
    thread = threading.Thread(target=service.run)
    thread.start()
    try:
        yield
    finally:
        service.end()
        thread.join()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    with plant(tmp_path_factory.mktemp("plant")) as made:
        yield made


def test_a_command_of_now_turns_the_motor(tmp_path: Path) -> None:
    with plant(tmp_path) as made:
        assert made.order("run", id="a", hz=20)["result"] == "done"
        seen(lambda: made.pump.frequency > 0)
        assert made.order("setpoint", hz=10)["result"] == "done"
        seen(lambda: (made.ear.last(f"{HERE}/pump/state") or {}).get("state") == "forward")
        # Whoever stops need say nothing.
        answer = made.say("stop", b"")
        assert (answer["order"], answer["result"]) == ("stop", "done")
        seen(lambda: made.pump.state == "stopped")
        assert made.order("run", hz=15, reverse=True)["result"] == "done"
        seen(lambda: made.pump.state == "reverse")
        assert made.say("coast", {})["result"] == "done"
        assert made.fan.writes() == []
        orders = [each["text"] for each in made.ear.at(f"{HERE}/event") if each["kind"] == "order"]
        seen(lambda: any('command "a" by mqtt: run at 20 Hz: done' in text for text in made.told))
        assert all("mqtt" in text for text in orders)


def test_the_end_of_the_service_halts_what_it_was_told_to_turn(tmp_path: Path) -> None:
    with plant(tmp_path) as made:
        made.order("run", hz=20)
        pump = made.pump
    assert pump.state == "stopped"


NOT_OF_NOW = {
    "kept": "to keep",
    "old": "s old",
    "ahead": "before its time",
    "a day off": "s old",
    "without a time": "does not say when",
    "expires late": "may be delivered for 60 s",
}


@pytest.mark.parametrize(
    ("what", "how"),
    [
        (what, how)
        for what in ("run", "setpoint", "reset", "stop")
        for how in NOT_OF_NOW
        # A stop need not say when.
        if (what, how) != ("stop", "without a time")
    ],
)
def test_a_command_that_is_not_of_now(shared: Plant, what: str, how: str) -> None:
    """Nothing of it is on the line, and it is told."""
    shared.pump.take_writes()
    now = time.time()
    told: dict[str, Any] = {}
    said: dict[str, Any] = {"id": f"{what} {how}", **({"hz": 20} if what in ("run", "setpoint") else {})}
    times = {"kept": now, "old": now - 3.0, "ahead": now + 30.0, "a day off": now - 86_400}
    said |= {"time": times[how]} if how in times else {}
    if how == "kept":
        told["keep"] = True
    elif how == "expires late":
        told["MessageExpiryInterval"] = 60
    answer = shared.say(what, said, **told)
    if how == "kept":
        shared.ear.say(f"{HERE}/pump/cmd/{what}", b"", keep=True)
    assert answer["result"] == "not sent"
    assert NOT_OF_NOW[how] in answer["text"]
    assert shared.pump.take_writes() == []


def test_a_command_that_came_already(shared: Plant) -> None:
    shared.pump.take_writes()
    at = datetime.now(timezone.utc).isoformat()
    assert shared.say("reset", {"id": "twice", "time": at})["id"] == "twice"
    shared.pump.take_writes()
    answer = shared.say("reset", {"id": "twice", "time": at})
    assert (answer["id"], answer["result"]) == ("twice", "not sent")
    assert "in the last 60 s" in answer["text"]
    assert shared.pump.take_writes() == []


@pytest.mark.parametrize(
    ("drive", "what", "said", "why"),
    [
        ("pump", "run", b"on", "not JSON"),
        ("pump", "run", b"x" * 1_000_000, None),
        ("pump", "run", b"x" * 50_000, "50000 bytes"),
        ("pump", "run", {"speed": 1}, "not known here"),
        ("pump", "run", {"hz": "$(reboot)"}, "not a number"),
        ("pump", "run", b'{"hz": NaN}', "not JSON"),
        ("pump", "run", {"hz": -1}, None),
        ("pump", "run", {"hz": 100_000}, None),
        ("pump", "setpoint", {}, "a setpoint needs a frequency"),
        ("pump", "jog", {}, "there is no order"),
        ("pump", "$(reboot)", {}, "there is no order"),
        ("fan", "run", {}, "there is no drive"),
        ("fan", "stop", {}, "there is no drive"),
        ("<script>", "run", {}, "there is no drive"),
        ("pump\u2028all is well", "run", {}, "there is no drive"),
        ("..", "run", {}, "there is no drive"),
        ("x" * 5_000, "run", {}, "there is no drive"),
    ],
)
def test_what_a_stranger_may_say(shared: Plant, drive: str, what: str, said: object, why: str | None) -> None:
    for each in (shared.pump, shared.fan):
        each.take_writes()
    if isinstance(said, bytes) and len(said) > 100_000:
        # The broker keeps it from us, and the next one is heard.
        shared.ear.say(f"{HERE}/{drive}/cmd/{what}", said)
        drive, what, said, why = "pump", "run", b"on", "not JSON"
    answer = shared.say(what, of_now(said), drive=drive)
    # On a busy machine it was too old when it was looked at.
    while " s old" in answer["text"]:
        answer = shared.say(what, of_now(said), drive=drive)
    assert answer["result"] == "not sent", answer
    assert why is None or why in answer["text"]
    assert shared.pump.take_writes() == []
    assert shared.fan.take_writes() == []
    assert all(text.isprintable() for text in shared.told)


def of_now(said: object) -> object:
    return {"time": time.time(), **said} if isinstance(said, dict) else said


def test_an_answer_goes_where_it_is_wanted(shared: Plant) -> None:
    shared.ear.say(f"{HERE}/pump/cmd/run", {"time": 0}, ResponseTopic="my/answers", CorrelationData=b"seven")
    seen(lambda: shared.ear.at("my/answers") != [])
    [message] = [each for each in shared.ear.heard if each.topic == "my/answers"]
    assert message.properties is not None
    assert getattr(message.properties, "CorrelationData", None) == b"seven"
    assert shared.ear.last("my/answers")["result"] == "not sent"


@pytest.mark.parametrize("topic", [f"{HERE}/pump/state", f"{HERE}/pump/cmd/stop"])
def test_an_answer_never_looks_like_what_this_says_itself(shared: Plant, topic: str) -> None:
    before = len(shared.ear.at(topic))
    shared.ear.say(f"{HERE}/pump/cmd/run", {"time": 0, "id": "odd"}, ResponseTopic=topic)
    seen(lambda: (shared.ear.last(f"{HERE}/pump/result") or {}).get("id") == "odd")
    shared.say("run", {"time": 0})
    assert not any("result" in each for each in shared.ear.at(topic)[before:])


def test_what_was_kept_is_never_carried_out_by_who_comes_later(tmp_path: Path) -> None:
    """And what was said while nobody was there is not heard."""
    with plant(tmp_path) as made:
        made.way.cut()
        seen(lambda: any("cannot be used" in text for text in made.told))
        before = len(made.answers())
        for what in ("run", "reset", "stop"):
            made.ear.say(f"{HERE}/pump/cmd/{what}", {"time": time.time() + 1}, keep=True)
        made.ear.say(f"{HERE}/pump/cmd/run", {"time": time.time() + 1, "id": "queued"})
        made.way.mend()
        seen(lambda: len(made.answers()) == before + 3)
        answers = made.answers()[before:]
        assert {each["order"] for each in answers} == {"run", "reset", "stop"}
        assert all("to keep" in each["text"] for each in answers)
        made.say("run", {"time": 0})
        assert made.pump.writes() == []
        assert not any(each["id"] == "queued" for each in made.answers())


@pytest.mark.parametrize("how", ["cut", "silence"])
def test_a_motor_is_halted_when_the_broker_is_gone(tmp_path: Path, how: str) -> None:
    with plant(tmp_path, dead_man="1") as made:
        assert made.order("run", hz=20)["result"] == "done"
        seen(lambda: made.pump.frequency > 0)
        getattr(made.way, how)()
        seen(lambda: made.pump.state == "stopped")
        assert any("halted, for mqtt has not heard of its broker for 1 s" in text for text in made.told)
        made.mend()
        assert made.order("run", hz=10)["result"] == "done"


def test_a_motor_runs_on_where_the_file_says_so(tmp_path: Path) -> None:
    with plant(tmp_path, dead_man='"off"') as made:
        assert made.order("run", hz=20)["result"] == "done"
        made.way.cut()
        seen(lambda: any("cannot be used" in text for text in made.told))
        made.mend()
        assert made.pump.state == "forward"
        assert made.say("stop", b"")["result"] == "done"
