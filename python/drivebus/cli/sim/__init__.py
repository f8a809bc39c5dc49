"""`drivebus sim`: serves simulated drives, and takes orders from another window while it does.

`serve` is the command, `control_commands` what a simulation that runs is told, `control_socket` the socket between the
two windows, and `ctl` the other window.
"""

from __future__ import annotations

from drivebus.cli.sim.ctl import ctl
from drivebus.cli.sim.serve import sim

__all__ = ["COMMANDS"]

sim.add_command(ctl)

COMMANDS = [sim]
