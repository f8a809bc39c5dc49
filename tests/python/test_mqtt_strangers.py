"""Who is at the broker, and who is the broker: certificates, passwords, and what strangers hear. A real Mosquitto."""

from __future__ import annotations

import shutil
import ssl
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from drivebus import Simulator
from drivebus.errors import NotAllowed
from drivebus.service import check
from drivebus.site import Site

from .mqtt_broker import Broker, Somebody, broker, environment, program
from .plant_text import served
from .tcp_client import seen
from .test_serve_mqtt import PLANT

SECRET = "a secret that nobody is told"
HERE = "drivebus/hall 1"
RULES = """
user hall-1
topic readwrite drivebus/hall 1/#
user watcher
topic read drivebus/#
"""


def certificate(folder: Path, name: str, subject: str) -> Path:
    """One that vouches for itself, for the *subject* of its extension; the key is beside it."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is missing")
    made = folder / f"{name}.pem"
    line = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=broker"
    more = ["-addext", f"subjectAltName={subject}", "-keyout", str(folder / f"{name}.key"), "-out", str(made)]
    subprocess.run([*line.split(), *more], check=True, capture_output=True)
    return made


@contextmanager
def strict(folder: Path, name: str = "broker", subject: str = "IP:127.0.0.1") -> Iterator[Broker]:
    """A broker that is encrypted, lets nobody in without a password, and lets each do what is meant for it."""
    made = certificate(folder, name, subject)
    passwords = folder / "passwords"
    for who in ("hall-1", "watcher"):
        add = [program("mosquitto_passwd"), "-b", *(() if passwords.exists() else ("-c",)), passwords, who, SECRET]
        subprocess.run(add, check=True, capture_output=True, env=environment())
    (folder / "acl").write_text(RULES)
    with broker(
        folder,
        f"allow_anonymous false\ncertfile {made}\nkeyfile {made.with_suffix('.key')}\n"
        f"password_file {passwords}\nacl_file {folder / 'acl'}\n",
    ) as at:
        yield at


def plant(folder: Path, port: str, at: Broker, *, trusts: str = "broker.pem", secret: str = SECRET) -> Path:
    """The file of a service that says *secret*, and believes whom the certificate *trusts* vouches for."""
    password = folder / "password"
    password.write_text(f"{secret}\n")
    password.chmod(0o600)
    file = folder / "drivebus.toml"
    more = f'tls = true\nca_file = "{trusts}"\nusername = "hall-1"\npassword_file = "password"\n'
    file.write_text(PLANT.format(port=port, at=at.port) + more)
    return file


def as_watcher(folder: Path, secret: str | None = SECRET) -> Callable[[paho.Client], object]:
    def ready(client: paho.Client) -> None:
        client.tls_set_context(ssl.create_default_context(cafile=str(folder / "broker.pem")))
        if secret is not None:
            client.username_pw_set("watcher", secret)

    return ready


def test_an_encrypted_way_with_a_password(tmp_path: Path) -> None:
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator, strict(tmp_path) as at:
        ear = Somebody(at, as_watcher(tmp_path))
        try:
            with served(plant(tmp_path, simulator.port, at), heard) as service:
                seen(lambda: ear.last(f"{HERE}/pump/availability") == "online")
                seen(lambda: ear.at(f"{HERE}/history") != [])
                status = service.status()["outlets"]["mqtt"]
            assert status["connected"]
            assert SECRET not in str(status) + str(heard)
        finally:
            ear.close()


@pytest.mark.parametrize(
    ("subject", "trusts", "secret", "why"),
    [
        ("IP:127.0.0.1", "other.pem", SECRET, "its certificate is not trusted: self"),
        ("DNS:broker.example", "broker.pem", SECRET, "its certificate is not trusted: IP address mismatch"),
        ("IP:127.0.0.1", "broker.pem", "another one", "not authorized"),
        ("IP:127.0.0.1", "broker.pem", "", "not authorized"),
    ],
)
def test_whom_one_does_not_believe_is_told_nothing(
    tmp_path: Path, subject: str, trusts: str, secret: str, why: str
) -> None:
    heard: list[str] = []
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        strict(tmp_path, subject=subject) as at,
    ):
        certificate(tmp_path, "other", "IP:127.0.0.1")
        file = plant(tmp_path, simulator.port, at, trusts=trusts, secret=secret)
        with served(file, heard) as service:
            seen(lambda: any("cannot be used" in text for text in heard))
            [told] = [text for text in heard if "cannot be used" in text]
            status = service.status()["outlets"]["mqtt"]
            assert why in told
            assert not status["connected"]
            assert why in status["why"]
            assert status["delivered"] == 0
        assert SECRET not in str(heard)


@pytest.mark.parametrize("who", ["nobody", "with a wrong password"])
def test_who_has_no_password_hears_nothing(tmp_path: Path, who: str) -> None:
    with strict(tmp_path) as at:
        client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        as_watcher(tmp_path, None if who == "nobody" else "guessed")(client)
        codes: list[int] = []
        client.on_connect = lambda _, __, ___, code, ____: codes.append(code.value)
        client.connect("127.0.0.1", at.port, clean_start=True)
        while not codes:
            client.loop(0.01)
        assert codes == [135]
        client.disconnect()


def test_who_only_watches_moves_nothing(tmp_path: Path) -> None:
    """Each topic is tried: the broker keeps it, and no answer comes."""
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator, strict(tmp_path) as at:
        ear = Somebody(at, as_watcher(tmp_path))
        file = plant(tmp_path, simulator.port, at)
        rule = '[[mqtt.allow]]\ndrives = ["pump"]\ncommands = ["reset"]\n'
        file.write_text(file.read_text() + rule)
        try:
            with served(file, heard):
                seen(lambda: ear.last(f"{HERE}/pump/availability") == "online")
                # Refused by the broker: that is the answer to each.
                for order in ("run", "setpoint", "reset", "stop", "coast"):
                    ear.say(f"{HERE}/pump/cmd/{order}", b"")
                ear.say(f"{HERE}/pump/state", {"quality": "good"}, keep=True)
                states = len(ear.at(f"{HERE}/pump/state"))
                simulator.drive(1).trip("OL1")
                seen(lambda: len(ear.at(f"{HERE}/pump/state")) > states)
        finally:
            ear.close()
        assert ear.at(f"{HERE}/pump/result") == []
        assert simulator.drive(1).writes() == []
        assert all(each["values"] or each["quality"] == "gone" for each in ear.at(f"{HERE}/pump/state"))


def test_what_the_broker_does_not_take_waits(tmp_path: Path) -> None:
    """It is told, and it comes when the broker takes it."""
    heard: list[str] = []
    with Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator, strict(tmp_path) as at:
        (tmp_path / "acl").write_text(RULES.replace("hall 1/#", "hall 1/pump/#"))
        at.kill()
        at.start()
        ear = Somebody(at, as_watcher(tmp_path))
        try:
            with served(plant(tmp_path, simulator.port, at), heard) as service:
                seen(lambda: any("refuses drivebus/hall 1/history: not authorized" in text for text in heard))
                assert service.status()["outlets"]["mqtt"]["delivered"] == 0
                # It goes on meanwhile: who listens there would miss the first that comes after a new start.
                (tmp_path / "acl").write_text(RULES)
                at.reload()
                seen(lambda: service.status()["outlets"]["mqtt"]["delivered"] > 20)
        finally:
            ear.close()
        assert ear.at(f"{HERE}/history")[0][0]["seq"] < 5


def test_a_password_that_others_may_read_is_not_used(tmp_path: Path) -> None:
    with strict(tmp_path) as at:
        file = plant(tmp_path, "sim://gd350", at)
        (tmp_path / "password").chmod(0o640)
        with pytest.raises(NotAllowed, match="others may read the password") as caught:
            check(Site.load(file))
        assert SECRET not in str(caught.value)
