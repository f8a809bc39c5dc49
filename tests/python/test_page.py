"""The page in a real browser: what people do with it, what attackers try, and how it looks to who cannot see it."""

from __future__ import annotations

import http.server
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Dialog, Page, Response, expect

from drivebus.web import Web, sessions

from .chromium import chromium
from .made_up_plant import EVIL, Plant
from .made_up_plant import made_up as made_up_plant
from .page_plant import FORWARD, MARIA, OTTO, REVERSE, STOP, PagePlant, page_plant
from .tcp_client import seen

LARGEST = 300_000
"""Bytes of all that a page loads."""
SERIOUS = ("serious", "critical")
NOTHING = "\u2013"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def plant(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PagePlant]:  # noqa: ARG001 - skips
    with page_plant(tmp_path_factory.mktemp("plant")) as plant:
        yield plant


@pytest.fixture
def made_up(browser: Browser) -> Iterator[tuple[Plant, Web]]:  # noqa: ARG001 - skips
    """A plant without drives, whose faults are attacks."""
    with made_up_plant() as plant:
        yield plant


@contextmanager
def at(
    browser: Browser, url: str, person: str = "maria", path: str = "/", expected: str = "", **options: Any
) -> Iterator[Page]:
    """A page of *person*, in a browser of its own, which complains of nothing but what is *expected*."""
    complaints: list[str] = []
    context = browser.new_context(**options)
    try:
        page = context.new_page()
        page.set_default_timeout(20_000)
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        if person:
            log_in(page, url, person, {"maria": MARIA, "otto": OTTO}[person])
            page.wait_for_url(f"{url}/")
            if path != "/":
                page.goto(url + path)
        yield page
        assert [each for each in complaints if not expected or expected not in each] == []
    finally:
        context.close()


def log_in(page: Page, url: str, person: str, password: str) -> None:
    page.goto(f"{url}/login")
    page.fill("[name=name]", person)
    page.fill("[name=password]", password)
    page.get_by_role("button", name="Log in").click()


def stand_still(plant: PagePlant) -> None:
    seen(lambda: all(plant.simulator.drive(unit).state == "stopped" for unit in (1, 2)))


def test_a_motor_is_run_and_stopped(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url, path="/drive/pump") as page:
        page.get_by_role("button", name="Run forward…").click()
        expect(page.get_by_role("status").first).to_contain_text("Give the speed in Hz first")
        page.get_by_label("Speed in Hz").fill("20")
        page.get_by_role("button", name="Run forward…").click()
        dialog = page.get_by_role("dialog")
        expect(dialog).to_contain_text("Run pump forward at 20 Hz?")
        page.keyboard.press("Escape")
        expect(dialog).to_be_hidden()
        assert FORWARD not in plant.told()
        page.get_by_role("button", name="Run in reverse…").click()
        expect(dialog).to_contain_text("Run pump in REVERSE at 20 Hz?")
        dialog.get_by_role("button", name="Run in reverse").click()
        expect(page.locator("#told li span").first).to_have_text("pump: run: done")
        expect(page.locator(".speed")).to_have_text("20.00 Hz")
        expect(page.locator("[data-of=state]")).to_have_text("reverse")
        expect(page.locator("[data-of=by]")).to_have_text("set in motion by maria")
        assert plant.told().count(REVERSE) == 1
        # A stop stays in reach where a question is open, and closes it.
        page.get_by_role("button", name="Coast…").click()
        dialog.get_by_role("button", name="Stop pump").click()
        expect(dialog).to_be_hidden()
        expect(page.locator("#told")).to_contain_text("pump: stop: done")
        expect(page.locator("[data-of=state]")).to_have_text("stopped")
        expect(page.locator("[data-of=by]")).to_be_hidden()
        assert plant.told()[-1] == STOP
        expect(page.locator("tbody[data-events]")).to_contain_text("now stopped")
        expect(page.locator("tbody[data-events]")).to_contain_text(
            "maria at 127.0.0.1 by the page of maria: stop: done"
        )
    stand_still(plant)


