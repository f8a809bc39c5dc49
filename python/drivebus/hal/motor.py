"""The drive, told and looked at: what the core decided goes out once, and what was started is stopped by all means.

From its start to its stop a motor is inside a block like that of `Drive.running`, so whatever ends the program ends the
run: an error, a signal, the interpreter. The drive's own watchdog, set before the first start, is for kill -9.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType

from drivebus.drive import Drive
from drivebus.errors import BadArgument, NotAllowed, Unverified
from drivebus.hal.core import Action, Coast, Reset, Run, Shown, Speed
from drivebus.profile import Profile
from drivebus.values import State
from drivebus.watchdog import Watchdog

__all__ = ["SpindleMotor"]

_CURRENT = "output_current"

_ACTIONS = ("stop", "coast", "trip")
"""What the drive is to do by itself, the best first: a spindle that coasts turns for long."""


class SpindleMotor:
    """What one drive turns.

    Args:
        drive: The drive.
        watchdog: Seconds of silence after which the drive is to act by itself; None sets nothing.
        say: Is told what people have to know.

    Raises:
        NotAllowed: The drive's watchdog is not verified for the family, or takes no such time. Nothing was sent.
    """

    def __init__(self, drive: Drive, watchdog: float | None, say: Callable[[str], None]) -> None:
        self._drive = drive
        self._say = say
        self._silence = watchdog
        self._action = None if watchdog is None else self._own_action()
        self._watchdog: Watchdog | None = None
        self._motor = drive.motor()
        self._counted: Profile | None = None
        self._has_current = _CURRENT in drive.profile.monitor_names() and self._is_readable(_CURRENT)

    @property
    def unstopped(self) -> str:
        """Why the last stop was not confirmed, after which the drive was told to coast; empty where it was."""
        return str(self._motor.unstopped or "")

    def counts(self) -> float:
        """What the drive counts for one hertz of its setpoint. May ask it what its setpoint means.

        Raises:
            NotAllowed: It takes no setpoint in Hz over the bus.
        """
        register, profile = self._setpoint()
        return float(profile.describe(register).scale)

    def look(self) -> Shown:
        """What the drive shows, read now."""
        status = self._drive.status()
        current = float(self._drive.read(_CURRENT)) if self._has_current else None
        link = self._drive.bus.link(self._drive.unit)
        return Shown(
            self._drive.bus.now(),
            status.state,
            status.frequency,
            0 if status.fault is None else status.fault.code,
            status.fault is not None or status.state is State.FAULT,
            status.ready,
            current,
            link.good / link.asked if link.asked else 1.0,
        )

    def carry_out(self, action: Action) -> None:
        """Tells the drive, once. Raises what came of it; a start of which nothing is known was then stopped."""
        if isinstance(action, Run):
            self._arm()
            self._motor.run(self._hertz(action.course.word), reverse=action.course.reverse)
        elif isinstance(action, Speed):
            self._drive.setpoint = self._hertz(action.word)
        elif isinstance(action, Reset):
            self._drive.reset_fault()
        elif isinstance(action, Coast):
            self._drive.coast()
        else:
            # While the program goes on, its own looks prove the stop: the pins are not to wait for that.
            self._motor.stop(confirm=0)

    def _hertz(self, word: int) -> float:
        """The frequency that the drive counts so: given back, it is the same word."""
        register, profile = self._setpoint()
        return float(profile.decode(register, word))

    def _setpoint(self) -> tuple[str, Profile]:
        """The register of the setpoint, and what the drive counts in it; that is asked once."""
        register, unit = self._drive.profile.role("setpoints.frequency"), self._drive.unit
        if register is None:
            raise BadArgument(
                f"no frequency setpoint of {self._drive.profile.title} is known, and a spindle needs one", unit=unit
            )
        if self._counted is None:
            profile = self._drive.settled_profile(register)
            described = profile.describe(register)
            if described.unit != "Hz":
                raise BadArgument(
                    f"the setpoint of unit {unit} is in {described.unit or 'a unit that is not known'}, and a spindle "
                    "needs one in Hz",
                    unit=unit,
                )
            self._counted = profile
        return register, self._counted

    def forget_watchdog(self) -> None:
        """Takes the drive's time-out for forgotten, as it is by one that was switched off: the next start sets it."""
        if self._watchdog is not None:
            watchdog, self._watchdog = self._watchdog, None
            watchdog.close()

    def give_back(self) -> None:
        """Waits for a motor that slows down, and gives the drive back the time-out that it had."""
        if self._watchdog is not None:
            self._watchdog.close()

    def __enter__(self) -> SpindleMotor:
        self._motor.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stops what was started here, and proves it; also what was told to stop before and did not confirm it."""
        self._motor.__exit__(kind, error, trace)

    def _own_action(self) -> str | None:
        """What the drive will do by itself; None where its family has no watchdog that can be set."""
        settings, profile = self._drive.profile.watchdog, self._drive.profile
        if settings is None or profile.memory() is None:
            self._say(
                f"{profile.title} has no communication time-out that can be set from here: if this program is killed, "
                "its motor turns on. An emergency stop is a wire"
            )
            return None
        if not (settings.verified or self._drive.unverified):
            raise Unverified(
                f"the communication time-out of {profile.title} ({settings.timeout}) is not verified: {settings.note} "
                "Use it anyway with --unverified, or do without with --no-watchdog. Nothing was sent",
                unit=self._drive.unit,
            )
        action = next(each for each in _ACTIONS if each in settings.choices)
        if action == "trip":
            self._say(
                f"{profile.title} trips when it hears nothing for {self._silence:g} s; whether its motor then stops is "
                "set in the drive"
            )
        profile.encode(settings.timeout, self._silence or 0.0)
        return action

    def _arm(self) -> None:
        if self._watchdog is None and self._silence is not None and self._action is not None:
            self._watchdog = self._drive.watchdog(self._silence, self._action)
            if self._watchdog.unsure:
                self._say(self._watchdog.unsure)

    def _is_readable(self, name: str) -> bool:
        try:
            self._drive.readable(name)
        except NotAllowed:
            return False
        return True
