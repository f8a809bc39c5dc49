"""Log all monitor registers of a drive as CSV, one line a second. Nothing is written to the drive.

python monitor_csv.py                         a simulated GD350, five lines
python monitor_csv.py /dev/ttyUSB0 > log.csv  a real one, until Ctrl-C
"""

import csv
import itertools
import sys

import drivebus

real = len(sys.argv) > 1
port = sys.argv[1] if real else "sim://gd350?clock=virtual"

with drivebus.Bus(port, read_only=True) as bus:
    drive = bus.drive(1)
    names = drive.profile.monitor_names()
    units = [drive.describe(name).unit for name in names]
    log = csv.writer(sys.stdout)
    log.writerow(["time", *(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True))])
    with bus.poll({drive: names}, interval=1.0) as poll:
        try:
            for sample in poll if real else itertools.islice(poll, 5):
                # A line without values where the drive did not answer: the beat goes on.
                log.writerow([f"{sample.time:.3f}", *(sample.get(name, "") for name in names)])
        except KeyboardInterrupt:
            pass
