"""Modbus in a capture of a network: RTU over TCP and Modbus TCP are read as what they are, everything else is named."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.python.made_captures import ethernet, framed, interface, packet, pcap, section, tcp

from drivebus.capture.network import Connection, Network, Side
from drivebus.capture.packets import Interface, Packet
from drivebus.cli import cli

TIME = 1_772_705_732
MASTER, GATEWAY = ("10.0.0.9", 50_000), ("10.0.0.2", 502)
ASKED, ANSWER = framed("03 03 30 00 00 02"), framed("03 03 04 03 E8 02 58")
WRITE, REFUSED = framed("03 06 20 01 07 D0"), framed("03 86 02")
READING = "unit 3: read 2 words at 3000H -> 3000H = 1000, 3001H = 600"
SYN, SYN_ACK = 0x02, 0x12

End = tuple[str, int]
Said = tuple[End, End, int, bytes, int]


def mbap(transaction: int, frame: bytes) -> bytes:
    """*frame* as Modbus TCP has it: a head, and no CRC."""
    return struct.pack(">HHH", transaction, 0, len(frame) - 2) + frame[:-2]


def talk(*said: bytes, client: End = MASTER, server: End = GATEWAY, opens: bool = True) -> list[Said]:
    """Segments by turns, the client's first; numbers begin just before they begin anew."""
    at = {client: 2**32 - 6, server: 77}
    segments: list[Said] = []
    if opens:
        segments = [(client, server, at[client] - 1, b"", SYN), (server, client, at[server] - 1, b"", SYN_ACK)]
    for turn, data in enumerate(said):
        source, target = (server, client) if turn % 2 else (client, server)
        segments.append((source, target, at[source], data, 0x18))
        at[source] += len(data)
    return segments


def captured(segments: Iterable[Said]) -> bytes:
    """A capture of Ethernet, ten milliseconds from one packet to the next."""
    return pcap(1, [(TIME + 0.01 * at, ethernet(tcp(*each))) for at, each in enumerate(segments)])


def decoded(tmp_path: Path, data: bytes, *words: str) -> Result:
    path = tmp_path / "a.pcap"
    path.write_bytes(data)
    return CliRunner().invoke(cli, [*words, "decode", str(path)])


def shown(done: Result) -> list[str]:
    assert done.exit_code == 0, done.output
    return [line[30:] for line in done.stdout.splitlines()]


def test_rtu_over_tcp_is_read_and_named(tmp_path: Path) -> None:
    done = decoded(tmp_path, captured(talk(ASKED, ANSWER[:4], b"", ANSWER[4:], WRITE, REFUSED)))
    assert shown(done) == [
        # From one packet to the other: over a network no character takes time.
        f"{READING}, after 30.00 ms",
        "unit 3: write 2001H = 2000 -> refused: exception 02H, after 10.00 ms",
    ]
    assert done.stderr == f"{tmp_path}/a.pcap is of a network: RTU over TCP, server 10.0.0.2:502, 1 connection.\n"


def test_modbus_tcp_is_read_and_named(tmp_path: Path) -> None:
    done = decoded(
        tmp_path, captured(talk(mbap(7, ASKED), mbap(7, ANSWER), mbap(8, WRITE), mbap(8, REFUSED))), "--json"
    )
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(row["unit"], row["turnaround"], row.get("exit_code")) for row in rows] == [
        (3, pytest.approx(0.01), None),
        (3, pytest.approx(0.01), 4),
    ]
    assert rows[0]["values"] == {"0x3000": 1000, "0x3001": 600}
    assert done.stderr == (
        f"{tmp_path}/a.pcap is of a network: Modbus TCP, server 10.0.0.2:502, 1 connection. "
        "Frames are shown as on a serial line, with a CRC.\n"
    )


def test_an_answer_belongs_to_the_request_of_its_transaction(tmp_path: Path) -> None:
    other = framed("04 03 30 00 00 01")
    others = framed("04 03 02 00 05")
    said = [mbap(1, ASKED) + mbap(2, other), mbap(2, others) + mbap(1, ANSWER)]
    done = decoded(tmp_path, captured(talk(*said)))
    assert [line.split(", after")[0] for line in shown(done)] == [READING, "unit 4: read 3000H -> 3000H = 5"]
    done = decoded(tmp_path, captured(talk(mbap(1, ASKED), mbap(0, ANSWER))))
    assert "nothing was asked with the transaction number of 1 answer of 10.0.0.2:502." in done.stderr


