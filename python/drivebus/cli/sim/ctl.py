"""`drivebus sim ctl`: what another window tells a simulation that runs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

import drivebus
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import Output
from drivebus.cli.session import Session, parse_format, pass_session
from drivebus.cli.sim.control_socket import Order, ask, running
from drivebus.cli.sim.rates import rates_of
from drivebus.cli.wrong_use import WrongUse

__all__ = ["ctl"]


@click.group(cls=Listing)
@click.option("--of", "which", metavar="PORT", help="Which simulation, by its port, its link or its process number.")
@click.pass_context
def ctl(context: click.Context, which: str | None) -> None:
    """Tell a simulation that runs what to do: trip a drive, load its motor, pull the adapter.

    It is one of your own, started by `drivebus sim` in another window.
    """
    context.meta[__name__] = which


def _send(session: Session, **order: Any) -> None:
    """Gives the simulation that was meant *order*, and shows what is so now."""
    path = _meant(click.get_current_context().meta[__name__])
    try:
        now = ask(path, order)
    except OSError as error:
        why = f"the simulation does not answer ({error}); whether it obeyed is not known"
        raise drivebus.PortError(why, errno=error.errno) from error
    session.out.render(_Simulation(now))


def _meant(which: str | None) -> Path:
    """Where the simulation is met that *which* names; the only one, where it names none.

    Raises:
        click.UsageError: There is none, or it could be several.
    """
    found = running()
    if not found:
        raise WrongUse("no simulation of yours takes orders; start one in another window: `drivebus sim`")
    meant = {path: told for path, told in found.items() if which is None or _is_called(told, which)}
    ports = ", ".join(str(told.get("port")) for told in found.values())
    if not meant:
        raise WrongUse(f'no simulation is called "{which}"; there are {ports}')
    if len(meant) > 1:
        raise WrongUse(f"{len(meant)} simulations run; choose one with --of: {ports}")
    return next(iter(meant))


def _is_called(told: Order, name: str) -> bool:
    """Whether *name* is the port of a simulation, what its link leads to, or its process."""
    return name in (told.get("port"), told.get("leads_to"), str(told.get("pid")))


@dataclass(frozen=True)
class _Simulation:
    """What is so in a simulation, as it told it itself."""

    told: Order

    def records(self) -> Iterator[Order]:
        """All of it."""
        yield self.told

    def lay_out(self, out: Output) -> None:
        """The line, and the drives on it."""
        told = self.told
        faults = ", ".join(f"{kind} {rate:g}" for kind, rate in told["faults"].items())
        out.facts(
            {
                "port": told["port"] if told["plugged"] else f"{told['port']}, unplugged",
                **({"ear": told["ear"]} if told.get("ear") else {}),
                "settings": told["settings"],
                "line_faults": faults or "none",
            }
        )
        out.say("")
        columns = ["unit", "family", "state", "frequency", "load", "fault"]
        out.rows(columns, [_row(drive) for drive in told["units"]])


def _row(drive: Order) -> list[Any]:
    fault = f"{drive['fault']} {drive['fault_name']}".strip() if drive["fault"] else "none"
    return [
        drive["unit"],
        drive["family"],
        drive["state"],
        f"{drive['frequency']:.2f} Hz",
        f"{100 * drive['load']:g} %",
        fault,
    ]


@ctl.command()
@pass_session
def status(session: Session) -> None:
    """Show the line and each drive, as seen from its shaft."""
    _send(session, order="about")


@ctl.command()
@click.argument("unit", type=int)
@click.argument("fault")
@pass_session
def trip(session: Session, unit: int, fault: str) -> None:
    """Trip a drive with a fault: its number, or what the keypad shows, such as OL1."""
    _send(session, order="trip", unit=unit, fault=int(fault) if re.fullmatch(r"[0-9]{1,9}", fault) else fault)


def _share(_: click.Context, parameter: click.Parameter, value: str) -> float:
    """*value* as a share: `80%` and `0.8` are the same."""
    text = value.strip()
    number = text.removesuffix("%").strip()
    try:
        share = float(number) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise click.BadParameter(f'"{value}" is not a load; write 80% or 0.8', param=parameter) from None
    if not 0 <= share <= 4:
        hint = f"; did you mean {number}%?" if share > 4 and not text.endswith("%") else ""
        raise click.BadParameter(f'"{value}" is out of range; allowed is 0% to 400%{hint}', param=parameter)
    return share


@ctl.command()
@click.argument("unit", type=int)
@click.argument("torque", callback=_share)
@pass_session
def load(session: Session, unit: int, torque: float) -> None:
    """Load a motor: 80% or 0.8 of its rated torque, up to 400%."""
    _send(session, order="load", unit=unit, share=torque)


@ctl.command("power-cycle")
@click.argument("unit", type=int)
@pass_session
def power_cycle(session: Session, unit: int) -> None:
    """Switch a drive off and on: what it kept in RAM is lost."""
    _send(session, order="power-cycle", unit=unit)


@ctl.command()
@pass_session
def unplug(session: Session) -> None:
    """Pull the adapter out: programs lose the port."""
    _send(session, order="unplug")


@ctl.command()
@pass_session
def replug(session: Session) -> None:
    """Put the adapter back. A pseudo-terminal then has another name; a link leads to it."""
    _send(session, order="replug")


@ctl.command()
@click.argument("rates", nargs=-1, metavar="[off | KIND=RATE ...]")
@pass_session
def faults(session: Session, rates: tuple[str, ...]) -> None:
    """Spoil answers: all=0.02, or one kind such as late=0.1; off ends it. What is not named has none."""
    if not rates:
        _send(session, order="faults")
    elif rates == ("off",):
        _send(session, order="faults", rates={})
    else:
        _send(session, order="faults", rates=rates_of(None, rates))


@ctl.command()
@click.argument("settings", nargs=-1, metavar="[BAUD] [8E1]")
@pass_session
@click.pass_context
def settings(context: click.Context, session: Session, settings: tuple[str, ...]) -> None:
    """Set every drive to another speed or format, as at its keypad: 9600, 8N1, or both.

    Ports stay as they are, so a program with the old settings gets no answer: a wrong baud rate without hardware.
    """
    wanted: dict[str, Any] = {}
    for word in settings:
        if re.fullmatch(r"[0-9]{1,9}", word):
            found: dict[str, Any] = {"baudrate": int(word)}
        else:
            bits, parity, stop = parse_format(context, context.command.params[0], word)
            found = {"bytesize": int(bits), "parity": parity, "stopbits": int(stop)}
        if found.keys() & wanted.keys():
            raise WrongUse(f"{' '.join(settings)}: one speed and one format, such as 9600 8N1")
        wanted |= found
    _send(session, order="settings", **wanted)
