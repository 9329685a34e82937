"""Open the live page: camera or photo in, its light out, all in the browser.

deeplight demo

deeplight demo --https            (for phones of the same network)

deeplight demo --export public    (a folder for any web host)

Nothing that the camera sees leaves the browser. Browsers give the camera only to https pages and to
localhost: docs/serve.md says how to open the page on a phone.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from ssl import SSLContext

LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class Args:
    """Options of `deeplight demo`."""

    port: int = 8765
    """Port to serve at; 0 takes any free one."""
    host: str = "127.0.0.1"
    """Address to serve at; 0.0.0.0 lets the whole network in, :: by IPv6 too."""
    name: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Names that the page may be asked by, besides this machine's: a tunnel's, a proxy's."""
    https: bool = False
    """Serve the local network by https, so that phones give the page their camera. They ask once
    whether to trust the certificate, which is made for this run (needs openssl)."""
    certificate: tuple[Path, Path] | None = None
    """With --https: your own certificate and its key (PEM) instead."""
    open: bool = True
    """Open the browser, when started from a terminal."""
    export: Path | None = None
    """Write the page into this folder instead, for any web host."""
    at: str | None = None
    """With --export: the address that the folder will have, so that links to it show a picture."""


def run(args: Args) -> None:
    """Serve until Ctrl-C, or write the folder."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.demo.https import local_address
    from deeplight.demo.server import DemoServer
    from deeplight.demo.site import Site

    if args.export is not None:
        unused = ("port", "host", "name", "https", "certificate", "open")
        refuse_unused(args, "with --export", *unused)
    else:
        refuse_unused(args, "without --export", "at")
    if not args.https:
        refuse_unused(args, "without --https", "certificate")
    site = Site.installed()
    if args.export is not None:
        count = site.copied(args.export, args.at)
        sys.stdout.write(f"{count} files in {args.export}: put them on any https host\n")
        return
    tls, fingerprint = _certificate(args) if args.https else (None, "")
    host = "0.0.0.0" if args.https and args.host in LOOPBACK else args.host
    with DemoServer(site, host, args.port, args.name, tls) as server:
        sys.stdout.write(f"DeepLight is at {server.url} (Ctrl-C stops it)\n")
        if args.https:
            address = f"https://{local_address()}:{server.port}/"
            sys.stdout.write(f"on a phone of the same network: {address}\n")
            sys.stdout.write(f"it asks about a certificate with the SHA-256 {fingerprint}\n")
        elif host not in LOOPBACK:
            sys.stdout.write("from other machines: photos only, no camera (that needs --https)\n")
        sys.stdout.flush()
        if args.open and sys.stdout.isatty():
            import webbrowser

            webbrowser.open(server.url)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            sys.stdout.write("\nstopped\n")


def _certificate(args: Args) -> "tuple[SSLContext, str]":
    from deeplight.demo.https import context_of, local_address, own_certificate

    if args.certificate is not None:
        return context_of(*args.certificate)
    return own_certificate(local_address())
