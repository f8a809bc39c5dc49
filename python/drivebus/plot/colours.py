"""The colours of states and events, the same in every kind of picture."""

from __future__ import annotations

__all__ = ["CURVES", "EVENTS", "GAP", "band_colour"]

_STATES = {
    "forward": "#2e9e4f",
    "reverse": "#1f77b4",
    "running": "#17a2a2",
    "stopped": "#b8b8b8",
    "fault": "#d62728",
    "power off": "#555555",
    "pre exciting": "#e0a800",
}
"""Green and blue turn, grey rests, red is a fault: as on the terminal."""

EVENTS = {"fault": "#d62728", "fault cleared": "#2e9e4f", "lost": "#9467bd"}

GAP = "#f3d9b1"
"""Where nothing was heard."""

_LIT = "#f2b632"
"""A bit that is on, as a lamp."""

_OTHER = "#cccccc"

CURVES = ["#1f77b4", "#d95f02", "#1b9e77", "#7570b3", "#e7298a", "#66a61e", "#a6761d", "#444444"]
"""For one curve after the other; told apart by most who see colours otherwise, too."""


def band_colour(state: str, lamp: bool) -> str:
    """The colour of a band: of a state, or of a bit that is on."""
    return _LIT if lamp else _STATES.get(state, _OTHER)
