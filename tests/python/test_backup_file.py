"""The file of a backup: what stands in it, and what is said of one that was spoilt by hand."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus import Backup, Bus, Drive, NotAllowed, Simulator
from drivebus.backup.parse import parse

HEAD = """\
format = 1

[drive]
family = "gd350"
unit = 1
identification = 0x01A0
taken = 2026-11-21T12:00:00Z

[parameters]
"""
FIRST = HEAD.count("\n") + 1
"""The line of the first parameter."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "drive.toml"


def load(file: Path, text: str) -> Backup:
    file.write_text(text, encoding="utf-8")
    return Backup.load(file)


def wrong(file: Path, text: str) -> list[str]:
    """What is said of each wrong line."""
    with pytest.raises(NotAllowed) as caught:
        load(file, text)
    head, *lines = str(caught.value).splitlines()
    assert str(file) in head
    return [line.removeprefix(f"{file}:") for line in lines]


def test_what_is_written_is_what_is_read(virtual_drive: Drive, file: Path) -> None:
    taken = virtual_drive.backup(file)
    again = Backup.load(file)
    assert (again.raw, again.origin) == (taken.raw, taken.origin)
    assert dict(again) == dict(taken)
    again.save(file)
    assert Backup.load(file).raw == taken.raw


def test_the_whole_file_is_toml(virtual_drive: Drive, file: Path) -> None:
    virtual_drive.backup(file)
    found = tomli.loads(file.read_text(encoding="utf-8"))
    assert (found["format"], found["complete"]) == (1, True)
    assert (found["drive"]["family"], found["drive"]["identification"]) == ("gd350", 0x01A0)
    assert found["parameters"]["P00"]["03"] == {"value": 50.0, "unit": "Hz", "raw": 5000}


def test_lines_stay_where_they_are_and_say_what_they_mean(virtual_drive: Drive, file: Path) -> None:
    virtual_drive.backup(file)
    before = file.read_text(encoding="utf-8").splitlines()
    settings, readings = "\n".join(before).split("[readings]")
    for section in (settings, readings):
        codes = [line.split(" ")[0] for line in section.splitlines() if line.startswith("P")]
        assert codes == sorted(codes)
    assert codes == ["P00.15", "P07.27", "P07.28", "P07.29", "P07.30", "P07.31", "P07.32"]
    assert 'P00.03 = { value = 50.00, unit = "Hz", raw = 5000 }  # Maximum output frequency' in before
    assert "P14.01 = { value = 4, raw = 4, told = 4 }  # Baud rate: 19200" in before
    virtual_drive.write("P00.11", 20.0, store=True, unverified=True)
    virtual_drive.backup(file)
    after = file.read_text(encoding="utf-8").splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new and "taken" not in new]
    assert changed == [
        (
            'P00.11 = { value = 10.0, unit = "s", raw = 100 }  # Acceleration time 1',
            'P00.11 = { value = 20.0, unit = "s", raw = 200 }  # Acceleration time 1',
        )
    ]


def test_a_password_stands_in_no_file(virtual_drive: Drive, file: Path) -> None:
    taken = virtual_drive.backup(file)
    assert "P07.00" not in taken
    assert "password" in taken.unread["P07.00"]
    assert "# P07.00 (User password) is not here: a password has no place in a file" in file.read_text()


def test_lines_may_be_taken_out_and_raw_words_left_out(file: Path) -> None:
    kept = load(file, HEAD + 'P00.11 = { value = 20.0, unit = "s" } # by hand\n"P00.12" = { value = 5 }\n\n')
    assert dict(kept.raw) == {"P00.11": 200, "P00.12": 50}


@pytest.mark.parametrize("spoil", ["\ufeff{}", "{}", "{}\n\n# the end"])
def test_editors_may_leave_their_marks(file: Path, spoil: str) -> None:
    file.write_bytes(spoil.format(HEAD + "P00.01 = { value = 2, raw = 2 }\n").replace("\n", "\r\n").encode())
    assert dict(Backup.load(file).raw) == {"P00.01": 2}


