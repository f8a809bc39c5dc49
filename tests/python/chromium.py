"""A real browser for tests and pictures: Debian's Chromium, driven by Playwright."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).resolve().parent.parent.parent
NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
# Root has no sandbox, and containers have little shared memory.
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]


def program() -> Path | None:
    """The browser: the system's, or the one that was unpacked; None: there is none."""
    if found := next(filter(None, map(shutil.which, NAMES)), None):
        return Path(found)
    unpacked = ROOT / ".tools/usr/lib/chromium/chromium-headless-shell"
    return unpacked if unpacked.exists() else None


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser, or the test is skipped; where nothing may be skipped it fails."""
    path = program()
    if path is None:
        reason = "Chromium is missing: run `make interop-parts`, or on Debian `apt-get install chromium-headless-shell`"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    folders = [
        folder for each in (ROOT / ".tools/usr/lib").glob("*-linux-*") for folder in (each, *each.glob("pulseaudio"))
    ]
    libraries = os.pathsep.join([*map(str, folders), os.environ.get("LD_LIBRARY_PATH", "")])
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=OPTIONS, env={**os.environ, "LD_LIBRARY_PATH": libraries}
        )
        try:
            yield browser
        finally:
            browser.close()
