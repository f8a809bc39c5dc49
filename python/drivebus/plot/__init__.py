"""Pictures of recordings and trials: PNG, SVG, or one HTML page that works without a network.

`picture` says what there is to see, `downsample` leaves out points without hiding a peak, `colours` has one colour for
each state, `matplotlib_writer` and `plotly_writer` draw it.
"""

from drivebus.plot.draw import draw
from drivebus.plot.picture import Picture, of_recording, of_samples

__all__ = ["Picture", "draw", "of_recording", "of_samples"]
