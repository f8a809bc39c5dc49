"""`python -m drivebus` is the command `drivebus`."""

from drivebus.cli import main

if __name__ == "__main__":
    main()
