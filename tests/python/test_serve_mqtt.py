"""A service at a real Mosquitto: what drives say is there, of now and all of it, whatever ends in between."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import pytest

from drivebus import Simulator
from drivebus.errors import NotAllowed
from drivebus.service import Service, check
from drivebus.sinks import Commander, Mqtt, MqttSettings, Picture
from drivebus.site import Site
from drivebus.spool import Spool

from .delivering import SIZE, cut_afterwards, feed, held, quiet
from .mqtt_broker import Broker, Somebody, Way, broker, somebody
from .plant_text import HALL, drive, served
from .tcp_client import seen

PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2, "vfd500")
    + """[[poll]]
interval = 0.1
heartbeat = 1
[spool]
[mqtt]
host = "127.0.0.1"
port = {at}
gateway = "hall 1"
"""
)
HERE = "drivebus/hall 1"


def is_all_in(service: Service) -> bool:
    """Whether the broker has what was spooled a moment ago."""
    status = service.status()["outlets"]["mqtt"]
    return bool(status["connected"] and status["delivered"] and not status["behind"])


def samples(ear: Somebody) -> list[dict[str, Any]]:
    return [sample for batch in ear.at(f"{HERE}/history") for sample in batch]


def numbers(ear: Somebody) -> list[tuple[str, int]]:
    return [(each["epoch"], each["seq"]) for each in [*samples(ear), *ear.at(f"{HERE}/event")]]


def test_what_drives_say_is_at_the_broker(tmp_path: Path) -> None:
    """And a drive that is gone shows no values any more."""
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        broker(tmp_path) as at,
        somebody(at) as ear,
    ):
        file.write_text(PLANT.format(port=simulator.port, at=at.port))
        with served(file, heard) as service:
            seen(lambda: (ear.last(f"{HERE}/pump/state") or {}).get("quality") == "good")
            state = ear.last(f"{HERE}/pump/state")
            assert state["values"]["bus_voltage"] == 537.0
            assert (state["state"], state["fault"]) == ("stopped", None)
            assert state["time"].endswith("Z")
            assert 0 <= state["age"] < 60
            seen(lambda: ear.last(f"{HERE}/fan/availability") == "online")
            assert ear.last(f"{HERE}/availability") == "online"
            seen(lambda: is_all_in(service))
            simulator.drive(1).refuse(asked="reads")
            seen(lambda: ear.last(f"{HERE}/pump/availability") == "offline")
            state = ear.last(f"{HERE}/pump/state")
            assert (state["quality"], state["values"], state["state"]) == ("gone", {}, None)
            assert state["missing"]
            seen(lambda: any(each["kind"] == "gone" for each in ear.at(f"{HERE}/event")))
            seen(lambda: any(each.get("missing") for each in samples(ear)))
        seen(lambda: ear.last(f"{HERE}/availability") == "offline")
    sample = next(each for each in samples(ear) if each["drive"] == "fan")
    assert set(sample) == {"epoch", "seq", "time", "took", "drive", "values"}
    assert all(message.retain is False for message in ear.heard)


def test_nothing_is_lost_when_the_broker_dies(tmp_path: Path) -> None:
    """Nor when the service ends meanwhile: each number is there, once or more often."""
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        broker(tmp_path) as at,
        closing(Way(at.port)) as way,
        somebody(at) as ear,
    ):
        file.write_text(PLANT.format(port=simulator.port, at=way.port))
        with served(file, heard) as service:
            seen(lambda: is_all_in(service))
            # What is under way now was perhaps taken, and perhaps not.
            way.cut()
            seen(lambda: any("cannot be used" in text for text in heard))
            at.kill()
            spooled = service.picture().spooled
            seen(lambda: service.picture().spooled > spooled + 20)
            seen(lambda: not ear.client.is_connected())
            at.start()
            seen(lambda: ear.hears)
            way.mend()
            seen(lambda: any("can be used again" in text for text in heard))
            seen(lambda: is_all_in(service))
            before = service.picture().spooled
            seen(lambda: service.picture().spooled > before + 20)
        with served(file, heard) as service:
            seen(lambda: is_all_in(service))
    assert lacking_of(tmp_path / "drivebus-spool", ear) == []
    assert len(set(numbers(ear))) > 60


def test_nothing_is_lost_when_the_service_is_killed(tmp_path: Path) -> None:
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        broker(tmp_path) as at,
        somebody(at) as ear,
    ):
        file.write_text(PLANT.format(port=simulator.port, at=at.port))
        for turn in range(1, 3):
            before = len(numbers(ear))
            with subprocess.Popen([sys.executable, "-c", SERVES, str(file)], stderr=subprocess.DEVNULL) as killed:
                seen(lambda b=before: len(numbers(ear)) > b + 30)  # type: ignore[misc]
                killed.kill()
            # The broker says it for who was killed.
            seen(lambda t=turn: ear.at(f"{HERE}/availability").count("offline") == t)  # type: ignore[misc]
        with served(file, heard) as service:
            seen(lambda: is_all_in(service))
    assert lacking_of(tmp_path / "drivebus-spool", ear) == []


def test_a_spool_that_is_cut_anywhere(quick_folder: Path, tmp_path: Path) -> None:
    """What it has is at the broker, and nothing that it never had."""
    path, chance = quick_folder / "spool", Random(34)
    has: set[tuple[str, int]] = set()
    had: set[tuple[str, int]] = set()
    with broker(tmp_path) as at, somebody(at) as ear:
        settings = MqttSettings("127.0.0.1", at.port, "hall 1", tls=False)
        for _ in range(100):
            spool = Spool(path, SIZE, quiet)
            with closing(spool.reader("test")) as reader:
                feed(spool, 10)
                has |= held(reader).keys()
                mqtt = Mqtt(settings, [], lambda: Picture(0.0, ()), spool, None, quiet)
                mqtt.start()
                until_told(ear, has)
                # Some of these are told, and all of them may be gone when it was cut.
                feed(spool, 10)
                had |= held(reader).keys()
            with cut_afterwards(path, chance):
                mqtt.close()
                spool.close()
    assert has <= set(numbers(ear)) <= had
    assert len({epoch for epoch, _ in has}) == 100


def until_told(ear: Somebody, wanted: set[tuple[str, int]]) -> None:
    seen(lambda: wanted <= set(numbers(ear)))


SERVES = """
import sys
from pathlib import Path
from drivebus.service import Service
from drivebus.sinks import Commander, Mqtt, MqttSettings, Picture
from drivebus.site import Site
Service(Site.load(Path(sys.argv[1])), print).run()
"""


def lacking_of(path: Path, ear: Somebody) -> list[tuple[str, int]]:
    """What the spool has, up to the last that the broker was given, and nobody heard."""
    with Spool(path, 1 << 30, print) as spool, closing(spool.reader("test")) as reader:
        kept = [(each.epoch, each.seq) for each in reader.after(0, 100_000)]
    told = set(numbers(ear))
    # What the last service kept in its last second is for the next one.
    last = max(place for place, each in enumerate(kept) if each in told)
    return [each for each in kept[: last + 1] if each not in told]


def test_a_drive_that_was_removed_leaves_nothing(tmp_path: Path) -> None:
    """Neither its state nor what Home Assistant was told of it."""
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator, broker(tmp_path) as at:
        text = PLANT.format(port=simulator.port, at=at.port) + 'home_assistant = "ha"\n'
        file.write_text(text)
        with served(file, heard), somebody(at) as ear:
            seen(lambda: ear.last(f"{HERE}/fan/availability") == "online")
            seen(lambda: sum("/fan-" in topic for topic in kept_at(at)) > 5)
        before = kept_at(at)
        assert f"{HERE}/fan/state" in before
        fan = '[drives.fan]\nline = "hall"\nunit = 2\nprofile = "vfd500"\n'
        assert fan in text
        file.write_text(text.replace(fan, "").replace("interval", 'registers = ["bus_voltage"]\ninterval'))
        with served(file, heard):
            seen(lambda: not any("fan" in topic for topic in kept_at(at)))
            seen(lambda: not any("output_current" in topic for topic in kept_at(at)))
            assert any("bus_voltage" in topic for topic in kept_at(at))


def kept_at(at: Broker) -> set[str]:
    """The topics at which the broker keeps something."""
    with somebody(at) as ear, somebody(at) as other:
        # What is kept comes before what is said later.
        other.say("here", "now")
        seen(lambda: ear.at("here") != [])
        return {message.topic for message in ear.heard if message.retain and message.payload}


def test_home_assistant_is_told_again_at_its_birth(tmp_path: Path) -> None:
    file = tmp_path / "drivebus.toml"
    heard: list[str] = []
    with Simulator({1: "gd350"}, transport="tcp", baudrate=115200) as simulator, broker(tmp_path) as at:
        text = PLANT.format(port=simulator.port, at=at.port).replace("unit = 2", "unit = 7")
        file.write_text(text + 'home_assistant = "ha"\n')
        topic = "ha/binary_sensor/hall_1_8a8e2c4b/pump-drive_answers/config"
        with served(file, heard), somebody(at) as ear:
            seen(lambda: ear.last(topic) is not None)
            times = len(ear.at(topic))
            ear.say("ha/status", "online")
            seen(lambda: len(ear.at(topic)) > times)
            told = ear.last(topic)
            assert (told["device_class"], told["device"]["name"]) == ("connectivity", "pump")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[spool]\n", "", "samples wait in a spool until the broker has them: say [spool]"),
        ('gateway = "hall 1"', "", "mqtt has no gateway"),
        ('"hall 1"', '"hall/1"', 'it may not have "/", "+" or "#" in it'),
        ('"hall 1"', '"hall\\u0007"', "characters in it that cannot be seen"),
        ("gateway", 'topic = "a//b"\ngateway', "it may not be empty"),
        ("gateway", 'password_file = "none"\ngateway', "a password is one of somebody: say username"),
        ("gateway", 'username = "me"\npassword_file = "none"\ngateway', "cannot be read"),
        ("gateway", 'ca_file = "none"\ngateway', "say tls = true"),
        ("gateway", 'tls = true\nca_file = "none"\ngateway', "the certificates in"),
        ("gateway", "dead_man = 0.2\ngateway", 'neither "off" nor seconds from 1 to 3600'),
    ],
)
def test_a_mistake_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    told_of(tmp_path, PLANT.replace(old, new, 1), said)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ('drives = ["pump"]\ncommands = ["run"]', "nothing says what becomes of it when they are gone: say dead_man"),
        ('drives = ["pump"]\ncommands = ["jog"]', 'commands = [\'jog\']: allowed is "run", "setpoint", "reset"'),
        ('drives = ["pumps"]\ncommands = ["run"]', 'there is no drive or group "pumps"'),
        ('commands = ["run"]', "mqtt.allow has no drives"),
    ],
)
def test_a_mistake_in_what_is_allowed_is_told(tmp_path: Path, rule: str, said: str) -> None:
    told_of(tmp_path, f"{PLANT}[[mqtt.allow]]\n{rule}\n", said)


def told_of(folder: Path, plant: str, said: str) -> None:
    file = folder / "drivebus.toml"
    file.write_text(plant.format(port="sim://gd350", at=1883))
    with pytest.raises(NotAllowed) as caught:
        check(Site.load(file))
    assert said in str(caught.value)


def test_without_the_library_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    for name in ("drivebus.sinks.mqtt_link", "drivebus.sinks.mqtt_client"):
        monkeypatch.delitem(sys.modules, name, raising=False)
        monkeypatch.delattr(name, raising=False)
    told_of(tmp_path, PLANT, "pip install 'drivebus[mqtt]'")


def test_the_way_is_encrypted_unless_the_file_says_otherwise(tmp_path: Path) -> None:
    file = tmp_path / "drivebus.toml"
    for host, more, expected in (
        ("broker.example", "", (True, 8883)),
        ("127.0.0.1", "", (False, 1883)),
        ("localhost", "", (False, 1883)),
        ("broker.example", "tls = false\n", (False, 1883)),
        ("::1", "tls = true\n", (True, 8883)),
    ):
        file.write_text(f'[spool]\n[mqtt]\nhost = "{host}"\ngateway = "g"\n{more}')
        told = Site.load(file).mqtt
        assert told is not None
        assert (told.broker.tls, told.broker.port) == expected


def test_what_goes_wrong_is_told_and_the_watch_goes_on(tmp_path: Path) -> None:
    heard: list[str] = []
    silences: list[float] = []

    def look() -> Picture:
        raise ValueError("nobody thought of this")

    commander = Commander(lambda _, __: None, lambda _, __: None, lambda: False, silences.append)
    with broker(tmp_path) as at:
        mqtt = Mqtt(MqttSettings("127.0.0.1", at.port, "g", tls=False), [], look, None, commander, heard.append)
        mqtt.start()
        seen(lambda: any("could not be said" in text and "nobody thought of this" in text for text in heard))
        before = len(silences)
        seen(lambda: len(silences) > before)
        assert mqtt.status() == {"connected": True, "why": "", "behind": 0, "delivered": 0}
        mqtt.close()
        mqtt.close()
    assert len([text for text in heard if "nobody thought" in text]) == 1
