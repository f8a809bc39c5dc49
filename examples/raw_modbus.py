"""Modbus RTU without profiles: words, frames, any function code. For units that no profile knows.

python raw_modbus.py                 a simulated GD350
python raw_modbus.py /dev/ttyUSB0    unit 1 at that port; only reads
"""

import sys

import drivebus

port = sys.argv[1] if len(sys.argv) > 1 else "sim://gd350?clock=virtual"

with drivebus.Bus(port, read_only=True) as bus:
    print("status words", bus.read(1, 0x2100, 3))
    print(f"round trip {bus.echo(1) * 1000:.2f} ms")
    print("any PDU", bus.transact(1, bytes.fromhex("03 21 03 00 01")).hex(" "))

# Frames without a line.
request = drivebus.rtu.encode_read(1, 0x2100, 1)
print("request", request.hex(" "), drivebus.rtu.decode(request))
answer = bytes.fromhex("01 03 02 00 03 F8 45")
print("answer", drivebus.rtu.decode_answer(request, answer))

serial_format = drivebus.SerialFormat(19200, "E")
print(f"t1.5 {serial_format.t15 * 1e6:.0f} us, t3.5 {serial_format.t35 * 1e6:.0f} us")
