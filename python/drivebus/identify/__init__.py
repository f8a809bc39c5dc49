"""What the unit at an address is, whether that agrees with what it was named, and whether it still is the same one."""
