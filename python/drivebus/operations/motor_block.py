"""A motor that turns for as long as a block of the program lasts, and is stopped whatever happens there."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager
from typing import TypeAlias

from drivebus.errors import DrivebusError, Unconfirmed
from drivebus.line.blocking import at_once
from drivebus.line.protocols import AwaitableBus
from drivebus.operations import motion, waiting
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import WITHIN
from drivebus.operations.last_will import LastWill
from drivebus.operations.program_end import Guard

__all__ = ["MotorBlock"]

_END_ATTEMPTS = 3
"""How often a motor is stopped whose drive took it and does not show it, before it is told to coast."""

_INTERRUPTED_AT_MOST = 64
"""How often an attempt that was interrupted before anything was sent counts as none."""

_Outcome: TypeAlias = tuple[DrivebusError | None, BaseException | None]
"""What is left to raise: why it could not be ended, and what interrupted that."""


class MotorBlock:
    """Runs a motor for one block of the program, and ends it by all means.

    Who makes it calls `begin`, and then, whatever comes of that, either `fail` or `finish`.

    Args:
        unit: What turns.
        start: Starts it.
        end: Ends it, over the view of the unit that it is given, which may be that of another thread, and within the
            seconds that it is given.
        standstill: For how many seconds it is waited for, once it was ended; None does not wait. What ends the program
            is not kept waiting.
        within: For how many seconds it is told to end until it takes that.
    """

    def __init__(
        self,
        unit: DriveView,
        start: Callable[[], Awaitable[None]],
        end: Callable[[DriveView, float], Awaitable[None]],
        standstill: float | None = None,
        within: float = WITHIN,
    ) -> None:
        self._unit = unit
        self._within = within
        self._standstill = standstill
        self._start = start
        self._end = end
        # Other threads and the end of the interpreter have no event loop: they end it over a line that blocks.
        self._elsewhere = unit.with_bus(unit.bus.blocking())
        self._guard = Guard(self._end_at_once, unit.bus.line)
        self._will = LastWill(unit)
        self._started = False
        self._starts_before = unit.record.starts

    async def begin(self) -> None:
        """Starts the motor.

        Raises:
            NotAllowed: Also where the end of the program has begun, or its standstill could not be seen. Nothing was
                sent.
        """
        if self._standstill is not None:
            waiting.check_standstill(self._unit, self._standstill)
        self._guard.arm()
        self._will.leave()
        with self._guard.beginning():
            await self._start()
        self._started = True
        self._guard.check()

    async def fail(self, reason: BaseException) -> None:
        """The block, or its beginning, ended with *reason*, which is to be raised after this."""
        if isinstance(reason, GeneratorExit):
            self._leave()
            return
        ended = False
        try:
            with self._keeping_interruptions(), self._unit.bus.undisturbed() as bus:
                # Of this package's errors, only Unconfirmed comes from a start once its command was sent. What ended it
                # before that, a Ctrl-C for one, leaves a motor alone that somebody else may run.
                may_turn = isinstance(reason, Unconfirmed) or not isinstance(reason, DrivebusError)
                failure = interrupted = None
                if self._started or (may_turn and self._unit.record.starts > self._starts_before):
                    failure, interrupted = await self._stop(bus)
                    ended = failure is None
                    if failure is not None:
                        _note(reason, f"and unit {self._unit.address} could not be stopped: {failure}")
                else:
                    self._will.withdraw()
                self._guard.disarm()
                if interrupted is not None:
                    raise interrupted
        except KeyboardInterrupt:
            # Of several that end the same block, and what ends the program anyway, the first is raised.
            if isinstance(reason, Exception):
                raise
        if ended and isinstance(reason, Exception):
            try:
                await self._stand()
            except DrivebusError as failure:
                _note(reason, f"and {self._unseen}: {failure}")

    async def finish(self) -> None:
        """The block went well. Raises what came of stopping the motor."""
        with self._keeping_interruptions(), self._unit.bus.undisturbed() as bus:
            failure, interrupted = await self._stop(bus)
            self._guard.disarm()
            unwelcome = failure or interrupted
            if unwelcome is not None:
                raise unwelcome
        try:
            await self._stand()
        except Unconfirmed:
            raise  # it says what the motor does
        except DrivebusError as failure:
            _note(failure, self._unseen)
            raise

    async def _stand(self) -> None:
        """Waits until the motor stands, where that was asked for."""
        if self._standstill is not None:
            await waiting.wait_until_stopped(self._unit, self._standstill)

    @property
    def _unseen(self) -> str:
        return f"unit {self._unit.address} was told to stop, but was not seen at rest"

    def _keeping_interruptions(self) -> AbstractContextManager[object]:
        before = self._unit.record.halts
        return self._guard.keeping_interruptions(lambda: self._unit.record.halts > before)

    async def _stop(self, bus: AwaitableBus) -> _Outcome:
        if not self._guard.begin_to_end():
            return None, None
        try:
            return await self._end_by_all_means(self._unit.with_bus(bus))
        except GeneratorExit:
            self._leave()
            raise

    def _leave(self) -> None:
        """Ends it where nothing can be awaited any more: the block was thrown away, as its event loop may be."""
        failure = self._end_at_once() if self._guard.begin_to_end() else None
        self._guard.disarm()
        if failure is not None:
            raise failure

    def _end_at_once(self) -> BaseException | None:
        with self._keeping_interruptions():
            failure, interrupted = at_once(self._end_by_all_means(self._elsewhere))
        return failure or interrupted

    async def _end_by_all_means(self, unit: DriveView) -> _Outcome:
        """Ends it, or coasts where that fails. Returns what is left to raise: a failure, and what interrupted it."""
        interrupted: BaseException | None = None
        failure: DrivebusError | None = None
        most_sent = -1
        attempts = interruptions = 0
        until = unit.bus.now() + self._within
        while attempts <= _END_ATTEMPTS:
            sent_before = unit.record.halts
            # What was not taken by then is not waited for so long again.
            left = max(until - unit.bus.now(), 0.0)
            try:
                await (self._end(unit, left) if attempts < _END_ATTEMPTS else motion.coast(unit, within=left))
            except DrivebusError as error:
                # The one that sent most says how often the drive was told; of several, the last.
                if (sent := unit.record.halts - sent_before) >= most_sent:
                    failure, most_sent = error, sent
                attempts += 1
            except GeneratorExit:
                raise
            except BaseException as error:
                # A second Ctrl-C must not leave the motor running: it is raised once the drive was told to stop.
                interrupted = interrupted or error
                interruptions += 1
                # What was interrupted before it was sent was no attempt.
                attempts += unit.record.halts > sent_before or interruptions > _INTERRUPTED_AT_MOST
            else:
                # Not where that failed: somebody else may yet halt it.
                self._will.withdraw()
                return None, interrupted
        return failure, interrupted


def _note(error: BaseException, text: str) -> None:
    """Says *text* with *error*. Python 3.10 has no notes."""
    if hasattr(error, "add_note"):
        error.add_note(text)
