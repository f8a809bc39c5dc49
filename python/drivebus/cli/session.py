"""What every command shares: the options before it, the bus they open, errors as exit codes, and asking first."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import IO, Any

import click

import drivebus
from drivebus.cli.advice import in_commands
from drivebus.cli.output import Output, remark

__all__ = [
    "DEFAULT_BAUD",
    "DEFAULT_FORMAT",
    "EXIT_CODES",
    "Session",
    "exit_code",
    "force_option",
    "parse_format",
    "pass_session",
    "tell",
    "yes_option",
]

EXIT_CODES: list[tuple[type[drivebus.DrivebusError], int]] = [
    (drivebus.NotAllowed, 2),
    (drivebus.NoAnswer, 3),
    (drivebus.Refused, 4),
    (drivebus.PortError, 5),
    (drivebus.BadAnswer, 6),
    (drivebus.Unconfirmed, 7),
]
"""What the process ends with, by whose fault it is; 0 is done, 1 anything else, such as differences found."""


DEFAULT_BAUD = 19_200
DEFAULT_FORMAT = ("8", "E", "1")
"""As the factory sets a Goodrive."""


class _Declined(click.ClickException):
    """What moves a motor was not wanted."""

    exit_code = 2

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - it goes to standard error in any case
        """Says so: it is not an error."""
        remark(self.message)


@dataclass
class Session:
    """The options before the command.

    Attributes:
        port: What to open, or None if it was not given.
        baud: Bits per second.
        line_format: Data bits, parity and stop bits, such as `("8", "E", "1")`.
        unit: Unit address.
        profile: Name or folder of a profile; None asks the drive.
        out: Where results go.
        rs485: Who switches the direction, as `drivebus.Bus` has it: `"kernel"`, `"rts"`, `"auto"`; None: the adapter.
        unverified: Whether what no document of the very family proves may be used.
        variants: What parameters of the drive make of its registers, by name.
        trust_profile: Whether the profile is meant, whatever the drive says of itself.
        read_only: Whether nothing may be written to a drive.
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

    @property
    def direction(self) -> dict[str, object] | None:
        """What `drivebus.Bus` is given for that."""
        return None if self.rs485 is None else {"mode": self.rs485}

    @contextmanager
    def bus(self, **options: Any) -> Iterator[drivebus.Bus]:
        """The bus that the options name, opened."""
        if self.port is None:
            raise click.UsageError("no port: give --port or set DRIVEBUS_PORT; `drivebus ports` lists what is there")
        bits, parity, stop = self.line_format
        settings: dict[str, Any] = {
            "baudrate": self.baud,
            "bytesize": int(bits),
            "parity": parity,
            "stopbits": int(stop),
            "rs485": self.direction,
            "read_only": self.read_only,
            **options,
        }
        with drivebus.Bus(self.port, **settings) as bus:
            yield bus

    @contextmanager
    def drive(self) -> Iterator[drivebus.Drive]:
        """The drive that the options name."""
        with self.bus() as bus:
            yield self.drive_on(bus)

    @contextmanager
    def drive_to_halt(self, command: str) -> Iterator[drivebus.Drive]:
        """As `drive`, but an error before *command* can be sent says so."""
        with self.bus() as bus:
            try:
                drive = self.drive_on(bus)
            except drivebus.DrivebusError:
                remark(
                    f"Unit {self.unit} was not told to {command}: the code for that depends on the family, and it did "
                    f"not say which it is. If you know: drivebus --profile FAMILY … {command}, which asks it nothing "
                    f"first (or set DRIVEBUS_PROFILE); families: {', '.join(drivebus.profiles())}. "
                    "If it has to stand now, use the emergency stop."
                )
                raise
            yield drive

    def drive_on(self, bus: drivebus.Bus) -> drivebus.Drive:
        """The drive that the options name, on a bus that is open."""
        return bus.drive(
            self.unit,
            self.profile,
            unverified=self.unverified,
            variants=self.variants or None,
            trust_profile=self.trust_profile,
        )

    def will_write(self) -> None:
        """Refuses a command that writes where only looking was asked for, before anything is opened."""
        if not self.read_only:
            return
        name = click.get_current_context().info_name
        halt = " If it has to stand now, use the emergency stop." if name in ("stop", "coast") else ""
        raise drivebus.NotAllowed(
            f"`{name}` writes to the drive, and --read-only says that nothing may; nothing was sent. Say it without "
            f"that switch; where the environment has it, with DRIVEBUS_READ_ONLY=0.{halt}"
        )

    def known_profile(self) -> drivebus.Profile:
        """The profile that the options name, from the drive itself only if it has to be asked."""
        if self.profile is not None:
            profile = drivebus.Profile.find(self.profile)
            return profile.with_variants(self.variants) if self.variants else profile
        if self.port is None:
            raise click.UsageError("no drive to ask what it is: give --profile NAME (`drivebus profiles`), or --port")
        with self.drive() as drive:
            return drive.profile

    def advise(self, *errors: drivebus.DrivebusError) -> None:
        """Names who finds out what else is wrong after *errors*: with a line that answers badly, with a profile."""
        silent = next((each for each in errors if isinstance(each, (drivebus.NoAnswer, drivebus.BadAnswer))), None)
        # A frame that is only taken apart came from nobody.
        if silent is not None and silent.unit and self.port is not None:
            remark(f"What may be wrong: `{self.doctor(silent.unit)}`")

        if self.profile and os.path.isdir(self.profile):  # noqa: PTH112 - Path raises where a name is too long
            problems = len(drivebus.Profile.check(self.profile))
            if problems > 1:
                remark(f"All {problems}: `drivebus profiles check {shlex.quote(self.profile)}`")

    def command(self, name: str) -> str:
        """The command *name* for the same drive, as it can be typed."""
        words = ["drivebus", "--port", shlex.quote(str(self.port))]
        if self.baud != DEFAULT_BAUD:
            words.append(f"--baud {self.baud}")
        if self.line_format != DEFAULT_FORMAT:
            words.append(f"--format {''.join(self.line_format)}")
        if self.unit != 1:
            words.append(f"--unit {self.unit}")
        if self.profile is not None:
            words.append(f"--profile {shlex.quote(self.profile)}")
        return " ".join([*words, name])

    def doctor(self, unit: int | None = None) -> str:
        """The command that looks at the same line, and at *unit*."""
        words = ["drivebus", "doctor", shlex.quote(str(self.port))]
        if unit is not None:
            words.append(f"--unit {unit}")
        if self.baud != DEFAULT_BAUD:
            words.append(f"--baud {self.baud}")
        if self.line_format != DEFAULT_FORMAT:
            words.append(f"--format {''.join(self.line_format)}")
        return " ".join(words)

    def ask_if_running(self, drive: drivebus.Drive, what: str, yes: bool) -> None:
        """As `ask`, but only where the motor turns, or may: what stands still is not moved by *what*."""
        try:
            state = drive.state()
        except drivebus.NotAllowed:
            self.ask(f"Whether the motor turns is not known; {what}", yes)
            return
        if not state.at_rest:
            self.ask(f"The motor turns; {what}", yes)

    def ask(self, what: str, yes: bool, unit: int | None = None) -> None:
        """Says that *what* moves the motor of *unit* (None: the one of the options), and goes on only if wanted."""
        remark(f"{what} (unit {unit or self.unit} on {self.port}).")
        if yes:
            return
        # Who closed standard input has none at all.
        if sys.stdin is None or not sys.stdin.isatty():
            raise click.UsageError("without a terminal this needs --yes; nothing was written")
        try:
            wanted = click.confirm("Is the machine clear? Go ahead?", err=True)
        except click.Abort:
            remark()
            wanted = False
        if not wanted:
            raise _Declined("Cancelled. Nothing was written.")


