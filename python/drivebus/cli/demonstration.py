"""The demonstration: a whole job on a simulated GD350 behind a port, at the speed of a real wire.

It uses the public API as any program would, and ends well only if everything it says did happen.
"""

from __future__ import annotations

import click
from rich.progress import BarColumn, Progress, TextColumn

import drivebus
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import Output
from drivebus.cli.session import EXAMPLE_PORT

__all__ = ["run"]

_RAMP = 15.0
"""Seconds from standstill to the drive's maximum frequency, and back."""

_OVERLOAD = 3.0
"""Torque, as a share of the motor's rated torque, that no motor bears for long."""


def run(out: Output) -> None:
    """The whole job.

    Raises:
        DrivebusError: Something did not hold, by whose fault it was.
        ClickException: The drive did not behave as it should; exit code 1.
    """
    with drivebus.Simulator({1: "gd350"}, baudrate=19200, parity="E") as simulator:
        # As any other program would, where one could.
        port = simulator if simulator.transport == "process" else simulator.port
        with drivebus.Bus(port, baudrate=19200, parity="E") as bus:
            _Job(out, simulator, bus).whole()


class _Job:
    def __init__(self, out: Output, simulator: drivebus.Simulator, bus: drivebus.Bus) -> None:
        self.out = out
        self.simulator = simulator
        self.bus = bus
        self.step = 0

    def whole(self) -> None:
        drive = self.find()
        self.prepare(drive)
        with drive.running(10.0):
            self.ramp(drive, "to 10 Hz", 0.0, 10.0)
            drive.setpoint = 25.0
            self.title("The setpoint changes while it runs")
            self.ramp(drive, "to 25 Hz", 10.0, 25.0)
            self.watch(drive)
            self.overload(drive)
            drive.reset_fault()
            self.title("The load is gone; reset, and start again")
            self.expect(drive.fault() is None, "the fault is gone")
            drive.run(10.0)
            self.ramp(drive, "to 10 Hz", 0.0, 10.0)
            self.title("Stop")
            drive.stop()
            drive.wait_until_stopped(timeout=15)
        self.expect(drive.status().state is drivebus.State.STOPPED, "it stands")
        self.statistics()
        self.farewell()

    def find(self) -> drivebus.Drive:
        self.title(f"A simulated drive is connected to {self.simulator.port} (19200 8E1). Which units answer?")
        found = list(self.bus.scan(range(1, 6)))
        self.out.rows(
            ["unit", "family", "identification", "round_trip"],
            [
                [each.unit, each.profile, f"{each.identification or 0:#06x}", f"{each.round_trip * 1000:.1f} ms"]
                for each in found
            ],
        )
        self.expect([each.profile for each in found] == ["gd350"], "one GD350 was found, at unit 1")
        drive = self.bus.drive(found[0].unit)
        self.out.say(f"It says: {drive.status()}")
        return drive

    def prepare(self, drive: drivebus.Drive) -> None:
        self.title("Does it obey the bus?")
        before = drive.check_control()
        self.out.say(str(before))
        self.expect(not before, "a drive fresh from the factory does not")
        try:
            drive.run(10.0)
        except drivebus.NotAllowed as error:
            self.out.say(f"A start is refused before it is sent: {in_commands(error)}")
        else:
            self.expect(False, "a start is refused")
        self.title("Set it to obey the bus, in RAM, and its ramps to 15 s")
        after = drive.prepare_control()
        self.out.say(str(after))
        self.expect(bool(after), "now it does")
        drive.write({"P00.11": _RAMP, "P00.12": _RAMP})
        self.expect(drive.read("P00.11", "P00.12") == {"P00.11": _RAMP, "P00.12": _RAMP}, "the ramps are set")
        self.title("Run: command and setpoint in one frame")

    def ramp(self, drive: drivebus.Drive, what: str, start: float, end: float) -> None:
        """Shows the frequency on its way from *start* to *end* Hz."""
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[now]}"))
        with Progress(*columns, console=self.out.console, disable=not self.out.live) as bar:
            task = bar.add_task(what, total=end - start, now="")
            deadline = self.bus.now() + 10.0
            said = -1
            while True:
                values = drive.monitor("running_frequency", "rotation_speed", "output_current")
                frequency = float(values.running_frequency)
                now = f"{frequency:5.2f} Hz  {values.rotation_speed:4.0f} rpm  {values.output_current:4.1f} A"
                bar.update(task, completed=frequency - start, now=now)
                if not self.out.live and int(frequency) // 2 != said:
                    said = int(frequency) // 2
                    self.out.say(f"  {now}")
                if abs(frequency - end) <= 0.1:
                    break
                self.expect(self.bus.now() < deadline, f"{end:g} Hz within 10 s", quietly=True)
                self.bus.sleep(0.05)
        self.expect(True, f"it turns at {drive.wait_for_speed(end).frequency:.2f} Hz")

    def watch(self, drive: drivebus.Drive) -> None:
        self.title("All its monitor registers, in two reads")
        values = drive.monitor()
        known = {name: drive.describe(str(name)) for name in values}
        # For a program the numbers, for a person their digits.
        shown = {name: value if self.out.as_json else known[name].text(value) for name, value in values.items()}
        rows = [[name, shown[name], row.unit, row.label] for name, row in known.items()]
        self.out.rows(["register", "value", "unit", "what"], rows)
        self.out.say(f"Read in {values.duration * 1000:.1f} ms.")

    def overload(self, drive: drivebus.Drive) -> None:
        self.title("Something jams the machine: three times the rated torque")
        machine = self.simulator.drive(drive.unit)
        machine.load = _OVERLOAD
        deadline = self.bus.now() + 20.0
        while (status := drive.status()).fault is None:
            self.expect(self.bus.now() < deadline, "the overload trips the drive", quietly=True)
            self.bus.sleep(0.2)
        self.expect(status.fault.mnemonic in ("OL1", "OL2", "OL3"), f"it tripped: {status.fault}")
        self.out.facts({"cause": status.fault.cause, "remedy": status.fault.remedy})
        self.expect(drive.fault_history()[:1] == [status.fault], "and it stands in the fault history")
        machine.load = 0.2

    def statistics(self) -> None:
        self.title("The line, in figures")
        stats = self.bus.stats()
        self.out.facts({name: value for name, value in stats.items() if isinstance(value, (int, float, str))})
        for hint in stats.hints:
            self.out.say(hint)
        self.expect(self.simulator.line.silence_violations == 0, "not one request broke the silence between frames")

    def farewell(self) -> None:
        self.out.say(
            "\nOn a real drive (wire A to A, B to B; `prepare` sets P00.01, P00.02 and P00.06):\n"
            "  drivebus ports\n"
            + "".join(
                f"  drivebus --port {EXAMPLE_PORT} {command}\n"
                for command in ("scan", "info", "monitor", "prepare", "run 10", "stop")
            )
            + "This is not a safety function: an emergency stop is a wire."
        )

    def title(self, text: str) -> None:
        self.step += 1
        self.out.record({"step": self.step, "title": text})
        self.out.heading(f"{self.step}. {text}")

    def expect(self, holds: bool, what: str, *, quietly: bool = False) -> None:
        if not holds:
            raise click.ClickException(f"the demonstration failed: expected that {what}")
        if not quietly:
            self.out.say(f"  ok: {what}")
