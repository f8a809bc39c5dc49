"""The command line as a whole: options before the command, the commands, errors as one line and an exit code."""

from __future__ import annotations

import errno
import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import click

import drivebus
from drivebus.advice import Text
from drivebus.cli.drive_selection import chosen, complete_drive, complete_port
from drivebus.cli.names import complete_profile, complete_variant, parse_variants
from drivebus.cli.option_order import in_front
from drivebus.cli.option_types import Place, Whole
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.errors import exit_code, tell
from drivebus.cli.present.help_format import first_sentence
from drivebus.cli.present.output import Output, laid_out, printable, remark
from drivebus.cli.registry import GROUPS, Commands
from drivebus.cli.session import DEFAULT_BAUD, DEFAULT_FORMAT, Session, parse_format
from drivebus.cli.wrong_use import WrongUse

__all__ = ["cli", "main"]


# Each variable is named by hand: with click's own prefix, DRIVEBUS_RUN_YES would answer the question before a motor
# starts, and DRIVEBUS_WRITE_STORE would wear EEPROM, without a word on the command line. --trust-profile has none: set
# for one drive, it would be believed of the next. Nor has --reserved: what it lets be written may reach all behind a
# gateway.


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    """A warning is one line as well: where in this program it came from helps nobody."""
    # Whoever has gone and reads it no more must not keep a stop from being sent.
    with suppress(OSError):
        remark(in_commands(Text("Warning: ", *(message.args[:1] if isinstance(message, Warning) else [message]))))


def _forget_what_is_not_shown() -> None:
    """Or the interpreter would try once more to write it when it ends, and say so in its own words."""
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


@contextmanager
def _quoted_as_letters() -> Iterator[None]:
    """What click quotes of words that are wrong, it shows as it was typed."""
    try:
        yield
    except click.ClickException as error:
        # It is shown later, by click itself, behind this word.
        label = "Error: "
        error.message = laid_out(label + printable(error.message)).removeprefix(label)  # type: ignore[misc]
        raise