SPOILT = [
    # line, what is said of it
    (
        'P00.03 = { value = 60.00, unit = "Hz", raw = 5000 }',
        "value 60.0 Hz and raw 5000 do not agree: raw 5000 is 50.00 Hz",
    ),
    ('P00.03 = { value = 700.00, unit = "Hz" }', "630"),
    ('P00.03 = { value = 50.001, unit = "Hz" }', "P00.03"),
    ('P00.03 = { value = 50.00, unit = "s", raw = 5000 }', "P00.03 is in Hz, not in 's'"),
    ("P00.03 = { value = 50.00, raw = 70000 }", "raw 70000 is not a whole number from 0 to 65535"),
    ("P00.03 = { value = 50.00, raw = 5000.0 }", "raw 5000.0 is not a whole number"),
    ("P00.03 = { value = 50.00, raw = true }", "raw True is not a whole number"),
    ("P00.03 = { value = true }", "value True is not a number"),
    ("P00.03 = { value = nan }", "not a number; give it in Hz"),
    ("P00.03 = { value = inf }", "inf"),
    ("P00.03 = { raw = 5000 }", "P00.03 lacks its value"),
    ("P00.03 = { value = 50.00, words = 5000 }", 'has no field "words"'),
    ("P00.03 = { valeu = 50.00 }", 'did you mean "value"?'),
    ("P00.03 = 50.00", 'P00.03 must be { value = 0.00, unit = "Hz", raw = 0 }'),
    ("P00.03 = { value = 50.00, raw = 5000, beyond = 1 }", "beyond must be true or false"),
    ("P00.03 = { value = 900.00, raw = 5000, beyond = true }", "do not agree"),
    ("P00.3 = { value = 50.00, raw = 5000 }", "may be P00.03 or P00.30; write both digits"),
    ("P0.03 = { value = 50.00, raw = 5000 }", "must be written as its code, P00.03"),
    ("p00.03 = { value = 50.00, raw = 5000 }", "P00.03"),
    ("P63.01 = { value = 1, raw = 1 }", "P63.01"),
    ("output_current = { value = 1.0 }", "is a register"),
    ("P00.03 = { value = 50.00, raw = 5000", "is not TOML"),
    ("P00.03 { value = 50.00 }", "is not TOML"),
    ("P00.03 = { value = 50,00, raw = 5000 }", "is not TOML"),
    ("just words", "is not TOML"),
    ("[parametres]", 'did you mean "parameters"?'),
    ("P00.03 = " + "[" * 900, "nested too deeply"),
    ('P00.03 = "' + "x" * 1000 + '"', "more than 1000 characters"),
    ("P00.03 = { value = 1" + "0" * 900 + " }", "P00.03"),
]


@pytest.mark.parametrize(("line", "said"), SPOILT, ids=range(len(SPOILT)))
def test_a_spoilt_line_is_named(file: Path, line: str, said: str) -> None:
    [found] = wrong(file, f"{HEAD}P00.11 = {{ value = 20.0, raw = 200 }}\n{line}\n")
    assert found.startswith(f"{FIRST + 1}: ")
    assert said in found


def test_all_spoilt_lines_are_named_at_once(file: Path) -> None:
    found = wrong(file, HEAD + "".join(f"{line}\n" for line, _ in SPOILT if not line.startswith("[")))
    expected = [number for number, (line, _) in enumerate((row for row in SPOILT if row[0][0] != "["), FIRST)]
    assert [int(line.split(":")[0]) for line in found] == expected
    with pytest.raises(NotAllowed, match=f"{len(expected)} lines are wrong; nothing was sent"):
        Backup.load(file)


HEADS: list[tuple[Callable[[str], str], str]] = [
    (lambda head: head.replace("format = 1\n", ""), "1: the file has no line `format = 1`"),
    (lambda head: head.replace("format = 1", "format = 2"), "1: the file has format 2"),
    (lambda head: head.replace("format = 1", "format = true"), "1: format must be a number"),
    (lambda head: head.replace("format", "fromat"), 'did you mean "format"?'),
    (lambda head: head.replace('family = "gd350"\n', ""), "does not name its drive"),
    (lambda head: head.replace('"gd350"', "350"), "4: family must be a text"),
    (lambda head: head.replace("unit = 1", 'unit = "1"'), "5: unit must be a number"),
    (lambda head: head.replace("unit = 1", "unit = 1\nunit = 2"), "6: unit is given twice"),
    (lambda head: head.replace("2026-11-21T12:00:00Z", '"today"'), "7: taken must be a moment"),
    (lambda head: head.replace("taken", "token"), 'did you mean "taken"?'),
    (lambda head: head.replace("2026-11-21T12:00:00Z", "0001-01-01T00:00:00+01:00"), "7: taken is not a moment"),
]


@pytest.mark.parametrize(("spoil", "said"), HEADS, ids=range(len(HEADS)))
def test_a_spoilt_head_is_named(file: Path, spoil: Callable[[str], str], said: str) -> None:
    assert any(said in line for line in wrong(file, spoil(HEAD) + "P00.01 = { value = 2, raw = 2 }\n"))


