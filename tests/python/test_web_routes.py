"""The page over real sockets, before a plant that is made up: who gets what, and what attackers get."""

from __future__ import annotations

import re
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from drivebus.errors import NotAllowed, PortError
from drivebus.sinks import DrivePicture, LinePicture, Picture
from drivebus.spool import Layout
from drivebus.web import Happened, Person, Shown, ShownDrive, Told, Web, connections, guard, web_context

from .page_plant import MARIA, OTTO, hash_of
from .tcp_client import is_cut_off, seen

EVIL = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>\x1b[2J\u202e"
LAYOUT = Layout("pump", "gd350", ("speed",), ("Hz",), (2,))
ALL = frozenset({"run", "setpoint", "reset", "stop", "coast"})
GETS = ["/", "/drive/pump", "/drive/nobody", "/events", "/live", "/trend/pump?value=speed", "/nowhere", "/login/x"]
POSTS = ["/order", "/here", "/logout", "/", "/live", "/nowhere"]
FILES = ["page.css", "page.js", "orders.js", "trend.js", "dygraph.min.js", "dygraph.min.css", "icon.svg"]


@dataclass
class Plant:
    """A plant that is made up, and what it was told."""

    url: str = ""
    port: int = 0
    orders: list[Told] = field(default_factory=list)
    stopped: list[tuple[str, str]] = field(default_factory=list)
    here: list[str] = field(default_factory=list)
    heard: list[str] = field(default_factory=list)
    looks: int = 0
    breaks: bool = False

    def look(self) -> Picture:
        self.looks += 1
        if self.breaks:
            raise RuntimeError("it broke")
        drive = DrivePicture(1, LAYOUT, time.time(), "", (50,), EVIL, EVIL)
        return Picture(time.time(), (LinePicture("hall", True, {}, (drive,), hints=(EVIL,)),))

    def order(self, told: Told) -> tuple[str, str]:
        self.orders.append(told)
        return ("refused", EVIL) if told.hz == 13 else ("done", "")

    def stop_all(self, person: str, address: str) -> dict[str, tuple[str, str]]:
        self.stopped.append((person, address))
        return {"pump": ("done", ""), "fan": ("not sent", "its line is away")}

    def shown(self) -> Shown:
        drives = [
            ShownDrive("pump", "hall", 1, EVIL, ALL, hold=150.0),
            ShownDrive("fan", "hall", 2, "", why_not=EVIL),
        ]
        return Shown(
            title="plant",
            drives={each.name: each for each in drives},
            people=[Person("maria", hash_of(MARIA), "command"), Person("otto", hash_of(OTTO))],
            look=self.look,
            events=lambda: [Happened(1.0, "pump", "fault", EVIL)],
            order=self.order,
            stop_all=self.stop_all,
            started=dict,
            here=self.here.append,
            tell=self.heard.append,
            dead_man=10.0,
        )

    @contextmanager
    def client(self, person: str = "", password: str = "") -> Iterator[httpx.Client]:
        """A browser of our own, logged in as *person* if there is one."""
        with httpx.Client(base_url=self.url, headers={"origin": self.url}, timeout=20) as client:
            if person:
                answer = client.post("/login", data={"name": person, "password": password})
                assert (answer.status_code, answer.headers["location"]) == (303, "/")
            yield client


@pytest.fixture
def plant() -> Iterator[Plant]:
    made = Plant()
    web = Web("127.0.0.1:0", (), None, made.shown())
    made.url, made.port = f"http://127.0.0.1:{web.port}", web.port
    yield made
    web.close()
    assert not web.serves


def token_of(client: httpx.Client) -> str:
    found = re.search(r'data-token="([^"]+)"', client.get("/").text)
    assert found is not None
    return found[1]


def order(client: httpx.Client, token: str, place: int = 0, **fields: str) -> httpx.Response:
    """An order that a page gives now."""
    about = {"form_token": token, "drive": "pump", "number": f"{place:032x}", "seen": str(time.time())}
    return client.post("/order", data=about | fields, headers={"accept": "application/json"})


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


PATHS = [
    "/static/../app.py",
    "/static/..%2fapp.py",
    "/static/%2e%2e/app.py",
    "/static/..%5capp.py",
    "/static//etc/passwd",
    "/static/%00",
    "/static/page.js%00.css",
    "/static/....//app.py",
    "/static/",
    "/static",
]


@pytest.mark.parametrize("path", PATHS)
def test_no_path_leads_out(plant: Plant, path: str) -> None:
    answer = raw(plant, f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n".encode())
    assert re.match(rb"HTTP/1.1 (401|404|400|307) ", answer), answer[:200]
    assert b"import" not in answer
    assert b"root:" not in answer


def raw(plant: Plant, sent: bytes) -> bytes:
    """What comes for bytes that no browser would send."""
    with socket.create_connection(("127.0.0.1", plant.port), timeout=20) as client:
        client.sendall(sent)
        came = b""
        with suppress(ConnectionResetError):
            while piece := client.recv(65_536):
                came += piece
        return came


HEAD = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\n"


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (HEAD + b"Content-Length: 10000000\r\n\r\n" + b"x" * 10_000, b"413"),
        (HEAD + b"Transfer-Encoding: chunked\r\n\r\n" + b"1000\r\n" + b"x" * 4096 + b"\r\n1\r\nx\r\n0\r\n\r\n", b"413"),
        (HEAD + b"Content-Length: -1\r\n\r\n", b"400"),
        (HEAD + b"Content-Length: 3\r\nContent-Length: 4\r\n\r\nabc", b"400"),
        (HEAD + b"Host: evil.example\r\n\r\n", b"400"),
        (b"GET / HTTP/1.1\r\n\r\n", b"400"),
        (b"GET / HTTP/1.0\r\n\r\n", b"421"),
        (b"GET /" + b"a" * 3_000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n", b"400"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"a" * 20_000 + b"\r\n\r\n", b"4"),
        (b"GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n", b"421"),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"400"),
        (b"\x00" * 1000 + b"\r\n\r\n", b"400"),
        (HEAD + b"Content-Length: 5\r\n\r\n\xff\xfe\x00\x01\x02", b"415"),
        (HEAD + b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 2\r\n\r\n\xff=", b"400"),
        (
            HEAD + b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 100\r\n\r\n" + b"a=1&" * 25,
            b"400",
        ),
    ],
)
def test_what_is_no_request_of_a_browser(plant: Plant, sent: bytes, status: bytes) -> None:
    if not sent.endswith(b"\r\n\r\n") or b"Connection: close" not in sent:
        sent = sent.replace(b"\r\nHost", b"\r\nConnection: close\r\nHost", 1)
    assert raw(plant, sent).startswith(b"HTTP/1.1 " + status)
    with plant.client() as client:
        assert client.get("/login").status_code == 200
    assert plant.heard == []


def test_a_body_of_ten_megabytes_is_not_kept(plant: Plant) -> None:
    with plant.client() as client:
        with suppress(httpx.TransportError):  # It may be cut off while it is sent.
            assert client.post("/login", content=b"x" * 10_000_000).status_code == 413
        assert client.get("/login").status_code == 200


def test_who_says_nothing_or_little_is_cut_off(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "_HEAD_WITHIN", 0.3)
    for begun in (b"", b"GET / HT", HEAD):
        with socket.create_connection(("127.0.0.1", plant.port), timeout=20) as client:
            client.sendall(begun)
            assert is_cut_off(client)
    with socket.create_connection(("127.0.0.1", plant.port), timeout=20) as client:
        client.sendall(b"GET / HTTP/1.1\r\nX: ")
        trickling = threading.Thread(target=trickle, args=(client,))
        trickling.start()
        assert is_cut_off(client)
        trickling.join()


def test_a_body_that_trickles_is_not_waited_for(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "_BODY_WITHIN", 0.3)
    with socket.create_connection(("127.0.0.1", plant.port), timeout=20) as client:
        client.sendall(HEAD + b"Content-Length: 4000\r\n\r\n")
        trickling = threading.Thread(target=trickle, args=(client,))
        trickling.start()
        assert client.recv(12) == b"HTTP/1.1 408"
        client.shutdown(socket.SHUT_RDWR)
        trickling.join()


def trickle(client: socket.socket) -> None:
    """Sends one byte after the other, as long as they are taken."""
    with suppress(OSError):
        while True:
            client.sendall(b"X")
            threading.Event().wait(0.01)


def test_a_thousand_connections_keep_nobody_out(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        token = token_of(client)
        held = []
        try:
            for _ in range(1_000):
                each = socket.create_connection(("127.0.0.1", plant.port), timeout=20)
                each.sendall(b"GET / HTTP/1.1\r\nX: ")
                held.append(each)
            # What it had was idle, and gave way.
            with httpx.Client(base_url=plant.url, headers=client.headers, cookies=client.cookies) as again:
                assert order(again, token, what="stop").json()[0]["result"] == "done"
        finally:
            for each in held:
                each.close()
    assert [told.what for told in plant.orders] == ["stop"]


def test_what_goes_wrong_inside_is_told_and_not_shown(plant: Plant) -> None:
    with plant.client("maria", MARIA) as client:
        plant.breaks = True
        answer = client.get("/")
        assert answer.status_code == 500
        assert "broke" not in answer.text
        seen(lambda: any("RuntimeError: it broke" in text for text in plant.heard))
        plant.breaks = False
        assert client.get("/").status_code == 200


def test_an_address_that_is_taken(plant: Plant) -> None:
    with pytest.raises(PortError, match="nothing can listen there"):
        Web(f"127.0.0.1:{plant.port}", (), None, Plant().shown())


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("tls")
    key, chain = folder / "key.pem", folder / "chain.pem"
    make_certificate(chain, key)
    return chain, key


def make_certificate(chain: Path, key: Path) -> None:
    words = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    words += ["-keyout", str(key), "-out", str(chain), "-days", "2", "-subj", "/CN=localhost"]
    words += ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    subprocess.run(words, check=True, capture_output=True)
    key.chmod(0o600)


def test_over_tls(certificate: tuple[Path, Path]) -> None:
    made = Plant()
    web = Web("127.0.0.1:0", ("localhost",), web_context(*certificate), made.shown())
    made.url = f"https://localhost:{web.port}"
    trusts = ssl.create_default_context(cafile=str(certificate[0]))
    try:
        with httpx.Client(base_url=made.url, headers={"origin": made.url}, verify=trusts) as client:
            answer = client.post("/login", data={"name": "maria", "password": MARIA})
            cookie = answer.headers["set-cookie"]
            assert cookie.startswith("__Host-drivebus=")
            assert {"Secure", "HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
            assert "Domain" not in cookie
            assert client.get("/").status_code == 200
            wrong = {"origin": made.url.replace("https", "http")}
            assert client.post("/login", data={}, headers=wrong).status_code == 403
        assert web_context(*certificate).minimum_version == ssl.TLSVersion.TLSv1_2
        with socket.create_connection(("127.0.0.1", web.port), timeout=20) as plain:
            plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert is_cut_off(plain)
    finally:
        web.close()


def test_a_key_that_cannot_be_used(certificate: tuple[Path, Path], tmp_path: Path) -> None:
    other, locked = tmp_path / "other.pem", tmp_path / "locked.pem"
    make_certificate(tmp_path / "chain.pem", other)
    words = ["openssl", "ec", "-in", str(other), "-out", str(locked), "-aes256", "-passout", "pass:secret"]
    subprocess.run(words, check=True, capture_output=True)
    for chain, key in (
        (certificate[0], other),
        (tmp_path / "chain.pem", locked),
        (certificate[0], tmp_path / "nowhere"),
        (certificate[1], certificate[0]),
    ):
        with pytest.raises(NotAllowed, match="cannot be used"):
            web_context(chain, key)


def test_it_ends_at_once_whoever_listens() -> None:
    """While a stream is open, a request is half there, and somebody does not read."""
    made = Plant()
    web = Web("127.0.0.1:0", (), None, made.shown())
    made.url, made.port = f"http://127.0.0.1:{web.port}", web.port
    with (
        made.client("maria", MARIA) as client,
        client.stream("GET", "/live") as answer,
        socket.create_connection(("127.0.0.1", made.port)) as half,
    ):
        half.sendall(HEAD)
        pieces = answer.iter_text()
        assert next(pieces)
        web.close()
        assert not web.serves
        with suppress(httpx.TransportError):
            assert not any("data: {" in piece for piece in list(pieces)[1:])