@pytest.mark.parametrize(
    ("link", "head"),
    [
        (0, struct.pack("<I", 2)),
        (101, b""),
        (228, b""),
        (108, struct.pack(">I", 2)),
        (113, struct.pack(">HHH8sH", 4, 1, 6, bytes(8), 0x0800)),
        (276, struct.pack(">HHIHBB8s", 0x0800, 0, 1, 1, 4, 6, bytes(8))),
        (1, bytes(12) + struct.pack(">HHHHH", 0x88A8, 5, 0x8100, 6, 0x0800)),
    ],
)
def test_every_way_to_carry_ip_is_known(tmp_path: Path, link: int, head: bytes) -> None:
    packets = [(TIME + 0.01 * at, head + tcp(*each)) for at, each in enumerate(talk(ASKED, ANSWER))]
    assert shown(decoded(tmp_path, pcap(link, packets))) == [f"{READING}, after 10.00 ms"]


def test_it_works_over_ipv6(tmp_path: Path) -> None:
    done = decoded(tmp_path, captured(talk(ASKED, ANSWER, client=("fe80::9", 40_000), server=("fe80::2", 4001))))
    assert shown(done) == [f"{READING}, after 10.00 ms"]
    assert "server [fe80::2]:4001" in done.stderr


def test_who_opened_a_connection_need_not_be_seen(tmp_path: Path) -> None:
    for server in (("10.0.0.2", 502), ("10.0.0.2", 4001)):
        done = decoded(tmp_path, captured(talk(ASKED, ANSWER, server=server, opens=False)))
        assert shown(done) == [f"{READING}, after 10.00 ms"]


def test_a_request_is_answered_on_its_own_connection(tmp_path: Path) -> None:
    one, two = talk(ASKED, ANSWER), talk(WRITE, REFUSED, client=("10.0.0.8", 50_000))
    mixed = [segment for pair in zip(one, two, strict=True) for segment in pair]
    done = decoded(tmp_path, captured(mixed))
    assert [line.split(", after")[0] for line in shown(done)] == [
        READING,
        "unit 3: write 2001H = 2000 -> refused: exception 02H",
    ]
    assert "server 10.0.0.2:502, 2 connections" in done.stderr
    # The same two ends once more: what was said before is nothing of it.
    again = decoded(tmp_path, captured([*talk(ASKED[:5]), *talk(ASKED, ANSWER)]))
    assert READING in again.stdout


def test_each_server_is_a_line_of_its_own(tmp_path: Path) -> None:
    other = ("10.0.0.3", 502)
    done = decoded(tmp_path, captured([*talk(ASKED, ANSWER), *talk(mbap(1, WRITE), mbap(1, REFUSED), server=other)]))
    assert [line for line in done.stdout.splitlines() if line.startswith("10.")] == ["10.0.0.2:502:", "10.0.0.3:502:"]
    assert done.stdout.count("->") == 2


def test_segments_that_are_repeated_late_or_out_of_order_change_nothing(tmp_path: Path) -> None:
    opened = talk(ASKED, ANSWER[:4])
    start = 77 + 4
    late = [(GATEWAY, MASTER, start + at, ANSWER[4 + at : 6 + at], 0x18) for at in (2, 4, 0, 0)]
    alive = (GATEWAY, MASTER, start - 1, b"\x00", 0x10)
    assert shown(decoded(tmp_path, captured([*opened, alive, *late]))) == [f"{READING}, after 50.00 ms"]


