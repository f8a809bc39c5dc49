"""A frame whose CRC is right is never said to have a wrong one: what is wrong with it stands inside."""

from __future__ import annotations

import pathlib

import pytest
from click.testing import CliRunner

from drivebus.cli import cli

from .odd_slave import framed

WRONG = {
    "0A 10 00 01 00 03 06 0A 0B 0C": "write of 3 words with 3 bytes of data where 6 are announced; the CRC is right",
    "0A 10 00 01 00 03 04 0A 0B 0C 0D": "write of 3 words with 4 bytes of data where 6 are needed; the CRC is right",
    "0A 10 00 01 00 00 00": "write of 0 words, which can be 1 to 123; the CRC is right",
    "01 04 00": "answers with 0 words; the CRC is right",
    "01 03 04 00 01": "answers with 2 bytes of data where 4 are announced; the CRC is right",
    "01 03 03 00 01 02": "answers with 3 bytes of data, which are no whole words; the CRC is right",
    "01 06 20 00 01": "write with 3 bytes where 4 are needed; the CRC is right",
}


def decoded(*arguments: str) -> str:
    done = CliRunner().invoke(cli, ["decode", *arguments])
    assert done.exit_code in (0, 6), done.output
    return " ".join(done.output.split())


@pytest.mark.parametrize("body", WRONG)
def test_a_frame_is_called_what_is_wrong_inside(body: str) -> None:
    assert WRONG[body] in decoded(framed(body).hex())


@pytest.mark.parametrize("body", WRONG)
def test_so_it_is_in_a_file(body: str, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "log.txt"
    file.write_text(framed(body).hex(" ").upper() + "\n", encoding="utf-8")
    text = decoded(str(file))
    assert "the CRC of the bytes is" not in text
    assert "its CRC does not match" not in text


def test_what_was_asked_says_more(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "log.txt"
    file.write_text("01 04 00 00 00 02 71 CB\n01 04 00 22 C0\n", encoding="utf-8")
    assert "answers with 0 words, 2 were asked for; the CRC is right" in decoded(str(file))