class _Program(click.Group):
    """Turns this package's errors into one message on standard error and the exit code of their kind."""

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        """Takes the words before the command."""
        with _quoted_as_letters():
            return super().make_context(*args, **extra)

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Takes the options of the whole program behind the command, too."""
        return super().parse_args(context, in_front(self, context, args))

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Shows the commands in groups, each with its first sentence."""
        for title, files in GROUPS.items():
            commands = [self.commands[name] for names in files.values() for name in names]
            with formatter.section(title):
                formatter.write_dl([(str(each.name), first_sentence(each)) for each in commands])

    def invoke(self, context: click.Context) -> Any:
        """Runs the command."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("always", drivebus.DrivebusWarning)
                warnings.showwarning = _warn
                with _quoted_as_letters():
                    return super().invoke(context)
        except drivebus.DrivebusError as error:
            tell(error)
            if isinstance(context.obj, Session):
                context.obj.advise(error)
            context.exit(exit_code(error))
        except KeyboardInterrupt as error:
            # What click makes of it, 1, would read as a difference.
            for line in ("Interrupted.", *getattr(error, "__notes__", ())):
                remark(line)
            context.exit(130)
        except OSError as error:
            # A reader that has gone ends the command in silence: click sees to that.
            if error.errno == errno.EPIPE:
                raise
            remark(f"Error: what was done cannot be shown: {error.strerror or error}")
            _forget_what_is_not_shown()
            context.exit(1)


@click.group(
    cls=_Program,
    commands=Commands(),
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 100,
    },
    epilog="Exit codes: 0 done, 1 differs or not all of it, 2 usage or not allowed, 3 no answer, 4 refused, 5 port, "
    "6 bad answer, 7 unconfirmed, 130 interrupted. "
    "These options can stand before the command or behind it, or in the environment: DRIVEBUS_PORT, DRIVEBUS_BAUD, "
    "DRIVEBUS_FORMAT, DRIVEBUS_RS485, DRIVEBUS_UNIT, DRIVEBUS_CONFIG, DRIVEBUS_PROFILE, DRIVEBUS_UNVERIFIED, "
    "DRIVEBUS_READ_ONLY, DRIVEBUS_VARIANT, DRIVEBUS_TRACE, DRIVEBUS_JSON. "
    "drivebus is not a safety function: an emergency stop is a wire.",
)
@click.option(
    "--port",
    "-p",
    metavar="PORT",
    envvar="DRIVEBUS_PORT",
    shell_complete=complete_port,
    help="/dev/ttyUSB0, COM3, socket://host:port, tcp://host:502, a line of drivebus.toml, or a simulated drive: "
    "sim://gd350.",
)
@click.option(
    "--baud",
    "-b",
    type=Whole(1),
    default=DEFAULT_BAUD,
    show_default=True,
    envvar="DRIVEBUS_BAUD",
    help="Bits per second.",
)
@click.option(
    "--format",
    "line_format",
    "-f",
    default="".join(DEFAULT_FORMAT),
    show_default=True,
    metavar="8E1",
    envvar="DRIVEBUS_FORMAT",
    callback=parse_format,
    help="Data bits, parity, stop bits.",
)
@click.option(
    "--rs485",
    type=click.Choice(["kernel", "rts", "auto"]),
    envvar="DRIVEBUS_RS485",
    help="Who switches the direction of a bare transceiver: the driver, this program, or whichever of them can.",
)
@click.option(
    "--unit",
    "-u",
    "units",
    metavar="LIST",
    default="1",
    show_default=True,
    envvar="DRIVEBUS_UNIT",
    help="Unit address, or several: 1-4,7.",
)
@click.option(
    "--reserved",
    is_flag=True,
    help="The line has units that the specification reserves: 248 to 254, and over tcp:// a device at 0 to write to.",
)
@click.option(
    "--drive",
    "-d",
    "drives",
    multiple=True,
    metavar="NAME",
    shell_complete=complete_drive,
    help="A drive or a group of drivebus.toml, instead of --port and --unit. May be repeated.",
)
@click.option(
    "--config",
    metavar="FILE",
    envvar="DRIVEBUS_CONFIG",
    help="Read this file instead of the drivebus.toml in this folder or in your settings.",
)
@click.option(
    "--profile",
    metavar="NAME",
    envvar="DRIVEBUS_PROFILE",
    shell_complete=complete_profile,
    help=f"Family of the drive ({', '.join(drivebus.profiles())}), or a folder with a profile. Default: ask the drive.",
)
@click.option(
    "--trust-profile",
    is_flag=True,
    help="Trust --profile even if the drive identifies as another family.",
)
@click.option(
    "--unverified",
    is_flag=True,
    envvar="DRIVEBUS_UNVERIFIED",
    help="Also use registers and commands that this family's manuals do not confirm.",
)
@click.option(
    "--read-only",
    is_flag=True,
    envvar="DRIVEBUS_READ_ONLY",
    help="Only read: refuse whatever would write to a drive, even a stop. "
    "A drive whose program was killed is stopped anyway.",
)
@click.option(
    "--variant",
    "variants",
    multiple=True,
    metavar="NAME=CHOICE",
    envvar="DRIVEBUS_VARIANT",
    callback=parse_variants,
    shell_complete=complete_variant,
    help="How the drive is configured, where that changes the meaning of registers: speed_unit=Hz.",
)
@click.option(
    "--trace",
    "-v",
    is_flag=True,
    envvar="DRIVEBUS_TRACE",
    help="Show each frame on the line, with its meaning, on standard error.",
)
@click.option(
    "--capture",
    type=Place(),
    metavar="FILE",
    help="Keep each frame on the line in a new file, which Wireshark opens.",
)
@click.option("--json", "as_json", is_flag=True, envvar="DRIVEBUS_JSON", help="Print one JSON object a line.")
@click.version_option(drivebus.__version__, prog_name="drivebus")
@click.pass_context
def cli(
    context: click.Context,
    port: str | None,
    baud: int,
    line_format: tuple[str, str, str],
    rs485: str | None,
    units: str,
    reserved: bool,
    drives: tuple[str, ...],
    config: str | None,
    profile: str | None,
    trust_profile: bool,
    unverified: bool,
    read_only: bool,
    variants: dict[str, str],
    trace: bool,
    capture: str | None,
    as_json: bool,
) -> None:
    """Control and watch variable-frequency drives over RS-485.

    Start with `drivebus demo` (no hardware), then `drivebus ports` and `drivebus --port … scan`.
    """
    if trust_profile and profile is None:
        raise WrongUse("--trust-profile is for a profile that is named: give --profile too")
    if trace:
        from drivebus.cli.present.frames import show_frames

        show_frames(context)
    if capture is not None and os.path.exists(capture):  # noqa: PTH110 - pathlib would be loaded for a stop
        raise WrongUse(f"{capture} is there already; give --capture another name")
    out = Output(as_json)
    base = Session(
        port,
        baud,
        line_format,
        1,
        profile,
        out,
        rs485,
        unverified,
        variants,
        trust_profile,
        read_only,
        reserved=reserved,
        capture=capture,
    )
    context.obj = chosen(context, base, drives, units, config)
    ports = sorted({str(each.port) for each in context.obj.several})
    if capture is not None and len(ports) > 1:
        raise WrongUse(f"--capture keeps one line, and these drives are on several: {', '.join(ports)}")


def main() -> None:
    """The entry point of the command."""
    # What a terminal, or a file on Windows, has no letter for is shown by its number: nobody is to miss the rest.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    cli(prog_name="drivebus")
