"""Back up every drive on a line, one file each, and say what was changed since the last time.

python backup_line.py FOLDER                 two simulated drives
python backup_line.py FOLDER /dev/ttyUSB0    whoever answers among units 1 to 31

Put FOLDER under version control: besides the date, the files change only where a drive does.
"""

import sys
import tempfile
from pathlib import Path

import drivebus

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
folder.mkdir(parents=True, exist_ok=True)
port = sys.argv[2] if len(sys.argv) > 2 else "sim://1=gd350,2=gd350?clock=virtual"

with drivebus.Bus(port, timeout=0.2, retries=1) as bus:
    for found in bus.scan(range(1, 32)):
        if not found.profile:
            print(f"unit {found.unit}: no profile, left out")
            continue
        # Some families are known by their answers only: sure enough to read, and a backup only reads.
        drive = bus.drive(found.unit, found.profile)
        path = folder / f"unit-{drive.unit}.toml"
        if path.exists():
            print(drive.diff(path))
        kept = drive.backup(path)
        print(f"{path}: {len(kept)} parameters, {len(kept.unread)} not read")
