"""The command `drivebus`: everything a technician needs in front of a drive, over the public API only."""

from drivebus.cli.app import cli, main

__all__ = ["cli", "main"]