def test_the_curve_of_a_value(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url, path="/drive/pump") as page:
        picture = page.get_by_role("img", name="running_frequency of pump, last 1 h")
        expect(picture).to_have_count(1)
        page.get_by_label("And").select_option("bus_voltage")
        page.get_by_label("Hours").select_option("24")
        other = page.get_by_role("img", name="bus_voltage of pump, last 24 h")
        expect(other).to_have_attribute("aria-label", re.compile(r"from \d+.* to \d+.* V"))
        drawn = "canvas => { const d = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        drawn += " return d.some((each) => each > 0); }"
        assert other.locator("canvas").first.evaluate(drawn)


def test_all_are_stopped_at_one_touch_from_every_page(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url, viewport={"width": 320, "height": 480}) as page:
        for path in ("/drive/fan", "/events", "/"):
            page.goto(plant.url + path)
            before = plant.told(2).count(STOP)
            page.mouse.wheel(0, 100_000)
            button = page.get_by_role("button", name="Stop all")
            expect(button).to_be_in_viewport()
            button.click()
            seen(lambda before=before: plant.told(2).count(STOP) > before)  # type: ignore[misc]
            expect(page.locator("#told")).to_contain_text("fan: stop: done")


def test_a_drive_that_is_gone_has_no_values(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url) as page:
        ghost, meter = page.locator("[data-drive=ghost]"), page.locator("[data-drive=meter]")
        expect(ghost.locator("[data-of=quality]")).to_contain_text("GONE")
        expect(ghost.locator(".speed")).to_have_text(NOTHING)
        expect(page.locator("[data-line=hall] [data-of=late]")).to_contain_text("ghost")
        expect(page.locator("[data-line=hall] [data-of=hints]")).to_contain_text("unit 9")
        expect(page.locator("[data-line=hall] [data-of=share]")).to_contain_text("% of its time used")
        expect(meter).to_contain_text("Cannot be stopped from here: it is read_only")
        expect(meter.locator(".speed")).to_have_text("0.00 Hz")
        plant.simulator.drive(3).refuse(asked="reads")
        expect(meter.locator("[data-of=quality]")).to_contain_text("GONE")
        expect(meter.locator(".speed")).to_have_text(NOTHING)
        plant.simulator.drive(3).refuse_no_more()
        expect(meter.locator(".speed")).to_have_text("0.00 Hz")


def test_who_looks_has_no_orders(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url, "otto") as page:
        expect(page.locator("[data-drive=pump] .speed")).to_have_text("0.00 Hz")
        expect(page.get_by_role("button")).to_have_text(["Log out"])
        page.goto(f"{plant.url}/drive/pump")
        expect(page.locator("[data-values] tr").first).to_contain_text("running_frequency")
        expect(page.get_by_role("button")).to_have_text(["Log out"])


def test_without_script_it_shows_and_stops(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url, java_script_enabled=False) as page:
        assert re.fullmatch(r"\d\.\d s ago", page.locator("[data-drive=pump] [data-of=quality]").inner_text())
        assert page.locator("[data-drive=pump] .speed").inner_text() == "0.00 Hz"
        assert page.locator('meta[http-equiv="refresh"]').get_attribute("content") == "5"
        before = plant.told().count(STOP)
        page.get_by_role("button", name="Stop pump").click()
        assert page.locator(".results").inner_text() == "pump: stop: done"
        assert plant.told().count(STOP) == before + 1
        page.get_by_role("link", name="Back").click()
        assert page.url == f"{plant.url}/"


def test_it_is_used_by_keys_alone(browser: Browser, plant: PagePlant) -> None:
    with at(browser, plant.url) as page:
        before = plant.told().count(STOP)
        page.keyboard.press("Tab")
        expect(page.get_by_role("button", name="Stop all")).to_be_focused()
        page.keyboard.press("Enter")
        seen(lambda: plant.told().count(STOP) > before)
        page.get_by_role("link", name="pump", exact=True).focus()
        page.keyboard.press("Enter")
        page.wait_for_url(f"{plant.url}/drive/pump")
        page.get_by_label("Speed in Hz").focus()
        page.keyboard.type("5")
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        # Who presses once more has said no.
        expect(page.get_by_role("dialog")).to_be_visible()
        page.keyboard.press("Enter")
        expect(page.get_by_role("dialog")).to_be_hidden()
        assert plant.told().count(FORWARD) == 0


