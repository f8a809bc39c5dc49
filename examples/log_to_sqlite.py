"""Write what a drive does into a table of SQLite, and ask the table. Nothing is written to the drive.

python log_to_sqlite.py                        a simulated GD350, five seconds
python log_to_sqlite.py /dev/ttyUSB0 log.db    a real one, five seconds
"""

import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import drivebus

SECONDS = 5
port = sys.argv[1] if len(sys.argv) > 1 else "sim://gd350?clock=virtual"
path = Path(sys.argv[2] if len(sys.argv) > 2 else Path(tempfile.mkdtemp(), "log.db"))

with closing(sqlite3.connect(path)) as table, drivebus.Bus(port, read_only=True) as bus:
    table.execute("CREATE TABLE IF NOT EXISTS log (time REAL, unit INTEGER, hertz REAL, amperes REAL, missing TEXT)")
    drive = bus.drive(1)
    with bus.poll({drive: ["running_frequency", "output_current"]}, interval=0.5) as poll:
        for sample in poll.batch(2 * SECONDS):
            hertz, amperes = sample.get("running_frequency"), sample.get("output_current")
            row = (sample.time, sample.unit, hertz, amperes, sample.missing and str(sample.missing))
            table.execute("INSERT INTO log VALUES (?, ?, ?, ?, ?)", row)
    table.commit()
    count, most, gaps = table.execute("SELECT count(*), max(amperes), count(missing) FROM log").fetchone()
    print(f"{count} rows in {path.name}, {gaps} without values; {most} A at most")
