"""A server for the built page: its files and nothing else, read-only."""

import errno
import shutil
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from deeplight.demo.site import HASHED, Site, content_policy, content_type, tag_of
from deeplight.errors import ConfigError

IDLE_S = 30
"""A connection that says nothing for so long is closed."""

LONGEST_ADDRESS = 1024
METHODS = ("GET", "HEAD")

PERMISSIONS = (
    "camera=(self), gyroscope=(self), accelerometer=(self), magnetometer=(self), "
    "microphone=(), geolocation=(), payment=(), usb=()"
)


class DemoServer(ThreadingHTTPServer):
    """Serves one site until it is stopped.

    Args:
        site: the files.
        host: address to listen at.
        port: 0 takes any free one; `port` tells which.

    Raises:
        ConfigError: the port is taken or not allowed, or there is no such address here.
    """

    daemon_threads = True
    # On Linux this allows a quick restart; on Windows it would let two servers share a port.
    allow_reuse_address = True

    def __init__(self, site: Site, host: str = "127.0.0.1", port: int = 0) -> None:
        self.site = site
        self.tags = {name: tag_of(path) for name, path in site.files.items()}
        self.policy = content_policy()
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise _cannot_listen(host, port, error) from error

    @property
    def port(self) -> int:
        """The port it listens at."""
        return int(self.server_address[1])

    @property
    def url(self) -> str:
        """The address to open on this machine."""
        host = str(self.server_address[0])
        return f"http://{'127.0.0.1' if host == '0.0.0.0' else host}:{self.port}/"

    def server_bind(self) -> None:
        # The standard one also looks up this machine's name, which can take seconds.
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = str(self.server_address[0]), self.port

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser that went away in the middle is no news."""


class _Handler(BaseHTTPRequestHandler):
    server: DemoServer
    server_version, sys_version = "DeepLight", ""
    protocol_version = "HTTP/1.1"
    timeout = IDLE_S

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def __getattr__(self, name: str) -> Any:
        # Any other method, known or made up. Its body is not read: the connection ends here.
        if name.startswith("do_"):
            return self._refuse_method
        raise AttributeError(name)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Keep the terminal quiet."""

    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", self.server.policy)
        self.send_header("Permissions-Policy", PERMISSIONS)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        super().end_headers()

    def _answer(self, with_body: bool) -> None:
        if len(self.path) > LONGEST_ADDRESS:
            self._refuse(HTTPStatus.REQUEST_URI_TOO_LONG)
            return
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)  # nothing here takes an upload
            return
        name = unquote(urlsplit(self.path).path).removeprefix("/") or "index.html"
        path = self.server.site.files.get(name)
        if path is None:
            self._refuse(HTTPStatus.NOT_FOUND)
        elif self.server.tags[name] in self.headers.get("If-None-Match", ""):
            self._send_head(name, HTTPStatus.NOT_MODIFIED, None)
        else:
            self._send_file(name, path, with_body)

    def _send_file(self, name: str, path: Path, with_body: bool) -> None:
        try:
            file = path.open("rb")
        except OSError:  # built anew, or taken away, while we serve
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        with file:
            length = file.seek(0, 2)
            file.seek(0)
            self._send_head(name, HTTPStatus.OK, length)
            if with_body:
                shutil.copyfileobj(file, self.wfile)

    def _send_head(self, name: str, status: HTTPStatus, length: int | None) -> None:
        self.send_response(status)
        for_ever = name.startswith(HASHED)
        self.send_header(
            "Cache-Control", "public, max-age=31536000, immutable" if for_ever else "no-cache"
        )
        self.send_header("ETag", self.server.tags[name])
        if length is not None:
            self.send_header("Content-Type", content_type(name))
            self.send_header("Content-Length", str(length))
        self.end_headers()

    def _refuse_method(self) -> None:
        self._refuse(HTTPStatus.METHOD_NOT_ALLOWED)

    def _refuse(self, status: HTTPStatus) -> None:
        text = f"{status.value} {status.phrase}\n".encode()
        self.close_connection = True
        self.send_response(status)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", ", ".join(METHODS))
        self.send_header("Content-Type", "text/plain; charset=utf-8")
        self.send_header("Content-Length", str(len(text)))
        self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(text)


def _cannot_listen(host: str, port: int, error: OSError | OverflowError) -> ConfigError:
    number = getattr(error, "errno", None)
    if number == errno.EADDRINUSE:
        return ConfigError("a free port", f"{port}, which is in use", "give another with --port")
    if number in (errno.EACCES, errno.EPERM):
        return ConfigError("a port we may use", f"{port}", "give one above 1023 with --port")
    if isinstance(error, OverflowError):
        return ConfigError("a port from 0 to 65535", f"{port}", "correct --port")
    return ConfigError("an address of this machine", f"{host}", "correct --host")