@pytest.mark.parametrize(
    ("scheme", "width", "scale"),
    # The last one is 1280 px at 200 %.
    [("light", 1280, 1), ("dark", 320, 1), ("light", 640, 2)],
)
def test_everybody_can_read_it(browser: Browser, plant: PagePlant, scheme: str, width: int, scale: int) -> None:
    found: list[tuple[str, str]] = []
    size: dict[str, Any] = {"viewport": {"width": width, "height": 480}, "device_scale_factor": scale}
    with at(browser, plant.url, color_scheme=scheme, **size) as page:

        def look(where: str) -> None:
            wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide == 0, where
            wrong = Axe().run(page).response["violations"] if scale == 1 else []
            found.extend((each["id"], where) for each in wrong if each["impact"] in SERIOUS)

        for path in ("/", "/events", "/drive/pump"):
            page.goto(plant.url + path)
            if path == "/drive/pump":
                expect(page.locator("#trend .picture")).to_be_visible()
            look(path)
        page.get_by_label("Speed in Hz").fill("5")
        page.get_by_role("button", name="Run forward…").click()
        look("dialog")
    assert found == []


def test_it_is_light_and_asks_nobody_else(browser: Browser, plant: PagePlant) -> None:
    """All that a browser that comes for the first time loads to see the curves of a drive."""
    with at(browser, plant.url) as page:
        answers: list[Response] = []
        page.on("response", lambda answer: answers.append(answer))
        page.context.new_cdp_session(page).send("Network.clearBrowserCache")
        page.goto(f"{plant.url}/drive/pump")
        expect(page.locator("#trend .picture")).to_be_visible()
        weights = {answer.url: len(answer.body()) for answer in answers if not answer.url.endswith(("/live", "/here"))}
    assert {url.partition("/static/")[2] for url in weights} >= {"page.js", "page.css", "dygraph.min.js", "trend.js"}
    assert all(url.startswith(f"{plant.url}/") for url in weights)
    assert sum(weights.values()) <= LARGEST, weights


