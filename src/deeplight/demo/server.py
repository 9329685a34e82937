"""A server for the built page: its files and nothing else, read-only."""

import errno
import io
import ipaddress
import shutil
import socket
import ssl
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import IO, Any
from urllib.parse import unquote, urlsplit

from deeplight.demo.asked import byte_range, gzipped, is_ours, takes_gzip
from deeplight.demo.connections import Connections
from deeplight.demo.site import HASHED, Site, content_policy, content_type, tag_of
from deeplight.errors import ConfigError

IDLE_S = 30
"""A connection that says nothing for so long is closed."""

ASKING_S = 10
"""A request's head must be here by then."""

ANSWER_S = 600
"""And its answer there: the network, over a slow line."""

MOST_CONNECTIONS = 64
LONGEST_ADDRESS = 1024
METHODS = ("GET", "HEAD")

PERMISSIONS = (
    "camera=(self), gyroscope=(self), accelerometer=(self), magnetometer=(self), "
    "microphone=(), geolocation=(), payment=(), usb=()"
)


class DemoServer(ThreadingHTTPServer):
    """A server of one site, until it is stopped.

    Args:
        site: the files.
        host: address to listen at.
        port: 0 takes any free one; `port` says which.
        names: further host names that it may be asked by, such as a tunnel's.
        tls: serve https with it.

    Raises:
        ConfigError: the port is taken or not allowed, or there is no such address here.
    """

    daemon_threads = True
    # On Linux this allows a quick restart; on Windows it would let two servers share a port.
    allow_reuse_address = True
    request_queue_size = 128

    def __init__(
        self,
        site: Site,
        host: str = "127.0.0.1",
        port: int = 0,
        names: Iterable[str] = (),
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self.site, self.tls = site, tls
        self.connections = Connections(MOST_CONNECTIONS)
        self.names = frozenset(name.lower() for name in (host, "localhost", *names))
        if ":" in host:
            self.address_family = socket.AF_INET6
        self.tags = {name: tag_of(path) for name, path in site.files.items()}
        self.policy = content_policy()
        try:
            super().__init__((host, port), _Handler)
            address = ipaddress.ip_address(str(self.server_address[0]).partition("%")[0])
            self.reachable = not address.is_loopback
            if self.reachable:
                self.names |= {self.server_name.lower(), f"{self.server_name.lower()}.local"}
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
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
        scheme = "http" if self.tls is None else "https"
        return f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.port}/"

    def server_bind(self) -> None:
        # The standard one also looks up this machine's full name, which can take seconds.
        if self.address_family == socket.AF_INET6:  # :: lets both kinds in
            self.socket.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = socket.gethostname(), self.port

    def get_request(self) -> tuple[Any, Any]:
        """Take a connection; who asks for https shakes hands later, in a thread of its own."""
        connection, address = super().get_request()
        if self.tls is None:
            return connection, address
        later = self.tls.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)
        return later, address

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, or close it: there are too many."""
        if self.connections.open(request, ASKING_S):
            super().process_request(request, client_address)
        else:
            super().shutdown_request(request)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self.connections.close(request)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Do what is due between two connections, or twice a second."""
        self.connections.end_late_ones()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser that went away in the middle is no news."""


class _Handler(BaseHTTPRequestHandler):
    server: DemoServer
    server_version, sys_version = "DeepLight", ""
    protocol_version = "HTTP/1.1"
    timeout = IDLE_S

    def handle_one_request(self) -> None:
        """Answer a request; the next one on the connection gets its time from here."""
        super().handle_one_request()
        self.server.connections.extend(self.connection, IDLE_S)

    def parse_request(self) -> bool:
        """Read a request's head."""
        # Its first line is here: whoever kept the connection idle gets no longer than others.
        self.server.connections.extend(self.connection, ASKING_S)
        whole = super().parse_request()
        self.server.connections.extend(self.connection, ANSWER_S)
        return whole

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
        if not is_ours(self.headers.get("Host"), self.server.names, self.server.reachable):
            self._refuse(HTTPStatus.MISDIRECTED_REQUEST)
            return
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
            self._send_head(name, HTTPStatus.NOT_MODIFIED, {})
        else:
            self._send_file(name, path, with_body)

    def _send_file(self, name: str, path: Path, with_body: bool) -> None:
        wanted = self.headers.get("Range")
        if self.headers.get("If-Range", self.server.tags[name]) != self.server.tags[name]:
            wanted = None  # a part of another version
        small = None
        try:
            if wanted is None and takes_gzip(self.headers.get("Accept-Encoding", "")):
                small = gzipped(path, self.server.tags[name])
            file: IO[bytes] = path.open("rb") if small is None else io.BytesIO(small)
        except OSError:  # built anew, or taken away, while we serve
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        with file:
            size = file.seek(0, 2)
            try:
                part = None if wanted is None else byte_range(wanted, size)
            except ValueError:
                self._refuse(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, size)
                return
            first, last = part or (0, size - 1)
            fields = {"Content-Length": str(last + 1 - first), "Accept-Ranges": "bytes"}
            if small is not None:
                fields["Content-Encoding"] = "gzip"
            if part is not None:
                fields["Content-Range"] = f"bytes {first}-{last}/{size}"
            status = HTTPStatus.OK if part is None else HTTPStatus.PARTIAL_CONTENT
            self._send_head(name, status, {"Content-Type": content_type(name), **fields})
            if with_body:
                file.seek(first)
                if part is None:
                    shutil.copyfileobj(file, self.wfile)
                else:
                    self.wfile.write(file.read(last + 1 - first))

    def _send_head(self, name: str, status: HTTPStatus, fields: Mapping[str, str]) -> None:
        self.send_response(status)
        for_ever = name.startswith(HASHED)
        self.send_header(
            "Cache-Control", "public, max-age=31536000, immutable" if for_ever else "no-cache"
        )
        self.send_header("ETag", self.server.tags[name])
        self.send_header("Vary", "Accept-Encoding")
        for field, value in fields.items():
            self.send_header(field, value)
        self.end_headers()

    def _refuse_method(self) -> None:
        self._refuse(HTTPStatus.METHOD_NOT_ALLOWED)

    def _refuse(self, status: HTTPStatus, size: int | None = None) -> None:
        text = f"{status.value} {status.phrase}\n".encode()
        self.close_connection = True
        self.send_response(status)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", ", ".join(METHODS))
        if size is not None:
            self.send_header("Content-Range", f"bytes */{size}")
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
