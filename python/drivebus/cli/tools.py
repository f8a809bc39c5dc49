"""Commands around the line: a simulated drive, shell completion, the demonstration."""

from __future__ import annotations

import re
import signal
import threading

import click
from click.shell_completion import get_completion_class

import drivebus
from drivebus.cli import demo as demonstration
from drivebus.cli.names import complete_units
from drivebus.cli.session import Session, pass_session
from drivebus.cli.types import Place, Whole

__all__ = ["COMMANDS"]


@click.command()
@click.option(
    "--units",
    default="1=gd350",
    show_default=True,
    metavar="LIST",
    shell_complete=complete_units,
    help=f"Such as 1=gd350,2=vfd500, or with a profile's folder, 3=./acme. There are {', '.join(drivebus.profiles())}.",
)
@click.option(
    "--transport",
    type=click.Choice(["auto", "pty", "tcp"]),
    default="auto",
    show_default=True,
    help="A pseudo-terminal, RTU over TCP, or the first of them that this system has.",
)
@click.option("--seed", type=Whole(0), default=0, show_default=True, help="Makes chance repeatable.")
@click.option(
    "--faults", type=click.FloatRange(0, 1), metavar="RATE", help="Share of answers that each kind of fault hits."
)
@click.option("--fault", "single", multiple=True, metavar="KIND=RATE", help="The same for one kind, such as late=0.02.")
@click.option("--echo", is_flag=True, help="As an adapter that hands back what it sends.")
@click.option("--link", type=Place(), help="A symbolic link to keep leading to the pseudo-terminal.")
@click.option("--fifo", type=Whole(1, 256), default=8, show_default=True, help="Characters read at once.")
@pass_session
def sim(
    session: Session,
    units: str,
    transport: str,
    seed: int,
    faults: float | None,
    single: tuple[str, ...],
    echo: bool,
    link: str | None,
    fifo: int,
) -> None:
    """Serve simulated drives until Ctrl-C or SIGTERM, for this program or any other."""
    bits, parity, stop = session.line_format
    simulator = drivebus.Simulator(
        _simulated(units),
        baudrate=session.baud,
        bytesize=int(bits),
        parity=parity,
        stopbits=int(stop),
        seed=seed,
        transport=transport,
        faults=_rates(faults, single),
        echo=echo,
        link=link,
        fifo=fifo,
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
        try:
            # Whoever reads the port may end it at once.
            if session.out.as_json:
                session.out.record({"port": simulator.port, "seed": seed, "faults": simulator.line.faults})
            else:
                session.out.say(simulator.port)
                if simulator.line.faults:
                    rates = ", ".join(f"{kind} {rate:g}" for kind, rate in simulator.line.faults.items())
                    session.out.say(f"Faults: {rates}")
                session.out.say(f"Seed: {seed}")
                session.out.say(f"Try: drivebus --port {simulator.port} info     Ctrl-C ends it.")
            threading.Event().wait()
        except KeyboardInterrupt:
            session.out.say("")


def _rates(every: float | None, single: tuple[str, ...]) -> dict[str, float]:
    rates = {} if every is None else {"all": every}
    for kind, rate in map(_rate, single):
        if kind in rates:
            raise click.UsageError(f"the rate of {kind} is given twice")
        rates[kind] = rate
    return rates


def _rate(text: str) -> tuple[str, float]:
    kind, _, rate = text.partition("=")
    try:
        return kind.strip().replace("-", "_"), float(rate)
    except ValueError:
        raise click.UsageError(f"{text!r} is no fault; write KIND=RATE, such as late=0.02") from None


def _simulated(text: str) -> dict[int, str]:
    units: dict[int, str] = {}
    for part in text.split(","):
        unit, equals, family = part.strip().partition("=")
        if not equals or re.fullmatch(r"\d{1,20}", unit) is None:
            raise click.UsageError(f"{part!r} is no simulated drive; write UNIT=FAMILY, such as 1=gd350")
        if int(unit) in units:
            raise click.UsageError(f"unit {unit} is given twice; give each unit once, such as 1=gd350,2=gd350")
        units[int(unit)] = family
    return units


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the completion script of a shell.

    \b
    bash: drivebus completion bash > ~/.local/share/bash-completion/completions/drivebus
    zsh:  drivebus completion zsh > a file _drivebus in a folder of $fpath
    fish: drivebus completion fish > ~/.config/fish/completions/drivebus.fish
    """  # noqa: D301 - click needs the control character
    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"no completion for {shell}")
    click.echo(kind(context.find_root().command, {}, "drivebus", "_DRIVEBUS_COMPLETE").source())


@click.command()
@pass_session
def demo(session: Session) -> None:
    """Run a simulated GD350 through a whole job: under a minute, no hardware, nothing to set up."""
    demonstration.run(session.out)


COMMANDS = [sim, completion, demo]
