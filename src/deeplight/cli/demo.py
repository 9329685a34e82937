"""Open the live page: camera or photo in, its light out, all in the browser.

deeplight demo

deeplight demo --export public    (a folder for any web host)

Nothing that the camera sees leaves the browser. Browsers give the camera only to https pages and to
localhost: docs/serve.md says how to open the page on a phone.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

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
    open: bool = True
    """Open the browser, when started from a terminal."""
    export: Path | None = None
    """Write the page into this folder instead, for any web host."""


def run(args: Args) -> None:
    """Serve until Ctrl-C, or write the folder."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.demo.server import DemoServer
    from deeplight.demo.site import Site

    if args.export is not None:
        refuse_unused(args, "with --export", "port", "host", "name", "open")
    site = Site.installed()
    if args.export is not None:
        count = site.copied(args.export)
        sys.stdout.write(f"{count} files in {args.export}: put them on any https host\n")
        return
    with DemoServer(site, args.host, args.port, args.name) as server:
        sys.stdout.write(f"DeepLight is at {server.url} (Ctrl-C stops it)\n")
        if args.host not in LOOPBACK:
            sys.stdout.write("from other machines: photos only, no camera (that needs https)\n")
        sys.stdout.flush()
        if args.open and sys.stdout.isatty():
            import webbrowser

            webbrowser.open(server.url)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            sys.stdout.write("\nstopped\n")
