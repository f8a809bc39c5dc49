"""One HTML page that works without a network: zoom, values under the pointer; by plotly."""

from __future__ import annotations

from html import escape
from pathlib import Path

import plotly.graph_objects
import plotly.subplots

from drivebus.plot.colours import CURVES, EVENTS, GAP, band_colour
from drivebus.plot.picture import Picture, from_zero

__all__ = ["write"]


def write(picture: Picture, path: Path, _kind: str) -> None:
    """Draws *picture* into a new file."""
    drives = list(dict.fromkeys(band.drive for band in picture.bands))
    rows = len(picture.panels) + bool(drives)
    heights = [1.0] * len(picture.panels) + ([0.15 + 0.1 * len(drives)] if drives else [])
    figure = plotly.subplots.make_subplots(
        rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.03, row_heights=heights
    )
    number = 0
    for row, (unit, curves) in enumerate(picture.panels.items(), start=1):
        for curve in curves:
            line = plotly.graph_objects.Scatter(
                x=list(curve.times),
                y=list(curve.values),
                name=escape(f"{curve.label} [{unit}]" if unit else curve.label),
                mode="lines",
                line={"color": CURVES[number % len(CURVES)], "width": 1.2},
                connectgaps=False,
            )
            figure.add_trace(line, row=row, col=1)
            number += 1
        floor = "tozero" if from_zero(curves) else "normal"
        figure.update_yaxes(title_text=escape(unit or "number"), rangemode=floor, row=row, col=1)
    _states(figure, picture, drives, rows)
    for _, begin, end in picture.gaps:
        figure.add_vrect(x0=begin, x1=end, fillcolor=GAP, opacity=0.6, line_width=0, layer="below")
    for mark in picture.marks:
        figure.add_vline(x=mark.time, line={"color": EVENTS[mark.kind], "dash": "dash", "width": 1})
        figure.add_annotation(
            x=mark.time, y=1.0, yref="paper", yanchor="bottom", showarrow=False, text=escape(mark.text), textangle=-15
        )
    figure.update_xaxes(title_text=picture.axis, row=rows, col=1)
    figure.update_layout(
        title={"text": escape(picture.title), "y": 0.99, "yanchor": "top"},
        height=max(260 * len(picture.panels) + 120, 420),
        margin={"t": 110},
        template="plotly_white",
        hovermode="x",
    )
    page = figure.to_html(include_plotlyjs=True, full_html=True, config={"displaylogo": False, "scrollZoom": True})
    path.write_text(page, encoding="utf-8")


def _states(figure: plotly.graph_objects.Figure, picture: Picture, drives: list[str], row: int) -> None:
    """The bands, one bar for each."""
    named: set[str] = set()
    for band in picture.bands:
        bar = plotly.graph_objects.Bar(
            x=[band.end - band.begin],
            y=[escape(band.drive)],
            base=[band.begin],
            orientation="h",
            name=escape(band.state),
            legendgroup=band.state,
            showlegend=band.state not in named,
            marker={"color": band_colour(band.state, band.lamp)},
            hovertext=escape(f"{band.drive}: {band.state}"),
            hoverinfo="text",
        )
        named.add(band.state)
        figure.add_trace(bar, row=row, col=1)
    if drives:
        figure.update_layout(barmode="overlay")
