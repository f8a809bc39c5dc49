"""A motor that a block of the program starts and stops as often as it wants, and that is stopped in the end."""

from __future__ import annotations

from types import TracebackType

from drivebus.errors import DrivebusError
from drivebus.line.blocking import at_once
from drivebus.operations.turning import Turning
from drivebus.operations.unit import Unit
from drivebus.strict_attributes import known_only

__all__ = ["Motor"]


@known_only
class Motor:
    """The motor of a drive inside one block of the program. `Drive.motor` makes it.

        with drive.motor() as motor:
            motor.run(10.0)
            motor.run(20.0, reverse=True)
            motor.stop()
            motor.run(5.0)              # is stopped when the block ends, whatever ends it

    For one thread at a time.
    """

    def __init__(self, unit: Unit, within: float) -> None:
        self._turning = Turning(unit, within)

    def __repr__(self) -> str:
        return f"<Motor of {self._turning}>"

    @property
    def may_turn(self) -> bool:
        """Whether it was started here, and no stop was taken since."""
        return self._turning.may_turn

    @property
    def unstopped(self) -> DrivebusError | None:
        """Why the drive did not take or prove the last stop from here, after which it was told to coast; None else.

        The end of the block sends another stop then.
        """
        return self._turning.unstopped

    def run(self, hz: float | None = None, *, reverse: bool = False, confirm: float = 1.0, force: bool = False) -> None:
        """Starts the motor, or gives one that turns another speed or direction. Arguments and errors as `Drive.run`.

        A start of which nothing is known is stopped before the error is raised: its note says where that failed.

        Raises:
            NotAllowed: Also outside the block. Nothing was sent.
        """
        at_once(self._turning.run(hz, reverse, confirm, force))

    def stop(self, *, confirm: float = 1.0) -> None:
        """Stops the motor, by all means where it was started here: as the end of `Drive.running` does.

        Args:
            confirm: Seconds for which the state is looked at; 0 does not look.

        Raises:
            Refused, NoAnswer, BadAnswer, PortError, Unconfirmed: It is not proved to stop; it may turn.
        """
        at_once(self._turning.stop(confirm))

    def __enter__(self) -> Motor:
        self._turning.enter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        at_once(self._turning.leave(error))
