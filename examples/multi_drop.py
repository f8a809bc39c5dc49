"""Find every drive on a line and poll them as fast as the wire. One that does not answer marks its samples, no more.

python multi_drop.py                 three simulated GD350
python multi_drop.py /dev/ttyUSB0    whoever answers among units 1 to 31
"""

import sys

import drivebus

port = sys.argv[1] if len(sys.argv) > 1 else "sim://1=gd350,2=gd350,7=gd350?clock=virtual"

with drivebus.Bus(port, timeout=0.2, retries=1) as bus:
    drives = [bus.drive(found.unit) for found in bus.scan(range(1, 32)) if found.profile]
    print(f"found {', '.join(str(drive.unit) for drive in drives) or 'none'}")

    names = ["running_frequency", "output_current", "bus_voltage"]
    with bus.poll(dict.fromkeys(drives, names)) as poll:
        print(f"one cycle takes at least {poll.shortest * 1000:.1f} ms on this line")
        for sample in poll.batch(3 * len(drives)):
            print(f"unit {sample.unit}: {sample.missing or dict(sample)}")
        print(f"{poll.cycles} cycles as fast as the wire, {poll.missing} samples missing")

    stats = bus.stats()
    print(
        f"{stats.requests} requests, {stats.answers} answers, {stats.timeouts} time-outs, {stats.crc_errors} bad CRCs"
    )