def test_an_unknown_family_names_the_closest(file: Path) -> None:
    with pytest.raises(NotAllowed, match='the closest is "gd350"'):
        load(file, HEAD.replace("gd350", "gd351"))


def test_one_parameter_stands_in_one_line(file: Path) -> None:
    [found] = wrong(file, HEAD + "P00.01 = { value = 2 }\nP00.01 = { value = 1 }\n")
    assert found.startswith(f"{FIRST + 1}: P00.01 is given twice; the first is in line {FIRST}")


WHOLE = HEAD + "".join(
    f"{line}\n"
    for line in (
        'P00.03 = { value = 50.00, unit = "Hz", raw = 5000 }  # Maximum output frequency',
        "P00.11 = { value = 20.0, raw = 200 }",
        "P09.00 = { value = 6, raw = 6, beyond = false }",
    )
)


@given(st.integers(0, len(WHOLE)), st.integers(0, 30), st.binary(max_size=20))
def test_any_edit_is_taken_or_refused_in_words(place: int, length: int, edit: bytes) -> None:
    data = WHOLE.encode()
    path = Path("drive.toml")
    said: list[str] = []
    raw: dict[str, int] = {}
    try:
        raw = parse(path, data[:place] + edit + data[place + length :], drivebus.Profile.builtin).raw
    except NotAllowed as error:
        said = str(error).splitlines()[1:]
    assert all(re.match(r"drive\.toml:\d+: ", line) for line in said)
    profile = drivebus.Profile.builtin("gd350")
    assert all(profile.encode(code, profile.decode(code, word)) == word for code, word in raw.items())


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "no line `format = 1`"),
        (b"\x00\x01\x02", "not TOML"),
        (HEAD.encode() + b"P00.01 = { value = 2 } # \xff\n", "not UTF-8"),
        (b"#" * ((1 << 20) + 1), "larger than a backup can be"),
    ],
)
def test_any_file_is_refused_in_words(file: Path, data: bytes, said: str) -> None:
    file.write_bytes(data)
    with pytest.raises(NotAllowed, match=said):
        Backup.load(file)


@pytest.mark.parametrize("path", ["", ".", 5, b"drive.toml", None, "a\0b"])
def test_what_is_no_path_is_refused(virtual: Simulator, virtual_drive: Drive, path: Any) -> None:
    before = virtual.line.requests
    with pytest.raises(NotAllowed):
        virtual_drive.restore(path)
    with pytest.raises(NotAllowed):
        virtual_drive.backup(path if path is not None else ".")
    assert virtual.line.requests - before <= 1  # who it is


@pytest.mark.parametrize("word", ["dry_run", "serial", "motor", "force"])
def test_what_is_neither_true_nor_false_is_refused(virtual_drive: Drive, word: str) -> None:
    """`restore(kept, ["P00"])` would be a dry run of everything."""
    kept = virtual_drive.backup()
    with pytest.raises(NotAllowed, match=f"{word} .* is neither True nor False"):
        virtual_drive.restore(kept, **{word: ["P00"]})  # type: ignore[arg-type]


