"""The pictures of the page, as a real browser shows it: `make pictures`, with Debian's Chromium.

Runs simulated drives and a service. What the curves show is an hour of such a drive in virtual time.
"""

from __future__ import annotations

import csv
import platform
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Page, expect
from tests.python.chromium import chromium
from tests.python.page_plant import MARIA, page_plant

import drivebus
from drivebus.spool import Layout, Spool

HERE = Path(__file__).resolve().parent.parent / "docs/pictures"
NAMES, UNITS, DIGITS = ("running_frequency", "output_voltage"), ("Hz", "V"), (2, 0)
SPEEDS = (30.0, 42.0, 42.0, 25.0, 0.0, 35.0, 20.0)
SIZE = {"width": 1080, "height": 640}


def hour_of(folder: Path) -> list[tuple[float, list[float]]]:
    """An hour of a drive: seconds, and what it said."""
    path = folder / "hour.csv"
    with (
        drivebus.Simulator({1: "gd350"}, clock="virtual", transport="process") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        with drivebus.Recorder(path, {drive: list(NAMES)}, interval=2.0) as recorder:
            for speed in SPEEDS:
                simulator.drive(1).load = 0.4 + speed / 100
                drive.run(speed) if speed else drive.stop()
                recorder.wait(3_600 / len(SPEEDS))
    rows = list(csv.DictReader(path.read_text().splitlines()))
    return [(2.0 * place, [value_of(row, name) for name in NAMES]) for place, row in enumerate(rows)]


def value_of(row: dict[str, str], name: str) -> float:
    """The value *name*, which the column of some drive has."""
    return next(float(text or 0.0) for column, text in row.items() if name in column)


def remember(folder: Path) -> None:
    """Puts an hour into the spool that the service finds."""
    samples = hour_of(folder)
    began = time.time() - samples[-1][0] - 5
    with Spool(folder / "drivebus-spool", 1 << 30, print) as spool:
        for at, values in samples:
            spool.add(Layout("pump", "gd350", NAMES, UNITS, DIGITS), began + at, 0.02, "", values)


def log_in(page: Page, url: str) -> None:
    """Maria comes."""
    page.goto(f"{url}/login")
    page.fill("[name=name]", "maria")
    page.fill("[name=password]", MARIA)
    page.get_by_role("button", name="Log in").click()
    page.wait_for_url(f"{url}/")


def run(page: Page, url: str, drive: str, speed: str) -> None:
    """Maria runs *drive*."""
    page.goto(f"{url}/drive/{drive}")
    page.get_by_label("Speed in Hz").fill(speed)
    page.get_by_role("button", name="Run forward…").click()
    page.get_by_role("dialog").get_by_role("button", name="Run forward").click()
    expect(page.locator(".speed")).to_have_text(f"{float(speed):.2f} Hz")


def main() -> None:
    """Draws them."""
    HERE.mkdir(exist_ok=True)
    # The page is called as the computer is.
    platform.node = lambda: "plant"
    with tempfile.TemporaryDirectory() as name, chromium() as browser:
        folder = Path(name)
        remember(folder)
        with page_plant(folder, interval=0.5) as plant:
            page = browser.new_page(viewport=SIZE, color_scheme="light")  # type: ignore[arg-type]
            log_in(page, plant.url)
            plant.simulator.drive(1).load = 0.6
            run(page, plant.url, "fan", "15")
            plant.simulator.drive(2).trip("OL1")
            run(page, plant.url, "pump", "20")
            page.get_by_label("And").select_option("output_voltage")
            expect(page.get_by_role("img", name="output_voltage of pump")).to_be_visible()
            # So high that nothing is scrolled, and no bar lies over it.
            page.set_viewport_size({"width": SIZE["width"], "height": 2_400})
            page.locator("#trend").screenshot(path=HERE / "page-trend.png")
            page.set_viewport_size({"width": SIZE["width"], "height": SIZE["height"]})
            page.goto(plant.url)
            expect(page.locator("[data-drive=fan]")).to_contain_text("Fault")
            expect(page.locator("[data-line=hall] [data-of=share]")).to_contain_text("used")
            page.screenshot(path=HERE / "page.png")
    print("drawn: page.png, page-trend.png")


if __name__ == "__main__":
    main()
