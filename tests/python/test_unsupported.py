"""What somebody reads whose Python or machine drivebus was not built for, and whose extra is missing: what to do."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import drivebus

OLDER = "import sys; sys.version_info = (3, 9, 2); import drivebus"
"""A program of Python 3.9, for all that the package sees."""


@pytest.fixture(params=["missing", "of another machine"])
def installed(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A folder with the package whose compiled part does not fit."""
    home = Path(drivebus.__file__).parent
    shutil.copytree(home, tmp_path / "drivebus", ignore=shutil.ignore_patterns("_native.*", "__pycache__"))
    if request.param != "missing":
        (compiled,) = (path.name for path in home.glob("_native.*") if path.suffix != ".pyi")
        (tmp_path / "drivebus" / compiled).write_bytes(b"none that this machine can load")
    return tmp_path


def last_words(program: str, folder: Path) -> str:
    """How *program* fails in *folder*."""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    return done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    "program",
    [
        "import drivebus; drivebus.Bus",
        "import drivebus.aio",
        "from drivebus import doctor",
        "from drivebus import record",
        "from drivebus.cli import main; main()",
    ],
)
def test_a_core_that_cannot_be_loaded_is_one_sentence(program: str, installed: Path) -> None:
    said = last_words(program, installed)
    assert said.startswith("ImportError: drivebus has no compiled part for this cpython 3.")
    assert f"{sys.executable} -m pip install --force-reinstall drivebus" in said


def test_a_python_that_is_too_old_is_one_sentence(tmp_path: Path) -> None:
    said = last_words(OLDER, tmp_path)
    assert said.startswith("ImportError: drivebus needs Python 3.10 or newer; this is ")
    assert sys.executable in said


def test_a_recording_that_needs_an_extra_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    path = tmp_path / "run.parquet"
    path.touch()
    with pytest.raises(drivebus.NotAllowed, match=r"need pyarrow: pip install 'drivebus\[parquet\]'"):
        drivebus.record.read(path)
