"""Whether a drive is set to obey the bus, and to heed what the bus tells it, and setting the parameters that takes.

The profile knows the parameters and the values. A value that no document of the family prints is shown as such, and is
written only for who says so.
"""

from __future__ import annotations

from typing import Any

from drivebus import checks
from drivebus.errors import NotAllowed, Unconfirmed
from drivebus.operations.parameters import Parameters
from drivebus.profile.evidence import not_verified
from drivebus.values import Control, ControlItem

__all__ = ["Controls"]


class Controls(Parameters):
    """Checks and sets what makes one drive obey."""

    async def check_control(self, setpoint: str | None = None, *, unverified: bool = False) -> Control:
        """Whether the drive is set to obey the bus: a list that is true when every item is as it must be.

        Args:
            setpoint: Which setpoint the bus is to give, such as `"torque"` or `"pid"`; None is the frequency.
            unverified: Also read parameters that are not verified; without it such an item has no actual value.

        Raises:
            NotAllowed: The family has no such setpoint; the message has those it has. Nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        drive = self.trusting(unverified)
        return await drive._check_items(drive._wanted(setpoint))

    async def prepare_control(
        self, store: bool = False, *, setpoint: str | None = None, unverified: bool = False
    ) -> Control:
        """Sets the drive to obey the bus, writing only what differs, and returns what `check_control` then says.

        To RAM: the drive forgets it when it is switched off, unless *store*, which keeps what this object set in RAM
        before as well.

        Args:
            store: Keep it in EEPROM.
            setpoint: Which setpoint the bus is to give; None is the frequency.
            unverified: Also write values that are not verified. One that the drive has already is not written.

        Raises:
            NotAllowed: What has to be written is not verified for the family, or not to RAM. Nothing was written.
            Refused: The drive kept what it had; parameters are locked while it runs, or by a password.
            Unconfirmed: It took the values, and shows others.
        """
        store = checks.flag("store", store)
        drive = self.trusting(unverified)
        wanted = drive._wanted(setpoint)
        needed = {}
        for item in await drive._check_items(wanted):
            if item.ok and not (store and item.code in drive._in_ram):
                continue
            if item.actual is None or not (item.verified or drive.unverified):
                what = f"setting {item.code} ({item.label}) of {drive.profile.title} to {int(item.wanted)}"
                raise not_verified(what, item.note, drive.unit)
            needed[item.code] = item.wanted
        if needed:
            await drive.write(needed, store=store)
        control = await drive._check_items(wanted)
        if not control:
            raise Unconfirmed(
                f"unit {drive.unit} took the settings and shows others:\n{control}",
                unit=drive.unit,
            )
        return control

    async def _check_heeded(self, setpoint: str, register: str) -> None:
        """Raises `NotAllowed` if the drive would not heed *setpoint*, because it takes that from elsewhere."""
        control = await self._check_items(self.profile.needs(setpoint))
        if not control:
            raise NotAllowed(
                f"unit {self.unit} would not heed its {setpoint.replace('_', ' ')} setpoint:\n{control}\nNothing was "
                f"sent. prepare_control(setpoint={setpoint!r}) sets what is needed; write({register!r}, …) writes it "
                "all the same",
                unit=self.unit,
            )

    async def _check_set(self, wanted: list[dict[str, Any]], what: str) -> None:
        """Raises `NotAllowed` if one of *wanted* is surely not as it must be: then the unit does *what* is said.

        What no document proves, or may not be read, keeps nobody from starting a motor.
        """
        sure = [row for row in wanted if row["verified"] or self.unverified]
        wrong = Control(item for item in await self._check_items(sure) if item.actual is not None and not item.ok)
        if len(wrong):
            raise NotAllowed(
                f"unit {self.unit} {what}:\n{wrong}\nNothing that moves it was sent. prepare_control() (`drivebus "
                "prepare`) sets what is needed",
                unit=self.unit,
            )

    def _wanted_of_commands(self) -> list[dict[str, Any]]:
        """What must be set for commands alone, whatever the setpoints."""
        names = self.profile.setpoint_names()
        of_setpoints = {row["code"] for name in names for row in self.profile.needs(name)}
        return [row for row in self.profile.control() if row["code"] not in of_setpoints]

    def _wanted(self, setpoint: str | None) -> list[dict[str, Any]]:
        """What must be set for *setpoint*, in the order in which to set it."""
        known = self.profile.setpoint_names()
        if setpoint is not None:
            checks.one_of("setpoint", setpoint, known)
        of_frequency = self.profile.needs("frequency") if "frequency" in known else []
        needs = of_frequency if setpoint is None else self.profile.needs(setpoint)
        told = {row["code"] for row in (*of_frequency, *needs)}
        return [*(row for row in self.profile.control() if row["code"] not in told), *needs]

    async def _check_items(self, wanted: list[dict[str, Any]]) -> Control:
        codes = self._evidence.readable(row["code"] for row in wanted)
        actual = await self.snapshot(*codes) if codes else {}
        return Control(
            ControlItem(
                code=row["code"],
                wanted=self.value(row["code"], row["value"]),
                actual=actual.get(row["code"]),
                ok=row["code"] in actual and actual[row["code"]] == row["value"],
                verified=row["verified"],
                label=row["label"],
                note=(None if row["code"] in actual else self._evidence.unreadable(row["code"])) or row["note"] or "",
            )
            for row in wanted
        )
