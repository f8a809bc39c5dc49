"""What is wrong with an adapter, a line and its units: looked at in that order, and said in words.

Sends reads and echoes, never a write: every bus is opened read-only. Each finding comes as soon as it is known.

    for finding in drivebus.doctor.examine("/dev/ttyUSB0"):
        print(finding.severity, finding)
"""

from drivebus.doctor.examination import examine
from drivebus.doctor.findings import Finding, Severity

__all__ = ["Finding", "Severity", "examine"]
