"""The command that makes a drive the spindle of LinuxCNC: a component of its HAL."""

from __future__ import annotations

import math
from contextlib import ExitStack

import click

from drivebus.cli.option_types import Place, Rpm, Seconds, Share
from drivebus.cli.present.output import remark
from drivebus.cli.session import Session, pass_session
from drivebus.hal import Alive, HalGone, Loop, Pins, Scale, Spindle, SpindleMotor, component, module

__all__ = ["COMMANDS"]

_RETRIES = 1
"""Who is asked again in the next cycle anyway must not keep a stop waiting."""

_LOST = 1.0
"""Seconds without an answer after which the link counts as lost, or the watchdog's time where that is longer."""


@click.command()
@click.option("--name", default="drivebus", show_default=True, help="What the component is called, and its pins.")
@click.option(
    "--rpm-per-hz",
    type=Rpm(0.001),
    required=True,
    metavar="RPM",
    help="Turns of the spindle per minute for each hertz: 60 for a motor with 2 poles, 30 for one with 4.",
)
@click.option("--max-rpm", type=Rpm(0.001), metavar="RPM", help="The highest speed given.")
@click.option(
    "--at-speed",
    type=Share(0, 1),
    default=0.02,
    show_default=True,
    metavar="SHARE",
    help="How far off the speed may be at which `at-speed` is true, as a share of it.",
)
@click.option(
    "--watchdog",
    type=Seconds(0.1, 60),
    default=2.0,
    show_default=True,
    metavar="SECONDS",
    help="After how long a silence the drive is to stop by itself, where its family can.",
)
@click.option("--no-watchdog", is_flag=True, help="Leave the drive's own time-out as it is.")
@click.option(
    "--hal-path",
    type=Place(exists=True, file_okay=False),
    metavar="FOLDER",
    help="Where LinuxCNC's hal.py is, if not where Debian has it.",
)
@pass_session
def hal(
    session: Session,
    name: str,
    rpm_per_hz: float,
    max_rpm: float | None,
    at_speed: float,
    watchdog: float,
    no_watchdog: bool,
    hal_path: str | None,
) -> None:
    """Run as a LinuxCNC HAL component, with the drive as a spindle. For `loadusr -W drivebus hal …`.

    Runs until HAL unloads it. The pins move the motor, and the end of the component stops it. docs/linuxcnc.md lists
    the pins. Not a safety function: an emergency stop is a wire.
    """
    session.will_write()
    linuxcnc = module(hal_path)
    seconds = None if no_watchdog else watchdog
    scale = Scale(rpm_per_hz, math.inf if max_rpm is None else max_rpm, at_speed)

    def say(text: str) -> None:
        remark(f"drivebus hal {name}: {text}")

    with session.bus(retries=_RETRIES) as bus:
        drive = session.drive_on(bus)
        motor = SpindleMotor(drive, seconds, say)
        known = component(linuxcnc, name)
        gone = False
        try:
            with ExitStack() as ends:
                # The last goes first: the stop, then HAL, then what waits until the motor stands.
                ends.callback(motor.give_back)
                ends.callback(known.exit)
                ends.enter_context(motor)
                spindle = Spindle(scale, max(_LOST, seconds or 0.0))
                loop = Loop(Pins(known), spindle, motor, drive, say, Alive())
                loop.cycle()
                known.ready()
                loop.forever()
        except HalGone as error:
            gone = True
            say(f"{error}: no pin changes any more, and this program has ended")
        except KeyboardInterrupt:
            pass  # HAL's `unload`, and Ctrl-C: how it is meant to end
        if motor.unstopped:
            say(f"at the end: {motor.unstopped}")
        if gone or motor.unstopped:
            raise click.exceptions.Exit(7 if motor.unstopped else 1)


COMMANDS = [hal]
