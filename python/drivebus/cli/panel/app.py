"""The panel as a program: its keys, its beat, and what it asks before anything moves.

It calls nothing that blocks. What is asked of a drive runs in threads (`motors`, `members`); what they have to say is
shown four times a second.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import ClassVar

from textual.app import App
from textual.binding import Binding, BindingType
from textual.driver import Driver
from textual.screen import ModalScreen

from drivebus import Drive, DrivebusError, NotAllowed
from drivebus.cli.panel import render
from drivebus.cli.panel.bus_control_dialog import lacking, question
from drivebus.cli.panel.dialogs import Ask, AskFor, Show
from drivebus.cli.panel.helping import help_text, journal_text
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.members import Member
from drivebus.cli.panel.motors import stop_all
from drivebus.cli.panel.numbers import number
from drivebus.cli.panel.overview import Overview
from drivebus.cli.panel.parameters import Parameters
from drivebus.cli.panel.space_stops import STOP_KEYS, stopping
from drivebus.cli.panel.view import DriveView, Fleet, View

__all__ = ["Panel"]

_BEAT = 0.25
"""Seconds from one look at what is new to the next."""
_LONGEST_JOG = 60.0
_CLEAR = "Is the machine clear?"


class Panel(App[None]):
    """The screen and the keys.

    Args:
        members: The drives.
        journal: What there is to say.

    Attributes:
        current: The drive that the keys are for: the one in view, or under the cursor.
        error: What ended the panel, where it was not somebody.
    """

    CSS = """
    Screen { background: ansi_default; }
    View { overflow: hidden; }
    #foot { dock: bottom; height: 4; }
    #head, #keys { height: 1; }
    #doing { height: auto; max-height: 2; }
    #messages { height: 3; }
    #tiles { height: 6; margin-top: 1; margin-bottom: 1; }
    #tiles Piece { width: 1fr; height: 6; }
    #values { height: 1fr; }
    #lamps, #fault, #line { height: auto; }
    #fault { max-height: 5; }
    #line { max-height: 3; }
    .tight #tiles { margin-top: 0; margin-bottom: 0; }
    .tight #foot { height: 3; }
    .tight #messages { height: 2; }
    #chosen { height: auto; max-height: 7; margin-top: 1; }
    Overview { height: 1fr; scrollbar-size-vertical: 0; }
    ModalScreen { align: center bottom; background: transparent; }
    Show { align: center middle; }
    .dialog { width: 100%; height: auto; border: solid ansi_yellow; padding: 0 2; margin-bottom: 1; }
    .dialog LineField { margin: 1 0; }
    .keys { margin: 1 0; }
    .page { width: 78; max-width: 100%; height: 90%; border: solid ansi_blue; padding: 0 1; }
    #search { height: 1; }
    DataTable { height: 1fr; background: ansi_default; scrollbar-size-horizontal: 0; }
    #detail { height: 5; }
    """
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(",".join(STOP_KEYS), "stopped", "STOP", priority=True),
        Binding("ctrl+c,ctrl+q", "leave", "quit", priority=True),
        Binding("ctrl+z", "stays", "", priority=True),
        Binding("r", "run(False)", "run"),
        Binding("R", "run(True)", "run in reverse"),
        Binding("s", "stop", "stop"),
        Binding("j", "jog(False)", "jog"),
        Binding("J", "jog(True)", "jog in reverse"),
        Binding("f", "setpoint", "setpoint"),
        Binding("x", "reset", "reset a fault"),
        Binding("b", "prepare", "prepare"),
        Binding("p", "parameters", "parameters"),
        Binding("m", "messages", "messages"),
        Binding("question_mark,f1", "help", "help"),
        Binding("q", "quit_asking", "quit"),
    ]

    def __init__(self, members: Sequence[Member], journal: Journal) -> None:
        self.members = members
        self.journal = journal
        self.current = members[0]
        self.error: Exception | None = None
        self.terminal_lost = threading.Event()
        self._stops = 0
        super().__init__(ansi_color=True)
        self.theme = "ansi-dark"

    def get_driver_class(self) -> type[Driver]:
        """The usual driver of this system, with Space taken out."""
        return stopping(super().get_driver_class(), self.stop_now, self._lose_terminal)

    def stop_now(self) -> None:
        """Stops the drive that the keys are for, and every motor that this panel started. From any thread."""
        self._stops += 1
        # Looked at once: the cursor may move in the other thread.
        current = self.current
        current.motor.stop()
        stop_all(member.motor for member in self.members if member is not current)

    def end_soon(self) -> None:
        """Ends the screen, as soon as it can. From any thread."""
        self.call_later(self.exit)

    def _lose_terminal(self) -> None:
        self.terminal_lost.set()
        stop_all(member.motor for member in self.members)
        self.end_soon()

    def on_mount(self) -> None:
        """Shows the overview, or the only drive."""
        first: View = self._view(self.current)
        if len(self.members) > 1:
            first = Fleet(self.members, lambda: self.current, self.journal)
        self.push_screen(first)
        self.set_interval(_BEAT, self._beat)

    def _view(self, member: Member) -> DriveView:
        return DriveView(member, self.members, self.journal)

    def _beat(self) -> None:
        """Takes what is new, and shows it on the view that is to be seen, also behind a dialog."""
        for member in self.members:
            member.take()
        if not any(member.drive for member in self.members):
            # What nobody can be shown for, and no trying again helps against.
            refused = [member.problem for member in self.members]
            if all(isinstance(error, NotAllowed) for error in refused):
                self.error = refused[0]
                self.exit()
        for screen in reversed(self.screen_stack):
            if isinstance(screen, View):
                if screen.is_ready:
                    screen.show()
                break

    # --- what a key does ---------------------------------------------------------------------------------------

    def action_stopped(self) -> None:
        """Space: the stop is on its way since the key was read. A dialog that would start something is closed."""
        if not self._stops:  # a driver that reads keys otherwise
            self.stop_now()
        self._stops = max(self._stops - 1, 0)
        if isinstance(self.screen, (Ask, AskFor)):
            self.screen.dismiss("")
        self._beat()

    def action_stop(self) -> None:
        """Stops the drive that the keys are for, and no other."""
        self.current.motor.stop()
        self._beat()

    def action_run(self, reverse: bool) -> None:
        """Asks for a speed, asks whether the machine is clear, and starts the motor."""
        member = self.current
        drive = member.drive
        if drive is None:
            self._unknown(member)
            return
        motor, way = member.motor, "in reverse" if reverse else "forward"

        def ask(hz: float) -> None:
            what = f"run {way} to {hz:g} Hz"
            self._if_it_obeys(
                member, drive, lambda: self._ask(member, what, lambda since: motor.run(drive, hz, reverse, since))
            )

        self._ask_number(member, f"run {way}, to how many Hz?", "Hz", self._setpoint(member), ask)

    def action_jog(self, reverse: bool) -> None:
        """Asks for how long, asks whether the machine is clear, and jogs the motor."""
        member = self.current
        drive = member.drive
        if drive is None:
            self._unknown(member)
            return
        motor, way = member.motor, "in reverse" if reverse else "forward"

        def ask(seconds: float) -> None:
            what = f"jog {way} for {seconds:g} s"
            self._if_it_obeys(
                member, drive, lambda: self._ask(member, what, lambda since: motor.jog(drive, seconds, reverse, since))
            )

        question = f"jog {way} at the drive's jog frequency, for how many seconds?"
        self._ask_number(member, question, "seconds", "1", ask, _LONGEST_JOG)

    def action_setpoint(self) -> None:
        """Asks for a setpoint, asks whether the machine is clear, and gives it."""
        member = self.current
        drive = member.drive
        if drive is None:
            self._unknown(member)
            return

        def ask(hz: float) -> None:
            what = f"change the setpoint to {hz:g} Hz"

            def give() -> None:
                drive.setpoint = hz

            self._if_it_obeys(
                member, drive, lambda: self._ask(member, what, lambda since: member.motor.later(what, give, since))
            )

        self._ask_number(member, "change the setpoint, to how many Hz?", "Hz", self._setpoint(member), ask)

    def action_reset(self) -> None:
        """Asks, and resets a fault."""
        member = self.current
        drive = member.drive
        if drive is None:
            self._unknown(member)
            return
        what = "reset the fault"
        more = "A drive that is still told to run may start."
        self._ask(member, what, lambda since: member.motor.later(what, drive.reset_fault, since), more)

    def action_prepare(self) -> None:
        """Looks whether the drive obeys the bus, and offers to set it so."""
        member = self.current
        if member.drive is None:
            self._unknown(member)
            return
        self._if_it_obeys(
            member,
            member.drive,
            lambda: self.journal.say(f"{member.called}: it obeys the bus; there is nothing to write"),
            only_sure=False,
        )

    def action_parameters(self) -> None:
        """Shows the parameters of the drive that the keys are for."""
        if self.current.drive is None:
            self._unknown(self.current)
        elif not isinstance(self.screen, Parameters):
            self.push_screen(Parameters(self.current, self.current.drive, self.journal))

    def action_leave_view(self) -> None:
        """Goes back to where one came from."""
        if len(self.screen_stack) > 2:
            self.pop_screen()

    def action_next(self, by: int) -> None:
        """Goes to the next drive."""
        if len(self.members) > 1 and isinstance(self.screen, DriveView):
            at = (self.members.index(self.screen.member) + by) % len(self.members)
            self.current = self.members[at]
            self.screen.turn_to(self.current)

    def on_overview_moved(self, event: Overview.Moved) -> None:
        """The keys are for another drive."""
        self.current = event.member
        self._beat()

    def on_overview_chosen(self, event: Overview.Chosen) -> None:
        """Looks at one drive, or asks whether it is of the one family that it may be of."""
        self.current = member = event.member
        family = member.likely
        if not family:
            self.push_screen(self._view(member))
            return
        text = (
            f"{member.called} does not say what it is, and answers like a {family}. Registers and commands differ "
            f"between families. Use it as a {family}?"
        )

        def go_on(key: str | None) -> None:
            if key == "y":
                member.take_as(family)
            self.push_screen(self._view(member))

        self.push_screen(Ask(text, {"y": f"yes, it is a {family}"}), go_on)

    def action_messages(self) -> None:
        """Shows all messages."""
        self.push_screen(Show(journal_text(self.journal)))

    def action_help(self) -> None:
        """Shows the help."""
        self.push_screen(Show(help_text()))

    def action_leave(self) -> None:
        """Ends the panel, which stops what it started."""
        stop_all(member.motor for member in self.members)
        self.exit()

    def action_stays(self) -> None:
        """Ctrl-Z: a panel that is held would not stop what it started."""
        self.journal.say("Ctrl-Z holds nothing here: a panel that is held stops no motor", "yellow")

    def action_quit_asking(self) -> None:
        """Ends the panel; asks first where that stops a motor."""
        started = [member for member in self.members if member.motor.started]
        # One that stands is stopped as well when the panel ends; that needs no question.
        turning = [member.called for member in started if not render.rests(member)]
        if turning:
            question = Ask(f"Stop {' and '.join(turning)}, and quit?", {"y": "stop and quit"})
            self.push_screen(question, lambda key: self.action_leave() if key else None)
        else:
            self.action_leave()

    # --- what is asked -----------------------------------------------------------------------------------------

    def _if_it_obeys(self, member: Member, drive: Drive, then: Callable[[], None], only_sure: bool = True) -> None:
        """Looks whether the drive obeys the bus, and does *then* if it does. If not, offers to set it so.

        Behind a preparation on the way to something (*only_sure*), *then* follows, which asks by itself.
        """
        since = member.motor.stops

        def look() -> None:
            try:
                items = lacking(member, drive, only_sure)
                text = question(member, drive, items) if len(items) else ""
            except DrivebusError as error:
                self.journal.fail(f"{member.called}: look whether it obeys the bus", error)
                return
            self.call_later(go_on, text)

        def go_on(text: str) -> None:
            # What somebody does meanwhile is the answer.
            if member.motor.stops != since or isinstance(self.screen, ModalScreen):
                self.journal.say(f"{member.called}: nothing was sent: another key was pressed meanwhile", "yellow")
            elif text:
                self.push_screen(Ask(text, {"y": "yes, prepare it"}), lambda key: prepare() if key == "y" else None)
            else:
                then()

        def prepare() -> None:
            def order() -> None:
                drive.prepare_control()
                if only_sure:
                    self.call_later(go_on, "")

            member.motor.later("prepare: it obeys the bus now", order, since)

        threading.Thread(target=look, name=f"panel {member.called}", daemon=True).start()

    def _ask(self, member: Member, what: str, do: Callable[[int], None], more: str = "") -> None:
        """Says which motor will do *what*, and does it only on yes. A stop meanwhile takes the yes back."""
        since = member.motor.stops
        now = f"It turns now: {render.doing(member).plain}. " if render.turns(member) else ""
        text = f"{member.what}: {what}. {more + ' ' if more else ''}{now}{_CLEAR}"
        self.push_screen(Ask(text, {"y": "yes, go ahead"}), lambda key: do(since) if key == "y" else None)

    def _ask_number(
        self, member: Member, text: str, what: str, value: str, ask: Callable[[float], None], most: float | None = None
    ) -> None:
        """Asks for a number of *what*, and goes on to *ask*."""

        def answered(typed: str | None) -> None:
            if not typed:
                return
            try:
                given = number(typed, what, most)
            except NotAllowed as error:
                self.journal.fail(member.called, error)
                return
            ask(given)

        self.push_screen(AskFor(f"{member.what}: {text}", value), answered)

    def _setpoint(self, member: Member) -> str:
        name = member.role("setpoint")
        return "" if name is None else render.plain_value(member, name)

    def _unknown(self, member: Member) -> None:
        why = f": {member.why}" if member.why else " yet"
        self.journal.say(f"{member.called}: what drive it is, is not known{why}. Space stops it anyway", "yellow")

    # --- what ends it ------------------------------------------------------------------------------------------

    def _handle_exception(self, error: Exception) -> None:
        """A mistake of ours ends the panel."""
        self.fail(error)
        self.exit()

    def fail(self, error: Exception) -> None:
        """Stops what was started, and keeps *error*, which is told when the screen is given back. From any thread."""
        stop_all(member.motor for member in self.members)
        self.journal.trace(error)
        self.error = self.error or error
