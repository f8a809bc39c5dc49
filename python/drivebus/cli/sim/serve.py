"""`drivebus sim`: simulated drives for any program, until it is ended."""

from __future__ import annotations

import re
import shlex
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

import drivebus
from drivebus.cli.names import complete_units
from drivebus.cli.option_types import Place, Whole
from drivebus.cli.present.help_format import Listing
from drivebus.cli.present.output import Output, remark
from drivebus.cli.session import Session, pass_session
from drivebus.cli.sim.control_commands import Orders, in_words
from drivebus.cli.sim.control_socket import open_to_orders
from drivebus.cli.sim.rates import rates_of
from drivebus.cli.wrong_use import WrongUse
from drivebus.end_signals import END_SIGNALS
from drivebus.latch import Latch

__all__ = ["sim"]

UNLINKED = ""
"""An ear without a link."""


class Ear(Place):
    """A link to an ear, or none."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        """*value* as a path, or as it is where no link was named."""
        return value if value == UNLINKED else super().convert(value, parameter, context)


class _Sim(Listing):
    """Takes a family for drives as well: `drivebus sim gd350`."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Takes a single word that is no command, but a family or a folder, for unit 1."""
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            word, *rest = args
            if "=" in word or word in drivebus.profiles() or Path(word).is_dir():
                args = ["--units", word if "=" in word else f"1={word}", *rest]
        return super().parse_args(context, args)


@click.group(cls=_Sim, invoke_without_command=True)
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
    """Serve simulated drives until Ctrl-C or SIGTERM, for this program or any other: `drivebus sim gd350`.

    The line has the settings of the global options --baud and --format: `drivebus sim --units 1=vfd500 --baud 9600
    --format 8N1`. Without them, a profile of your own says how its drive leaves the factory.

    While it serves them, `drivebus sim ctl` in another window trips, loads and unplugs them.
    """
    if context.invoked_subcommand is not None:
        return
    drives = _simulated(units)
    session = _on_their_line(context, session, drives)
    bits, parity, stop = session.line_format
    simulator = drivebus.Simulator(
        drives,
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
    for number in END_SIGNALS:
        signal.signal(number, signal.default_int_handler)
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
                takes_orders = _take_orders(open_things, orders)
                # Whoever reads the port may end it at once.
                session.out.render(
                    _Served(
                        simulator,
                        opened(),
                        heard_at,
                        "".join(f" {word}" for word in session.setting_words()),
                        takes_orders,
                    )
                )
                Latch().wait()
        except KeyboardInterrupt:
            session.out.say("")


def _take_orders(open_things: ExitStack, orders: Orders) -> bool:
    """Lets other windows give orders. Where they cannot, that is said, this is false, and the rest goes on."""
    try:
        open_things.enter_context(open_to_orders(orders.obey))
    except (drivebus.NotAllowed, OSError) as error:
        remark(f"Warning: this simulation takes no orders by `drivebus sim ctl`: {error}")
        return False
    return True


@dataclass(frozen=True)
class _Served:
    """What is simulated.

    Attributes:
        simulator: That.
        opened: What other programs open.
        ear: What they open to listen; None for nothing.
        line_words: The options for the line, as they are typed behind `drivebus`.
        takes_orders: Whether other windows can give some.
    """

    simulator: drivebus.Simulator
    opened: str
    ear: str | None
    line_words: str
    takes_orders: bool

    def _drives(self) -> dict[int, str]:
        return {unit: self.simulator.drive(unit).profile for unit in self.simulator.units}

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it in one object."""
        simulator = self.simulator
        yield {
            "port": self.opened,
            "leads_to": simulator.port,
            "units": self._drives(),
            "settings": in_words(simulator.format),
            **({} if self.ear is None else {"ear": self.ear, "ear_leads_to": simulator.ear}),
            "seed": simulator.seed,
            "faults": simulator.line.faults,
        }

    def lay_out(self, out: Output) -> None:
        """What to open, what is there, and what to do next."""
        simulator, opened, ear = self.simulator, self.opened, self.ear
        out.say(opened)
        if opened != simulator.port:
            out.say(f"Leads to: {simulator.port}")
        if ear is not None:
            leads = "" if ear == simulator.ear else f", leads to {simulator.ear}"
            out.say(f"Ear: {ear}{leads}")
        for unit, family in self._drives().items():
            out.say(f"Unit {unit}: {family}")
        out.say(f"Settings: {in_words(simulator.format)}")
        if simulator.line.faults:
            out.say("Faults: " + ", ".join(f"{kind} {rate:g}" for kind, rate in simulator.line.faults.items()))
        out.say(f"Seed: {simulator.seed}")
        first = simulator.units[0]
        which = "" if first == 1 else f" --unit {first}"
        out.say(f"Try in another window: `drivebus --port {shlex.quote(opened)}{self.line_words}{which} info`")
        if ear is not None:
            out.say(f"Hear it: `drivebus{self.line_words} sniff {shlex.quote(ear)}`")
        if self.takes_orders:
            out.say("Trip, load, unplug: `drivebus sim ctl --help`")
        out.say("Ctrl-C ends it.")


def _on_their_line(context: click.Context, session: Session, drives: dict[int, str]) -> Session:
    """*session* with the line that profiles of one's own give, where they agree and none was typed."""
    root = context.find_root()
    typed = any(root.get_parameter_source(name) is not ParameterSource.DEFAULT for name in ("baud", "line_format"))
    if typed or any(family in drivebus.profiles() for family in drives.values()):
        return session
    known = [drivebus.Profile.find(family).serial() for family in drives.values()]
    lines = {(each.baud_rate, each.format) for each in known if each is not None}
    if len(lines) != 1 or None in known:
        return session
    [(baud, characters)] = lines
    return replace(session, baud=baud, line_format=(characters[0], characters[1], characters[2]))


def _simulated(text: str) -> dict[int, str]:
    units: dict[int, str] = {}
    for part in text.split(","):
        unit, equals, family = part.strip().partition("=")
        if not equals or re.fullmatch(r"\d{1,20}", unit) is None:
            raise WrongUse(f'"{part}" is not a simulated drive; write UNIT=FAMILY, such as 1=gd350')
        if int(unit) in units:
            raise WrongUse(f"unit {unit} is given twice; give each unit once, such as 1=gd350,2=gd350")
        units[int(unit)] = family
    return units
