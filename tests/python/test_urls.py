"""Ports as people write them, by the vectors that the Rust tests read too: `tests/vectors/urls.toml`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tomli

from drivebus import Bus, NotAllowed, _native
from drivebus.line import port_urls
from drivebus.profile import profiles
from drivebus.sim import FAULT_KINDS

VECTORS = Path(__file__).resolve().parent.parent / "vectors" / "urls.toml"
URLS = tomli.loads(VECTORS.read_text(encoding="utf-8"))["url"]
FOREIGN = port_urls._PYSERIAL_SCHEMES
OPTIONS = ("clock", "seed", "strict_silence", "echo", "faults", *FAULT_KINDS)
NAMES = {
    "{families}": ", ".join(profiles()),
    "{options}": ", ".join(OPTIONS),
    "{schemes}": ", ".join(f"{scheme}://" for scheme in ("socket", "tcp", "sim", *FOREIGN)),
}


@pytest.mark.parametrize("url", [url for url in URLS if "error" not in url], ids=lambda url: url["port"])
def test_a_port_is_what_it_says(url: dict[str, Any]) -> None:
    scheme, simulator = _native.port_url(url["port"], schemes=FOREIGN, families=profiles(), faults=FAULT_KINDS)
    assert scheme == url["scheme"]
    if scheme != "sim":
        assert simulator == {}
        return
    assert simulator == {
        "units": {int(unit): family for unit, family in url["units"].items()},
        "clock": "virtual" if url.get("virtual") else "real",
        "seed": int(url.get("seed", "0")),
        "strict_silence": url.get("strict", False),
        "echo": url.get("echo", False),
        "faults": url.get("faults", {}),
    }


@pytest.mark.parametrize("url", [url for url in URLS if "error" in url], ids=lambda url: url["port"])
def test_what_is_wrong_is_named(url: dict[str, Any]) -> None:
    expected = url["error"]
    for name, value in NAMES.items():
        expected = expected.replace(name, value)
    with pytest.raises(NotAllowed) as refused:
        Bus(url["port"])
    assert str(refused.value) == expected
