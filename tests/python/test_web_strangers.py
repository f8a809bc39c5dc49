"""The page over real sockets, and what strangers send: requests that are none, too much, too slowly, and to no end."""

from __future__ import annotations

import re
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from drivebus.errors import NotAllowed, PortError
from drivebus.web import Web, connections, guard, web_context

from .made_up_plant import Plant, made_up, make_certificate, order, token_of
from .page_plant import MARIA
from .tcp_client import is_cut_off, seen


@pytest.fixture
def plant() -> Iterator[Plant]:
    with made_up() as (plant, _):
        yield plant


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
        with suppress(OSError):  # It may have cut that off already.
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
