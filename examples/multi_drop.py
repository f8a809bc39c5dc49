"""Find every drive on a line and poll them in turn. A drive that does not answer does not end the program.

python multi_drop.py                 three simulated GD350
python multi_drop.py /dev/ttyUSB0    whoever answers among units 1 to 31
"""

import sys

import drivebus

port = sys.argv[1] if len(sys.argv) > 1 else "sim://1=gd350,2=gd350,7=gd350?clock=virtual"

with drivebus.Bus(port, timeout=0.2, retries=1) as bus:
    drives = [bus.drive(found.unit) for found in bus.scan(range(1, 32)) if found.profile]
    print(f"found {', '.join(str(drive.unit) for drive in drives) or 'none'}")

    for _ in range(3):
        for drive in drives:
            try:
                values = drive.monitor("running_frequency", "output_current", "bus_voltage")
                print(f"unit {drive.unit}: {values}")
            except drivebus.NoAnswer as error:
                print(f"unit {drive.unit}: {error}")
        bus.sleep(1.0)

    stats = bus.stats()
    print(
        f"{stats.requests} requests, {stats.answers} answers, {stats.timeouts} time-outs, {stats.crc_errors} bad CRCs"
    )
