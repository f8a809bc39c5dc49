"""How a service does, in a small file: whoever asks reads it, and disturbs nobody."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drivebus.errors import NotAllowed
from drivebus.line.runtime_folder import run_time_folder
from drivebus.site import Site, state_file

__all__ = ["StatusFile", "read_status"]

_MACHINE = Path(os.environ.get("DRIVEBUS_MACHINE_DIR") or "/run/drivebus")
"""The folder that a service of the machine gets from its service manager."""


class StatusFile:
    """The file of one service, written anew each time and removed at its end."""

    def __init__(self, site: Site) -> None:
        given = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
        self._path = (Path(given) if given else _own_folder()) / _name(site)

    def write(self, status: Mapping[str, Any]) -> None:
        """Replaces what is there, whole."""
        new = self._path.with_suffix(f".{os.getpid()}")
        new.write_text(json.dumps(status), encoding="utf-8")
        new.chmod(0o644)
        new.replace(self._path)

    def remove(self) -> None:
        """Nobody serves any more."""
        self._path.unlink(missing_ok=True)


def read_status(site: Site) -> dict[str, Any]:
    """How the service of *site* does.

    Raises:
        NotAllowed: None runs, as far as can be seen.
    """
    for folder in (_MACHINE, _own_folder()):
        try:
            status = json.loads((folder / _name(site)).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(status, dict):
            return status
    raise NotAllowed(f"no service of {site.path} runs on this computer, as far as this user can see")


def _own_folder() -> Path:
    """The folder of this user's services, which is there."""
    if sys.platform != "win32":
        return run_time_folder()
    folder = Path(state_file("serve")).parent
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _name(site: Site) -> str:
    return f"serve-{hashlib.sha256(str(site.path.resolve()).encode()).hexdigest()[:12]}.json"