pass_session = click.make_pass_decorator(Session)


def yes_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option that answers the question before it is asked."""
    return click.option("--yes", "-y", is_flag=True, help="Do not ask first.")(command)


def force_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option that starts a motor over a line that may not carry its stop."""
    text = "Start although the link is bad; a stop may not get through."
    return click.option("--force", is_flag=True, help=text)(command)


def parse_format(context: click.Context, parameter: click.Parameter, value: str) -> tuple[str, str, str]:
    """Data bits, parity and stop bits of a text such as `8E1`."""
    match = re.fullmatch(r"([78])([NEO])([12])", value.strip().upper())
    if match is None:
        raise click.BadParameter(
            f"{value!r} is no character format; give data bits (7, 8), parity (N, E, O) and stop bits (1, 2): 8E1, 8N1",
            context,
            parameter,
        )
    return match[1], match[2], match[3]


def exit_code(error: drivebus.DrivebusError) -> int:
    """What the process ends with after *error*."""
    return next((code for kind, code in EXIT_CODES if isinstance(error, kind)), 1)


def tell(error: drivebus.DrivebusError, about: str = "") -> None:
    """Says *error* on standard error; *about* is what it is the error of, where it was one of several."""
    # Notes say what was done before; Python 3.10 has none.
    for line in (f"Error: {about + ': ' if about else ''}{error}", *getattr(error, "__notes__", ())):
        remark(in_commands(line))
