"""`drivebus sim`: simulated drives for any program, until it is ended."""

from __future__ import annotations

import re
import shlex
import signal
from contextlib import ExitStack
from typing import Any

import click

import drivebus
from drivebus.cli.names import complete_units
from drivebus.cli.option_types import Place, Whole
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import remark
from drivebus.cli.session import DEFAULT_BAUD, DEFAULT_FORMAT, Session, pass_session
from drivebus.cli.sim.control_commands import Orders, in_words
from drivebus.cli.sim.control_socket import open_to_orders
from drivebus.cli.sim.rates import rates_of
from drivebus.latch import Latch

__all__ = ["sim"]

UNLINKED = ""
"""An ear without a link."""


class Ear(Place):
    """A link to an ear, or none."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as a path, or as it is where no link was named."""
        return value if value == UNLINKED else super().convert(value, parameter, context)


@click.group(cls=Listing, invoke_without_command=True)
@click.option(
    "--units",
    default="1=gd350",
    show_default=True,
    metavar="LIST",
    shell_complete=complete_units,
    help="Drives by unit: 1=gd350,2=vfd500. A folder with a profile of your own: 3=./acme. Families: "
    f"{', '.join(drivebus.profiles())}.",
)
@click.option(
    "--transport",
    type=click.Choice(["auto", "pty", "tcp"]),
    default="auto",
    show_default=True,
    help="A pseudo-terminal, or RTU over TCP. auto: the first of them that this system has.",
)
@click.option(
    "--seed", type=Whole(0), default=0, show_default=True, help="Repeat the same random faults with the same seed."
)
@click.option(
    "--faults",
    type=click.FloatRange(0, 1),
    metavar="RATE",
    help="Share of answers that each kind of fault damages: 0.02.",
)
@click.option("--fault", "single", multiple=True, metavar="KIND=RATE", help="The same for one kind: late=0.02.")
@click.option("--echo", is_flag=True, help="Act like an adapter that echoes everything it sends.")
@click.option("--link", type=Place(), help="Keep a symbolic link to the pseudo-terminal at this path.")
@click.option(
    "--ear",
    type=Ear(),
    is_flag=False,
    flag_value=UNLINKED,
    metavar="[LINK]",
    help="Also open a port that hears the line, for `drivebus sniff` beside another program. LINK leads there.",
)
@click.option(
    "--fifo", type=Whole(1, 256), default=8, show_default=True, help="Characters that a program receives at once."
)
@pass_session
@click.pass_context
def sim(
    context: click.Context,
    session: Session,
    units: str,
    transport: str,
    seed: int,
    faults: float | None,
    single: tuple[str, ...],
    echo: bool,
    link: str | None,
    ear: str | None,
    fifo: int,
) -> None:
    """Serve simulated drives until Ctrl-C or SIGTERM, for this program or any other.

    The line has the settings of the global options --baud and --format: `drivebus sim --units 1=vfd500 --baud 9600
    --format 8N1`.

    While it serves them, `drivebus sim ctl` in another window trips, loads and unplugs them.
    """
    if context.invoked_subcommand is not None:
        return
    bits, parity, stop = session.line_format
    simulator = drivebus.Simulator(
        _simulated(units),
        baudrate=session.baud,
        bytesize=int(bits),
        parity=parity,
        stopbits=int(stop),
        seed=seed,
        transport=transport,
        faults=rates_of(faults, single),
        echo=echo,
        link=link,
        fifo=fifo,
        ear=False if ear is None else ear or True,
    )
    # Whoever ends it, the link goes with it.
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    with simulator:
        if simulator.transport == "process":
            raise drivebus.PortError(
                "nothing that this system has is a port to the simulated line: no other program can open it"
            )

        def opened() -> str:
            return simulator.port if link is None else link

        heard_at = ear or simulator.ear
        orders = Orders(simulator, opened, session.out.say, heard_at)
        try:
            with ExitStack() as open_things:
                _take_orders(open_things, orders)
                # Whoever reads the port may end it at once.
                _say_what_is_served(session, simulator, opened(), heard_at)
                Latch().wait()
        except KeyboardInterrupt:
            session.out.say("")


def _take_orders(open_things: ExitStack, orders: Orders) -> None:
    """Lets other windows give orders. Where they cannot, that is said, and the rest goes on."""
    try:
        open_things.enter_context(open_to_orders(orders.obey))
    except (drivebus.NotAllowed, OSError) as error:
        remark(f"Warning: this simulation takes no orders by `drivebus sim ctl`: {error}")


def _say_what_is_served(session: Session, simulator: drivebus.Simulator, opened: str, heard_at: str | None) -> None:
    """What to open, what is there, and what to do next."""
    drives = {unit: simulator.drive(unit).profile for unit in simulator.units}
    settings = in_words(simulator.format)
    if session.out.as_json:
        told: dict[str, Any] = {"port": opened, "leads_to": simulator.port, "units": drives, "settings": settings}
        if heard_at is not None:
            told |= {"ear": heard_at, "ear_leads_to": simulator.ear}
        session.out.record({**told, "seed": simulator.seed, "faults": simulator.line.faults})
        return
    session.out.say(opened)
    if opened != simulator.port:
        session.out.say(f"Leads to: {simulator.port}")
    if heard_at is not None:
        leads = "" if heard_at == simulator.ear else f", leads to {simulator.ear}"
        session.out.say(f"Ear: {heard_at}{leads}")
    for unit, family in drives.items():
        session.out.say(f"Unit {unit}: {family}")
    session.out.say(f"Settings: {settings}")
    if simulator.line.faults:
        session.out.say("Faults: " + ", ".join(f"{kind} {rate:g}" for kind, rate in simulator.line.faults.items()))
    session.out.say(f"Seed: {simulator.seed}")
    first = simulator.units[0]
    which = "" if first == 1 else f" --unit {first}"
    words = "".join(f" --{name} {value}" for name, value, usual in _settings_of(session) if value != usual)
    session.out.say(f"Try in another window: `drivebus --port {shlex.quote(opened)}{words}{which} info`")
    if heard_at is not None:
        session.out.say(f"Hear it: `drivebus{words} sniff {shlex.quote(heard_at)}`")
    session.out.say("Trip, load, unplug: `drivebus sim ctl --help`")
    session.out.say("Ctrl-C ends it.")


def _settings_of(session: Session) -> list[tuple[str, object, object]]:
    """The options for the line: name, value and what is usual."""
    return [
        ("baud", session.baud, DEFAULT_BAUD),
        ("format", "".join(session.line_format), "".join(DEFAULT_FORMAT)),
    ]


def _simulated(text: str) -> dict[int, str]:
    units: dict[int, str] = {}
    for part in text.split(","):
        unit, equals, family = part.strip().partition("=")
        if not equals or re.fullmatch(r"\d{1,20}", unit) is None:
            raise click.UsageError(f'"{part}" is not a simulated drive; write UNIT=FAMILY, such as 1=gd350')
        if int(unit) in units:
            raise click.UsageError(f"unit {unit} is given twice; give each unit once, such as 1=gd350,2=gd350")
        units[int(unit)] = family
    return units
