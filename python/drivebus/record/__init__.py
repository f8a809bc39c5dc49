"""Values of drives as files, while they come: CSV, JSON lines, SQLite and Parquet, and the way back.

`table` says which columns there are, `gap_events` finds gaps and faults in samples, `recorder` takes samples and
writes, with a file for each format beside it, and `reading` gives back what was written.
"""

from drivebus.record.reading import Recording, read
from drivebus.record.recorder import Recorder

__all__ = ["Recorder", "Recording", "read"]
