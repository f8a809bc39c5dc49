"""What every command shares: the options before it, the bus they open, and asking first."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import IO, TYPE_CHECKING, Any

import click

import drivebus
from drivebus.cli.option_types import Seconds
from drivebus.cli.present.errors import tell_wills
from drivebus.cli.present.output import Output, remark
from drivebus.cli.suspension import gives_way_when_held
from drivebus.cli.wrong_use import WrongUse
from drivebus.line.addresses import Addresses
from drivebus.site import forget, known_family, remember

if TYPE_CHECKING:
    from drivebus.cli.parallel import Crew

__all__ = [
    "DEFAULT_BAUD",
    "DEFAULT_FORMAT",
    "Declined",
    "Session",
    "ask_once",
    "force_option",
    "is_another",
    "may_turn",
    "parse_format",
    "pass_session",
    "within_option",
    "yes_option",
]

DEFAULT_BAUD = 19_200
DEFAULT_FORMAT = ("8", "E", "1")
"""As the factory sets a Goodrive."""
EXAMPLE_PORT = "COM3" if sys.platform == "win32" else "/dev/ttyUSB0"
"""What an adapter may be called on this system."""


class Declined(click.ClickException):
    """What moves a motor was not wanted."""

    exit_code = 2

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - it goes to standard error in any case
        """Says so: it is not an error."""
        remark(self.message)


@dataclass(eq=False, repr=False)
class Session:
    """The options before the command, for one drive.

    Attributes:
        port: What to open, or None if it was not given.
        baud: Bits per second.
        line_format: Data bits, parity and stop bits, such as `("8", "E", "1")`.
        unit: DriveView address.
        profile: Name or folder of a profile; None asks the drive.
        out: Where results go.
        rs485: Who switches the direction, as `drivebus.Bus` has it: `"kernel"`, `"rts"`, `"auto"`; None: the adapter.
        unverified: Whether what no document of the very family proves may be used.
        variants: What parameters of the drive make of its registers, by name.
        trust_profile: Whether the profile is meant, whatever the drive says of itself.
        read_only: Whether nothing may be written to a drive.
        reserved: Whether the line has units that the specification reserves, as `drivebus.Bus` takes it.
        capture: The file that gets each frame on the line; None: no file.
        name: What the drive is called in `drivebus.toml`; empty where it was not chosen by name.
        beside_unit_0: Whether one of those on the same line, chosen as well, is a unit 0 that may only be looked at.
        several: One session for each drive, where several were chosen.
        crew: The others that work beside this one, where several drives were chosen.
    """

    port: str | None
    baud: int
    line_format: tuple[str, str, str]
    unit: int
    profile: str | None
    out: Output
    rs485: str | None = None
    unverified: bool = False
    variants: Mapping[str, str] = field(default_factory=dict)
    trust_profile: bool = False
    read_only: bool = False
    reserved: bool = False
    capture: str | None = None
    name: str = ""
    beside_unit_0: bool = False
    several: tuple[Session, ...] = ()
    crew: Crew | None = None
    _writes: bool = field(default=False, init=False)

    @property
    def called(self) -> str:
        """The drive as people know it: its name, or its address."""
        return self.name or f"unit {self.unit}"

    @property
    def direction(self) -> dict[str, object] | None:
        """What `drivebus.Bus` is given for that."""
        return None if self.rs485 is None else {"mode": self.rs485}

    def one_port(self) -> str:
        """The port that the options name, for a command that takes one drive at a time."""
        if self.several:
            named = ", ".join(each.called for each in self.several)
            command = click.get_current_context().info_name
            raise WrongUse(f"`{command}` takes one drive at a time, and these are named: {named}")
        if self.port is None:
            raise WrongUse(
                "no port: give --port or set DRIVEBUS_PORT, or name a drive of drivebus.toml with --drive; "
                "`drivebus ports` lists what is there"
            )
        return self.port

    @property
    def addresses(self) -> Addresses:
        """Which units the line may have."""
        return Addresses.of(self.port, reserved=self.reserved)

    @property
    def may_only_look(self) -> bool:
        """Whether nothing may be written to the unit: it was said so, or what is written to it may be for others."""
        try:
            self.addresses.unit(self.unit, changes=True)
        except drivebus.NotAllowed:
            return True
        return self.read_only

    @property
    def opens_read_only(self) -> bool:
        """Whether its bus is for reading only.

        Who has not said that it writes shares the bus of one that may not: many a gateway has one connection.
        """
        return self.may_only_look or (self.beside_unit_0 and not self._writes)

    @property
    def line_key(self) -> str:
        """What is the same for all drives that can be asked over one bus."""
        return repr((self.port, self.baud, self.line_format, self.rs485, self.reserved, self.opens_read_only))

    @property
    def serial_format(self) -> drivebus.SerialFormat:
        """How characters look on the line that the options name."""
        bits, parity, stop = self.line_format
        return drivebus.SerialFormat(self.baud, parity, int(stop), int(bits))

    @contextmanager
    def bus(self, **options: Any) -> Iterator[drivebus.Bus]:
        """The bus that the options name, opened."""
        port = self.one_port()
        bits, parity, stop = self.line_format
        if bits != "8":
            raise WrongUse(
                f"Modbus RTU has 8 data bits, and --format has {bits}: `{self.doctor()}` finds the right one"
            )
        settings: dict[str, Any] = {
            "baudrate": self.baud,
            "bytesize": int(bits),
            "parity": parity,
            "stopbits": int(stop),
            "rs485": self.direction,
            "trace": self.capture,
            "read_only": self.opens_read_only,
            "reserved": self.reserved,
            **options,
        }
        if self.crew is not None:
            yield self.crew.bus(port, settings)
            return
        with drivebus.Bus(port, **settings) as bus, gives_way_when_held(lambda: [bus]):
            try:
                yield bus
            finally:
                tell_wills(bus)

    @contextmanager
    def drive(self) -> Iterator[drivebus.Drive]:
        """The drive that the options name."""
        with self.bus() as bus:
            yield self.drive_on(bus)

    def halt(self, bus: drivebus.Bus, command: str, do: Callable[[drivebus.Drive], None]) -> drivebus.Drive:
        """Halts the drive by *do*, which is *command*, as the family that was named, was known last, or shows itself.

        What was known last is a hint where to look first: a drive of another family is halted as what it shows. An
        error before anything can be sent says so.
        """
        port = str(self.port)
        family = None if self.profile is not None else known_family(port, self.unit)
        if family in drivebus.profiles():
            drive = bus.drive(self.unit, family, unverified=self.unverified, variants=self.variants or None)
            failure: drivebus.DrivebusError | None = None
            try:
                do(drive)
            except drivebus.DrivebusError as error:
                failure = error
            if not is_another(drive):
                if failure is not None:
                    raise failure
                return drive
            forget(port, self.unit)
            remark(f"{self.called} was a {family} when it was asked last, and is not one now.")
            if failure is None:
                # What it shows was halted, and says what came of it.
                return self.as_it_shows(bus, drive)
            if not isinstance(failure, drivebus.NotAllowed):
                raise failure
        try:
            drive = self.drive_on(bus, urgent=True)
        except drivebus.DrivebusError:
            typed = replace(self, profile="FAMILY").command(command)
            remark(
                f"{self.called} was not told to {command}: the code depends on the family, and the unit did not say "
                f"which it is. If you know it: `{typed}`, which asks no more than it must. Families: "
                f"{', '.join(drivebus.profiles())}. If it must stop now, use the emergency stop."
            )
            raise
        do(drive)
        return drive

    def as_it_shows(self, bus: drivebus.Bus, drive: drivebus.Drive) -> drivebus.Drive:
        """The drive as the family that it shows, for what is told of it; *drive* where that is not one alone."""
        try:
            family = bus.identify(self.unit).family
        except drivebus.DrivebusError:
            return drive
        return bus.drive(self.unit, family, unverified=True) if family in drivebus.profiles() else drive

    def drive_on(self, bus: drivebus.Bus, *, urgent: bool = False) -> drivebus.Drive:
        """The drive that the options name, on a bus that is open. Where it said surely what it is, that is kept.

        Where it is asked what it is, that goes before all who wait for the line if it is *urgent*.
        """
        drive = bus.drive(
            self.unit,
            self.profile,
            unverified=self.unverified,
            variants=self.variants or None,
            trust_profile=self.trust_profile,
            urgent=urgent,
        )
        if self.profile is None and not self.unverified and _is_told_by_code(drive.profile):
            remember(str(self.port), self.unit, drive.profile.name)
        return drive

    def keep_found(self, found: drivebus.Found) -> None:
        """Keeps what a unit of this line surely is, as a scan *found* it."""
        family = found.profile if found.certainty == "certain" else None
        if family is not None and _is_told_by_code(drivebus.Profile.find(family)):
            remember(str(self.port), found.unit, family)

    def will_write(self) -> None:
        """As `check_read_only`; also where the unit is 0 over `tcp://`, and nobody said that it is a device."""
        self.check_read_only()
        self.addresses.unit(self.unit, changes=True)
        self._writes = True

    def check_read_only(self) -> None:
        """Refuses a command that writes where only looking was asked for, before anything is opened."""
        if not self.read_only:
            return
        context = click.get_current_context()
        name, group = context.info_name, context.parent
        if group is not None and group.parent is not None:
            name = f"{group.info_name} {name}"
        halt = " If it must stop now, use the emergency stop." if name in ("stop", "coast") else ""
        raise drivebus.NotReady(
            f"`{name}` writes to the drive, and --read-only says that nothing may; nothing was sent. Say it without "
            f"that switch; where the environment has it, with DRIVEBUS_READ_ONLY=0.{halt}",
            why="read_only",
        )

    def known_profile(self) -> drivebus.Profile:
        """The profile that the options name, from the drive itself only if it has to be asked."""
        if self.profile is not None:
            profile = drivebus.Profile.find(self.profile)
            return profile.with_variants(self.variants) if self.variants else profile
        if self.port is None:
            raise WrongUse(
                "the family is not known: give --profile NAME (`drivebus profiles`), or --port to ask a drive"
            )
        with self.drive() as drive:
            return drive.profile

    def advise(self, *errors: drivebus.DrivebusError) -> None:
        """Names who finds out what else is wrong after *errors*: with a line that answers badly, with a profile."""
        silent = next((each for each in errors if isinstance(each, (drivebus.NoAnswer, drivebus.BadAnswer))), None)
        # A frame that is only taken apart came from nobody.
        if silent is not None and silent.unit and self.port is not None:
            if isinstance(silent, drivebus.NoAnswer):
                self._name_factory_settings()
            remark(f"What may be wrong: `{self.doctor(silent.unit)}`")

        if self.profile and os.path.isdir(self.profile):  # noqa: PTH112 - Path raises where a name is too long
            problems = len(drivebus.Profile.check(self.profile))
            if problems > 1:
                remark(f"All {problems}: `drivebus profiles check {_quoted(self.profile)}`")

    def _name_factory_settings(self) -> None:
        """Says how the factory sets drives of the family that was named, where that is not how it was asked."""
        if self.profile is None or self.name:
            return
        with suppress(drivebus.DrivebusError):
            profile = drivebus.Profile.find(self.profile)
            factory = profile.serial()
            if factory is None:
                return
            unit = factory.unit or self.unit
            if (factory.baud_rate, factory.format, unit) != (self.baud, "".join(self.line_format), self.unit):
                settings = f"--baud {factory.baud_rate} --format {factory.format} --unit {unit}"
                remark(f"From the factory {profile.title} has other settings: `{settings}`")

    def command(self, name: str) -> str:
        """The command *name* for the same drive, as it can be typed."""
        words = ["drivebus", *(["--drive", self.name] if self.name else self._line_words())]
        if self.profile is not None:
            words.append(f"--profile {_quoted(self.profile)}")
        return " ".join([*words, name])

    def for_line(self, name: str) -> str:
        """The command *name* for the same port, whatever its settings and units, as it can be typed."""
        return f"drivebus --port {_quoted(str(self.port))} {name}"

    def setting_words(self) -> list[str]:
        """The options for speed and characters, where they are not as usual."""
        words = [] if self.baud == DEFAULT_BAUD else [f"--baud {self.baud}"]
        return words if self.line_format == DEFAULT_FORMAT else [*words, f"--format {''.join(self.line_format)}"]

    def _line_words(self) -> list[str]:
        """The options for the line and the unit, where they are not as usual."""
        words = ["--port", "…" if self.port is None else _quoted(str(self.port)), *self.setting_words()]
        if self.unit != 1:
            words.append(f"--unit {self.unit}")
        if self.reserved:
            words.append("--reserved")
        return words

    def doctor(self, unit: int | None = None) -> str:
        """The command that looks at the same line, and at *unit*."""
        words = ["drivebus", "doctor", _quoted(str(self.port))]
        if unit is not None:
            words.append(f"--unit {unit}")
        words += self.setting_words()
        if self.reserved:
            words.append("--reserved")
        return " ".join(words)

    def ask_if_running(self, drive: drivebus.Drive, what: str, yes: bool) -> None:
        """As `ask`, but only where the motor turns, or may: what stands still is not moved by *what*."""
        turning = may_turn(drive)
        if turning:
            self.ask(f"{turning}; {what}", yes)

    def ask(self, what: str, yes: bool, unit: int | None = None) -> None:
        """Says that *what* moves the motor of *unit* (None: the one of the options), and goes on only if wanted."""
        which = f"unit {unit or self.unit} on {self.port}"
        text = f"{what} ({self.name}: {which})." if self.name else f"{what} ({which})."
        if self.crew is not None:
            self.crew.ask(text, yes)
        else:
            ask_once([text], yes)


def may_turn(drive: drivebus.Drive) -> str:
    """That the motor turns, or that nobody knows whether it does; empty if it stands still. Asks the drive."""
    try:
        return "" if drive.state().at_rest else "The motor turns"
    except drivebus.NotAllowed:
        return "It is not known whether the motor turns"


def ask_once(texts: Sequence[str], yes: bool) -> None:
    """Says what *texts* say, and goes on only if that is wanted: without a question if *yes*.

    Raises:
        Declined: It is not.
    """
    for text in texts:
        remark(text)
    if yes:
        return
    # Who closed standard input has none at all.
    if sys.stdin is None or not sys.stdin.isatty():
        raise WrongUse("without a terminal this needs --yes; nothing was done")
    try:
        wanted = click.confirm("Is the machine clear? Go ahead?", err=True)
    except click.Abort:
        remark()
        wanted = False
    if not wanted:
        raise Declined("Cancelled. Nothing was written.")


def is_another(drive: drivebus.Drive) -> bool:
    """Whether *drive* says that it is of another family than it was taken for."""
    try:
        return drive.contradiction() is not None
    except drivebus.DrivebusError:
        return False


def _is_told_by_code(profile: drivebus.Profile) -> bool:
    """Whether the family has identification codes, and shares none with another."""
    own = [row for row in profile.identifications() if row.family == profile.family]
    return bool(own) and not any(row.shared for row in own)


pass_session = click.make_pass_decorator(Session)


def yes_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option that answers the question before it is asked."""
    return click.option("--yes", "-y", is_flag=True, help="Do not ask first.")(command)


def force_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option that starts a motor over a line that may not carry its stop."""
    text = "Start although the link is bad; a stop may not get through."
    return click.option("--force", is_flag=True, help=text)(command)


def within_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option that says for how long a halt is sent."""
    text = "Send it until the drive takes it, for so long at most."
    kind = Seconds(0, 3600)
    return click.option("--within", type=kind, default=10.0, show_default=True, metavar="SECONDS", help=text)(command)


def _quoted(text: str) -> str:
    """*text* as a shell takes it."""
    import shlex

    return shlex.quote(text)


def parse_format(context: click.Context, parameter: click.Parameter, value: str) -> tuple[str, str, str]:
    """Data bits, parity and stop bits of a text such as `8E1`."""
    letters = value.strip().upper()
    if len(letters) != 3 or letters[0] not in "78" or letters[1] not in "NEO" or letters[2] not in "12":
        raise click.BadParameter(
            f'"{value}" is not a character format; give data bits (7, 8), parity (N, E, O) and stop bits (1, 2), '
            "such as 8E1 or 8N1",
            context,
            parameter,
        )
    return letters[0], letters[1], letters[2]
