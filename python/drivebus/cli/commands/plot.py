"""`drivebus plot`: recordings as pictures."""

from __future__ import annotations

from pathlib import Path

import click

from drivebus.cli.option_types import Place, Seconds, Whole
from drivebus.cli.present.recordings import Drawn
from drivebus.cli.session import Session, pass_session
from drivebus.cli.wrong_use import WrongUse
from drivebus.plot import draw, of_recording
from drivebus.plot.draw import check
from drivebus.record import read

__all__ = ["COMMANDS"]


@click.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=Place())
@click.option("--output", "-o", "target", type=Place(), metavar="PICTURE", help="Default: FILE with .png.")
@click.option("--only", "names", multiple=True, metavar="NAME", help="Draw this register only. Repeatable.")
@click.option("--from", "begin", type=Seconds(0), default=0.0, metavar="SECONDS", help="Begin so long after the start.")
@click.option("--to", "end", type=Seconds(0), metavar="SECONDS", help="End so long after the start.")
@click.option(
    "--points", type=Whole(10, 1_000_000), default=4000, show_default=True, help="Most points of a curve. Peaks stay."
)
@click.option("--force", is_flag=True, help="Replace the picture if it is there.")
@pass_session
def plot(
    session: Session,
    files: tuple[str, ...],
    target: str | None,
    names: tuple[str, ...],
    begin: float,
    end: float | None,
    points: int,
    force: bool,
) -> None:
    """Draw a recording: values by unit under each other, states as bands, faults and gaps marked.

    Several files of one recording are drawn as one. PICTURE ends with .png, .svg or .html. The page works without a
    network.
    """
    picture_file = Path(files[0]).with_suffix(".png") if target is None else Path(target)
    check(picture_file)
    if picture_file.exists() and not force:
        raise WrongUse(f"{picture_file} is there already; give another name by -o, or --force")
    recording = read(*files)
    picture = of_recording(recording, Path(files[0]).name, names, begin=begin, end=end, points=points)
    draw(picture, picture_file)
    session.out.render(Drawn(picture, picture_file, recording.complete))


COMMANDS = [plot]
