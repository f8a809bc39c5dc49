"""Commands that write to a drive. Those that move a motor say so first and ask."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import click

import drivebus
from drivebus import State
from drivebus.advice import Text
from drivebus.cli import names
from drivebus.cli.each_drive import each_drive
from drivebus.cli.option_types import Hertz, Seconds
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.motors import OBEYING, on_the_way
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, force_option, pass_session, within_option, yes_option
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]


_IN_RAM = "Kept in RAM until the drive is switched off; --store keeps it in EEPROM."
_IN_EEPROM = "Kept in EEPROM: the drive has it after it was switched off, too."


class _Run(click.Command):
    """Takes `-5` for a speed, which it is not allowed to be, and not for an option."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        for before, word in zip(["", *args], args, strict=False):
            if before != "--wait" and re.fullmatch(r"-\d+(\.\d*)?", word):
                raise WrongUse(
                    f"A speed cannot be {word} Hz; `drivebus run {word[1:]} --reverse` turns the other way", context
                )
        return super().parse_args(context, args)


@click.command(cls=_Run)
@click.argument("hz", type=Hertz(0), required=False)
@click.option("--reverse", is_flag=True, help="Turn the other way.")
@click.option("--wait", type=Seconds(0), metavar="SECONDS", help="Wait until the speed is reached.")
@force_option
@yes_option
@each_drive
def run(session: Session, hz: float | None, reverse: bool, wait: float | None, force: bool, yes: bool) -> None:
    """Start the motor, at HZ if given, or change its speed. It keeps running when this command has ended."""
    session.will_write()
    way = "in reverse" if reverse else "forward"
    speed = "at the setpoint it has" if hz is None else f"at {hz:g} Hz"
    with session.drive() as drive:
        told = drive.profile.role("setpoint") is not None
        if wait is not None and hz is None and not told:
            raise drivebus.BadArgument(
                f"{drive.profile.title} does not tell its setpoint, so there is no speed to wait for: give the speed, "
                f"or leave --wait out. Nothing was sent to unit {drive.unit}"
            )
        wanted = None if told else hz
        if wait is not None:
            drive.check_speed(wanted)
        session.ask(f"This starts the motor {way} {speed}", yes)
        drive.run(hz, reverse=reverse, force=force)
        if wait is not None:
            with _told_that_it_runs(session, drive):
                drive.wait_for_speed(wanted, timeout=wait)
        _done(session, drive, "run", State.REVERSE if reverse else State.FORWARD)


@click.command()
@click.option("--wait", type=Seconds(0), metavar="SECONDS", help="Wait until the motor stands still.")
@click.option("--all", "every", is_flag=True, help="Stop every drive that is known on the line, or in drivebus.toml.")
@within_option
@pass_session
@click.pass_context
def stop(context: click.Context, session: Session, wait: float | None, every: bool, within: float) -> None:
    """Stop the motor as the drive is set to stop it, usually by a ramp. Does not ask first.

    With --all, every drive that is known is told first, each by its own family's code, and then looked at. Known are
    the drives of drivebus.toml, and those on the line that once said surely what they are.
    """
    if every:
        from drivebus.cli.commands.stop_all import stop_all

        session.check_read_only()
        stop_all(context, session, within, lambda one, drive: _stopped(one, drive, wait))
    else:
        _stop_named(wait, within)


@each_drive
def _stop_named(session: Session, wait: float | None, within: float) -> None:
    """Stops the drives that the options name."""
    session.will_write()
    with _line_to_halt(session) as bus:
        _stopped(session, session.halt(bus, "stop", lambda drive: drive.stop(within=within)), wait)


@contextmanager
def _line_to_halt(session: Session) -> Iterator[drivebus.Bus]:
    """The bus, opened; where that fails, a motor may turn that nobody was told to stop."""
    is_open = False
    try:
        with session.bus() as bus:
            is_open = True
            yield bus
    except drivebus.PortError as error:
        if is_open:
            raise
        goes_on = "; nothing was sent. If the motor turns, stop it at the keypad, or switch the drive off"
        raise drivebus.PortError(Text(error.text, goes_on), errno=error.errno) from error


def _stopped(session: Session, drive: drivebus.Drive, wait: float | None) -> None:
    """Waits for standstill, if that is wanted, and says what a drive does that was told to stop."""
    if wait is not None:
        drive.wait_until_stopped(timeout=wait)
    _done(session, drive, "stop", State.STOPPED)


