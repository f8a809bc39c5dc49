"""What clients of Modbus TCP may write, and what becomes of it: by the drives' own logs."""

from __future__ import annotations

import itertools
import json
import struct
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import drivebus
from drivebus import Allow, Bus, Gateway, Simulator

from .conftest import NO_PTY
from .tcp_client import HERE, answer, connected, is_cut_off, request, seen

RUN, STOP, SETPOINT = b"\x06\x20\x00\x00\x01", b"\x06\x20\x00\x00\x05", b"\x06\x20\x01\x13\x88"
CODES = {1: (0x2000, {"run": [1, 2], "jog": [3, 4], "reset": [7]}, [5, 6, 8]), 2: (0x7000, {"run": [1, 2]}, [5, 6])}
"""Where commands go and what they are, and the stops that each writer has: GD350 manual 9.4.4, VFD500 manual A.4."""
PLACES = {1: {"setpoint": [0x2001], "P00.11": [0x000B, 0x800B]}, 2: {"setpoint": [0x7001], "P03.02": [0x0302, 0x8302]}}
"""Where else is written: the same manuals. INVT keeps a write without bit 15, Veikong one with it."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500", 3: "gd600"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture(scope="module")
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.1, retries=0) as bus:
        yield bus


Rule = tuple[str, int, tuple[int, ...], tuple[str, ...], tuple[str, ...]]
"""Who, which unit, by which functions, and what may be written and commanded."""


def rules() -> st.SearchStrategy[list[Rule]]:
    of_unit = st.sampled_from([1, 2]).flatmap(
        lambda unit: st.tuples(
            st.sampled_from(["127.0.0.2", "127.0.0.0/8", "10.0.0.0/8"]),
            st.just(unit),
            st.sets(st.sampled_from([3, 6, 16]), min_size=1).map(lambda some: tuple(sorted(some))),
            st.sets(st.sampled_from([name for name in PLACES[unit] if name != "setpoint"])).map(tuple),
            st.sets(st.sampled_from([*CODES[unit][1], "setpoint"])).map(tuple),
        )
    )
    return st.lists(of_unit, min_size=1, max_size=3)


def may(rules: list[Rule], host: str, unit: int, function: int, address: int, words: list[int]) -> bool:
    """What the rules say, by the manuals."""
    mine = [rule for rule in rules if rule[1] == unit and (rule[0] == "127.0.0.0/8" or rule[0] == host)]
    if function == 3:
        return any(function in rule[2] for rule in mine)
    if function not in (6, 16):
        return False
    place, commands, stops = CODES.get(unit, (0, {}, []))
    for at, word in enumerate(words, address):
        if at == place and word in stops and any(rule[3] or rule[4] for rule in mine):
            continue
        for _, _, functions, names, commanded in mine:
            codes = [code for name in commanded for code in commands.get(name, [])]
            places = [there for name in (*names, *commanded) for there in PLACES[unit].get(name, [])]
            if function in functions and ((at == place and word in codes) or at in places):
                break
        else:
            return False
    return True


WORDS = {3: [[0]], 6: [[1], [3], [5], [6], [7], [9]], 16: [[5], [1, 1000], [5, 1000]], 5: [[1]], 22: [[1]]}
ADDRESSES = (0x2000, 0x2001, 0x7000, 0x7001, 0x000B, 0x800B, 0x0302, 0x8302)
MATRIX = [(function, address, words) for function in WORDS for address in ADDRESSES for words in WORDS[function]]


@settings(max_examples=25)
@given(rules=rules())
def test_the_rules_as_a_matrix(simulator: Simulator, bus: Bus, rules: list[Rule]) -> None:
    """Networks x units x functions x registers: what is refused leaves nothing in any drive's log."""
    drives = {1: bus.drive(1, "gd350"), 2: bus.drive(2, "vfd500", unverified=True)}
    # Functions that write without anything to write, and the other way round, are told as a mistake.
    rules = [
        rule if any(function != 3 for function in rule[2]) == bool(rule[3] or rule[4]) else (*rule[:2], (3,), (), ())
        for rule in rules
    ]
    allow = [Allow([rule[0]], [drives[rule[1]]], rule[2], rule[3], rule[4]) for rule in rules]
    with ExitStack() as stack:
        gateway = stack.enter_context(Gateway(bus, HERE, allow=allow, dead_man="off", answer_within=30.0))
        for host in ("127.0.0.2", "127.0.0.3"):
            client = stack.enter_context(connected(gateway, host))
            for unit, (function, address, words) in itertools.product((1, 2, 3), MATRIX):
                logged(simulator)
                client.sendall(request(1, unit, pdu_of(function, address, words)))
                came = answer(client)[2]
                passes = may(rules, host, unit, function, address, words)
                told = gateway.told()
                if passes and address in (0x000B, 0x8302) and "wears the memory of the drive" in "".join(told):
                    # Some of these are let pass, and no more.
                    passes = False
                if not passes:
                    assert came == bytes([function | 0x80, 1]), (rules, host, unit, function, address, words)
                is_written = passes and function != 3 and not came[0] & 0x80
                expected = list(enumerate(words, address)) if is_written else []
                assert logged(simulator) == {each: expected if each == unit else [] for each in (1, 2, 3)}


