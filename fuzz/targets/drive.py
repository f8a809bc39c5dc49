"""`fuzz/drive.py` under libFuzzer, by the coverage of the package's Python: `make fuzz TARGET=drive`."""

import sys

import atheris

with atheris.instrument_imports(include=["drivebus"]):
    from fuzz.drive import drive

atheris.Setup(sys.argv, drive)
atheris.Fuzz()
