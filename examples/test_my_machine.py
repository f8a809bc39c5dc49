"""A test of one's own program on a simulated drive, in virtual time: a minute of a motor takes milliseconds.

pytest test_my_machine.py, or as here: python test_my_machine.py
"""

from collections.abc import Callable

import drivebus

Test = Callable[[drivebus.Simulator, drivebus.Drive], None]


def fill(drive: drivebus.Drive, hz: float = 20.0) -> None:
    """What is tested: the pump runs for a minute, and rests then."""
    with drive.running(hz, wait=True):
        drive.wait_for_speed(timeout=60)
        drive.bus.sleep(60)


def on_a_drive(test: Test) -> None:
    """Runs *test* with a drive that is set to obey the bus."""
    with (
        drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        test(simulator, drive)


def test_it_runs_for_a_minute_and_rests() -> None:
    """A job that goes well."""

    def test(simulator: drivebus.Simulator, drive: drivebus.Drive) -> None:
        began = simulator.now()
        fill(drive)
        assert simulator.now() - began > 60
        assert drive.status().state is drivebus.State.STOPPED

    on_a_drive(test)


def test_a_trip_ends_it() -> None:
    """A drive that trips on its way is told as that, and is at rest."""

    def test(simulator: drivebus.Simulator, drive: drivebus.Drive) -> None:
        simulator.drive(1).trip("OL1")
        try:
            fill(drive)
            why = "it was started"
        except drivebus.NotReady as error:
            why = error.why
        assert (why, simulator.drive(1).state) == ("fault", "fault")

    on_a_drive(test)


if __name__ == "__main__":
    test_it_runs_for_a_minute_and_rests()
    test_a_trip_ends_it()
    print("both hold")
