"""A motor that a block of the program starts and stops as often as it wants, and that is stopped in the end."""

from __future__ import annotations

from types import TracebackType

from drivebus.line.blocking import at_once
from drivebus.operations.turning import MotorFace, turning_of
from drivebus.plain_annotations import plain_annotations
from drivebus.strict_attributes import known_only

__all__ = ["Motor"]


@plain_annotations
@known_only
class Motor(MotorFace):
    """The motor of a drive inside one block of the program. `Drive.motor` makes it.

        with drive.motor() as motor:
            motor.run(10.0)
            motor.run(20.0, reverse=True)
            motor.stop()
            motor.run(5.0)              # is stopped when the block ends, whatever ends it

    For one thread at a time.
    """

    def run(self, hz: float | None = None, *, reverse: bool = False, confirm: float = 1.0, force: bool = False) -> None:
        """Starts the motor, or gives one that turns another speed or direction. Arguments and errors as `Drive.run`.

        A start of which nothing is known is stopped before the error is raised: its note says where that failed.

        Raises:
            NotAllowed: Also outside the block. Nothing was sent.
        """
        at_once(turning_of(self).run(hz, reverse, confirm, force))

    def stop(self, *, confirm: float = 1.0) -> None:
        """Stops the motor, by all means where it was started here: as the end of `Drive.running` does.

        Args:
            confirm: Seconds for which the state is looked at; 0 does not look.

        Raises:
            Refused, NoAnswer, BadAnswer, PortError, Unconfirmed: It is not proved to stop; it may turn.
        """
        at_once(turning_of(self).stop(confirm))

    def __enter__(self) -> Motor:
        turning_of(self).enter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        at_once(turning_of(self).leave(error))