@given(st.data())
@settings(max_examples=200)
def test_a_side_is_whole_in_any_order_of_its_segments(data: st.DataObject) -> None:
    wire = bytes(range(200))
    ends = [0, *sorted(data.draw(st.sets(st.integers(1, 199), max_size=12))), 200]
    parts = [(start, wire[start:end]) for start, end in pairwise(ends)]
    parts += data.draw(st.lists(st.sampled_from(parts), max_size=4))
    first = data.draw(st.integers(0, 2**32 - 1))
    side = Side()
    side.begin(first)
    for index, (start, part) in enumerate(data.draw(st.permutations(parts))):
        side.take((first + start) % 2**32, index, None, part, 0)
    side.finish()
    assert [b"".join(record.data for record in run) for run in side.runs] == [wire]


def test_what_the_capture_lost_is_joined_with_nothing(tmp_path: Path) -> None:
    said = talk(ASKED, ANSWER[:4], b"", ANSWER[4:], ASKED, ANSWER)
    del said[3]
    done = decoded(tmp_path, captured(said))
    assert [line.split(", after")[0] for line in shown(done)] == [
        "unit 3: read 2 words at 3000H -> was answered by 5 bytes and no frame [E8 02 58 59 19]",
        "unit 3: read 2 words at 3000H (again, 1) -> 3000H = 1000, 3001H = 600",
    ]
    # Cut short by the capture: what is missing is known by the length that IP tells.
    packets = [(TIME + 0.01 * at, tcp(*each)) for at, each in enumerate(talk(ASKED, ANSWER, ASKED, ANSWER))]
    done = decoded(tmp_path, pcap(101, packets, longest=48))
    assert [line.split(" -> ")[1] for line in shown(done)] == [
        f"was answered by 8 bytes and no frame [{ANSWER[:8].hex(' ').upper()}]"
    ] * 2
    assert "a.pcap: the capture tells of 2 packets that it cut short.\n" in done.stderr
    done = decoded(tmp_path, pcap(101, packets, longest=46))
    assert (done.exit_code, "found in it (4 packets cut short by the capture)" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ([b"GET / HTTP/1.1\r\n\r\n", b"HTTP/1.1 200 OK\r\n\r\n" + bytes(500)], "neither Modbus TCP nor RTU over TCP"),
        ([], "neither Modbus TCP nor RTU over TCP"),
    ],
)
def test_a_network_without_modbus_is_told(tmp_path: Path, said: list[bytes], why: str) -> None:
    done = decoded(tmp_path, captured(talk(*said)))
    assert (done.exit_code, done.stdout) == (2, "")
    assert "is a capture of link type 1 (Ethernet), which is not a serial line" in done.stderr
    assert why in done.stderr


def test_modbus_over_udp_is_named(tmp_path: Path) -> None:
    data = mbap(1, ASKED)
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 28 + len(data), 0, 0, 64, 17, 0, b"\n\0\0\x09", b"\n\0\0\x02")
    datagram = struct.pack(">HHHH", 5000, 502, 8 + len(data), 0) + data
    done = decoded(tmp_path, pcap(1, [(TIME, ethernet(ip + datagram))]))
    assert done.exit_code == 2
    assert "UDP is not read, of which 1 packet went to or from port 502" in done.stderr


def test_modbus_in_a_network_is_left_out_beside_a_serial_line(tmp_path: Path) -> None:
    network = b"".join(packet(TIME * 10**6, ethernet(tcp(*each)), on=0) for each in talk(ASKED, ANSWER))
    serial = packet(TIME * 10**6, WRITE, on=1) + packet((TIME * 1000 + 20) * 1000, REFUSED, on=1)
    done = decoded(tmp_path, section() + interface(1) + interface(147) + network + serial)
    assert [line.split(", after")[0] for line in shown(done)] == [
        "unit 3: write 2001H = 2000 -> refused: exception 02H"
    ]
    assert "interface 0 is left out with 4 packets: link type 1 (Ethernet) is no serial line." in done.stderr


def test_another_protocol_does_not_fill_the_memory() -> None:
    asked: list[Connection] = []

    def is_wanted(connection: Connection) -> bool:
        asked.append(connection)
        return False

    network = Network(is_wanted)
    at = 1
    for index in range(400):
        segment = tcp(GATEWAY, MASTER, at, bytes(1000))
        network.take(index, Packet(Interface(0, 101), None, None, segment))
        at += 1000
    assert len(asked) == 1
    assert list(network.connections()) == []
    assert asked[0].answered.runs == [[]]
