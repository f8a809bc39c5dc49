"""What the doctor finds."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.output import Output

__all__ = ["Finding"]

_SIGNS = {"ok": "ok", "note": "note", "warning": "WARNING", "fault": "FAULT"}
_STYLES = {"ok": "green", "note": "", "warning": "bold yellow", "fault": "bold red"}


@dataclass(frozen=True)
class Finding:
    """What was *found* on the line at *port*."""

    found: drivebus.doctor.Finding
    port: str

    @property
    def exit_code(self) -> int:
        """What the process ends with if this is the worst: that of the error which calls end with because of it."""
        if not self.found.wrong or self.found.error is None:
            return 0
        return exit_code(self.found.error)

    def _texts(self) -> tuple[str, str]:
        """What is said, and what to do; what it says to type is for this port, unless the environment has it."""
        is_usual = os.environ.get("DRIVEBUS_PORT") == self.port
        here = "`drivebus " if is_usual else f"`drivebus --port {shlex.quote(self.port)} "
        text, advice = (in_commands(said).replace("`drivebus ", here) for said in (self.found.text, self.found.advice))
        return text, advice

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it."""
        text, advice = self._texts()
        yield {
            "step": self.found.step,
            "name": self.found.name,
            "severity": self.found.severity,
            "unit": self.found.unit,
            "text": text,
            "advice": advice,
            "values": self.found.values,
            "exit_code": self.exit_code,
        }

    def lay_out(self, out: Output) -> None:
        """How bad it is, what it is, and what to do."""
        text, advice = self._texts()
        severity = self.found.severity.value
        out.say(f"{_SIGNS[severity]:<8} {text}", _STYLES[severity], hanging=9)
        if advice:
            out.say(f"{'':<8} -> {advice}", hanging=3)
