"""Tables that a spreadsheet opened and saved again: recordings and profiles mean what they meant before.

What it does to them: a mark before the text or UTF-16, semicolons or tabs, a line `sep=;`, decimal commas, quotes,
CRLF, empty cells behind the last column, rows of nothing. A number that may mean two things is an error, never a guess.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from drivebus import NotAllowed, Profile
from drivebus.record import Recording, read

TIMES = ("2026-11-26T12:00:00.000000+00:00", "2026-11-26T12:00:01.000000+00:00", "2026-11-26T12:00:02.000000+00:00")
ROWS = [
    ["time", "drive", "event", "text", "state", "output_current [A]", "running_frequency [Hz]"],
    [TIMES[0], "", "recording", '{"drives": [], "interval": 1.0, "note": "1,234; 5.6"}', "", "", ""],
    [TIMES[0], "gd350, unit 1", "", "", "forward", "1.5", "49.98"],
    [TIMES[1], "gd350, unit 1", "", "", "forward", "12.0", "50.00"],
    [TIMES[2], "", "end", "1,234", "", "", ""],
]


def table(rows: list[list[str]], divider: str = ",", *, comma: bool = False, end: str = "\n") -> str:
    def cell(title: str, text: str) -> str:
        return text.replace(".", ",") if comma and "[" in title else text

    out = io.StringIO()
    written = [rows[0], *([cell(*pair) for pair in zip(rows[0], row, strict=True)] for row in rows[1:])]
    csv.writer(out, delimiter=divider, lineterminator=end).writerows(written)
    return out.getvalue()


PLAIN = table(ROWS)
GERMAN = table(ROWS, ";", comma=True, end="\r\n")
KEPT = "\r\n".join(line + ";;" for line in GERMAN.splitlines())
SAVED: dict[str, bytes] = {
    "as it was written": PLAIN.encode(),
    "a mark before the text": PLAIN.encode("utf-8-sig"),
    "both ends of a line": table(ROWS, end="\r\n").encode(),
    "semicolons and decimal commas": GERMAN.encode("utf-8-sig"),
    "a line that says so": f"sep=;\r\n{GERMAN}".encode(),
    "that line in quotes": f'"sep=;"\r\n{GERMAN}'.encode(),
    "tabs, UTF-16": table(ROWS, "\t", comma=True, end="\r\n").encode("utf-16"),
    "UTF-16, the high byte first": b"\xfe\xff" + GERMAN.encode("utf-16-be"),
    "every cell in quotes": "".join(
        ";".join(f'"{cell}"' for cell in line) + "\r\n"
        for line in csv.reader(GERMAN.replace('""', "''").splitlines(), delimiter=";")
    )
    .replace("''", '""')
    .encode(),
    "columns of nothing behind the last": f"{KEPT}\r\n".encode(),
    "rows of nothing": f"{GERMAN};;;;;;\r\n\r\n ;;\r\n".replace("\r\n20", "\r\n;;;;;;\r\n20").encode(),
    "commas, and numbers in quotes": table(ROWS, comma=True).encode(),
}


def recording(folder: Path, data: bytes) -> Recording:
    path = folder / "line.csv"
    path.write_bytes(data)
    return read(path)


@pytest.mark.parametrize("how", SAVED)
def test_a_recording_means_what_it_meant(tmp_path: Path, how: str) -> None:
    found = recording(tmp_path, SAVED[how])
    assert found.drives == ["gd350, unit 1"]
    assert found.values == {
        "gd350, unit 1": {"output_current [A]": [1.5, 12.0], "running_frequency [Hz]": [49.98, 50.0]}
    }
    assert found.about["note"] == "1,234; 5.6"
    assert [(event.kind, event.text) for event in found.events][1:] == [("end", "1,234")]
    assert found.complete
    assert found.times["gd350, unit 1"] == [1795694400.0, 1795694401.0]


def test_a_number_that_may_be_two_is_told_and_not_guessed(tmp_path: Path) -> None:
    for cells, said in (
        ({"1.5": "1,234", "12.0": "", "49.98": "", "50.00": ""}, r'line 3: "1,234" may be 1\.234 or 1234'),
        ({"1.5": "1,5", "12.0": "12.0", "49.98": "", "50.00": ""}, "which of the two divides the decimals"),
        ({"1.5": "1.234,5", "12.0": "", "49.98": "", "50.00": ""}, "thousands apart"),
    ):
        rows = [[cells.get(cell, cell) for cell in row] for row in ROWS]
        with pytest.raises(NotAllowed, match=said):
            recording(tmp_path, table(rows, ";").encode())
    rows = [
        ["1,234" if cell == "12.0" else cell.replace(".", ",") if "." in cell[:5] else cell for cell in row]
        for row in ROWS
    ]
    found = recording(tmp_path, table(rows, ";").encode())
    assert found.values["gd350, unit 1"]["output_current [A]"] == [1.5, 1.234]


@pytest.mark.parametrize("how", SAVED)
def test_cut_at_any_byte_it_is_a_shorter_recording_or_none(tmp_path: Path, how: str) -> None:
    whole = recording(tmp_path, SAVED[how]).values["gd350, unit 1"]
    for end in range(len(SAVED[how])):
        try:
            found = recording(tmp_path, SAVED[how][:end])
        except NotAllowed:
            continue
        for title, values in found.values.get("gd350, unit 1", {}).items():
            assert values == whole[title][: len(values)], end


@pytest.mark.parametrize("how", SAVED)
def test_with_any_byte_changed_it_is_read_or_refused(tmp_path: Path, how: str) -> None:
    for at in range(0, len(SAVED[how]), 3):
        data = bytearray(SAVED[how])
        data[at] ^= 0x15
        with suppress(NotAllowed):
            recording(tmp_path, bytes(data))


def spoilt(folder: Path, change: Callable[[str], bytes]) -> Path:
    """A profile whose tables went through *change*."""
    source = Path(__file__).resolve().parent.parent / "vectors/profiles/ex9"
    for path in source.iterdir():
        text = path.read_text(encoding="utf-8")
        (folder / path.name).write_bytes(change(text) if path.suffix == ".csv" else text.encode("utf-8-sig"))
    return folder


def german(text: str) -> str:
    rows = list(csv.reader(io.StringIO(text)))
    places = [at for at, title in enumerate(rows[0]) if title in ("low", "high", "default")]
    for row in rows[1:]:
        for at in places:
            row[at] = row[at].replace(".", ",")
    out = io.StringIO()
    csv.writer(out, delimiter=";", lineterminator="\r\n").writerows([*rows, [""] * len(rows[0])])
    return out.getvalue()


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.encode("utf-8-sig"),
        lambda text: german(text).encode("utf-8-sig"),
        lambda text: f"sep=;\r\n{german(text)}".encode(),
        lambda text: german(text).replace("\r\n", ";;\r\n").encode("utf-16"),
        lambda text: ("\n" + text.replace("\n", "\n\n")).encode(),
    ],
)
def test_a_profile_means_what_it_meant(tmp_path: Path, change: Callable[[str], bytes]) -> None:
    assert Profile.check(spoilt(tmp_path, change)) == []
    plain = Profile.load(Path(__file__).resolve().parent.parent / "vectors/profiles/ex9")
    saved = Profile.load(tmp_path)
    names = plain.names()
    assert names
    assert [saved.describe(name) for name in names] == [plain.describe(name) for name in names]


def test_what_a_profile_cannot_mean_is_told_with_its_line(tmp_path: Path) -> None:
    def change(text: str) -> bytes:
        lines = german(text).split("\r\n")
        cells = next(csv.reader([lines[1]], delimiter=";"))
        titles = next(csv.reader([lines[0]], delimiter=";"))
        if "high" not in titles:
            return text.encode()
        cells[titles.index("high")] = "1,234"
        out = io.StringIO()
        csv.writer(out, delimiter=";", lineterminator="").writerow(cells)
        return "\r\n".join([lines[0], out.getvalue()]).encode()

    told = [
        problem for problem in Profile.check(spoilt(tmp_path, change)) if "may be 1.234 or 1234" in problem["reason"]
    ]
    assert [problem["line"] for problem in told] == [2, 2]