@click.command()
@within_option
@each_drive
def coast(session: Session, within: float) -> None:
    """Switch the output off: the motor freewheels to a stop. Does not ask first."""
    session.will_write()
    with _line_to_halt(session) as bus:
        drive = session.halt(bus, "coast", lambda drive: drive.coast(within=within))
        _done(session, drive, "coast")


@click.command()
@click.option("--seconds", type=Seconds(0, 60), default=1.0, show_default=True, help="How long.")
@click.option("--reverse", is_flag=True, help="Turn the other way.")
@force_option
@yes_option
@each_drive
def jog(session: Session, seconds: float, reverse: bool, force: bool, yes: bool) -> None:
    """Jog the motor at the drive's jog frequency. The jog ends whatever happens: Ctrl-C, a closed terminal."""
    session.will_write()
    way = "in reverse" if reverse else "forward"
    with session.drive() as drive:
        session.ask(f"This jogs the motor {way} for {seconds:g} s", yes)
        with drive.jogging(reverse=reverse, force=force):
            drive.bus.sleep(seconds)
        _done(session, drive, "jog")


@click.command()
@yes_option
@each_drive
def reset(session: Session, yes: bool) -> None:
    """Reset a fault after its cause is gone. The drive may start again if its run command is still active."""
    session.will_write()
    with session.drive() as drive:
        session.ask("This resets the fault; a drive that is still told to run may start", yes)
        drive.reset_fault()
        _done(session, drive, "reset")


@click.command()
@click.option(
    "--store", is_flag=True, help="Keep it in EEPROM: the drive still obeys the bus after it was switched off."
)
@yes_option
@each_drive
def prepare(session: Session, store: bool, yes: bool) -> None:
    """Set the drive to obey the bus, and show the settings. Writes only those that differ. Does not move the motor."""
    session.will_write()
    with session.drive() as drive:
        session.ask_if_running(drive, OBEYING, yes)
        before = drive.check_control()
        rows = [
            [item.code, item.actual, item.wanted, item.verified, item.label]
            for item in drive.prepare_control(store=store)
        ]
        if store:
            _say_kept([item.code for item in before if item.ok])
        session.out.rows(["code", "is", "needed", "verified", "label"], rows)
        if not store:
            session.out.say(_IN_RAM)


@click.command()
@click.argument(
    "assignments", metavar="NAME=VALUE...", nargs=-1, required=True, shell_complete=names.complete_assignment
)
@click.option("--store", is_flag=True, help="Keep parameters in EEPROM, which stands a limited number of writes.")
@click.option(
    "--force", is_flag=True, help="Also write to addresses that the profile does not know. Always asks first."
)
@yes_option
@each_drive
def write(session: Session, assignments: tuple[str, ...], store: bool, force: bool, yes: bool) -> None:
    """Write registers or parameters. Parameters go to RAM and are lost when the drive is switched off, unless --store.

    All values are checked before the first is sent. Command registers are refused; use `run`, `stop` and the like. If
    the motor turns, the command asks first.
    """
    # A stop, which this file has as well, waits for none of it.
    from drivebus.cli.present.drive_facts import Reading, Written

    session.will_write()
    asked = [names.parse_assignment(text) for text in assignments]
    with session.drive() as drive:
        wanted: dict[str, Any] = {}
        words: dict[int, int] = {}
        for text, value in asked:
            place = names.resolve(drive.profile, text, written=True)
            if isinstance(place, int):
                words[place] = _word(drive, place, value, force)
                continue
            known = drive.describe(place)
            if known.name in wanted:
                raise drivebus.BadArgument(f"{known.code or known.name} is given twice; nothing was sent")
            wanted[known.name] = names.without_unit(value, known.unit)
        if words:
            session.ask(f"This writes {', '.join(assignments)}, without knowing what that does", yes)
        else:
            session.ask_if_running(drive, f"this writes {', '.join(assignments)}", yes)
        parameters = [name for name in wanted if drive.describe(name).kind == "parameter"] if store else []
        before = {name: drive.read(name) for name in parameters}
        if wanted:
            drive.write(wanted, store=store)
        for place, word in words.items():
            drive.write_words(place, word, force=True)
        now = _read_back(drive, wanted)
        kept: list[str] = []
        rows: list[Reading] = []
        for name in wanted:
            known, there = drive.describe(name), now.get(name)
            text = "" if there is None else known.text(there)
            rows.append(Reading(known.code or known.name, known.unit, known.label, None, there, text))
            if name in before and before[name] == now.get(name):
                kept.append(known.code or known.name)
        rows += [
            Reading(f"{place:04X}H", "", "unknown register, not read back", None, word, str(word))
            for place, word in words.items()
        ]
        _say_kept(kept)
        session.out.render(Written(rows))
        if any(drive.describe(name).kind == "parameter" for name in wanted) and not kept:
            session.out.say(_IN_EEPROM if store else _IN_RAM)


