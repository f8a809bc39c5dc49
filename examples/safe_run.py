"""Run a motor through a speed profile; whatever goes wrong, it is stopped.

An error, Ctrl-C and SIGTERM are caught by `running`. What no program sees, kill -9 and a cable that is cut, is left to
the drive: `watchdog` sets its own communication time-out.

    python safe_run.py                 a simulated GD350
    python safe_run.py /dev/ttyUSB0    a real one. THE MOTOR TURNS.

This is not a safety function. An emergency stop is a wire.
"""

import sys

import drivebus

STEPS = [(5.0, 0.5), (15.0, 1.0), (10.0, 0.5)]  # Hz, and seconds to stay there

port = sys.argv[1] if len(sys.argv) > 1 else "sim://gd350"

with drivebus.Bus(port) as bus:
    drive = bus.drive(1)
    drive.prepare_control()
    drive.write({"P00.11": 5.0, "P00.12": 5.0})  # ramps in seconds; RAM, so a power cut forgets them

    # Not every manual prints what it sets (`verified`): try it on your drive, by pulling the plug of the adapter.
    with drive.watchdog(2.0, action="coast", unverified=True) as watchdog, drive.running(hz=STEPS[0][0]):
        print(watchdog)
        for hz, seconds in STEPS:
            drive.setpoint = hz
            status = drive.wait_for_speed(hz, timeout=30)
            print(f"{status.frequency:5.2f} Hz, {drive.read('output_current'):.1f} A")
            bus.sleep(seconds)

    print(drive.wait_until_stopped(timeout=30))
