"""What the panel costs: `python -m tools.measure_panel [--units N] [--seconds S]`.

Simulated drives stand behind a pseudo-terminal of another process, and turn at changing speeds. The panel watches all
of them in a window of 200 by 50. Prints the share of one core that the panel's process took, of /proc, in the overview
and in the view of one drive, and what it wrote to the terminal.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.python.panels import Terminal, on_a_terminal

import drivebus

_TICKS = os.sysconf("SC_CLK_TCK")


def spent(process: int) -> float:
    """Seconds of processor time that *process* has taken, in user and system."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def share(terminal: Terminal, seconds: float) -> tuple[float, float]:
    """The share of one core, and bytes a second to the terminal."""
    before, wrote, began = spent(terminal.child.pid), len(terminal.raw), time.monotonic()
    while time.monotonic() - began < seconds:
        terminal.take(0.1)
    took = time.monotonic() - began
    return (spent(terminal.child.pid) - before) / took, (len(terminal.raw) - wrote) / took


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=32)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--baud", type=int, default=115_200)
    options = parser.parse_args()
    units = ",".join(f"{unit}=gd350" for unit in range(1, options.units + 1))
    with tempfile.TemporaryDirectory() as folder:
        link = f"{folder}/line"
        command = [sys.executable, "-m", "drivebus", "sim", "--units", units, "--link", link]
        with subprocess.Popen([*command, "--baud", str(options.baud)], stdout=subprocess.DEVNULL) as simulation:
            while not Path(link).exists():
                time.sleep(0.05)
            words = ["--port", link, "--baud", str(options.baud), "--unit", f"1-{options.units}", "panel"]
            with on_a_terminal(words, Path(folder, "record"), (200, 50), quiet=True) as terminal:
                terminal.until(f"{options.units} drives", lambda text: "waiting" not in text)
                with drivebus.Bus(link, baudrate=options.baud) as bus:
                    for unit in range(1, options.units + 1):
                        drive = bus.drive(unit, "gd350")
                        drive.prepare_control()
                        # Ramps that last as long as this does: every value changes all the time.
                        drive.write({"P00.11": 8 * options.seconds + unit, "P00.12": 8 * options.seconds})
                        drive.run(hz=50.0)
                terminal.until(f"{options.units} running")
                for name, key in (("overview", ""), ("one drive", "\r")):
                    terminal.press(key)
                    terminal.take(1.0)
                    cost, wrote = share(terminal, options.seconds)
                    print(f"{name:<10} {100 * cost:5.1f} % of one core, {wrote / 1024:5.1f} kB/s to the terminal")
                terminal.press("\x03")
                terminal.ends()
            simulation.terminate()


if __name__ == "__main__":
    main()
