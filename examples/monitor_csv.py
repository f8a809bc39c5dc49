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
    log = csv.writer(sys.stdout)
    first = drive.monitor()
    log.writerow(["time", *(f"{name} [{unit}]" if unit else name for name, unit in first.units.items())])
    try:
        for _ in itertools.count() if real else range(5):
            snapshot = drive.monitor()
            log.writerow([f"{snapshot.time:.3f}", *snapshot.values()])
            bus.sleep(1.0)
    except KeyboardInterrupt:
        pass
