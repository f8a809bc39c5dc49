"""One drive on a line: commands, values, and what it says about itself, in the words of its family.

What it needs of the line and of the profile stands in `drivebus.protocols`. Time is the line's clock, so everything
here runs in virtual time as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivebus import checks
from drivebus.errors import DrivebusError, Unconfirmed
from drivebus.motion import POLL_INTERVAL, Motion, Seen
from drivebus.safeguard import Guard
from drivebus.values import Control, ControlItem, Fault, Snapshot, State, Status
from drivebus.watchdog import Watchdog

__all__ = ["Drive"]

_STANDSTILL = 0.05
"""Output frequency in Hz below which a drive that has stopped counts as stopped."""

_END_ATTEMPTS = 3
"""How often a stop is sent that is not confirmed, before the drive is told to coast."""


class Drive(Motion):
    """A drive, as `drivebus.Bus.drive` gives it.

    Nothing is kept between calls but what was written to RAM, how often EEPROM was written, what the drive said it is,
    and, for errors, its last state: every property asks the drive. Safe from any thread; a command and its confirmation
    are several requests, between which others may come.
    """

    def __repr__(self) -> str:
        return f"<Drive {self.unit}: {self.profile.name}>"

    def status(self) -> Status:
        """State, readiness, control source, frequency and fault, in two reads.

        Raises:
            NoAnswer, BadAnswer, Refused: See each.
        """
        return self._status(self.look())

    def _status(self, seen: Seen) -> Status:
        frequencies = self.snapshot("running_frequency", "set_frequency_actual")
        motor = seen.fields.get("motor", "")
        ready = seen.fields.get("ready")
        alarm = seen.fields.get("overload_alarm")
        return Status(
            state=seen.state,
            ready=None if ready is None else ready == "ready",
            source=seen.source,
            motor=int(motor.removeprefix("motor ")) if motor.startswith("motor ") else None,
            overload_alarm=None if alarm is None else alarm != "none",
            frequency=float(frequencies["running_frequency"]),
            setpoint=float(frequencies["set_frequency_actual"]),
            fault=seen.fault,
            fields=seen.fields,
            time=seen.time,
        )

    def fault(self) -> Fault | None:
        """The present fault, or None."""
        return self.look().fault

    def fault_history(self) -> list[Fault]:
        """The last faults, the latest first; as many as the drive keeps."""
        names = self.profile.fault_history
        if not names:
            return []
        return [self.profile.fault(int(code)) for code in self.snapshot(*names).values() if code]

    def monitor(self, *names: str) -> Snapshot:
        """Reads *names*, or all monitor registers of the family, in the fewest requests, under one time stamp.

        The result is a mapping whose names are attributes too: `drive.monitor().output_current`; its `units` say in
        what each is.

        Raises:
            NotAllowed: An unknown name; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        return self.snapshot(*(names or self.profile.monitor_names()))

    def wait_for_speed(self, hz: float | None = None, tolerance: float = 0.1, timeout: float = 60.0) -> Status:
        """Waits until the output frequency is *hz*, or the setpoint in force if None.

        Args:
            hz: Wanted output frequency in Hz, whichever way the motor turns.
            tolerance: How far off it may be, in Hz.
            timeout: Seconds of the line's clock.

        Raises:
            Unconfirmed: The drive tripped meanwhile, or the time was up; the message says where it stands. The drive
                keeps running if it ran.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """
        wanted = None if hz is None else checks.number("frequency", hz, 0.0)
        tolerance = checks.number("tolerance", tolerance, 0.0)
        goal = "its setpoint" if wanted is None else f"{wanted:g} Hz"

        def reached(status: Status) -> bool:
            target = status.setpoint if wanted is None else wanted
            # Hundredths are what drives count in; binary floats must not turn 0.1 into a miss.
            return status.state.running and abs(status.frequency - target) <= tolerance + 1e-9

        return self._wait(reached, f"{goal} was not reached", timeout)

    def wait_until_stopped(self, timeout: float = 60.0) -> Status:
        """Waits until the drive is stopped and its output frequency is zero.

        A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.

        Raises:
            Unconfirmed: The drive tripped meanwhile, or the time was up.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """

        def stopped(status: Status) -> bool:
            known = status.state is not State.UNKNOWN
            return known and not status.state.running and status.frequency <= _STANDSTILL

        return self._wait(stopped, "it did not stop", timeout)

    def check_control(self) -> Control:
        """Whether the drive is set to obey the bus: a list that is true when every item is as it must be."""
        wanted = self.profile.control()
        actual = self.snapshot(*(item["code"] for item in wanted))
        return Control(
            ControlItem(
                code=item["code"],
                wanted=self.value(item["code"], item["value"]),
                actual=actual[item["code"]],
                ok=actual[item["code"]] == item["value"],
                verified=item["verified"],
                label=item["label"],
                note=item["note"] or "",
            )
            for item in wanted
        )

    def prepare_control(self, store: bool = False) -> Control:
        """Sets the drive to obey the bus, writing only what differs, and returns what `check_control` then says.

        To RAM: the drive forgets it when it is switched off, unless *store*, which keeps what this object set in RAM
        before as well.

        Raises:
            Refused: The drive kept what it had; parameters are locked while it runs, or by a password.
            Unconfirmed: It took the values, and shows others.
        """
        needed = {
            item.code: item.wanted
            for item in self.check_control()
            if not item.ok or (store and item.code in self._in_ram)
        }
        if needed:
            self.write(needed, store=store)
        control = self.check_control()
        if not control:
            raise Unconfirmed(
                f"unit {self.unit} took the settings and shows others:\n{control}",
                unit=self.unit,
            )
        return control

    @contextmanager
    def running(
        self, hz: float | None = None, reverse: bool = False, *, confirm: float = 1.0, force: bool = False
    ) -> Iterator[Drive]:
        """Runs the motor inside a `with` block and stops it whatever happens there, Ctrl-C included.

        A stop that is not confirmed is sent again, and in the end the drive is told to coast. An error from inside the
        block is raised as it is; if the drive could not be stopped either, its note says so.

        The end of the program stops it too: what is still inside such a block when the interpreter ends, and, while the
        main thread is inside one, SIGTERM and SIGHUP (unless the program listens to them itself), which raise
        SystemExit there. What no program sees, such as kill -9, is for `watchdog`.

        Raises:
            NotAllowed, Refused, NoAnswer, BadAnswer, PortError: From `run`, which was not sent or not taken: the
                motor is left as it was. Or from stopping, when the block itself went well.
            Unconfirmed: From `run`, after which it is stopped; or from stopping: the motor may still turn.
        """
        with self._moving(lambda: self.run(hz, reverse, confirm=confirm, force=force), self.stop):
            yield self

    @contextmanager
    def jogging(self, reverse: bool = False, *, confirm: float = 1.0, force: bool = False) -> Iterator[Drive]:
        """Jogs the motor inside a `with` block and ends the jog whatever happens there. Otherwise as `running`."""
        with self._moving(lambda: self.jog(reverse, confirm=confirm, force=force), self.jog_stop):
            yield self

    def watchdog(self, timeout: float, action: str = "coast") -> Watchdog:
        """Makes the drive act by itself when it hears nothing for *timeout* seconds, and keeps it from that until then.

            with drive.watchdog(1.0), drive.running(hz=10.0):
                ...

        For what no program can look after: kill -9, a computer that hangs, a cable that is cut. The drive's own
        time-out and its action (P14.04 and P14.05 of a GD350) are set in RAM and read back, and a thread asks the
        drive for its state four times within *timeout*. When the block ends, a motor that slows down is waited for,
        and the drive gets back the settings it had; where the motor goes on turning, or cannot be asked, they stay, and
        the drive acts. A drive that was switched off meanwhile has forgotten them.

        The thread keeps real time: on a line in virtual time it does not keep up.

        Args:
            timeout: Seconds, in the range and steps of the drive's parameter (GD350: 0.1 to 60.0, in tenths). Longer
                than the bus's own time-out, or one lost answer is enough.
            action: `"coast"` takes the voltage off the motor and trips a fault (GD350: CE), whoever is in control;
                `"stop"` stops it as the drive is set to, without a fault.

        Raises:
            NotAllowed: The family has no such thing, or *timeout* or *action* is not among what it takes. Nothing was
                sent.
            Refused: The drive kept what it had.
            NoAnswer, BadAnswer, PortError: The line failed. The drive may have taken the settings: then it acts when
                *timeout* is over.
            Unconfirmed: The drive took the settings and shows others; it was given back those it had.
        """
        return Watchdog(self, timeout, action)

    @contextmanager
    def _moving(self, start: Callable[[], None], end: Callable[[], None]) -> Iterator[None]:
        """Starts, and ends by all means."""
        guard = Guard(lambda: self._end_by_all_means(end))
        started = False
        try:
            guard.arm()
            start()
            started = True
            guard.check()
            yield
        except BaseException as reason:
            # Of this package's errors, only Unconfirmed comes from a start once its command was sent.
            if started or isinstance(reason, Unconfirmed) or not isinstance(reason, DrivebusError):
                failure = guard.end()
                if failure is not None and hasattr(reason, "add_note"):
                    reason.add_note(f"and unit {self.unit} could not be stopped: {failure}")
            guard.disarm()
            raise
        failure = guard.end()
        guard.disarm()
        if failure is not None:
            raise failure

    def _end_by_all_means(self, end: Callable[[], None]) -> BaseException | None:
        """Calls *end*, or coasts where that fails. Returns what is left to raise: a failure, or a Ctrl-C that came."""
        interrupted: KeyboardInterrupt | None = None
        failure: BaseException | None = None
        for attempt in [end] * _END_ATTEMPTS + [self.coast]:
            try:
                attempt()
            except DrivebusError as error:
                failure = error
            except KeyboardInterrupt as error:
                # A second Ctrl-C must not leave the motor running: it is raised once the drive was told to stop.
                interrupted = error
            else:
                failure = None
                break
        return failure or interrupted

    def _wait(self, reached: Callable[[Status], bool], otherwise: str, timeout: float) -> Status:
        timeout = checks.number("timeout", timeout, 0.0)
        deadline = self.bus.now() + timeout
        while True:
            status = self.status()
            if status.state is State.FAULT or status.fault is not None:
                raise Unconfirmed(
                    f"unit {self.unit} tripped while waiting: {status.fault or 'fault not named'}", unit=self.unit
                )
            if reached(status):
                return status
            if self.bus.now() >= deadline:
                raise Unconfirmed(
                    f"unit {self.unit}: {otherwise} within {timeout:g} s; it is {status}",
                    unit=self.unit,
                )
            self.bus.sleep(POLL_INTERVAL)
