"""What a file says of its page: each mistake is named with its line, and no password or hash stands in a message."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from drivebus.cli.app import cli
from drivebus.errors import NotAllowed
from drivebus.service import check
from drivebus.service.page import shown_drives
from drivebus.site import Site, SitePerson
from drivebus.web import is_hash
from drivebus.web.passwords import is_right

from .made_up_plant import make_certificate
from .page_plant import MARIA

HASH = "scrypt$32768$8$1$MDEyMzQ1Njc4OWFiY2RlZg==$xxaWgqTSKTdh7WrfWLps/DMbPoovZsowrLVRbAkJkjA="
"""Of `MARIA`, made by hashlib alone."""
PLANT = f"""\
[lines.hall]
port = "/dev/ttyUSB0"
[drives.pump]
line = "hall"
unit = 1
profile = "gd350"
[web]
address = "127.0.0.1:8080"
dead_man = 10
[[people]]
name = "maria"
password = "{HASH}"
role = "command"
"""


def looked_through(tmp_path: Path, text: str) -> Site:
    file = tmp_path / "drivebus.toml"
    file.write_text(text)
    site = Site.load(file)
    check(site)
    return site


def test_a_file_with_a_page(tmp_path: Path) -> None:
    site = looked_through(tmp_path, PLANT)
    assert site.people == (SitePerson("maria", HASH, "command"),)
    assert site.web is not None
    assert (site.web.address, site.web.dead_man, site.web.hosts) == ("127.0.0.1:8080", 10.0, ())
    assert is_right(MARIA, HASH)
    assert HASH not in repr(site)
    assert HASH.rpartition("$")[2] not in repr(site)


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ('address = "127.0.0.1:8080"', 'address = "0.0.0.0:8080"', 8, "would cross the network unencrypted"),
        ('address = "127.0.0.1:8080"', 'address = "192.168.7.10:8080"', 8, "such as 127.0.0.1:8080"),
        ('address = "127.0.0.1:8080"', 'address = "[::]:8080"', 8, "say in hosts by which names"),
        ('address = "127.0.0.1:8080"', 'address = "plant.example:8080"', 8, "unencrypted"),
        ('address = "127.0.0.1:8080"', "", 7, "web has no address"),
        ("dead_man = 10\n", "", 7, "nothing says what becomes of one"),
        ("dead_man = 10", "dead_man = 1", 9, 'neither "off" nor seconds from 3'),
        ("dead_man = 10", 'hosts = ["https://plant.example"]', 9, "not the name of a computer"),
        ("dead_man = 10", 'certificate = "c.pem"', 7, "certificate and key belong together"),
        ("dead_man = 10", 'certificate = "c.pem"\nkey = "k.pem"', 9, "cannot be used"),
        ("dead_man = 10", "port = 8080", 9, '"port" is not known here'),
        (PLANT[PLANT.index("[[people]]") :], "", 7, "nobody could log in"),
        ('name = "maria"', 'name = ""', 11, "not a text"),
        ('name = "maria"', 'name = "a\\u001b[31m"', 11, "not a name"),
        ('name = "maria"', f'name = "{"m" * 65}"', 11, "up to 64"),
        (HASH, "correct horse", 12, "not what drivebus serve --password prints"),
        (HASH, HASH.replace("32768", "1024"), 12, "not what drivebus serve --password prints"),
        ('role = "command"', 'role = "admin"', 13, 'allowed is "look", "command"'),
        ('role = "command"', "", 10, "people has no role"),
        ('role = "command"', f'role = "look"\n[[people]]\nname = "maria"\npassword = "{HASH}"\n', 15, "another"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, old: str, new: str, line: int, said: str) -> None:
    assert old in PLANT
    with pytest.raises(NotAllowed) as caught:
        looked_through(tmp_path, PLANT.replace(old, new, 1))
    told = str(caught.value)
    assert any(f":{line}: " in each and said in each for each in told.splitlines()), told
    assert "correct horse" not in told
    assert "$" not in told.replace("$(", "")


def test_who_only_looks_needs_no_dead_man(tmp_path: Path) -> None:
    looked_through(tmp_path, PLANT.replace("dead_man = 10\n", "").replace('"command"', '"look"'))
    looked_through(tmp_path, PLANT.replace("dead_man = 10", 'dead_man = "off"'))


@pytest.mark.skipif("sys.platform == 'win32'", reason="files have no owners' rights there")
def test_an_address_of_the_network_needs_a_certificate(tmp_path: Path) -> None:
    chain, key = tmp_path / "chain.pem", tmp_path / "key.pem"
    make_certificate(chain, key)
    secure = 'address = "0.0.0.0:8443"\ncertificate = "chain.pem"\nkey = "key.pem"\nhosts = ["plant.example"]'
    text = PLANT.replace('address = "127.0.0.1:8080"', secure)
    site = looked_through(tmp_path, text)
    assert site.web is not None
    assert site.web.key == key
    key.chmod(0o644)
    with pytest.raises(NotAllowed, match=rf":10: everybody on this computer can read {key}"):
        looked_through(tmp_path, text)


def test_what_may_be_ordered_is_what_each_family_proves(tmp_path: Path) -> None:
    more = """
[drives.meter]
line = "hall"
unit = 2
profile = "gd350"
read_only = true
[drives.stranger]
line = "hall"
unit = 3
[drives.heater]
line = "hall"
unit = 4
profile = "gd3000-rectifier"
[[poll]]
drives = ["pump"]
heartbeat = 30
"""
    drives = shown_drives(looked_through(tmp_path, PLANT.replace("[web]", more + "[web]")))
    assert drives["pump"].may == {"run", "setpoint", "reset", "stop", "coast"}
    assert (drives["pump"].family, drives["pump"].hold) == ("INVT Goodrive350", 75.0)
    assert [drives[name].may for name in ("meter", "stranger", "heater")] == [frozenset()] * 3
    assert "read_only" in drives["meter"].why_not
    assert "no profile" in drives["stranger"].why_not
    assert drives["heater"].why_not == "nothing is known that halts it"
    assert drives["meter"].hold == 0


def test_a_password_becomes_a_line_of_the_file() -> None:
    done = CliRunner().invoke(cli, ["serve", "--password"], input=f"{MARIA}\n{MARIA}\n")
    assert done.exit_code == 0
    found = re.search(r'^password = "(scrypt\$[^"]+)"$', done.stdout, re.MULTILINE)
    assert found is not None
    assert is_hash(found[1])
    assert MARIA not in done.output


@pytest.mark.parametrize(
    ("words", "typed", "said"),
    [
        (["--password"], "short\nshort\n", "10 characters or more"),
        (["--password", "--check"], "", "give one of them"),
        (["--password"], f"{MARIA}\nanother\n", "do not match"),
    ],
)
def test_a_password_that_is_not_taken(words: list[str], typed: str, said: str) -> None:
    done = CliRunner().invoke(cli, ["serve", *words], input=typed)
    assert done.exit_code != 0
    assert said in done.output + str(done.exception)
    assert "scrypt" not in done.output
