"""Pictures of recordings and trials: PNG, SVG, or one HTML page that works without a network.

`picture` says what there is to see, `thin` leaves out points without hiding a peak, `colours` has one colour for each
state, `still` draws with matplotlib and `page` with plotly.
"""

from drivebus.plot.draw import draw
from drivebus.plot.picture import Picture, of_recording, of_samples

__all__ = ["Picture", "draw", "of_recording", "of_samples"]
