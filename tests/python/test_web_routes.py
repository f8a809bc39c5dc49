"""The page over real sockets, before a plant that is made up: who gets what, and who may order what."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from .made_up_plant import EVIL, Plant, made_up, order, token_of
from .page_plant import MARIA, OTTO
from .tcp_client import seen

GETS = ["/", "/drive/pump", "/drive/nobody", "/events", "/live", "/trend/pump?value=speed", "/nowhere", "/login/x"]
POSTS = ["/order", "/here", "/logout", "/", "/live", "/nowhere"]
FILES = ["page.css", "page.js", "orders.js", "trend.js", "dygraph.min.js", "dygraph.min.css", "icon.svg"]


@pytest.fixture
def plant() -> Iterator[Plant]:
    with made_up() as (plant, _):
        yield plant


def test_nobody_gets_anything_without_a_log_in(plant: Plant) -> None:
    forged = {"cookie": f"drivebus-{plant.port}={'A' * 43}"}
    with plant.client() as client:
        for headers in ({}, forged, {"accept": "text/html"}):
            for path in GETS:
                answer = client.get(path, headers=headers)
                if "accept" in headers:
                    assert (answer.status_code, answer.headers["location"]) == (303, "/login"), path
                else:
                    assert answer.status_code == 401, path
                assert "pump" not in answer.text
            for path in POSTS:
                assert client.post(path, data={"what": "stop_all"}, headers=headers).status_code == 401, path
        assert client.get("/login").status_code == 200
        assert all(client.get(f"/static/{name}").status_code == 200 for name in FILES)
    assert plant.looks == 0
    assert not plant.orders
    assert not plant.stopped


def test_who_looks_orders_nothing(plant: Plant) -> None:
    with plant.client("otto", OTTO) as client:
        for path in ("/", "/drive/pump", "/events"):
            page = client.get(path)
            assert page.status_code == 200
            assert 'action="/order"' not in page.text
            assert "data-what" not in page.text
        token = token_of(client)
        for what in ("run", "stop", "coast", "reset", "setpoint", "stop_all", ""):
            assert order(client, token, what=what, hz="5").status_code == 403
        assert client.post("/here", data={"form_token": token}).status_code == 204
    assert not plant.orders
    assert not plant.stopped


def test_every_page_says_what_a_browser_may_do_with_it(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        for path in ("/", "/drive/pump", "/events", "/login", "/static/page.js", "/nowhere", "/trend/pump?hours=2"):
            headers = client.get(path).headers
            policy = headers["content-security-policy"]
            assert "default-src 'self'" in policy
            assert "unsafe" not in policy
            assert "frame-ancestors 'none'" in policy
            assert headers["x-content-type-options"] == "nosniff"
            assert headers["cache-control"] == ("no-cache" if path.startswith("/static") else "no-store")
            assert "server" not in headers
        for path in ("/", "/drive/pump", "/drive/fan", "/events"):
            text = client.get(path).text
            assert not re.search(r"(?:src|href|action)=\"(?:https?:)?//", text)
            assert not re.search(r"<[^>]*\s(?:style|on\w+)=|<style", text), "nothing within that the policy would block"


def test_what_drives_say_is_text(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        token = token_of(client)
        texts = [client.get(path).text for path in ("/", "/drive/pump", "/drive/fan", "/events")]
        refused = client.post(
            "/order",
            data={"form_token": token, "drive": "pump", "what": "run", "hz": "13"}
            | {"number": "0" * 32, "seen": str(time.time())},
        )
        texts.append(refused.text)
        texts.append(client.post("/order", data={"form_token": token, "drive": EVIL, "what": EVIL}).text)
    assert refused.status_code == 409
    for text in texts:
        assert "&lt;script&gt;" in text
        assert "<script>" not in text
        assert "<img" not in text
        assert "\x1b" not in text
        assert "\u202e" not in text


def test_orders_are_carried_out_once_and_by_their_rules(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        token = token_of(client)
        assert order(client, token, 1, what="run", hz="20.5", reverse="1").json()[0]["result"] == "done"
        told = plant.orders.pop()
        assert told[:6] == ("pump", "run", 20.5, True, "maria", "127.0.0.1")
        assert 0 < told.until - time.monotonic() <= 2.0
        again = order(client, token, 1, what="run", hz="20.5")
        assert (again.status_code, again.json()[0]["result"]) == (409, "not sent")
        for place, fields in enumerate(
            (
                {"what": "run"},
                {"what": "run", "hz": "fast"},
                {"what": "run", "hz": "20", "seen": str(time.time() - 60)},
                {"what": "run", "hz": "20", "seen": ""},
                {"what": "run", "hz": "20", "drive": "nobody"},
                {"what": "jog", "hz": "20"},
                {"what": "$(reboot)", "hz": "20"},
            ),
            2,
        ):
            assert order(client, token, place, **fields).json()[0]["result"] == "not sent", fields
        assert not plant.orders
        for what in ("stop", "coast"):
            assert order(client, token, 1, what=what, seen="", number="").json()[0]["result"] == "done", "always"
        assert [told.what for told in plant.orders] == ["stop", "coast"]
        answer = order(client, token, what="stop_all")
        assert (answer.status_code, [each["result"] for each in answer.json()]) == (409, ["done", "not sent"])
        assert plant.stopped == [("maria", "127.0.0.1")]
        # Without script.
        page = client.post("/order", data={"form_token": token, "drive": "pump", "what": "stop", "from": "drive"})
        assert page.status_code == 200
        assert "pump: stop: done" in page.text
        assert 'href="/drive/pump"' in page.text


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": "http://localhost:1"},
        {"origin": "", "sec-fetch-site": "cross-site"},
    ],
)
def test_another_page_orders_nothing_with_the_cookie(plant: Plant, headers: dict[str, str]) -> None:
    with plant.client("maria", MARIA) as client:
        token = token_of(client)
        for path in ("/order", "/here", "/logout", "/login"):
            data = {"form_token": token, "what": "stop_all", "name": "maria", "password": MARIA}
            assert client.post(path, data=data, headers=headers).status_code == 403
        assert client.get("/live", headers=headers).status_code == 403
        assert client.get("/trend/pump", headers=headers).status_code == 403
        assert client.get("/", headers={"host": "evil.example"}).status_code == 421
    assert not plant.stopped


def test_a_form_of_another_session_or_of_none_is_refused(plant: Plant) -> None:
    with plant.client("maria", MARIA) as one, plant.client("maria", MARIA) as other:
        theirs = token_of(other)
        for token in (theirs, "", "é", theirs[:-1]):
            for path in ("/order", "/here", "/logout"):
                assert one.post(path, data={"form_token": token, "what": "stop_all"}).status_code == 403
        answer = one.post("/order", json={"form_token": token_of(one), "what": "stop_all"})
        assert answer.status_code == 415
    assert not plant.stopped


def test_a_session_is_over_at_its_log_out(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        token = token_of(client)
        cookie = dict(client.cookies)
        assert list(cookie) == [f"drivebus-{plant.port}"]
        assert client.post("/logout", data={"form_token": token}).headers["location"] == "/login"
        assert not client.cookies
        with httpx.Client(base_url=plant.url, headers=client.headers, cookies=cookie) as replayed:
            assert replayed.get("/").status_code == 401
            assert order(replayed, token, what="stop").status_code == 401
        client.post("/login", data={"name": "maria", "password": MARIA})
        assert dict(client.cookies) != cookie, "a new one each time"
    assert not plant.orders


def test_a_stream_ends_with_its_session_and_a_browser_keeps_connections(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client, plant.client("maria", MARIA) as other, ThreadPoolExecutor(6) as pool:
        token, begun = token_of(client), threading.Semaphore(0)

        def listen() -> str:
            with client.stream("GET", "/live") as answer:
                assert answer.headers["content-type"] == "text/event-stream; charset=utf-8"
                text = ""
                for piece in answer.iter_text():
                    if not text:
                        begun.release()
                    text += piece
                return text

        first = pool.submit(listen)
        begun.acquire()
        rest = [pool.submit(listen) for _ in range(4)]
        assert first.result().endswith("event: enough\ndata: \n\n")
        for _ in rest:
            begun.acquire()
        looks = plant.looks
        seen(lambda: plant.looks > looks + 1)
        assert not any(each.done() for each in rest)
        client.post("/logout", data={"form_token": token})
        for each in rest:
            text = each.result()
            assert text.endswith("event: out\ndata: \n\n")
            assert "\ndata: {" in text
            assert "<script>" in text, "as JSON, which a page puts in as text"
        assert other.get("/").status_code == 200
    # Five listened, and one looked at the plant.
    assert plant.looks < 15


def test_ten_wrong_passwords(plant: Plant) -> None:
    with plant.client() as client:
        told = [client.post("/login", data={"name": "maria", "password": f"wrong {turn}"}) for turn in range(10)]
        assert [each.status_code for each in told[:4]] == [403, 403, 403, 429]
        assert all(each.status_code in (403, 429) for each in told)
        late = next(each for each in told if each.status_code == 429)
        assert int(late.headers["retry-after"]) >= 1
        assert "Try again in" in late.text
        assert client.post("/login", data={"name": "otto", "password": OTTO}).status_code in (303, 429)
        unknown = client.post("/login", data={"name": EVIL, "password": "x"})
        assert "<script>" not in unknown.text
    assert not any("wrong 1" in text for text in plant.heard)
