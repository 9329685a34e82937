"""Fetching panoramas, from a stand-in for Poly Haven's API on this machine."""

import ast
import csv
import hashlib
import http.server
import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli import fetch as command
from deeplight.errors import ConfigError, DownloadError
from deeplight.io.radiance import write_hdr
from deeplight.simulate.panorama import load, places_in
from deeplight.simulate.poly_haven import Server, fetch_panoramas, rows_in, rows_of


@dataclass
class Haven:
    """What the stand-in serves, and how badly.

    Attributes:
        content: of each file, by its path.
        answers: of the API, by path.
        breaks_off: how many bytes are sent before the connection is dropped, one item per request.
        requests: path and Range of every request.
    """

    address: str = ""
    content: dict[str, bytes] = field(default_factory=dict)
    answers: dict[str, object] = field(default_factory=dict)
    breaks_off: list[int] = field(default_factory=list)
    status: list[int] = field(default_factory=list)
    knows_ranges: bool = True
    requests: list[tuple[str, str | None]] = field(default_factory=list)
    agents: set[str] = field(default_factory=set)

    def add(self, slug: str, content: bytes, **info: object) -> None:
        self.content[f"/dl/{slug}_1k.hdr"] = content
        entry = {
            "url": f"{self.address}/dl/{slug}_1k.hdr",
            "size": len(content),
            "md5": hashlib.md5(content).hexdigest(),
        }
        self.answers[f"/files/{slug}"] = {"hdri": {"1k": {"hdr": entry}}}
        self.answers[f"/info/{slug}"] = {"name": slug, **info}

    def entry(self, slug: str) -> dict[str, object]:
        return self.answers[f"/files/{slug}"]["hdri"]["1k"]["hdr"]  # type: ignore[index]


def handler(haven: Haven) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            wanted = self.headers.get("Range")
            haven.requests.append((self.path, wanted))
            haven.agents.add(self.headers["User-Agent"])
            if haven.status:
                return self.send_error(haven.status.pop(0))
            if self.path in haven.answers:
                return self.send(200, json.dumps(haven.answers[self.path]).encode())
            if self.path not in haven.content:
                return self.send_error(404)
            content = haven.content[self.path]
            first = int(wanted.split("=")[1].rstrip("-")) if wanted and haven.knows_ranges else 0
            return self.send(206 if first else 200, content[first:])

        def send(self, status: int, content: bytes) -> None:
            self.send_response(status)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            limit = haven.breaks_off.pop(0) if haven.breaks_off and "/dl/" in self.path else None
            self.wfile.write(content[:limit])

        def log_message(self, *words: object) -> None:
            pass

    return Handler


@pytest.fixture
def haven() -> Iterator[Haven]:
    served = Haven()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler(served))
    served.address = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield served
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def panorama(tmp_path: Path) -> bytes:
    radiance = np.random.default_rng(0).uniform(0.1, 3, (64, 128, 3)).astype(np.float32)
    write_hdr(tmp_path / "made.hdr", radiance)
    return (tmp_path / "made.hdr").read_bytes()


def fetch(haven: Haven, folder: Path, *slugs: str) -> Path:
    return fetch_panoramas(rows_of(slugs), folder, Server(haven.address, 5.0, 0.0))


def test_what_is_fetched_can_be_filmed_in(haven: Haven, panorama: bytes, tmp_path: Path) -> None:
    haven.add("a_room", panorama, categories=["Indoor", "urban"])
    haven.add("the_sky", panorama, category="Pure Skies", attributes={"environment": "outdoor"})
    fetch(haven, tmp_path / "hdri", "the_sky", "a_room")
    places = {place.name: place for place in places_in(tmp_path / "hdri")}
    assert places["a_room"].scene == "indoor"
    assert places["the_sky"].scene == "outdoor"
    assert places["the_sky"].synthetic_ground
    assert not places["a_room"].synthetic_ground
    assert "CC0" in places["a_room"].licence
    assert load(places["a_room"]).shape == (64, 128, 3)
    assert all(agent.startswith("deeplight/") for agent in haven.agents)


def test_a_download_that_broke_off_goes_on(haven: Haven, panorama: bytes, tmp_path: Path) -> None:
    haven.add("a_room", panorama)
    haven.breaks_off = [1000, 500]
    fetch(haven, tmp_path, "a_room")
    assert (tmp_path / "a_room.hdr").read_bytes() == panorama
    asked = [wanted for path, wanted in haven.requests if "/dl/" in path]
    assert asked == [None, "bytes=1000-", "bytes=1500-"]
    assert not list(tmp_path.glob("*.part"))


