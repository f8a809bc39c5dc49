"""Makes a wheel say nothing of who built it, and when, so that the same sources can give the same bytes.

maturin writes a list of the crates in a wheel (CycloneDX), with a random number, the time, and the folder of the
sources. These are taken out. The times in the archive are already the same for all.

usage: settle_wheel.py WHEEL …
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import sys
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# The earliest time that an archive can hold; maturin takes it too.
NO_TIME = (1980, 1, 1, 0, 0, 0)


def cargo_home() -> Path:
    """Where cargo keeps the sources of crates."""
    return Path(os.environ.get("CARGO_HOME") or Path.home() / ".cargo")


def settled(bill: bytes) -> bytes:
    """The list of crates `bill` without number, time and folder."""
    parts: dict[str, Any] = json.loads(
        bill.replace(f"path+file://{ROOT.as_posix()}".encode(), b"path+file:///drivebus")
    )
    parts.pop("serialNumber", None)
    parts["metadata"].pop("timestamp", None)
    return (json.dumps(parts, indent=2, ensure_ascii=False) + "\n").encode()


def record(files: dict[str, bytes], own: str) -> bytes:
    """The table of what a wheel holds: name, hash and length of each file but the table itself."""
    lines = []
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(data)}\n")
    return "".join([*lines, f"{own},,\n"]).encode()


def settle(wheel: Path) -> None:
    """Writes `wheel` anew."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in sorted(archive.namelist())}
        modes = {info.filename: info.external_attr for info in archive.infolist()}
    for name in files:
        if ".dist-info/sboms/" in name:
            files[name] = settled(files[name])
    own = next(name for name in files if name.endswith(".dist-info/RECORD"))
    del files[own]
    files[own] = record(files, own)
    new = wheel.with_suffix(".new")
    with zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, NO_TIME)
            info.create_system, info.external_attr, info.compress_type = 3, modes[name], zipfile.ZIP_DEFLATED
            archive.writestr(info, data)
    new.replace(wheel)


def traces(wheel: Path) -> list[str]:
    """The files of `wheel` that hold a folder of who built it."""
    folders = [str(folder).encode() for folder in (ROOT, cargo_home())]
    with zipfile.ZipFile(wheel) as archive:
        return [name for name in archive.namelist() if any(folder in archive.read(name) for folder in folders)]


def main() -> None:
    """The command."""
    for name in sys.argv[1:]:
        settle(Path(name))


if __name__ == "__main__":
    main()
