"""Raise the speed step by step, and stop where the current is above a limit. What stands against a start is told apart.

python guarded_ramp.py                 a simulated GD350
python guarded_ramp.py /dev/ttyUSB0    a real one. THE MOTOR TURNS.
"""

import sys

import drivebus

MOST = 12.0  # A
port = sys.argv[1] if len(sys.argv) > 1 else "sim://gd350?clock=virtual"

with drivebus.Bus(port) as bus:
    drive = bus.drive(1)
    reached = 0.0
    for attempt in range(2):
        try:
            with drive.running(5.0, wait=True):
                for hz in (5.0, 10.0, 15.0, 20.0):
                    drive.write_setpoint(hz)
                    drive.wait_for_speed(hz, timeout=30)
                    snapshot = drive.monitor("output_current", "running_frequency")
                    print(f"{snapshot.running_frequency:5.2f} Hz, {snapshot.output_current:.1f} A")
                    if float(snapshot.output_current) > MOST:
                        print(f"more than {MOST:g} A: this is far enough")
                        break
                    reached = hz
            break
        except drivebus.NotReady as error:
            # Nothing was sent. Here the drive is still set to obey its keypad.
            print(f"not ready, {error.why}; what helps: {', '.join(advice.name for advice in error.advice)}")
            if attempt or error.why not in ("control_source", "settings"):
                raise
            drive.prepare_control()
        except drivebus.BadLink as error:
            sys.exit(f"not started over a line as bad as this: {error}")
    print(f"{reached:g} Hz were reached; {drive.status()}")
