"""One command for several drives, side by side: `-d pumps`, `-u 1-4`.

Each drive has a thread, and the drives of a line share its bus: a unit that does not answer keeps nobody else waiting
longer than its own time-outs. What each shows is kept until it is done and shown in the order in which the drives were
named. A question is asked once, for all that have to ask it, before any of them goes on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

import click

import drivebus
from drivebus.cli.present.errors import exit_code, tell, tell_wills
from drivebus.cli.present.output import about, remark
from drivebus.cli.session import Declined, Session, ask_once
from drivebus.cli.suspension import gives_way_when_held

__all__ = ["Crew"]

_Work = Callable[[Session], None]


class _Ended(Exception):
    """The program was interrupted before this drive went on."""


class Crew:
    """The commands that run side by side for several drives.

    Args:
        sessions: One for each drive.
    """

    def __init__(self, sessions: Sequence[Session]) -> None:
        self._sessions = [replace(one, crew=self, out=one.out.held(one.called)) for one in sessions]
        self._said: SimpleQueue[tuple[int, str | None, bool]] = SimpleQueue()
        self._answers = [SimpleQueue[BaseException | None]() for _ in sessions]
        self._failed: dict[int, BaseException] = {}
        self._here = threading.local()
        self._lock = threading.Lock()
        self._buses: dict[str, drivebus.Bus] = {}
        self._is_over = False

    def run(self, work: _Work) -> None:
        """Does *work* for each drive. Who failed, and why, is told; the exit code is that of the first of them.

        Raises:
            click.exceptions.Exit: One failed.
            KeyboardInterrupt: The calls under way were ended. What was sent before stays sent.
        """
        context = click.get_current_context()
        threads = [
            threading.Thread(target=self._work, args=(place, context, work), name=f"drivebus {one.called}", daemon=True)
            for place, one in enumerate(self._sessions)
        ]
        try:
            with gives_way_when_held(lambda: list(self._buses.values())):
                for thread in threads:
                    thread.start()
                self._lead()
        except KeyboardInterrupt as error:
            self._end(threads)
            if hasattr(error, "add_note") and context.info_name == "run":
                error.add_note(
                    "Motors that were started keep running: `drivebus … stop` with the same drives stops them."
                )
            raise
        finally:
            self._end(threads)
        self._conclude()

    def bus(self, port: str, settings: dict[str, Any]) -> drivebus.Bus:
        """The bus on *port*, which all that have the same settings share. It is closed when all are done."""
        key = repr((port, sorted(settings.items(), key=lambda item: item[0])))
        with self._lock:
            if self._is_over:
                raise _Ended
            if key not in self._buses:
                self._buses[key] = drivebus.Bus(port, **settings)
            return self._buses[key]

    def ask(self, text: str, yes: bool) -> None:
        """Says *text*, and goes on when all were asked and the answer is yes.

        Raises:
            Declined: It is not.
        """
        place = self._here.place
        self._said.put((place, text, yes))
        answer = self._answers[place].get()
        if answer is not None:
            raise answer

    def _work(self, place: int, context: click.Context, work: _Work) -> None:
        """One drive's part, in its thread."""
        self._here.place = place
        session = self._sessions[place]
        with context.scope(cleanup=False), about(session.called):
            try:
                work(session)
            except BaseException as error:  # whatever it is, the others go on, and it is told in the end
                self._failed[place] = error
        self._said.put((place, None, False))

    def _lead(self) -> None:
        """Waits until all are done, and asks what is to be asked when nobody else is still on the way."""
        hidden = list(range(len(self._sessions)))
        busy = set(hidden)
        asking: dict[int, str] = {}
        while busy:
            place, text, yes = self._said.get()
            busy.discard(place)
            if text is not None:
                asking[place] = text
            # In the order in which they were named; before a question, all that is known by then.
            while hidden and (hidden[0] not in busy | asking.keys() or (not busy and len(hidden) > len(asking))):
                self._show(next(each for each in hidden if each not in busy | asking.keys()), hidden)
            if asking and not busy:
                answer = _answer([asking[each] for each in sorted(asking)], yes)
                for each in asking:
                    self._answers[each].put(answer)
                busy, asking = set(asking), {}

    def _show(self, place: int, hidden: list[int]) -> None:
        """What one drive's command showed, and why it failed if it did."""
        hidden.remove(place)
        session = self._sessions[place]
        session.out.let_go()
        failure = self._failed.get(place)
        with about(session.called):
            if isinstance(failure, drivebus.DrivebusError):
                tell(failure)
                session.advise(failure)

    def _conclude(self) -> None:
        """Says who failed, and ends with the code of the first."""
        failed = [(self._sessions[place].called, self._failed[place]) for place in sorted(self._failed)]
        codes: list[int] = []
        for _, failure in failed:
            if isinstance(failure, drivebus.DrivebusError):
                codes.append(exit_code(failure))
            elif isinstance(failure, click.exceptions.Exit):
                codes.append(failure.exit_code)
            else:
                raise failure  # a wrong word, an answer, or a mistake of ours: the same for all
        if codes:
            remark(f"{len(failed)} of {len(self._sessions)} failed: {', '.join(name for name, _ in failed)}")
            raise click.exceptions.Exit(codes[0])

    def _end(self, threads: Sequence[threading.Thread]) -> None:
        """Closes the lines, which ends what is under way on them: a motor that a block runs is stopped before."""
        with self._lock:
            self._is_over = True
            buses, self._buses = list(self._buses.values()), {}
        for answers in self._answers:
            answers.put(_Ended())
        for bus in buses:
            tell_wills(bus)
            with suppress(drivebus.DrivebusError):
                bus.close()
        for thread in threads:
            if thread.ident is not None:
                thread.join()


def _answer(texts: Sequence[str], yes: bool) -> BaseException | None:
    """What keeps those that asked *texts* from going on; None lets them."""
    try:
        ask_once(texts, yes)
    except (Declined, click.UsageError) as error:
        return error
    return None
