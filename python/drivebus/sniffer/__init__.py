"""Listening to others on a line, without a word: who asks whom for what, and what comes of it.

`frames` says what stands in a frame, `families` which family a unit may be, `pairing` makes exchanges of what the core
has told apart, `statistics` counts them and says what they mean for the line, and `live` hears a port.
"""

from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.families import Families
from drivebus.sniffer.live import sniff
from drivebus.sniffer.pairing import exchanges_in
from drivebus.sniffer.statistics import Figures

__all__ = ["Exchange", "Families", "Figures", "exchanges_in", "sniff"]
