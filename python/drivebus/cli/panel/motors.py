"""The motors, as far as the panel tells them anything: what starts, what stops, and who stops it in the end.

Nothing here knows a screen. Whatever may move a motor runs in a thread of its own and is known while it is under way. A
stop waits for none of that. It goes out at once, and again and again until what was under way is over: a stop that
overtook a start would otherwise be followed by it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from queue import SimpleQueue

import drivebus
from drivebus.cli.panel.journal import Journal

__all__ = ["PanelMotor", "stop_all", "wait_for_all"]

_PAUSE = 0.05
"""Seconds between two stops while a start is under way: on a line full of stops, which go first, no start ends."""


_STOPPED = "it was told to stop meanwhile; nothing was sent"


class _Block:
    """A motor that this panel started and has not stopped yet.

    Attributes:
        orders: What is still to be done with it, one at a time; None ends it.
        over: Whether it is to end.
        jogs: Whether it is a jog, which takes no other orders.
    """

    def __init__(self, jogs: bool) -> None:
        self.orders: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self.over = threading.Event()
        self.jogs = jogs

    def end(self) -> None:
        """Has its thread stop the motor."""
        self.over.set()
        self.orders.put(None)


class PanelMotor:
    """The motor of one drive.

    Args:
        called: What the drive is called.
        halt: Stops it, whether it is known already what drive it is or not.
        tell: Asks the drive what the motor does now, and says it in words.
        journal: Who is told what came of it.
        watchdog: After how many seconds of silence the drive stops by itself while this panel runs it; None: never.

    Attributes:
        stops: How often it was told to stop. Who asks before a start keeps it: a stop meanwhile takes the answer back.
        is_slowing: Whether a stop was confirmed, as it is on the ramp, and it was not seen to stand or run since.
        failure: Why a motor that this panel started could not be stopped when it was stopped last; None if it could.
    """

    def __init__(
        self,
        called: str,
        halt: Callable[[float | None], None],
        tell: Callable[[], str],
        journal: Journal,
        watchdog: float | None,
    ) -> None:
        self.called = called
        self._halt = halt
        self._tell = tell
        self._journal = journal
        self._watchdog = watchdog
        self._lock = threading.Lock()
        self._under_way = 0
        self._block: _Block | None = None
        self._proving = False
        self._repeating = False
        self._thread: threading.Thread | None = None
        self.stops = 0
        self.is_slowing = False
        self.failure: drivebus.DrivebusError | None = None

    @property
    def started(self) -> bool:
        """Whether this panel started it, and has not stopped it yet."""
        return self._block is not None

    def run(self, drive: drivebus.Drive, hz: float | None, reverse: bool, since: int) -> None:
        """Starts it, or changes speed or direction of one that this panel started; not if it was stopped *since*."""
        way = "in reverse" if reverse else "forward"
        what = f"run {way}" if hz is None else f"run {way} at {hz:g} Hz"
        with self._lock:
            block = self._block
            if self.stops != since:
                self._journal.say(f"{self.called}: {what}: {_STOPPED}", "yellow")
            elif block is None:
                self._begin(_Block(False), what, drive, lambda: drive.running(hz, reverse=reverse), None)
            elif block.over.is_set() or block.jogs:
                self._journal.say(f"{self.called}: it is still being stopped; give the order again", "yellow")
            else:
                block.orders.put(lambda: self._do(what, lambda: drive.run(hz, reverse=reverse), since))

    def jog(self, drive: drivebus.Drive, seconds: float, reverse: bool, since: int) -> None:
        """Jogs it for *seconds*, or until it is stopped; not if it was stopped *since*."""
        what = f"jog {'in reverse' if reverse else 'forward'} for {seconds:g} s"
        with self._lock:
            if self.stops != since:
                self._journal.say(f"{self.called}: {what}: {_STOPPED}", "yellow")
            elif self._block is None:
                self._begin(_Block(True), what, drive, lambda: drive.jogging(reverse=reverse), seconds)
            else:
                self._journal.say(f"{self.called}: it turns already; stop it before a jog", "yellow")

    def later(self, what: str, order: Callable[[], None], since: int) -> None:
        """Does *order* in a thread of its own, if it was not stopped *since*; what came of it is told."""
        threading.Thread(target=self._do, args=(what, order, since), name=f"panel {self.called}", daemon=True).start()

    def _do(self, what: str, order: Callable[[], None], since: int) -> None:
        """Does *order*, which may move the motor: a stop meanwhile is sent until it is over."""
        try:
            with self._moving(since):
                order()
        except drivebus.DrivebusError as error:
            self._journal.fail(f"{self.called}: {what}", error)
        else:
            self._journal.say(f"{self.called}: {what}: done")

    def stop(self) -> None:
        """Stops it, on the spot, whoever started it. Returns before the stop is confirmed, which is told later."""
        self._journal.say(f"{self.called}: stop", "bold")
        with self._lock:
            self.stops += 1
            block, busy = self._block, self._under_way > 0
            its_own = block is not None and not block.over.is_set()
            if block is not None:
                block.end()
            if its_own and not busy:
                return  # the thread that runs it sends the stop now
            # A start that is under way proves nothing when it ends: it may have been sent, and refused by us.
            prove = (block is None or busy) and not self._proving
            self._proving |= prove
        threading.Thread(target=self._stop, args=(prove,), name=f"stop {self.called}", daemon=True).start()

    def wait(self) -> None:
        """Waits until what this panel started is stopped, or could not be."""
        thread = self._thread
        if thread is not None:
            thread.join()

    def _begin(
        self,
        block: _Block,
        what: str,
        drive: drivebus.Drive,
        enter: Callable[[], AbstractContextManager[drivebus.Drive]],
        seconds: float | None,
    ) -> None:
        self._block, self.failure, self.is_slowing = block, None, False
        # Before the thread begins: a stop that comes before it is to find it.
        self._under_way += 1
        self._thread = threading.Thread(
            target=self._turn, args=(block, what, drive, enter, seconds), name=f"panel {self.called}", daemon=True
        )
        self._thread.start()

    def _turn(
        self,
        block: _Block,
        what: str,
        drive: drivebus.Drive,
        enter: Callable[[], AbstractContextManager[drivebus.Drive]],
        seconds: float | None,
    ) -> None:
        """Runs it for as long as the block lasts: it is stopped whatever happens here."""
        turns = False
        try:
            with ExitStack() as stack:
                try:
                    if self._watchdog is not None:
                        settings = drive.profile.watchdog
                        action = "coast" if settings is None else settings.choices[0]
                        watchdog = stack.enter_context(drive.watchdog(self._watchdog, action))
                        if watchdog.unsure:
                            self._journal.say(f"{self.called}: watchdog: {watchdog.unsure}", "yellow")
                    if not block.over.is_set():
                        stack.enter_context(enter())
                        turns = True
                finally:
                    self._arrived()
                if turns:
                    self._journal.say(f"{self.called}: {what}: done")
                    self._obey(block, seconds)
            if turns:
                self._say_stopped()
        except drivebus.DrivebusError as error:
            self.failure = error if turns else None
            self._journal.fail(f"{self.called}: {'stop' if turns else what}", error)
        finally:
            with self._lock:
                self._block = None

    def _obey(self, block: _Block, seconds: float | None) -> None:
        """Does what is ordered until the block is over."""
        if seconds is not None:
            block.over.wait(seconds)
            return
        while not block.over.is_set():
            order = block.orders.get()
            if order is not None:
                order()

    def _stop(self, prove: bool) -> None:
        """Sends stops until nothing that moves it is under way any more; with *prove*, looks at the drive then."""
        mine = False
        try:
            while (mine := self._repeats(mine)) or (prove and self._moves()):
                try:
                    if mine:
                        self._halt(0.0)
                except drivebus.DrivebusError as error:
                    self._journal.fail(f"{self.called}: stop", error)
                threading.Event().wait(_PAUSE)
            if not prove:
                # Its own thread proves it, or the stop before this one.
                self._halt(0.0)
                return
            self._halt(None)
            self._say_stopped()
        except drivebus.DrivebusError as error:
            self._journal.fail(f"{self.called}: stop", error)
        finally:
            if prove:
                self._proving = False
            if mine:  # what nobody foresaw ended it
                self._repeating = False

    def _say_stopped(self) -> None:
        """Says that the stop is confirmed, and what the motor does then."""
        told = self._tell()
        self.is_slowing = True
        self._journal.say(f"{self.called}: stop confirmed: {told}")

    def _repeats(self, mine: bool) -> bool:
        """Whether this thread sends the next stop: one at a time does, and while something is under way."""
        with self._lock:
            if self._repeating and not mine:
                return False
            self._repeating = self._under_way > 0
            return self._repeating

    def _moves(self) -> bool:
        with self._lock:
            return self._under_way > 0

    @contextmanager
    def _moving(self, since: int) -> Iterator[None]:
        with self._lock:
            if self.stops != since:
                raise drivebus.NotReady(_STOPPED, why="halted")
            self._under_way += 1
        try:
            yield
        finally:
            self._arrived()

    def _arrived(self) -> None:
        with self._lock:
            self._under_way -= 1


def stop_all(motors: Iterable[PanelMotor]) -> None:
    """Stops those of *motors* that this panel started, all at once."""
    for motor in motors:
        if motor.started:
            motor.stop()


def wait_for_all(motors: Iterable[PanelMotor]) -> None:
    """Waits until all that this panel started are stopped, or could not be."""
    for motor in motors:
        motor.wait()
