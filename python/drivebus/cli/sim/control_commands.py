"""What a simulation that runs can be told from another window: its drives, its line, its adapter."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any

import drivebus
from drivebus import sim
from drivebus.cli.sim.control_socket import Order

__all__ = ["Orders", "in_words"]


class Orders:
    """The orders that *simulator* takes. Each answers with what is so now.

    Args:
        simulator: The one that is told.
        opened: What other programs open to reach it.
        said: Is given each order that was carried out, in words.
        heard_at: What other programs open to hear its line, if it has an ear.
    """

    def __init__(
        self,
        simulator: drivebus.Simulator,
        opened: Callable[[], str],
        said: Callable[[str], None],
        heard_at: str | None = None,
    ) -> None:
        self._simulator = simulator
        self._opened = opened
        self._said = said
        self._heard_at = heard_at
        # Two windows may pull at one adapter.
        self._turn = threading.Lock()

    def obey(self, order: Order) -> Order:
        """Carries out *order*, and returns what is so now.

        Raises:
            drivebus.NotAllowed: It is no order, or cannot be done; nothing was changed.
        """
        orders: dict[object, Callable[[Order], str]] = {
            "about": lambda _: "",
            "trip": self._trip,
            "load": self._load,
            "power-cycle": self._power_cycle,
            "unplug": self._unplug,
            "replug": self._replug,
            "faults": self._faults,
            "settings": self._settings,
        }
        name = order.get("order")
        carry_out = orders.get(name) if isinstance(name, str) else None
        if carry_out is None:
            raise drivebus.BadArgument(f"{name!r} is not an order; a simulation takes {', '.join(map(str, orders))}")
        with self._turn:
            done = carry_out(order)
            if done:
                self._said(done)
            return self._about()

    def _about(self) -> Order:
        line = self._simulator.line
        return {
            "pid": os.getpid(),
            "port": self._opened(),
            "leads_to": self._simulator.port,
            "ear": self._heard_at,
            "settings": in_words(line.format),
            "plugged": line.plugged,
            "faults": line.faults,
            "units": [self._told(unit) for unit in self._simulator.units],
        }

    def _told(self, unit: int) -> Order:
        drive = self._simulator.drive(unit)
        return {
            "unit": unit,
            "family": drive.profile,
            "state": drive.state,
            "frequency": drive.frequency,
            "load": drive.load,
            "fault": drive.fault,
            "fault_name": drive.fault_name,
        }

    def _drive(self, order: Order) -> sim.SimulatedDrive:
        unit: Any = order.get("unit")
        return self._simulator.drive(unit)

    def _trip(self, order: Order) -> str:
        drive = self._drive(order)
        fault: Any = order.get("fault")
        drive.trip(fault)
        return f"unit {drive.unit}: tripped, {drive.fault_name}"

    def _load(self, order: Order) -> str:
        drive = self._drive(order)
        share: Any = order.get("share")
        drive.load = share
        return f"unit {drive.unit}: load {drive.load * 100:g} % of rated torque"

    def _power_cycle(self, order: Order) -> str:
        drive = self._drive(order)
        drive.power_cycle()
        return f"unit {drive.unit}: switched off and on"

    def _unplug(self, _: Order) -> str:
        self._simulator.line.unplug()
        return "the adapter is unplugged"

    def _replug(self, _: Order) -> str:
        self._simulator.line.replug()
        return f"the adapter is plugged in: {self._opened()}"

    def _faults(self, order: Order) -> str:
        if "rates" not in order:
            return ""
        rates: Any = order["rates"]
        rates = sim.check_faults(rates, self._simulator.transport)
        self._simulator.line.set_faults(**rates)
        named = ", ".join(f"{kind} {rate:g}" for kind, rate in self._simulator.line.faults.items())
        return f"faults: {named or 'none'}"

    def _settings(self, order: Order) -> str:
        now = self._simulator.line.format
        keys = ("baudrate", "parity", "stopbits", "bytesize")
        if not any(key in order for key in keys):
            return ""
        wanted: dict[str, Any] = {key: order.get(key, getattr(now, key)) for key in keys}
        self._simulator.line.format = drivebus.SerialFormat(**wanted, silence=now.silence)
        return f"every unit is set to {in_words(self._simulator.line.format)}"


def in_words(settings: drivebus.SerialFormat) -> str:
    """*settings* as people write them: `19200 8E1`."""
    return f"{settings.baudrate} {settings.bytesize}{settings.parity}{settings.stopbits}"
