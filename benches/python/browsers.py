"""What browsers cost a line: how much it is asked while the page of its plant is open in many of them, and in none.

One line of eight simulated drives in a process of their own, polled as often as they answer (24 reads need 154 ms of
the wire, and are asked for each 160); `drivebus serve` in another; and Debian's Chromium, in which each page is logged
in by itself, stays open and shows what comes. The turns with and without pages follow each other, so that both meet the
same machine. People have their browsers on computers of their own: here on the processors that the line and the service
are not on, which have the first.

usage: python -m benches.python.browsers [--pages 20] [--seconds 20] [--runs 3] [--json]
"""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benches.python.figures import markdown, show
from benches.python.plant import Gateway, free_port, lines, status
from playwright.sync_api import Browser
from tests.python.chromium import chromium
from tests.python.page_plant import MARIA, hash_of
from tests.python.test_page import log_in

DRIVES = 8
FILE = """[lines.hall]
port = "{port}"
baud = 115200
{drives}
[[poll]]
interval = 0.16
[spool]
[web]
address = "127.0.0.1:{web}"
dead_man = 60
[[people]]
name = "maria"
password = "{password}"
role = "command"
"""
DRIVE = '[drives.drive{unit}]\nline = "hall"\nunit = {unit}\nprofile = "gd350"\n'


def asked(folder: Path) -> float:
    """The requests of the line so far."""
    return float(status(folder).get("lines", {}).get("hall", {}).get("requests", 0))


def a_second(folder: Path, seconds: float) -> float:
    """How many requests a second the line carries meanwhile."""
    # What its status says is a second old at most; over whole looks at it that evens out.
    first, begun = asked(folder), time.monotonic()
    time.sleep(seconds)
    return (asked(folder) - first) / (time.monotonic() - begun)


@contextmanager
def opened(browser: Browser, url: str, pages: int) -> Iterator[None]:
    """As many pages of people who are logged in; each has shown a value."""
    with ExitStack() as stack:
        for number in range(pages):
            context = browser.new_context()
            stack.callback(context.close)
            page = context.new_page()
            log_in(page, url, "maria", MARIA)
            page.wait_for_url(f"{url}/")
            # Half of them look at the plant, the others at one drive with its trend.
            if number % 2:
                page.goto(f"{url}/drive/drive{number % DRIVES + 1}")
            page.get_by_text("stopped").first.wait_for()
        yield


def measure(pages: int, seconds: float, runs: int) -> dict[str, float]:
    """Requests a second with and without pages, and how much of the one is left of the other."""
    alone, watched = [], []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="drivebus-browsers-")))
        first, *rest = sorted(os.sched_getaffinity(0))
        # Whatever is started from here on stays there.
        os.sched_setaffinity(0, [first])
        [port] = stack.enter_context(lines(1, DRIVES))
        web = free_port()
        drives = "".join(DRIVE.format(unit=unit) for unit in range(1, DRIVES + 1))
        told = FILE.format(port=port, drives=drives, web=web, password=hash_of(MARIA))
        (folder / "drivebus.toml").write_text(told)
        gateway = Gateway(folder)
        stack.callback(gateway.end, signal.SIGTERM)
        os.sched_setaffinity(0, rest)
        browser = stack.enter_context(chromium())
        while not asked(folder):
            time.sleep(0.2)
        for _ in range(runs):
            alone.append(a_second(folder, seconds))
            with opened(browser, f"http://127.0.0.1:{web}", pages):
                watched.append(a_second(folder, seconds))
    without, with_pages = statistics.median(alone), statistics.median(watched)
    return {"pages": pages, "without": without, "with": with_pages, "share_left": with_pages / without}


def main() -> None:
    """Measures, and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pages", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    figures = measure(given.pages, given.seconds, given.runs) | {"processors": os.cpu_count() or 1}
    show(given.json, figures, markdown(list(figures), [[f"{value:g}" for value in figures.values()]]))


if __name__ == "__main__":
    main()
