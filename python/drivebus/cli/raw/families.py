"""Which family each unit is, for names and for what its words command: as `--profile` says, or as the unit does."""

from __future__ import annotations

from dataclasses import replace

import drivebus
from drivebus.cli.raw.request import Request, check_commands
from drivebus.cli.session import Session
from drivebus.line.write_guard import check_words

__all__ = ["UnitFamilies"]


class UnitFamilies:
    """The families of the units on the line that *session* names.

    Args:
        session: The options before the command.
        bus: The line, opened.
    """

    def __init__(self, session: Session, bus: drivebus.Bus) -> None:
        self._session = session
        self._bus = bus
        self._known: dict[int, drivebus.Profile] = {}

    @property
    def units(self) -> list[int]:
        """The units whose family is known."""
        return list(self._known)

    def known(self, unit: int) -> drivebus.Profile | None:
        """The family of *unit*, if it was named or asked for; nothing is sent for that."""
        if unit not in self._known and self._session.profile is not None:
            self.find(unit)
        return self._known.get(unit)

    def find(self, unit: int) -> drivebus.Profile:
        """The family of *unit*. Where nobody named it, the unit is asked, by reads.

        Raises:
            NotAllowed: It is not sure, or there is no such profile.
            NoAnswer, BadAnswer, PortError: The unit did not tell.
        """
        if unit not in self._known:
            self._known[unit] = replace(self._session, unit=unit).drive_on(self._bus).profile
        return self._known[unit]

    def check(self, request: Request, force: bool) -> None:
        """Raises `NotAllowed` where *request* may not be sent: a write under --read-only, a command that is none."""
        if not request.only_looks:
            replace(self._session, unit=request.unit).will_write()
        if force:
            return
        profile = self.known(request.unit)
        if profile is None:
            check_commands(request)
            return
        for address, words in drivebus.rtu.may_write(request.pdu):
            check_words([profile], request.unit, address, words)