def logged(simulator: Simulator) -> dict[int, list[tuple[int, int]]]:
    return {unit: [write[1:] for write in simulator.drive(unit).take_writes()] for unit in (1, 2, 3)}


def pdu_of(function: int, address: int, words: list[int]) -> bytes:
    if function == 3:
        return struct.pack(">BHH", 3, address, 1)
    if function == 16:
        return struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words)
    if function == 22:
        return struct.pack(">BHHH", 22, address, 0, words[0])
    return struct.pack(">BHH", function, address, 0xFF00 if function == 5 else words[0])


@contextmanager
def held(bus: Bus) -> Iterator[None]:
    """A block in which the line is in use, so that all else waits."""
    inside, go_on = threading.Event(), threading.Event()

    def wait(*_: object) -> None:
        inside.set()
        go_on.wait()

    core = bus.line
    assert isinstance(core, drivebus._native.Bus)
    core.watch(wait)
    user = threading.Thread(target=bus.read, args=(1, 0x2103))
    user.start()
    inside.wait()
    try:
        yield
    finally:
        go_on.set()
        user.join()
        core.watch(None)


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_a_write_whose_answer_is_lost_is_sent_once_and_told_so(tmp_path: Path) -> None:
    audit = tmp_path / "audit.jsonl"
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        Bus(simulator, timeout=0.1, retries=2) as bus,
        Gateway(
            bus, HERE, allow=[Allow(drives=[bus.drive(1, "gd350")], commands=["setpoint"])], audit=audit
        ) as gateway,
        connected(gateway) as client,
    ):
        client.sendall(request(1, 1, SETPOINT))
        assert answer(client)[2] == SETPOINT
        simulator.drive(1).take_writes()
        simulator.line.drop_answers()
        client.sendall(request(2, 1, SETPOINT))
        assert answer(client)[2] == b"\x86\x0b"
        assert [write[1:] for write in simulator.drive(1).take_writes()] == [(0x2001, 5000)]
        assert gateway.stats.written == 2
        gateway.close()
    assert [line["outcome"] for line in lines(audit)] == ["done", "may have been done"]


def test_the_audit_tells_who_wrote_what_over_what(bus: Bus, tmp_path: Path) -> None:
    audit, drive = tmp_path / "audit.jsonl", bus.drive(1, "gd350")
    before = drive.profile.encode("P00.11", drive.read("P00.11"))
    with (
        Gateway(bus, HERE, allow=[Allow(drives=[drive], write=["P00.11"])], audit=audit) as gateway,
        connected(gateway) as client,
    ):
        name = "{}:{}".format(*client.getsockname())
        client.sendall(request(1, 1, b"\x06\x80\x0b\x00\x64"))
        assert answer(client)[2] == b"\x06\x80\x0b\x00\x64"
        client.sendall(request(2, 1, b"\x06\x80\x0b\xff\xff"))
        code = answer(client)[2]
        client.sendall(request(3, 1, STOP))
        assert answer(client)[2] == STOP
        client.sendall(request(4, 1, RUN))
        assert answer(client)[2] == b"\x86\x01"
    told = [{key: line[key] for key in line if key not in ("time", "client")} for line in lines(audit)]
    ramp = {"unit": 1, "function": 6, "table": "holding", "address": 0x800B, "registers": ["P00.11"]}
    assert told == [
        {**ramp, "old": [before], "new": [100], "outcome": "done"},
        {**ramp, "old": [100], "new": [0xFFFF], "outcome": "refused", "exception": code[1]},
        {**ramp, "address": 0x2000, "registers": ["stop"], "old": None, "new": [5], "outcome": "done"},
    ]
    assert {line["client"] for line in lines(audit)} == {name}