def _read_back(drive: drivebus.Drive, written: Mapping[str, Any]) -> dict[str, Any]:
    """What is there now, of what was *written* and can be read; says so where it cannot be read any more.

    That is no error of the writing: a password locks the drive from the moment it is set, a cable may be pulled.
    """
    described = {name: drive.describe(name) for name in written}
    now = {name: value for name, value in written.items() if described[name].access == "wo"}
    missing = [name for name in written if name not in now]
    try:
        while missing:
            now[missing[0]] = drive.read(missing[0])
            del missing[0]
    except drivebus.DrivebusError as error:
        lost = ", ".join(described[name].code or name for name in missing)
        _say_lost(f"{lost}: written, but could not be read back: {in_commands(error)}")
    return now


def _word(drive: drivebus.Drive, place: int, value: float | str, force: bool) -> int:
    """The word for an address that the profile does not know, which only *force* writes."""
    if not force:
        raise drivebus.BadArgument(
            f"{drive.profile.name} knows nothing at {place:04X}H, so its range is unknown; --force writes a word there"
        )
    if not isinstance(value, int) or not 0 <= value <= 0xFFFF:
        raise drivebus.BadArgument(
            f'"{value}" is not a word from 0 to 65535, which is what an address takes; nothing was sent'
        )
    return value


def _say_kept(names: list[str]) -> None:
    """Says that *names* were not stored, because they have their values: where from, a drive does not tell."""
    if names:
        remark(
            f"{', '.join(names)}: the value was there already, so EEPROM was not written. If it came from an earlier "
            "write to RAM, it is lost with power: switch the drive off and on, then store again."
        )


def _say_lost(text: str) -> None:
    """Says that something was done, and that the drive does not tell what came of it."""
    remark(text)


@contextmanager
def _told_that_it_runs(session: Session, drive: drivebus.Drive) -> Iterator[None]:
    """Whoever ends a wait by Ctrl-C, or cannot look, is told that the motor goes on, and how to stop it."""
    try:
        yield
    except drivebus.Unconfirmed:
        raise
    except drivebus.DrivebusError as error:
        raise drivebus.Unconfirmed(
            Text(
                f"{session.called} took the start, and what it does could not be looked at: ",
                error.text,
                f". The motor may turn; `{session.command('stop')}` stops it",
            ),
            unit=drive.unit,
        ) from error
    except KeyboardInterrupt as error:
        doing = ""
        with suppress(drivebus.DrivebusError):
            status = drive.status()
            if not status.state.running:
                raise
            doing = f" ({status.state}{'' if status.frequency is None else f', {status.frequency:.2f} Hz'})"
        if hasattr(error, "add_note"):
            error.add_note(f"The motor keeps running{doing}: `{session.command('stop')}` stops it.")
        raise


def _done(session: Session, drive: drivebus.Drive, command: str, towards: State | None = None) -> None:
    """Says what the drive does now, on its way *towards* a state if it is not there yet.

    What it does not tell is no error of *command*, which was confirmed.
    """
    status: drivebus.Status | None = None
    try:
        status = drive.status()
    except drivebus.DrivebusError as error:
        whose = "" if session.crew else f"{session.called}: "
        _say_lost(f"{whose}{command} was done, but the state afterwards could not be read: {in_commands(error)}")
    told = {name: getattr(status, name, None) for name in ("state", "frequency", "setpoint", "fault")}
    session.out.record({"command": command, "unit": drive.unit, **told})
    if status is not None:
        session.out.say(f"{session.called}: {on_the_way(status, towards) or status}")


COMMANDS = [run, stop, coast, jog, reset, prepare, write]
