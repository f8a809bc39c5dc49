"""A motor that a block of a task starts and stops as often as it wants, and that is stopped in the end."""

from __future__ import annotations

from types import TracebackType

from drivebus.aio.awake import Awake
from drivebus.operations.drive_view import DriveView
from drivebus.operations.turning import MotorFace, turning_of
from drivebus.plain_annotations import plain_annotations
from drivebus.strict_attributes import known_only

__all__ = ["Motor"]


@plain_annotations
@known_only
class Motor(MotorFace):
    """The motor of a drive inside one `async with` block. `Drive.motor` makes it; otherwise as `drivebus.Motor`."""

    def __init__(self, unit: DriveView, within: float) -> None:
        super().__init__(unit, within)
        self._awake: Awake | None = None

    async def run(
        self, hz: float | None = None, *, reverse: bool = False, confirm: float = 1.0, force: bool = False
    ) -> None:
        """Starts the motor, or gives one that turns another speed or direction. See `drivebus.Motor.run`."""
        await turning_of(self).run(hz, reverse, confirm, force)

    async def stop(self, *, confirm: float = 1.0) -> None:
        """Stops the motor, by all means where it was started here. See `drivebus.Motor.stop`."""
        await turning_of(self).stop(confirm)

    async def __aenter__(self) -> Motor:
        turning_of(self).enter()
        self._awake = Awake()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            await turning_of(self).leave(error)
        finally:
            if self._awake is not None:
                self._awake.end()
