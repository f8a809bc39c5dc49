"""What can go wrong, by whose fault it is, and what then is known about the motor.

    python handle_errors.py

Runs on a simulated line, because it makes things go wrong on purpose.
"""

import drivebus

with (
    drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
    drivebus.Bus(simulator, timeout=0.2, retries=1) as bus,
):
    drive = bus.drive(1)

    try:
        drive.run(hz=10.0)
    except drivebus.NotAllowed as error:
        print(f"NotAllowed, nothing was sent: {error}")
    drive.prepare_control()

    try:
        drive.write("P00.11", 5000.0)
    except drivebus.NotAllowed as error:
        print(f"NotAllowed, out of range: {error}")

    try:
        bus.read(1, 0x6300)
    except drivebus.Refused as error:
        print(f"Refused, exception {error.code:02X}H, {error.name}: {error}")

    try:
        bus.read(9, 0x2100)
    except drivebus.NoAnswer as error:
        print(f"NoAnswer: {error}")

    drive.run(hz=10.0)
    simulator.line.drop_answers(1)
    try:
        drive.stop()
    except drivebus.Unconfirmed as error:
        # The answer was lost, not the request: look before deciding what to do.
        print(f"Unconfirmed: {error}")
    print(f"the drive says: {drive.status()}")

    simulator.drive(1).trip("OL1")
    fault = drive.fault()
    print(f"fault: {fault}; cause: {fault.cause if fault else ''}")