@pytest.fixture
def evil() -> Iterator[tuple[str, list[str]]]:
    """Another site, which has the page of the day."""
    pages: list[str] = [""]

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = pages[-1].encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Says nothing."""

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield f"http://localhost:{server.server_port}", pages
        server.shutdown()
        serving.join()


ATTACK = """<!doctype html><title>trying</title>
<form id=f method=post action="{url}/order" target=there>
<input name=what value=stop_all><input name=form_token value=x></form>
<iframe name=there></iframe><iframe src="{url}/"></iframe><img src="{url}/trend/pump?value=speed">
<script>
(async () => {{
  const came = [], credentials = "include", body = new URLSearchParams("what=stop_all");
  for (const mode of ["cors", "no-cors"]) for (const path of ["/", "/trend/pump?value=speed", "/live"]) {{
    await fetch("{url}" + path, {{ mode, credentials }})
      .then((got) => got.text()).then((text) => text && came.push(text), () => 0);
  }}
  for (const path of ["/order", "/here", "/logout"]) {{
    await fetch("{url}" + path, {{ method: "POST", mode: "no-cors", credentials, body }}).catch(() => 0);
  }}
  const stream = new EventSource("{url}/live", {{ withCredentials: true }});
  await new Promise((done) => {{
    stream.onmessage = (event) => {{ came.push(event.data); done(); }};
    stream.onerror = done;
  }});
  stream.close();
  document.getElementById("f").submit();
  await new Promise((done) => {{ document.getElementsByName("there")[0].onload = done; }});
  document.body.dataset.came = JSON.stringify(came);
  document.title = "tried";
}})();
</script>"""


def test_another_site_reads_and_orders_nothing(
    browser: Browser, made_up: tuple[Plant, Web], evil: tuple[str, list[str]]
) -> None:
    plant, _ = made_up
    other, pages = evil
    pages.append(ATTACK.format(url=plant.url))
    context = browser.new_context()
    try:
        page = context.new_page()
        log_in(page, plant.url, "maria", MARIA)
        page.wait_for_url(f"{plant.url}/")
        page.goto(other)
        expect(page).to_have_title("tried")
        assert page.evaluate("document.body.dataset.came") == "[]"
        # What is followed from elsewhere leads to the log-in, for the cookie stays at home.
        page.goto(f"{plant.url}/")
        expect(page.locator("[data-drive=pump]")).to_have_count(1)
    finally:
        context.close()
    assert not plant.stopped
    assert not plant.orders


def test_what_a_drive_says_is_no_script(browser: Browser, made_up: tuple[Plant, Web]) -> None:
    plant, _ = made_up
    with at(browser, plant.url) as page:
        ran: list[Dialog] = []
        page.on("dialog", lambda dialog: ran.append(dialog))
        for path in ("/", "/drive/pump", "/events"):
            page.goto(plant.url + path)
            if path != "/events":
                # As the server wrote it, and as the stream put it in anew.
                page.evaluate("document.querySelector('[data-of=fault]').textContent = ''")
                expect(page.locator("[data-of=fault]").first).to_contain_text(EVIL[:25])
            expect(page.locator("main")).to_contain_text("<script>alert(1)</script>")
            assert page.locator("main img").count() == page.locator("main script").count() == 0
        assert ran == []


def test_all_is_old_when_the_service_is_gone(browser: Browser, made_up: tuple[Plant, Web]) -> None:
    plant, web = made_up
    context = browser.new_context()
    try:
        page = context.new_page()
        log_in(page, plant.url, "maria", MARIA)
        page.goto(f"{plant.url}/drive/pump")
        expect(page.locator("[data-of=quality]")).to_have_text(re.compile(r"^\d\.\d s ago$"))
        expect(page.locator("#lost")).to_be_hidden()
        web.close()
        expect(page.locator("[data-of=quality]")).to_contain_text("OLD", timeout=5_000)
        expect(page.locator("#lost")).to_contain_text("No word from the service")
        expect(page.locator("[data-values] td.old-at")).to_contain_text("OLD")
        expect(page.locator("[data-values] td.value")).to_have_class(re.compile("old"))
        page.get_by_role("button", name="Stop pump").click()
        expect(page.locator("#told")).to_contain_text("NOT KNOWN whether it was done")
    finally:
        context.close()
    assert not plant.orders


def test_who_is_logged_out_elsewhere_is_out(browser: Browser, made_up: tuple[Plant, Web]) -> None:
    plant, _ = made_up
    with at(browser, plant.url) as page:
        other = page.context.new_page()
        other.goto(f"{plant.url}/events")
        other.get_by_role("button", name="Log out").click()
        page.wait_for_url(f"{plant.url}/login")
        page.go_back()
        expect(page.get_by_role("button", name="Log in")).to_be_visible()


def test_a_session_that_nobody_uses_ends(
    browser: Browser, made_up: tuple[Plant, Web], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant, _ = made_up
    # Whatever it was about to ask for.
    with at(browser, plant.url, expected="401") as page:
        monkeypatch.setattr(sessions, "IDLE", -1.0)
        page.wait_for_url(f"{plant.url}/login")


def test_ten_wrong_passwords(browser: Browser, made_up: tuple[Plant, Web]) -> None:
    plant, _ = made_up
    context = browser.new_context()
    try:
        page = context.new_page()
        for turn in range(10):
            log_in(page, plant.url, "maria", f"wrong {turn}")
        expect(page.get_by_role("alert")).to_contain_text(re.compile("Try again in|is wrong"))
        assert sum("failed" in text for text in plant.heard) < 10, "not all of them were looked at"
    finally:
        context.close()


def test_a_motor_is_halted_when_its_page_is_closed(browser: Browser, tmp_path: Path) -> None:
    with page_plant(tmp_path, dead_man=3) as plant:
        with at(browser, plant.url, path="/drive/pump") as page:
            page.get_by_label("Speed in Hz").fill("20")
            page.get_by_role("button", name="Run forward…").click()
            page.get_by_role("dialog").get_by_role("button", name="Run forward").click()
            expect(page.locator(".speed")).to_have_text("20.00 Hz")
            # For longer than the dead man waits, the page says that somebody is there.
            signs: list[str] = []
            page.on("request", lambda request: signs.append(request.url) if request.url.endswith("/here") else None)
            expect(page.locator("[data-of=state]")).to_have_text("forward")
            while len(signs) < 4:
                page.wait_for_timeout(50)
            assert STOP not in plant.told()
        seen(lambda: plant.told()[-1] == STOP)
        seen(lambda: any("gave no sign of life for 3 s" in text for text in plant.heard))
