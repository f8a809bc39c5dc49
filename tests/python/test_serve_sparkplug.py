"""A service as an edge node of Sparkplug: its drives are born, live and die for a host at a real broker."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("google.protobuf")

from drivebus import Simulator
from drivebus.errors import NotAllowed
from drivebus.service import check
from drivebus.site import Site

from .mqtt_broker import broker
from .plant_text import HALL, drive, served
from .tcp_client import seen
from .test_sparkplug import Listener

PLANT = (
    HALL
    + drive("pump", 1)
    + drive("fan", 2, "vfd500")
    + """[[poll]]
interval = 0.1
heartbeat = 1
[spool]
[sparkplug]
host = "127.0.0.1"
port = {at}
group = "plant"
node = "hall"
primary_host = "scada"
"""
)


def test_drives_live_and_die_for_a_host(tmp_path: Path) -> None:
    file, heard = tmp_path / "drivebus.toml", list[str]()
    with (
        Simulator({1: "gd350", 2: "vfd500"}, transport="tcp", baudrate=115200) as simulator,
        broker(tmp_path) as at,
        closing(Listener(at.port)) as listener,
    ):
        file.write_text(PLANT.format(port=simulator.port, at=at.port))
        with served(file, heard):
            seen(lambda: {"pump", "fan"} <= listener.host.values.keys())
            assert listener.host.values["pump"]["bus_voltage"] == 537.0
            assert listener.host.values["pump"]["status_word_1"] == 3
            simulator.drive(1).refuse(asked="reads")
            seen(lambda: "pump" not in listener.host.values)
            assert "fan" in listener.host.values
            seen(lambda: str(listener.host.values[""]["event"]).startswith("pump: gives no values"))
        seen(lambda: not listener.host.values)
        assert not listener.wrong


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('node = "hall"', "", "sparkplug has no node"),
        ('node = "hall"', 'node = "a/b"', 'may not have "/"'),
        ('group = "plant"', 'group = "+"', 'may not have "/"'),
        ("[spool]\n", "", "say [spool]"),
        ("port = 1883", "prt = 1883", 'did you mean "port"'),
        ("port = 1883", 'password_file = "none"', "say username"),
        ("port = 1883", 'username = "u"\npassword_file = "none"', "none"),
        ('primary_host = "scada"', 'primary_host = "$x"', 'nor begin with "$"'),
    ],
)
def test_a_mistake_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = tmp_path / "drivebus.toml"
    text = PLANT.format(port="sim://gd350", at=1883)
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(NotAllowed) as caught:
        check(Site.load(file))
    assert said in str(caught.value)
