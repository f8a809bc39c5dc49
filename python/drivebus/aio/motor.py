"""A motor that a block of a task starts and stops as often as it wants, and that is stopped in the end."""

from __future__ import annotations

from types import TracebackType

from drivebus.aio.awake import Awake
from drivebus.errors import DrivebusError
from drivebus.operations.turning import Turning
from drivebus.operations.unit import Unit
from drivebus.strict_attributes import known_only

__all__ = ["Motor"]


@known_only
class Motor:
    """The motor of a drive inside one `async with` block. `Drive.motor` makes it; otherwise as `drivebus.Motor`."""

    def __init__(self, unit: Unit, within: float) -> None:
        self._turning = Turning(unit, within)
        self._awake: Awake | None = None

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

    async def run(
        self, hz: float | None = None, *, reverse: bool = False, confirm: float = 1.0, force: bool = False
    ) -> None:
        """Starts the motor, or gives one that turns another speed or direction. See `drivebus.Motor.run`."""
        await self._turning.run(hz, reverse, confirm, force)

    async def stop(self, *, confirm: float = 1.0) -> None:
        """Stops the motor, by all means where it was started here. See `drivebus.Motor.stop`."""
        await self._turning.stop(confirm)

    async def __aenter__(self) -> Motor:
        self._turning.enter()
        self._awake = Awake()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            await self._turning.leave(error)
        finally:
            if self._awake is not None:
                self._awake.end()