def test_it_goes_on_in_the_next_run_too(haven: Haven, panorama: bytes, tmp_path: Path) -> None:
    haven.add("a_room", panorama)
    haven.breaks_off = [100, 0, 0]
    with pytest.raises(DownloadError, match="broke off"):
        fetch(haven, tmp_path, "a_room")
    assert not (tmp_path / "a_room.hdr").exists()
    fetch(haven, tmp_path, "a_room")
    assert haven.requests[-2][1] == "bytes=100-"
    assert (tmp_path / "a_room.hdr").read_bytes() == panorama
    before = len(haven.requests)
    fetch(haven, tmp_path, "a_room")
    assert len(haven.requests) == before + 1  # only its checksum was asked for


def test_a_server_without_ranges_is_read_from_the_start(
    haven: Haven, panorama: bytes, tmp_path: Path
) -> None:
    haven.add("a_room", panorama)
    haven.knows_ranges, haven.breaks_off = False, [1000]
    fetch(haven, tmp_path, "a_room")
    assert (tmp_path / "a_room.hdr").read_bytes() == panorama


def test_other_bytes_than_announced_are_not_kept(
    haven: Haven, panorama: bytes, tmp_path: Path
) -> None:
    haven.add("a_room", panorama)
    haven.content["/dl/a_room_1k.hdr"] = panorama[:-1] + bytes([panorama[-1] ^ 1])
    with pytest.raises(DownloadError, match="MD5"):
        fetch(haven, tmp_path, "a_room")
    assert [path.name for path in tmp_path.iterdir()] == ["made.hdr"]


def test_no_more_is_written_than_announced(haven: Haven, panorama: bytes, tmp_path: Path) -> None:
    haven.add("a_room", panorama)
    haven.content["/dl/a_room_1k.hdr"] = panorama + bytes(10_000_000)
    fetch(haven, tmp_path, "a_room")
    assert (tmp_path / "a_room.hdr").read_bytes() == panorama


def test_a_passing_fault_is_tried_again_and_a_lasting_one_reported(
    haven: Haven, panorama: bytes, tmp_path: Path
) -> None:
    haven.add("a_room", panorama)
    haven.status = [503, 429]
    fetch(haven, tmp_path, "a_room")
    with pytest.raises(DownloadError, match="404"):
        fetch(haven, tmp_path, "no_such_room")
    assert [path for path, _ in haven.requests].count("/files/no_such_room") == 1


@pytest.mark.parametrize("slug", ["../../etc/passwd", "a/b", "", ".hidden", "a b", "x" * 81, "a\n"])
def test_hostile_names_are_refused(slug: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="name of letters"):
        rows_of([slug])
    manifest = tmp_path / "wanted.csv"
    with manifest.open("w", newline="") as file:
        csv.writer(file).writerows([["slug", "file"], [slug, ".."]])
    with pytest.raises(ConfigError):
        rows_in(manifest)


@pytest.mark.parametrize("url", ["file:///etc/passwd", "ftp://example.org/x", "data:,x", "x"])
def test_only_the_web_is_read(haven: Haven, panorama: bytes, tmp_path: Path, url: str) -> None:
    haven.add("a_room", panorama)
    haven.entry("a_room")["url"] = url
    with pytest.raises(DownloadError, match="web address"):
        fetch(haven, tmp_path, "a_room")
    with pytest.raises(DownloadError, match="web address"):
        Server(url)


@pytest.mark.parametrize(
    "answer", [[], {"hdri": {"1k": {"hdr": {"url": "http://x", "size": -1, "md5": "0" * 32}}}}, {}]
)
def test_a_strange_answer_is_reported_in_one_line(
    haven: Haven, tmp_path: Path, answer: object
) -> None:
    haven.answers["/files/a_room"] = answer
    with pytest.raises(DownloadError) as caught:
        fetch(haven, tmp_path, "a_room")
    assert "\n" not in str(caught.value)


def test_nobody_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DownloadError, match="check the name, the network"):
        fetch_panoramas(rows_of(["a_room"]), tmp_path, Server("http://127.0.0.1:9", 1.0, 0.0))


def test_a_manifest_keeps_its_splits(haven: Haven, panorama: bytes, tmp_path: Path) -> None:
    haven.add("a_room", panorama)
    wanted = tmp_path / "wanted.csv"
    wanted.write_text("slug,split,place,scene\na_room,test,home,indoor\n")
    command.run(command.Args((), tmp_path / "hdri", wanted, api=haven.address))
    (place,) = places_in(tmp_path / "hdri")
    assert (place.split, place.name, place.scene) == ("test", "home", "indoor")
    with pytest.raises(ConfigError, match="neither"):
        command.run(command.Args())
    with pytest.raises(DownloadError):
        command.run(command.Args(("gone",), tmp_path / "new", api=haven.address))
    assert not (tmp_path / "new").exists()  # no folder for nothing


def test_nothing_else_uses_the_network(root: Path) -> None:
    """But for what is asked for by address: a cluster, or a data set elsewhere."""
    network = {"urllib.request", "urllib.error", "http.client", "requests", "httpx"}
    using = set()
    for path in (root / "src" / "deeplight").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if network & set(names):
                using.add(path.name)
    assert using == {"poly_haven.py"}
