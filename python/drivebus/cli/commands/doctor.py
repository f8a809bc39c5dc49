"""`drivebus doctor`: what `drivebus.doctor` finds, as it finds it, and an exit code by the worst of it."""

from __future__ import annotations

from contextlib import closing, nullcontext
from time import monotonic

import click
from click.core import ParameterSource
from rich.status import Status

import drivebus
from drivebus.cli.option_types import Seconds, Whole
from drivebus.cli.present.findings import Finding
from drivebus.cli.present.output import counted, show
from drivebus.cli.session import EXAMPLE_PORT, Session, parse_format, pass_session
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMANDS"]


@click.command()
@click.argument("port", required=False)
@click.option("--unit", "-u", type=Whole(0, 255), help="Only this one.  [default: whoever answers]")
@click.option("--baud", "-b", type=Whole(1), help="Bits per second it should be.  [default: 19200]")
@click.option(
    "--format",
    "line_format",
    "-f",
    metavar="8E1",
    callback=lambda context, parameter, value: value and parse_format(context, parameter, value),
    help="Data bits, parity and stop bits it should be.  [default: 8E1]",
)
@click.option(
    "--full", is_flag=True, help="Try every address, baud rate and format, with ten times the echoes. Takes minutes."
)
@click.option(
    "--listen", type=Seconds(0, 3600), default=1.0, show_default=True, help="Seconds to listen before asking."
)
@pass_session
@click.pass_context
def doctor(
    context: click.Context,
    session: Session,
    port: str | None,
    unit: int | None,
    baud: int | None,
    line_format: tuple[str, str, str] | None,
    full: bool,
    listen: float,
) -> None:
    """Find what is wrong with an adapter, a line and its units, and say what to do. Only reads.

    Without --unit, addresses 1 to 32 are asked. If nobody answers, other baud rates and parities are tried. With
    --profile, units that do not identify themselves are examined as that family.
    """
    port = port or session.port
    if port is None:
        raise WrongUse(f"no port: give it, as in `drivebus doctor {EXAMPLE_PORT}`; `drivebus ports` lists them")
    if unit is None and context.find_root().get_parameter_source("units") is not ParameterSource.DEFAULT:
        unit = session.unit
    bits, parity, stop = line_format or session.line_format
    out = session.out
    wrong: list[Finding] = []
    began = monotonic()
    with Status("", console=out.console) if out.live else nullcontext() as status:
        findings = drivebus.doctor.examine(
            port,
            unit,
            baudrate=baud or session.baud,
            bytesize=int(bits),
            parity=parity,
            stopbits=int(stop),
            full=full,
            listen=listen,
            rs485=session.direction,
            profile=session.profile,
            unverified=session.unverified,
            reserved=session.reserved,
            tell=(lambda text: status.update(show(text))) if status is not None else None,
        )
        # Closing it closes the port, also where Ctrl-C or a full pipe ends this.
        with closing(findings):
            for found in findings:
                finding = Finding(found, port)
                out.render(finding)
                if found.wrong:
                    wrong.append(finding)
    took = f"Took {monotonic() - began:.0f} s."
    if not wrong:
        out.say(f"Nothing is wrong. {took}")
        return
    counts = [(name, sum(finding.found.severity == name for finding in wrong)) for name in ("fault", "warning")]
    out.say(f"{', '.join(counted(count, name) for name, count in counts if count)}. {took}")
    # The first of the worst.
    context.exit(max(wrong, key=lambda finding: finding.found.severity.rank).exit_code)


COMMANDS = [doctor]