def test_no_write_goes_out_when_its_client_has_hung_up(tmp_path: Path) -> None:
    """A thousand that wait, of 63 clients."""
    audit = tmp_path / "audit.jsonl"
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        Bus(simulator, timeout=0.1, retries=0) as bus,
        Gateway(
            bus,
            HERE,
            answer_within=60.0,
            allow=[Allow(drives=[bus.drive(1, "gd350")], commands=["run", "setpoint"])],
            dead_man=10.0,
            audit=audit,
        ) as gateway,
    ):
        clients = [connected(gateway, f"127.0.0.{2 + number % 4}") for number in range(63)]
        for client in clients:
            client.sendall(request(1, 1, SETPOINT))
            assert answer(client)[2] == SETPOINT
        simulator.drive(1).take_writes()
        with held(bus):
            for client in clients:
                client.sendall(b"".join(request(n, 1, RUN if n % 4 else SETPOINT) for n in range(16)))
            seen(lambda: gateway.stats.requests == 63 * 17)
            for client in clients[::2]:
                client.close()
            # Half of them are gone before the line is free, and half while it becomes free.
            seen(lambda: gateway.stats.clients == 31)
            for client in clients[1::2]:
                client.close()
        seen(lambda: gateway.stats.clients == 0)
        bus.read(1, 0x2103)
        assert not simulator.drive(1).take_writes()
        assert gateway.stats.halted == 0
        gateway.close()
    outcomes = [line["outcome"] for line in lines(audit)]
    assert (outcomes[:63], outcomes[63:]) == (["done"] * 63, ["not sent"] * 63 * 16)


def test_what_is_too_old_is_answered_in_time_and_never_sent(simulator: Simulator, bus: Bus) -> None:
    allow = [Allow(drives=[bus.drive(1, "gd350")], commands=["run", "setpoint"])]
    with (
        Gateway(bus, HERE, answer_within=0.05, allow=allow, dead_man=60) as gateway,
        connected(gateway) as client,
    ):
        simulator.drive(1).take_writes()
        with held(bus):
            client.sendall(b"".join(request(n, 1, (RUN, SETPOINT, STOP)[n % 3]) for n in range(9)))
            assert sorted(answer(client) for _ in range(9)) == [(n, 1, b"\x86\x0b") for n in range(9)]
        bus.read(1, 0x2103)
        assert not simulator.drive(1).take_writes()
        assert gateway.stats.late == 9


def test_a_stop_of_a_client_is_the_next_frame(simulator: Simulator, bus: Bus) -> None:
    allow = [Allow(drives=[bus.drive(1, "gd350")], commands=["run", "setpoint"])]
    with ExitStack() as stack:
        gateway = stack.enter_context(Gateway(bus, HERE, answer_within=60.0, allow=allow, dead_man=60))
        clients = [stack.enter_context(connected(gateway)) for _ in range(16)]
        clients[0].sendall(request(1, 1, SETPOINT))
        assert answer(clients[0])[2] == SETPOINT
        simulator.drive(1).take_writes()
        with held(bus):
            for client in clients[1:]:
                client.sendall(b"".join(request(n, 1, (RUN, SETPOINT)[n % 2]) for n in range(8)))
            seen(lambda: gateway.stats.requests == 1 + 15 * 8)
            clients[0].sendall(request(2, 1, STOP))
            seen(lambda: gateway.stats.requests == 2 + 15 * 8)
        assert answer(clients[0])[2] == STOP
        came = [answer(client)[2] for client in clients[1:] for _ in range(8)]
        written = [write[1:] for write in simulator.drive(1).take_writes()]
        assert written[0] == (0x2000, 5)
        # What was to start the motor before that is not sent after it.
        assert set(written[1:]) == {(0x2001, 5000)}
        assert sorted(set(came)) == [SETPOINT, b"\x86\x0b"]


def test_what_wears_the_drive_is_not_written_in_a_loop(simulator: Simulator, bus: Bus) -> None:
    with (
        Gateway(bus, HERE, allow=[Allow(drives=[bus.drive(1, "gd350")], write=["P00.11"])]) as gateway,
        connected(gateway) as client,
    ):
        before = simulator.drive(1).eeprom_writes

        def write(place: bytes, word: int) -> bytes:
            client.sendall(request(1, 1, b"\x06" + place + word.to_bytes(2, "big")))
            return answer(client)[2]

        kept = [write(b"\x00\x0b", 100 + turn) for turn in range(20)]
        assert [came[0] for came in kept] == [0x06] * 5 + [0x86] * 15
        assert simulator.drive(1).eeprom_writes - before <= 5
        assert "each write wears the memory of the drive: 800BH is the same in RAM" in gateway.told()[-1]
        assert [write(b"\x80\x0b", 200 + turn)[0] for turn in range(20)] == [0x06] * 20


