"""Commands around the line: frames by hand, a simulated drive, profiles, shell completion, the demonstration."""

from __future__ import annotations

import signal
import threading

import click
from click.shell_completion import get_completion_class

import drivebus
from drivebus.cli import demo as demonstration
from drivebus.cli import names
from drivebus.cli.session import Session, pass_session, yes_option

__all__ = ["COMMANDS"]

_READS = frozenset({0x01, 0x02, 0x03, 0x04, 0x08})
"""Function codes that change nothing in a unit."""


@click.command()
@click.argument("data", metavar="HEX...", nargs=-1, required=True)
@yes_option
@pass_session
def raw(session: Session, data: tuple[str, ...], yes: bool) -> None:
    """Send any request and show the answer: unit and PDU in hexadecimal, without the CRC.

    As the serial assistants of the manuals: `drivebus raw 01 03 21 00 00 01`.
    """
    body = names.parse_hex(data)
    if not 2 <= len(body) <= 254:
        raise click.UsageError(f"{len(body)} bytes is no request; give the unit, then 1..253 bytes of PDU, and no CRC")
    unit, pdu = body[0], body[1:]
    if not 1 <= unit <= 247:
        raise click.UsageError(f"unit {unit:02X} is nobody who answers; the first byte is the unit, 01..F7")
    with session.bus() as bus:
        if pdu[0] not in _READS:
            session.ask(f"Function {pdu[0]:02X}H writes, which can move the motor", yes, unit)
        _show_frame(session, "sent", _framed(body))
        try:
            answer = bus.transact(unit, pdu)
        except drivebus.Refused as error:
            _show_frame(session, "answer", error.raw)
            if session.profile is not None:
                name, meaning = drivebus.Profile.find(session.profile).exception(error.code)
                session.out.say(f"{'':<7}{session.profile} means by it: {name}, {meaning}")
            raise
        _show_frame(session, "answer", _framed(bytes([unit]) + answer))


@click.command()
@click.argument("data", metavar="HEX...", nargs=-1, required=True)
@pass_session
def decode(session: Session, data: tuple[str, ...]) -> None:
    """Take a whole frame apart, CRC included."""
    _show_frame(session, "frame", names.parse_hex(data))


def _framed(body: bytes) -> bytes:
    return body + drivebus.crc16(body).to_bytes(2, "little")


def _show_frame(session: Session, what: str, frame: bytes) -> None:
    decoded = drivebus.rtu.decode(frame)
    if session.out.as_json:
        fields = {name: value for name, value in vars(decoded).items() if value is not None}
        session.out.record({"what": what, "hex": frame, **fields})
    else:
        session.out.say(f"{what:<7}{frame.hex(' ').upper()}")
        session.out.say(f"{'':<7}{decoded!r}")


@click.command()
@click.option("--units", default="1=gd350", show_default=True, metavar="LIST", help="Such as 1=gd350,2=gd350.")
@click.option("--transport", type=click.Choice(["pty", "tcp"]), default="pty", show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Makes chance repeatable.")
@click.option(
    "--faults", type=click.FloatRange(0, 1), metavar="RATE", help="Share of answers that each kind of fault hits."
)
@click.option("--fault", "single", multiple=True, metavar="KIND=RATE", help="The same for one kind, such as late=0.02.")
@click.option("--echo", is_flag=True, help="As an adapter that hands back what it sends.")
@click.option("--link", type=click.Path(), help="A symbolic link to keep leading to the pseudo-terminal.")
@click.option("--fifo", type=click.IntRange(1, 256), default=8, show_default=True, help="Characters read at once.")
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
        faults=({} if faults is None else {"all": faults}) | dict(map(_rate, single)),
        echo=echo,
        link=link,
        fifo=fifo,
    )
    # Whoever ends it, the link goes with it.
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    with simulator:
        if session.out.as_json:
            session.out.record({"port": simulator.port, "seed": seed, "faults": simulator.line.faults})
        else:
            session.out.say(simulator.port)
            if simulator.line.faults:
                rates = ", ".join(f"{kind} {rate:g}" for kind, rate in simulator.line.faults.items())
                session.out.say(f"Faults: {rates}")
            session.out.say(f"Seed: {seed}")
            session.out.say(f"Try: drivebus --port {simulator.port} info     Ctrl-C ends it.")
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            session.out.say("")


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
        if not equals or not unit.isdecimal():
            raise click.UsageError(f"{part!r} is no simulated drive; write UNIT=FAMILY, such as 1=gd350")
        if int(unit) in units:
            raise click.UsageError(f"unit {unit} is given twice; give each unit once, such as 1=gd350,2=gd350")
        units[int(unit)] = family
    return units


@click.command()
@pass_session
def profiles(session: Session) -> None:
    """List the families of drives that are known."""
    known = [drivebus.Profile.builtin(name) for name in drivebus.profiles()]
    session.out.rows(["name", "title", "registers"], [[each.name, each.title, len(each.names())] for each in known])


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


COMMANDS = [raw, decode, sim, profiles, completion, demo]
