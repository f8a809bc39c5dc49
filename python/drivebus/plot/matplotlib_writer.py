"""Pictures that stand still: PNG and SVG, by matplotlib."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from drivebus.plot.colours import CURVES, EVENTS, GAP, band_colour
from drivebus.plot.picture import Picture, from_zero

__all__ = ["write"]

_MOST_NAMES = 12
"""More curves of one unit are not named beside it."""


def write(picture: Picture, path: Path, kind: str) -> None:
    """Draws *picture* into a new file."""
    drives = list(dict.fromkeys(band.drive for band in picture.bands))
    heights = [2.2] * len(picture.panels) + ([0.25 + 0.2 * len(drives)] if drives else [])
    figure = Figure(figsize=(11, 1.2 + sum(heights)), layout="constrained")
    found = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)
    axes: list[Axes] = [row[0] for row in found]
    figure.suptitle(_plain(picture.title), fontsize=11)
    for place, (unit, curves) in enumerate(picture.panels.items()):
        axis = axes[place]
        for number, curve in enumerate(curves):
            values = [float("nan") if value is None else value for value in curve.values]
            colour = CURVES[number % len(CURVES)]
            axis.plot(curve.times, values, color=colour, linewidth=1.0, label=_plain(curve.label))
        if from_zero(curves):
            axis.set_ylim(bottom=0)
        axis.set_ylabel(_plain(unit or "number"))
        axis.grid(visible=True, alpha=0.3)
        if len(curves) <= _MOST_NAMES:
            axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
        _events(axis, picture, named=place == 0)
    if drives:
        _states(axes[-1], picture, drives)
    axes[-1].set_xlabel(picture.axis)
    figure.savefig(path, format=kind, dpi=110)


def _events(axis: Axes, picture: Picture, named: bool) -> None:
    """Gaps and faults, in every panel; their text once."""
    for _, begin, end in picture.gaps:
        axis.axvspan(begin, end, color=GAP, linewidth=0)
    for mark in picture.marks:
        colour = EVENTS[mark.kind]
        axis.axvline(mark.time, color=colour, linewidth=1.0, linestyle="--")
        if named:
            axis.annotate(
                _plain(mark.text),
                (mark.time, 1.0),
                xycoords=("data", "axes fraction"),
                fontsize=7,
                color=colour,
                rotation=15,
            )


def _states(axis: Axes, picture: Picture, drives: list[str]) -> None:
    for band in picture.bands:
        row = len(drives) - 1 - drives.index(band.drive)
        colour = band_colour(band.state, band.lamp)
        axis.barh(row, band.end - band.begin, left=band.begin, color=colour, height=0.8)
    axis.set_yticks(range(len(drives)), [_plain(drive) for drive in reversed(drives)], fontsize=7)
    shown = dict.fromkeys((band.state, band.lamp) for band in picture.bands)
    names = [Patch(color=band_colour(*each), label=_plain(each[0])) for each in shown]
    axis.legend(handles=names, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)


def _plain(text: str) -> str:
    """*text* without what matplotlib takes for mathematics."""
    return text.replace("$", r"\$")