@NO_PTY
def test_another_drive_at_the_address_gets_nothing(tmp_path: Path) -> None:
    """The port comes back with another drive at the address."""
    with ExitStack() as stack:
        first = stack.enter_context(Simulator({1: "gd350"}, transport="pty"))
        second = stack.enter_context(Simulator({1: "vfd500"}, transport="pty"))
        port = tmp_path / "port"
        port.symlink_to(first.port)
        bus = stack.enter_context(Bus(str(port), timeout=0.5, share="never"))
        allow = [Allow(drives=[bus.drive(1, "gd350")], commands=["run"])]
        gateway = stack.enter_context(Gateway(bus, HERE, answer_within=20.0, dead_man=20, allow=allow))
        client = stack.enter_context(connected(gateway))
        client.sendall(request(1, 1, STOP))
        assert answer(client)[2] == STOP
        port.unlink()
        port.symlink_to(second.port)
        first.close()
        told, came = "", set()
        while "another drive answers at its address: nothing was sent" not in told:
            client.sendall(request(2, 1, RUN))
            came.add(answer(client)[2])
            told += "".join(gateway.told())
        assert came <= {b"\x86\x0b", b"\x86\x0a"}
        assert not second.drive(1).take_writes()
        assert gateway.stats.written == 1


@pytest.mark.parametrize(
    ("allow", "said"),
    [
        ({"drives": [1], "write": [0x2000]}, "it is the command register of"),
        ({"drives": [1], "commands": ["run"]}, "no drive that is known"),
        ({"commands": ["run"]}, "which are they"),
        ({"write": ["P00.11"]}, "which are they"),
        ({"drives": ["pump"], "commands": ["rum"]}, 'did you mean "run"'),
        ({"drives": ["pump"], "write": ["P00.99"]}, "P00.99"),
        ({"drives": ["pump"], "write": ["control_command"]}, "takes commands"),
        ({"drives": ["pump"], "write": ["status_word_1"]}, "can only be read"),
        ({"drives": ["pump"], "write": [0x000B]}, "by its name or code"),
        ({"drives": ["pump"], "functions": [6]}, "need what may be written"),
        ({"drives": ["pump"], "functions": [22], "write": ["P00.11"]}, "function 22"),
        ({"networks": ["10.0.0.1/8"]}, "host bits set"),
        ({"networks": "10.0.0.0/8"}, "networks is a list"),
        ({"drives": [256]}, "256"),
        ({"drives": ["pump"], "commands": ["run"]}, "say dead_man"),
    ],
)
def test_a_wrong_rule_is_told_and_nothing_listens(bus: Bus, allow: dict[str, object], said: str) -> None:
    drives = [bus.drive(1, "gd350") if each == "pump" else each for each in allow.get("drives", [])]  # type: ignore[attr-defined]
    with pytest.raises(drivebus.NotAllowed, match=said):
        Gateway(bus, HERE, allow=[Allow(**{**allow, "drives": drives})])  # type: ignore[arg-type]


def test_an_audit_that_cannot_be_written_is_told_before_anything_listens(bus: Bus, tmp_path: Path) -> None:
    with pytest.raises(drivebus.PortError, match="Is a directory"):
        Gateway(bus, HERE, audit=tmp_path)


def test_units_that_are_none_of_the_specification_only_where_listed(simulator: Simulator, bus: Bus) -> None:
    with Gateway(bus, HERE, allow=[Allow(drives=[0], write=[0x0010]), Allow(drives=[1])]) as gateway:
        for each in (1, 2, 3):
            simulator.drive(each).take_writes()
        with connected(gateway) as client:
            client.sendall(request(1, 0, b"\x06\x00\x10\x00\x07"))
            assert answer(client) == (1, 0, b"\x06\x00\x10\x00\x07")
            client.sendall(request(2, 250, b"\x03\x21\x03\x00\x01"))
            assert answer(client) == (2, 250, b"\x83\x01")
            client.sendall(request(3, 2, b"\x03\x21\x03\x00\x01"))
            assert answer(client) == (3, 2, b"\x83\x01")
    assert gateway.stats.written == 1


def test_a_client_cut_off_ends_only_itself(bus: Bus) -> None:
    with Gateway(bus, HERE, allow=[Allow(["127.0.0.2"])]) as gateway:
        with connected(gateway, "127.0.0.3") as client:
            client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
            assert answer(client) == (1, 1, b"\x83\x01")
            client.sendall(b"GET / HTTP/1.1\r\n\r\n")
            assert is_cut_off(client)
        with connected(gateway, "127.0.0.2") as client:
            client.sendall(request(1, 1, b"\x03\x21\x03\x00\x01"))
            assert answer(client) == (1, 1, b"\x03\x02\x01\xa0")
