"""The page of a plant, begun and ended with its service: it is given what it shows, and its orders are carried out.

Each person has a door of their own, so that who set a motor in motion is known by name.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from drivebus.errors import NotAllowed
from drivebus.operations import network_rights
from drivebus.operations.last_will import WAYS
from drivebus.profile.evidence import Evidence
from drivebus.service.listening import Listening
from drivebus.service.mistakes import evidence_of
from drivebus.service.orders import Door, Order
from drivebus.service.plant import Plant
from drivebus.sinks.order_words import ORDERS
from drivebus.site import Site, SiteDrive, SitePoll, SiteWeb
from drivebus.web import Happened, Person, Presence, Shown, ShownDrive, Told, Web, web_context

__all__ = ["Page", "shown_drives"]

_ANSWERS_WITHIN = 4.0
"""Seconds for which who stops all waits for drives that are silent."""
_SAFELY = 2.5
"""A value that stays the same is kept again by its heartbeat; after so many of them without one it is not known."""


class Page:
    """The page.

    Args:
        plant: What it shows, and what may be ordered there.
        told: What the file says of the page.
    """

    def __init__(self, plant: Plant, told: SiteWeb) -> None:
        self._plant, self._told, self._orders = plant, told, plant.orders
        self._drives = shown_drives(plant.site)
        self._people = [Person(each.name, each.password, each.role) for each in plant.site.people]
        may = {name: each.may for name, each in self._drives.items() if each.may}
        self._doors = {
            each.name: Door(f"the page of {each.name}", may) for each in self._people if each.role == "command"
        }
        dead_man = told.dead_man if isinstance(told.dead_man, float) else None
        self._presence = None if dead_man is None else Presence(dead_man)
        self._dead_man = dead_man
        self._is_over = False
        self._context = web_context(told.certificate, told.key) if told.certificate and told.key else None
        self._web: Web | None = None
        self._listening = Listening(
            "web",
            f"the page is at {'http' if self._context is None else 'https'}://{told.address}/",
            self._listen,
            plant.tell,
        )

    def start(self) -> None:
        """Listens, or says why not."""
        self._listening.start()

    def turn(self) -> None:
        """Halts what those who are gone have set in motion, and listens where it does not."""
        if self._presence is not None:
            for person in self._presence.gone(time.monotonic()):
                why = f"gave no sign of life for {self._dead_man:g} s"
                self._orders.shut(self._doors[person].name, why, lambda: self._is_over)
        if self._web is not None and not self._web.serves:
            self._plant.tell("web: the page broke down, and is begun again")
            self._listening.close()
        self._listening.turn()

    def close(self) -> None:
        """Ends it. What was set in motion is halted by the end of its line."""
        self._is_over = True
        self._listening.close()

    def status(self) -> dict[str, Any]:
        """Whether it listens, and why not."""
        return self._listening.status()

    def _listen(self) -> Web:
        plant = self._plant
        shown = Shown(
            title=platform.node() or "drivebus",
            drives=self._drives,
            people=self._people,
            look=plant.look,
            events=lambda: [Happened(*each) for each in plant.events.last()],
            order=self._order,
            stop_all=self._stop_all,
            started=self._started,
            here=self._here,
            tell=plant.tell,
            dead_man=self._dead_man,
            spool=None if plant.spool is None else plant.spool.path,
            audit=plant.site.share.audit,
        )
        self._web = Web(self._told.address, self._told.hosts, self._context, shown)
        return self._web

    def _order(self, told: Told) -> tuple[str, str]:
        # Before it is sent: whoever sets a motor in motion is there.
        self._here(told.person)
        order = Order(told.drive, told.what, told.hz, told.reverse)
        return self._orders.give(self._doors[told.person], order, _who(told.person, told.address), told.until)

    def _stop_all(self, person: str, address: str) -> Mapping[str, tuple[str, str]]:
        return self._orders.stop_all(self._doors[person], _who(person, address), _ANSWERS_WITHIN)

    def _started(self) -> dict[str, str]:
        return {name: person for person, door in self._doors.items() for name in self._orders.started_by(door.name)}

    def _here(self, person: str) -> None:
        if self._presence is not None and person in self._doors:
            self._presence.here(person, time.monotonic())


def _who(person: str, address: str) -> str:
    return f"{person} at {address}"


def shown_drives(site: Site) -> dict[str, ShownDrive]:
    """The drives of the file, each with what may be ordered of it."""
    return {name: _shown(each, site.polls) for name, each in site.drives.items()}


def _shown(drive: SiteDrive, polls: tuple[SitePoll, ...]) -> ShownDrive:
    hold = max((_SAFELY * max(each.heartbeat, each.interval) for each in polls if drive in each.drives), default=0.0)
    here = ShownDrive(drive.name, drive.line.name, drive.unit, drive.profile or "", hold=hold)
    if drive.profile is None:
        return replace(here, why_not="the file names no profile of it")
    try:
        known = evidence_of(drive)
    except NotAllowed as error:
        return replace(here, why_not=str(error))
    here = replace(here, family=known.profile.title)
    if drive.read_only:
        return replace(here, why_not="it is read_only in the file")
    halts = {way for way in WAYS if known.unusable(way) is None}
    if not halts:
        return replace(here, why_not="nothing is known that halts it")
    return replace(here, may=frozenset(halts | {each for each in ORDERS if _can(known, each)}))


def _can(known: Evidence, order: str) -> bool:
    try:
        network_rights.of_drive(known, [], [order])
    except NotAllowed:
        return False
    return True