def test_a_file_of_a_profile_of_somebodys_own_says_so(virtual_bus: Bus, tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text(
        'name = "mine"\nversion = 3\nsource = "notes"\n[overlay]\nprofile = "gd350"\n'
    )
    (tmp_path / "parameters.csv").write_text(
        "code,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n"
        "P08.09,Jog ramp,s,10,no,0.0,,3600.0,,,run,,yes,,notes\n"
    )
    mine = drivebus.Profile.load(tmp_path)
    file = tmp_path / "drive.toml"
    virtual_bus.drive(1, mine).backup(file)
    assert (Backup.load(file, mine).origin.profile, Backup.load(file, mine).origin.profile_version) == ("mine", 3)
    file.write_text(file.read_text() + "P08.09 = { value = 1.0, raw = 10 }\n")
    assert Backup.load(file, mine)["P08.09"] == 1.0
    with pytest.raises(NotAllowed, match='read with the profile "mine", and checked against "gd350"'):
        Backup.load(file)


@pytest.mark.parametrize("code", ["utf-16-le", "utf-16-be"])
def test_a_file_in_two_bytes_a_letter_says_so(file: Path, code: str) -> None:
    """As Windows' own editors and shells may save it."""
    file.write_bytes(("\ufeff" + HEAD).encode(code))
    with pytest.raises(NotAllowed, match="was saved as UTF-16, and a backup is UTF-8") as caught:
        Backup.load(file)
    assert len(str(caught.value).splitlines()) == 1


def test_of_a_text_that_is_no_backup_a_few_lines_are_told(file: Path) -> None:
    assert len(wrong(file, "one line of many\n" * 80)) == 21
    assert len(wrong(file, HEAD + "one line of many\n" * 80)) == 80


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(NotAllowed, match="file"):
            Backup.load(path)


@pytest.mark.parametrize("give", ["restore", "diff"])
def test_nothing_is_sent_for_a_spoilt_file(virtual: Simulator, virtual_drive: Drive, file: Path, give: str) -> None:
    file.write_text(HEAD + "P00.11 = { value = 20.0, raw = 200 }\nP00.12 = { value = 20.0, raw = 100 }\n")
    before = virtual.line.requests
    with pytest.raises(NotAllowed, match=f"{file}:{FIRST + 1}: P00.12"):
        getattr(virtual_drive, give)(file)
    assert virtual.line.requests == before


def test_a_value_that_no_document_allows_is_kept_as_the_drive_told_it(
    virtual_drive: Drive, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P01.21 is 0 or 1 by the manual; this drive has 7."""
    read = Bus.read

    def told(bus: Bus, unit: int, address: int, count: int = 1, /, **how: Any) -> list[int]:
        words = read(bus, unit, address, count, **how)
        return [7 if address + index == 0x0115 else word for index, word in enumerate(words)]

    monkeypatch.setattr(Bus, "read", told)
    virtual_drive.backup(file)
    assert "P01.21 = { value = 7, raw = 7, beyond = true }  # Restart after a power cut" in file.read_text()
    assert Backup.load(file).raw["P01.21"] == 7
    assert not virtual_drive.diff(file)


def test_a_file_is_written_whole_or_not_at_all(
    virtual_drive: Drive, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full, or the power gone, before the new file is whole."""
    virtual_drive.backup(file)
    before = file.read_bytes()
    virtual_drive.write("P00.11", 3.0, store=True, unverified=True)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(NotAllowed, match="cannot be written: No space left on device"):
            virtual_drive.backup(file)
    assert file.read_bytes() == before
    assert not list(file.parent.glob("*.tmp"))
    virtual_drive.backup(file)
    assert Backup.load(file)["P00.11"] == 3.0
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.skipif(os.name == "nt", reason="links need a right of their own there")
def test_a_link_goes_on_leading_to_the_file(virtual_drive: Drive, tmp_path: Path) -> None:
    place = tmp_path / "place.toml"
    link = tmp_path / "link.toml"
    link.symlink_to(place)
    virtual_drive.backup(link)
    assert link.is_symlink()
    assert Backup.load(place).raw


def test_what_cannot_be_written_is_known_before_the_drive_is_asked(
    virtual: Simulator, virtual_drive: Drive, tmp_path: Path
) -> None:
    before = virtual.line.requests
    with pytest.raises(NotAllowed, match="cannot be written"):
        virtual_drive.backup(tmp_path / "no" / "folder.toml")
    assert virtual.line.requests - before <= 2  # who it is


def test_factory_values_are_compared_where_they_are_known(virtual_drive: Drive, file: Path) -> None:
    virtual_drive.write("P00.03", 60.0)
    [found] = virtual_drive.backup(file).diff()
    assert (found.code, found.left, found.right) == ("P00.03", 50.0, 60.0)
    [same] = virtual_drive.diff()
    assert same == found


def test_two_files_are_compared(file: Path) -> None:
    first = load(file, HEAD + "P00.01 = { value = 2 }\nP00.11 = { value = 1.0 }\nP07.27 = { value = 3 }\n")
    second = load(file, HEAD + "P00.01 = { value = 1 }\nP00.12 = { value = 1.0 }\nP07.27 = { value = 4 }\n")
    found = [(each.code, each.left, each.right) for each in first.diff(second)]
    assert found == [("P00.01", 2, 1), ("P00.11", 1.0, None), ("P00.12", None, 1.0)]
    assert not first.diff(first)
    assert len(first.diff(second, everything=True)) == 4
    assert str(first.diff(second)).splitlines()[1] == ("P00.01 Where run commands come from: 2 = communication -> 1")


def test_files_of_two_families_are_not_compared(file: Path) -> None:
    first = load(file, HEAD)
    origin = drivebus.Backup(first.origin, {}, {}, first.profile).origin
    other = Backup(type(origin)(**{**vars(origin), "family": "vfd500"}), {}, {}, first.profile)
    with pytest.raises(NotAllowed, match="cannot be compared"):
        first.diff(other)
