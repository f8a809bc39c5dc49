"""`drivebus decode` of a log: exchanges and their values, what is wrong, what was not used, and how it ends."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from drivebus.cli import cli

ASKED, ANSWER = "03 03 30 00 00 02 CA E9", "03 03 04 03 E8 02 58 59 19"
READ = "unit 3: read 2 words at 3000H -> 3000H = 1000, 3001H = 600"


def decode(folder: Path, text: str | bytes) -> Result:
    file = folder / "line.log"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return CliRunner().invoke(cli, ["decode", str(file)])


def said(result: Result) -> str:
    return " ".join(result.output.split())


@pytest.mark.parametrize(
    "text",
    [
        f"TX: {ASKED}\nRX: {ANSWER}\n",
        f"RX: {ASKED}\nTX: {ANSWER}\n",
        f"9 {ASKED}\n10 {ANSWER}\n",
        f"09:15:30 {ASKED} 09:15:31 {ANSWER}\n",
        "03 03 3000 0002 CAE9\n03 03 04 03E8 0258 5919\n",
        "TX: 3, 3, 48, 0, 0, 2, 202, 233\nRX: 3, 3, 4, 3, 232, 2, 88, 89, 25\n",
        f"{ASKED}\n{ANSWER}\n".encode("utf-16"),
        f"{ASKED}\r\n{ANSWER}\r\n".encode("utf-8-sig"),
        f"Größe {ASKED}\n{ANSWER}\0\0\n".encode("latin-1"),
    ],
)
def test_a_read_is_paired_and_has_its_values(tmp_path: Path, text: str | bytes) -> None:
    result = decode(tmp_path, text)
    assert (result.exit_code, said(result)) == (0, READ)


def test_a_frame_that_is_wrong_inside_is_called_that(tmp_path: Path) -> None:
    for text, says in [
        (
            "0A 10 00 01 00 03 06 0A 0B 0C EE 98",
            "unit 10: write of 3 words with 3 bytes of data where 6 are announced; the CRC is right",
        ),
        (
            "01 04 00 00 00 02 71 CB\n01 04 00 22 C0",
            "unit 1: read 2 input registers at 0000H -> answers with 0 words, 2 were asked for; the CRC is right "
            "[01 04 00 22 C0]",
        ),
        (
            # One word where two were asked for.
            "01 04 00 00 00 02 71 CB\n01 04 02 00 07 F8 F2",
            "unit 1: read 2 input registers at 0000H -> answers with 1 word, 2 were asked for; the CRC is right "
            "[01 04 02 00 07 F8 F2]",
        ),
    ]:
        result = decode(tmp_path, text)
        assert (result.exit_code, said(result)) == (0, says)
    pasted = CliRunner().invoke(cli, ["decode", "0A 10 00 01 00 03 06 0A 0B 0C EE 98"])
    assert pasted.exit_code == 0
    assert "write of 3 words with 3 bytes of data where 6 are announced; the CRC is right" in said(pasted)


def test_a_write_that_is_wrong_inside_ends_the_request_before_it(tmp_path: Path) -> None:
    result = decode(tmp_path, f"TX: {ASKED}\nTX: 0A 10 00 01 00 03 06 0A 0B 0C EE 98\n")
    assert "did not answer" in said(result)
    assert said(result).index("did not answer") < said(result).index("write of 3 words")


@pytest.mark.parametrize(
    "text",
    [
        "nothing of that kind\n",
        "",
        "12:00:00 the motor runs at 50 Hz\n",
        "TX: 03 03 30 00 00 02 CA E8\n",
        b"\xff\x00" * 99,
    ],
)
def test_a_file_without_a_frame_says_what_was_looked_for(tmp_path: Path, text: str | bytes) -> None:
    result = decode(tmp_path, text)
    assert result.exit_code == 2
    assert "holds no frame" in said(result)
    assert "looked for: bytes as hexadecimal, decimal, octal or binary numbers" in said(result)


def test_damage_is_shown_with_the_right_crc(tmp_path: Path) -> None:
    result = decode(tmp_path, f"TX: {ASKED}\nRX: {ANSWER}\nTX: 03 03 30 00 00 02 CA E8\n")
    assert result.exit_code == 0
    assert "8 bytes are not a frame: the CRC of the bytes is CA E9, with them came CA E8" in said(result)


def test_no_byte_beside_a_frame_is_lost(tmp_path: Path) -> None:
    result = decode(tmp_path, f"TX: {ASKED}\nRX: AA {ANSWER} BB\n")
    assert READ in said(result)
    assert said(result).count("1 byte is not a frame") == 2


def test_modbus_ascii_is_named(tmp_path: Path) -> None:
    # Modbus over Serial Line V1.02, 2.5.2: the LRC is the sum's complement; 01+03+21+00+00+01 = 26H, DAH.
    result = decode(tmp_path, ":010321000001DA\r\n")
    assert result.exit_code == 2
    assert "line 1 is Modbus ASCII, its LRC is right" in said(result)


def test_modbus_tcp_is_known_with_units_that_no_line_has(tmp_path: Path) -> None:
    for unit, who in (("FF", "unit 255"), ("00", "all units"), ("03", "unit 3")):
        result = decode(
            tmp_path, f"00 01 00 00 00 06 {unit} 03 30 00 00 02\n00 01 00 00 00 07 {unit} 03 04 03 E8 02 58\n"
        )
        assert result.exit_code == 0
        assert f"{who}: read 2 words at 3000H -> " in said(result)
        assert "3000H = 1000, 3001H = 600" in said(result)
        assert "2 frames of Modbus TCP, which has no CRC" in said(result)


def test_no_time_is_told_where_the_log_has_none(tmp_path: Path) -> None:
    assert "ms" not in decode(tmp_path, f"{ASKED}\n{ANSWER}\n03 06 20 00 00 01 42 28\n").output


@pytest.mark.parametrize(
    "typed",
    [
        ["TX: 3, 3, 48, 0, 0, 2, 202, 233"],
        ["03H", "03H", "30H", "00H", "00H", "02H", "CAH", "E9H"],
        ["[03][03][30][00][00][02][CA][E9]"],
        ["12:00:01", "03033000", "0002CAE9"],
    ],
)
def test_a_pasted_line_is_understood_as_a_file_is(typed: list[str]) -> None:
    result = CliRunner().invoke(cli, ["decode", *typed])
    assert result.exit_code == 0
    assert said(result) == f"frame {ASKED} unit 3: read 2 words at 3000H"


def test_two_pasted_frames_are_an_exchange() -> None:
    result = CliRunner().invoke(cli, ["decode", *ASKED.split(), *ANSWER.split()])
    assert (result.exit_code, said(result)) == (0, READ)


@pytest.mark.parametrize("typed", ["[03][03][30][00][00][02][CA][E8]", "TX: 3, 3, 48, 0, 0, 2, 202, 232"])
def test_a_pasted_frame_that_is_damaged_says_its_crc(typed: str) -> None:
    result = CliRunner().invoke(cli, ["decode", typed])
    assert result.exit_code == 6
    assert "the CRC of the bytes is CA E9, with them came CA E8" in said(result)


def test_each_cut_and_each_changed_byte_ends_as_documented(tmp_path: Path) -> None:
    text = f"09:15:30 TX: {ASKED}\n09:15:31 RX: {ANSWER}\n".encode()
    for at in range(len(text)):
        for damaged in (text[:at], text[:at] + b"x" + text[at + 1 :]):
            result = decode(tmp_path, damaged)
            assert result.exit_code in (0, 2)
            assert result.exception is None or isinstance(result.exception, SystemExit)
            whole = ASKED.encode() in damaged or ANSWER.encode() in damaged
            assert (result.exit_code == 0) == whole


def test_an_address_of_a_hexdump_is_no_frame(tmp_path: Path) -> None:
    # 00 00 01 B0 ends with its own CRC.
    lines = [
        "000001a0: 0303 3000 0002 cae9 0303 0403 e802 5859",
        "000001b0: 1903 0330 0000 02ca e903 0304 03e8 0258",
        "000001c0: 5919",
    ]
    result = decode(tmp_path, "\n".join(lines))
    assert (result.exit_code, said(result)) == (0, f"{READ} {READ}")


def test_bytes_beside_a_frame_on_several_lines_are_not_lost(tmp_path: Path) -> None:
    result = decode(tmp_path, "AA 03 03 30\n00 00 02 CA\nE9 BB\n")
    assert said(result) == (
        "1 byte is not a frame: at least 4 are needed "
        "unit 3: read 2 words at 3000H -> was answered by 1 byte and no frame [BB]"
    )
