"""A read-only bus sends what has the form of a read, and nothing that only begins as one.

In Huanyang's own protocol, on the same wires and with the same CRC, 02H writes a parameter and 03H commands the motor:
LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_modbus.c, whose frames are function, number of bytes, bytes.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest
from click.testing import CliRunner

from drivebus import Bus, NotAllowed, Refused, Simulator, aio
from drivebus.cli import cli

from .odd_slave import good, on_a_socket, on_a_terminal

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals")

ODD = (
    "03 01 01",  # Huanyang's: run forward
    "03 01 08",  # stop
    "02 03 05 00 11",  # write PD005, byte for byte a read of discrete inputs
    "02 03 05 FF FF",
    "02 02 05 11",
    "01",
    "02",
    "03",
    "04",
    "03 00 00 00",
    "03 00 00 00 01 00",
    "03 00 00 00 00",
    "03 00 00 00 7E",
    "03 FF FF 00 02",
    "02 00 00 07 D1",
    "04 01 00",
    "07 00",
    "11 01",
    "14 07 05 00 04 00 01 00 02",
    "18 04",
)
READS = ("03 21 00 00 02", "04 00 08 00 01", "04 03 00 00 00", "01 00 13 00 13", "02 00 00 00 08", "07", "11")


@contextmanager
def line(kind: str) -> Iterator[tuple[Bus, list[bytes]]]:
    """A read-only bus on a line of this *kind*, and what was heard there."""
    heard: list[bytes] = []

    def plan(request: bytes) -> bytes:
        heard.append(request)
        return good(request)

    with ExitStack() as held:
        if kind == "socket":
            yield held.enter_context(Bus(held.enter_context(on_a_socket(plan)), timeout=5.0, read_only=True)), heard
            return
        path = held.enter_context(on_a_terminal(plan))
        how = {"parity": "N", "timeout": 5.0, "retries": 0}
        others = {"terminal": (), "guest": ({},), "guest of one that is, too": ({"read_only": True},)}.get(kind, ())
        for other in others:
            held.enter_context(Bus(path, **how, **other))  # type: ignore[arg-type]  # as Bus has them
        bus = held.enter_context(Bus(path, **how, read_only=True))  # type: ignore[arg-type]  # as Bus has them
        if kind == "host":
            held.enter_context(Bus(path, **how))  # type: ignore[arg-type]  # as Bus has them
        yield bus, heard


KINDS = ("terminal", "socket", "host", "guest", "guest of one that is, too")


@pytest.mark.parametrize("kind", KINDS)
def test_what_has_not_the_form_of_a_read_is_not_sent(kind: str) -> None:
    with line(kind) as (bus, heard):
        for text in ODD:
            pdu = bytes.fromhex(text)
            for reply_length in (None, 5):
                said = rf"has not the form of a read of function {pdu[0]:02X}H.*Huanyang.*nothing was sent"
                with pytest.raises(NotAllowed, match=said) as error:
                    bus.transact(1, pdu, reply_length)
                assert error.value.started is None
        assert heard == []


@pytest.mark.parametrize("kind", KINDS)
def test_reads_are_sent(kind: str) -> None:
    with line(kind) as (bus, heard):
        for text in READS:
            pdu = bytes.fromhex(text)
            with suppress(Refused):
                bus.transact(1, pdu, len(good(b"\1" + pdu)) - 3)
            assert heard[-1] == b"\1" + pdu


def test_on_a_line_in_virtual_time() -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        with Bus(simulator, read_only=True) as bus:
            for text in ODD:
                with pytest.raises(NotAllowed, match="has not the form of a read"):
                    bus.transact(1, bytes.fromhex(text))
            assert simulator.line.requests == 0
            assert bus.transact(1, bytes.fromhex("03 21 03 00 01"))[0] == 3
            with pytest.raises(Refused):
                bus.read(1, 0x0305, 17, table="discrete")
        with Bus(simulator) as bus, pytest.raises(Refused):
            bus.transact(1, bytes.fromhex("02 03 05 00 11"))


def test_an_event_loop_is_told_the_same() -> None:
    heard: list[bytes] = []

    def plan(request: bytes) -> bytes:
        heard.append(request)
        return good(request)

    async def asks(path: str) -> None:
        async with aio.Bus(path, parity="N", timeout=5.0, read_only=True) as bus:
            for text in ODD:
                with pytest.raises(NotAllowed, match="has not the form of a read"):
                    await bus.transact(1, bytes.fromhex(text))

    with on_a_terminal(plan) as path:
        asyncio.run(asks(path))
    assert heard == []


def test_every_byte_that_is_cut_from_or_changed_in_a_read_leaves_a_read_or_nothing() -> None:
    whole = bytes.fromhex("03 21 00 00 02")
    with line("terminal") as (bus, heard):
        for cut in range(1, 5):
            with pytest.raises(NotAllowed, match="has not the form"):
                bus.transact(1, whole[:cut])
        for place in range(5):
            for bit in range(8):
                heard.clear()
                pdu = bytearray(whole)
                pdu[place] ^= 1 << bit
                try:
                    bus.transact(1, bytes(pdu))
                except NotAllowed:
                    assert heard == []
                except Refused:
                    assert heard
                for request in heard:
                    count = int.from_bytes(request[4:6], "big")
                    if request[1] == 8:
                        continue  # an echo
                    assert request[1] in (1, 2, 3, 4), request
                    assert 1 <= count <= (125 if request[1] in (3, 4) else 2000), request


def test_the_command_raw_is_told_so() -> None:
    heard: list[bytes] = []

    def plan(request: bytes) -> bytes:
        heard.append(request)
        return good(request)

    with on_a_terminal(plan) as path:
        words = ["--port", path, "--format", "8N1", "--read-only", "raw"]
        for text in ("01 03 01 01", "01 02 03 05 00 11"):
            done = CliRunner().invoke(cli, [*words, *text.split()])
            assert done.exit_code == 2
            assert "has not the form of a read of function" in done.stderr
        assert heard == []
        assert CliRunner().invoke(cli, [*words, "01", "03", "21", "00", "00", "02"]).exit_code == 0
