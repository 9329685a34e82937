"""The demo's server by https: a phone of the local network may use its camera."""

import http.client
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from deeplight.cli.main import main
from deeplight.demo import https
from deeplight.demo.server import DemoServer
from deeplight.demo.site import Site
from deeplight.errors import ConfigError
from patience import patient

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    (folder / "index.html").write_bytes(b"<!doctype html>")
    return folder


@pytest.fixture(scope="module")
def served(site: Path) -> Iterator[tuple[DemoServer, str]]:
    tls, fingerprint = https.own_certificate(https.local_address())
    with DemoServer(Site.installed(site), tls=tls) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server, fingerprint
        server.shutdown()


def trusting(certificate: str) -> ssl.SSLContext:
    return ssl.create_default_context(cadata=certificate)


def test_a_page_comes_by_https_from_a_certificate_for_this_machine(served) -> None:
    server, fingerprint = served
    assert server.url == f"https://127.0.0.1:{server.port}/"
    certificate = ssl.get_server_certificate(("127.0.0.1", server.port))
    digest = https.hashlib.sha256(ssl.PEM_cert_to_DER_cert(certificate)).hexdigest()
    assert fingerprint.replace(":", "").lower() == digest
    context = trusting(certificate)
    for name in ("127.0.0.1", "localhost"):
        connection = http.client.HTTPSConnection(name, server.port, context=context, timeout=10)
        connection.request("GET", "/")
        answer = connection.getresponse()
        assert (answer.status, answer.read()) == (200, b"<!doctype html>")
    stranger = http.client.HTTPSConnection("127.0.0.1", server.port, timeout=10)
    with pytest.raises(ssl.SSLCertVerificationError):  # nobody vouches for it
        stranger.request("GET", "/")


def test_who_never_shakes_hands_holds_up_nobody(served) -> None:
    server, _ = served
    context = trusting(ssl.get_server_certificate(("127.0.0.1", server.port)))
    silent = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(3)]
    plain = socket.create_connection(("127.0.0.1", server.port))
    plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    started = time.monotonic()
    connection = http.client.HTTPSConnection("127.0.0.1", server.port, context=context, timeout=30)
    connection.request("GET", "/")
    assert connection.getresponse().status == 200
    assert time.monotonic() - started < patient(5)
    assert b"<!doctype" not in plain.recv(1000)  # nothing of the page without TLS
    for one in (*silent, plain):
        one.close()


def test_ones_own_certificate_is_taken_and_a_wrong_one_is_one_line(tmp_path, capsys) -> None:
    certificate, key = tmp_path / "c.pem", tmp_path / "k.pem"
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=a"
    made = [*command.split(), "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(made, check=True, capture_output=True)
    _, fingerprint = https.context_of(certificate, key)
    assert len(fingerprint) == 95
    key.write_text("no key")
    with pytest.raises(ConfigError, match="--certificate"):
        https.context_of(certificate, key)
    words = ["demo", "--certificate", str(certificate), str(key)]
    assert main(words) == 2
    assert "without --https" in capsys.readouterr().err


def test_without_openssl_a_tunnel_is_named(monkeypatch) -> None:
    monkeypatch.setattr(https.shutil, "which", lambda name: None)
    with pytest.raises(ConfigError, match="cloudflared tunnel"):
        https.own_certificate("127.0.0.1")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_command_prints_the_address_for_the_phone_and_the_fingerprint() -> None:
    try:
        Site.installed()
    except ConfigError:
        pytest.skip("the page is not built")
    command = [sys.executable, "-m", "deeplight", "demo", "--https", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline() for _ in range(3)]
        process.terminate()
    assert lines[0].startswith("DeepLight is at https://127.0.0.1:")
    assert f"https://{https.local_address()}:" in lines[1]
    assert "SHA-256" in lines[2]
    assert len(lines[2].split()[-1]) == 95
