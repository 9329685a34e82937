"""The demo's server gives its files and nothing else, whatever it is asked."""

import contextlib
import gzip
import http.client
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from built_page import FILES, SECRET, write_site
from deeplight.demo.server import DemoServer
from deeplight.demo.site import MODEL, Site, content_policy
from deeplight.errors import ConfigError
from deeplight.estimators.onnx import shipped_model
from patience import patient


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_site(tmp_path)


@pytest.fixture
def server(folder: Path) -> Iterator[DemoServer]:
    with serving(DemoServer(Site.installed(folder))) as running:
        yield running


@contextmanager
def serving(server: DemoServer) -> Iterator[DemoServer]:
    with server as running:
        thread = threading.Thread(target=running.serve_forever, args=(0.01,))
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def ask(
    server: DemoServer, address: str, method: str = "GET", headers: dict[str, str] | None = None
) -> tuple[http.client.HTTPResponse, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=patient(10))
    connection.request(method, address, headers=headers or {})
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response, body


def say(server: DemoServer, request: bytes) -> bytes:
    """Send raw bytes; give the whole answer."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=patient(10)) as connection:
        connection.sendall(request)
        answer = b""
        try:
            while part := connection.recv(65536):
                answer += part
        except ConnectionResetError:
            pass  # it stopped listening before we had said everything
        return answer


@pytest.mark.parametrize(
    ("address", "name", "kind"),
    [
        ("/", "index.html", "text/html; charset=utf-8"),
        ("/index.html?from=home", "index.html", "text/html; charset=utf-8"),
        ("/assets/page-1a2b.js", "assets/page-1a2b.js", "text/javascript; charset=utf-8"),
        ("/runtime/ort.wasm", "runtime/ort.wasm", "application/wasm"),
        ("/with%20space.txt", "with space.txt", "text/plain; charset=utf-8"),
    ],
)
def test_files_come_whole_and_with_their_type(
    server: DemoServer, address: str, name: str, kind: str
) -> None:
    response, body = ask(server, address)
    assert (response.status, body) == (200, FILES[name])
    assert response.headers["Content-Type"] == kind
    assert response.headers["Content-Security-Policy"] == content_policy()
    assert response.headers["X-Content-Type-Options"] == "nosniff"


def test_the_network_is_the_installed_one(server: DemoServer) -> None:
    response, body = ask(server, f"/{MODEL}")
    assert body == shipped_model().read_bytes()
    assert response.headers["Content-Type"] == "application/octet-stream"


def test_the_policy_allows_nothing_from_elsewhere_and_no_inline_scripts() -> None:
    rules = dict(rule.strip().split(" ", 1) for rule in content_policy().split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == "'self' 'wasm-unsafe-eval'"
    assert not any("http" in rule or "*" in rule for rule in rules.values())
    assert not any("'unsafe-" in rule for rule in rules.values())


@pytest.mark.parametrize(
    "address",
    [
        "/../secret.txt",
        "/..%2fsecret.txt",
        "/%2e%2e/secret.txt",
        "/%252e%252e%252fsecret.txt",
        "/assets/../../secret.txt",
        "/..\\secret.txt",
        "/%2e%2e%5csecret.txt",
        "//secret.txt",
        "/link.txt",
        "/linked/secret.txt",
        "/etc/passwd",
        "/index.html%00.txt",
        "/assets",
        "/assets/",
        "/.",
        "/..",
        "http://127.0.0.1/../secret.txt",
        "/missing.txt",
    ],
)
def test_nothing_else_is_found(server: DemoServer, address: str) -> None:
    answer = say(
        server, f"GET {address} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode()
    )
    assert answer.startswith(b"HTTP/1.1 404 ")
    assert SECRET not in answer


def test_an_absolute_address_reads_from_the_site_only(server: DemoServer, folder: Path) -> None:
    path = (folder.parent / "secret.txt").as_posix()
    for address in (path, f"/{path}", f"file://{path}"):
        assert SECRET not in say(server, f"GET {address} HTTP/1.0\r\n\r\n".encode())


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PROPFIND", "MADEUP"])
def test_only_reading_is_allowed(server: DemoServer, method: str) -> None:
    response, _ = ask(server, "/", method)
    assert response.status == 405
    assert response.headers["Allow"] == "GET, HEAD"


def test_an_upload_is_refused_before_it_is_read(server: DemoServer) -> None:
    head = b"POST /model/deeplight.onnx HTTP/1.1\r\nHost: x\r\nContent-Length: 9000000000\r\n\r\n"
    assert say(server, head).startswith(b"HTTP/1.1 405 ")
    head = b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9000000000\r\n\r\n"
    assert say(server, head).startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /" + b"a" * 2000 + b" HTTP/1.1\r\n\r\n", b"414"),
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n", b"414"),
        (b"GET / HTTP/1.1\r\n" + b"X: " + b"y" * 70_000 + b"\r\n\r\n", b"431"),
        (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n", b"431"),
        (b"\x16\x03\x01\x02\x00\r\n\r\n", b"400"),
        (b"GET / HTTP/9.9\r\n\r\n", b"505"),
    ],
)
def test_oversized_and_broken_requests_are_refused(
    server: DemoServer, request_: bytes, status: bytes
) -> None:
    answer = say(server, request_)
    assert status in answer[:400] or answer == b""  # closed before it could be answered
    assert ask(server, "/")[0].status == 200  # and the server goes on


def test_head_gives_everything_but_the_file(server: DemoServer) -> None:
    response, body = ask(server, "/", "HEAD")
    assert (response.status, body) == (200, b"")
    assert response.headers["Content-Length"] == str(len(FILES["index.html"]))


def test_an_unchanged_file_is_not_sent_again(server: DemoServer) -> None:
    response, _ = ask(server, "/")
    assert response.headers["Cache-Control"] == "no-cache"
    again, body = ask(server, "/", headers={"If-None-Match": response.headers["ETag"]})
    assert (again.status, body) == (304, b"")
    assert ask(server, "/", headers={"If-None-Match": '"other"'})[0].status == 200
    assert "immutable" in ask(server, "/assets/page-1a2b.js")[0].headers["Cache-Control"]


def test_a_file_that_vanishes_is_not_found(server: DemoServer, folder: Path) -> None:
    (folder / "with space.txt").unlink()
    assert ask(server, "/with%20space.txt")[0].status == 404


def test_one_connection_serves_many_files(server: DemoServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=patient(10))
    for address in ("/", "/runtime/ort.wasm", "/"):
        connection.request("GET", address)
        assert connection.getresponse().read() in FILES.values()
    connection.close()


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1", 200),
        ("127.0.0.1:8765", 200),
        ("LOCALHOST:1", 200),
        ("localhost.", 200),
        ("[::1]:8765", 200),
        ("evil.example", 421),
        ("localhost.evil.example", 421),
        ("127.0.0.1.evil.example", 421),
        ("192.168.1.7", 421),  # nobody comes by that address to a server of this machine alone
        ("user@localhost", 421),
        ("", 421),
        ("tunnel.example", 421),
    ],
)
def test_a_page_elsewhere_cannot_pass_for_ours(server: DemoServer, host: str, status: int) -> None:
    response, body = ask(server, "/", headers={"Host": host})
    assert response.status == status
    assert (body == FILES["index.html"]) == (status == 200)


def test_a_server_for_others_is_asked_by_its_addresses_and_names(folder: Path) -> None:
    with serving(DemoServer(Site.installed(folder), "0.0.0.0", 0, ["Tunnel.Example"])) as server:
        for host in ("192.168.1.7:8765", "tunnel.example", socket.gethostname(), "localhost"):
            assert ask(server, "/", headers={"Host": host})[0].status == 200
        assert ask(server, "/", headers={"Host": "evil.example"})[0].status == 421


@pytest.mark.parametrize(
    ("asked", "first", "last"),
    [("bytes=0-4", 0, 4), ("bytes=5-", 5, 38), ("bytes=-4", 35, 38), ("bytes=30-999", 30, 38)],
)
def test_a_part_of_a_file_comes_alone(
    server: DemoServer, asked: str, first: int, last: int
) -> None:
    whole = FILES["index.html"]
    response, body = ask(server, "/", headers={"Range": asked})
    assert (response.status, body) == (206, whole[first : last + 1])
    assert response.headers["Content-Range"] == f"bytes {first}-{last}/{len(whole)}"
    tag = response.headers["ETag"]
    assert ask(server, "/", headers={"Range": asked, "If-Range": tag})[0].status == 206
    assert ask(server, "/", headers={"Range": asked, "If-Range": '"old"'})[1] == whole


def test_other_ranges_give_the_whole_or_are_refused(server: DemoServer) -> None:
    for asked in ("bytes=4-2", "bytes=0-1,3-4", "lines=1-2", "bytes=-", "nonsense"):
        response, body = ask(server, "/", headers={"Range": asked})
        assert (response.status, body) == (200, FILES["index.html"])
    response, _ = ask(server, "/", headers={"Range": "bytes=39-"})
    assert (response.status, response.headers["Content-Range"]) == (416, "bytes */39")


def test_text_comes_compressed_where_that_is_asked_for(folder: Path) -> None:
    text = b"const light = 1;\n" * 500
    (folder / "assets/long-3c4d.js").write_bytes(text)
    with serving(DemoServer(Site.installed(folder))) as server:
        for accepted in ("gzip, deflate, br", "br;q=1.0, gzip;q=0.5", "*"):
            response, body = ask(
                server, "/assets/long-3c4d.js", headers={"Accept-Encoding": accepted}
            )
            assert response.headers["Content-Encoding"] == "gzip"
            assert gzip.decompress(body) == text
            assert len(body) < len(text) / 10
            assert response.headers["Vary"] == "Accept-Encoding"
        for accepted in ("br", "gzip;q=0", ""):
            response, body = ask(
                server, "/assets/long-3c4d.js", headers={"Accept-Encoding": accepted}
            )
            assert response.headers["Content-Encoding"] is None
            assert body == text
        response, _ = ask(server, "/", headers={"Accept-Encoding": "gzip"})
        assert response.headers["Content-Encoding"] is None  # too short to gain


def test_there_is_a_cap_on_connections(server: DemoServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server.connections, "_most", 3)
    held = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(3)]
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        ask(server, "/")
    for connection in held:
        connection.close()
    answered = False
    until = time.monotonic() + patient(5)
    while time.monotonic() < until:
        with contextlib.suppress(http.client.HTTPException, ConnectionError):
            answered = ask(server, "/")[0].status == 200
        if answered:
            return
        time.sleep(0.05)
    raise AssertionError("it never took connections again")


def test_who_asks_too_slowly_is_cut_off(
    server: DemoServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deeplight.demo.server.ASKING_S", 0.3)
    monkeypatch.setattr("deeplight.demo.server.IDLE_S", 0.3)
    for start in (b"", b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"):  # at once, or later
        with socket.create_connection(
            ("127.0.0.1", server.port), timeout=patient(10)
        ) as connection:
            connection.sendall(start)
            began = time.monotonic()
            with contextlib.suppress(ConnectionError):
                while time.monotonic() < began + patient(8):
                    connection.sendall(b"G")
                    time.sleep(0.02)
            assert time.monotonic() - began < patient(5)


def test_it_serves_by_ipv6(folder: Path) -> None:
    try:
        server = DemoServer(Site.installed(folder), "::1")
    except ConfigError:
        pytest.skip("this machine has no IPv6")
    with serving(server):
        assert server.url == f"http://[::1]:{server.port}/"
        connection = http.client.HTTPConnection("::1", server.port, timeout=patient(10))
        connection.request("GET", "/")
        assert connection.getresponse().read() == FILES["index.html"]


def test_a_port_in_use_is_reported(server: DemoServer, folder: Path) -> None:
    with pytest.raises(ConfigError, match=f"got {server.port}, which is in use; give another"):
        DemoServer(Site.installed(folder), port=server.port)


@pytest.mark.parametrize(
    ("host", "port", "line"),
    [
        ("127.0.0.1", 99_999, "a port from 0 to 65535"),
        ("203.0.113.1", 0, "an address of this machine; got 203.0.113.1"),
        ("no.such.host.invalid", 0, "an address of this machine"),
    ],
)
def test_an_impossible_address_is_reported(folder: Path, host: str, port: int, line: str) -> None:
    with pytest.raises(ConfigError, match=line):
        DemoServer(Site.installed(folder), host, port)
