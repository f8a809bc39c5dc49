"""Back a drive up, change it, say what differs, and give it back what it had.

python back_up_and_compare.py    a simulated GD350, since this writes
"""

import tempfile
from pathlib import Path

import drivebus

with tempfile.TemporaryDirectory() as folder, drivebus.Bus("sim://gd350?clock=virtual") as bus:
    drive = bus.drive(1)
    path = Path(folder, "pump.backup.toml")
    kept = drive.backup(path)
    print(f"{len(kept)} parameters, {'complete' if kept.complete else 'not complete'}")

    drive.write("P00.11", 7.5, store=True)
    found = drive.diff(path)
    for each in found:
        print(f"{each.code} {each.label}: {each.left} -> {each.right} {each.unit}")

    report = drive.restore(path)
    written = [item for item in report if item.result == "restored"]
    print(f"{', '.join(item.code for item in written)} given back; {len(drive.diff(path))} parameters differ now")
