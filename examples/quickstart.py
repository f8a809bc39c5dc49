"""Run a motor at 10 Hz, look at it, stop it.

python quickstart.py                 a simulated GD350
python quickstart.py /dev/ttyUSB0    a real one, unit 1, 19200 8E1. THE MOTOR TURNS.
"""

import sys

import drivebus

port = sys.argv[1] if len(sys.argv) > 1 else "sim://gd350?clock=virtual"

with drivebus.Bus(port, baudrate=19200, parity="E") as bus:
    drive = bus.drive(1)
    print(drive.prepare_control())
    with drive.running(hz=10.0):
        drive.wait_for_speed(timeout=60)
        print(drive.status())
        print(drive.monitor("output_current", "output_voltage", "rotation_speed"))
    drive.wait_until_stopped(timeout=60)
    print(drive.status())
