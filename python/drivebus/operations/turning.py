"""The motor of one drive, as far as one program turns it: started as often as wanted, stopped whatever happens.

`drivebus.motor` and `drivebus.aio.motor` are its faces: one carries this out at once, one awaits it.
"""

from __future__ import annotations

from drivebus import checks
from drivebus.errors import BadArgument, DrivebusError
from drivebus.operations import motion
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import WITHIN
from drivebus.operations.motor_block import MotorBlock

__all__ = ["MotorFace", "Turning", "turning_of"]


class Turning:
    """A motor that one program starts and stops, and that is stopped when the block is left.

    Attributes:
        unstopped: Why the drive did not take, or not prove, the last stop that was sent here, after which it was told
            to coast; None where it did. The end of the block sends another.
    """

    def __init__(self, unit: DriveView, within: float) -> None:
        self.unstopped: DrivebusError | None = None
        self._unit = unit
        self._within = checks.number("stop_within", within, 0.0, 3600.0)
        self._block: MotorBlock | None = None
        self._confirm = 1.0
        self._entered = False

    @property
    def address(self) -> int:
        """The address of what turns."""
        return self._unit.address

    @property
    def may_turn(self) -> bool:
        """Whether it was started here, and no stop was taken since."""
        return self._block is not None or self.unstopped is not None

    def enter(self) -> None:
        """The block begins."""
        if self._entered:
            raise BadArgument("this motor's block is entered already", unit=self._unit.address)
        self._entered = True

    async def run(self, hz: float | None, reverse: bool, confirm: float, force: bool) -> None:
        """Starts it; one that turns already gets another speed or direction."""
        if not self._entered:
            raise BadArgument(
                f"the motor of unit {self._unit.address} is run inside its block, whose end stops it; nothing was sent",
                unit=self._unit.address,
            )

        async def start() -> None:
            await motion.run(self._unit, hz, reverse=reverse, confirm=confirm, force=force)

        if self._block is not None:
            await start()
            return
        self._block = MotorBlock(self._unit, start, self._end, within=self._within)
        try:
            await self._block.begin()
        except DrivebusError as reason:
            block, self._block = self._block, None
            await block.fail(reason)
            raise

    async def stop(self, confirm: float) -> None:
        """Stops it: by all means where it was started here, else as anybody may."""
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        block, self._block = self._block, None
        if block is None:
            await motion.stop(self._unit, confirm=confirm, within=self._within)
            self.unstopped = None
        else:
            self._confirm = confirm
            try:
                await block.finish()
            finally:
                self._confirm = 1.0

    async def leave(self, reason: BaseException | None) -> None:
        """Stops what was started here, and proves it: also what was told to stop before and did not take it."""
        block, self._block = self._block, None
        unstopped, self.unstopped = self.unstopped, None
        self._entered = False
        if block is not None:
            await (block.finish() if reason is None else block.fail(reason))
        elif unstopped is not None:
            await self._end(self._unit, self._within)

    async def _end(self, unit: DriveView, within: float = WITHIN) -> None:
        try:
            await motion.end_run(unit, within, confirm=self._confirm)
        except DrivebusError as error:
            self.unstopped = error
            raise
        self.unstopped = None


class MotorFace:
    """What a motor tells of itself, in both faces, without asking the drive."""

    def __init__(self, unit: DriveView, within: float) -> None:
        self._turning = Turning(unit, within)

    def __repr__(self) -> str:
        return f"<Motor of unit {self._turning.address}: {'may turn' if self.may_turn else 'not started here'}>"

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


def turning_of(motor: MotorFace) -> Turning:
    """What a motor's methods carry out."""
    return motor._turning
