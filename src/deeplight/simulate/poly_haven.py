"""CC0 panoramas from Poly Haven's public API, for people who are online.

The only part of the program that uses the network. `GET /files/SLUG` gives the address, size and
MD5 of every resolution and format of an HDRI, `GET /info/SLUG` where it was taken
(github.com/Poly-Haven/Public-API). Their terms ask for a user agent of one's own and for the credit
line `CREDIT`. A download that broke off goes on where it was; a file with another checksum than
announced is not kept.
"""

import csv
import hashlib
import re
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from http.client import HTTPException
from importlib.metadata import version
from io import BufferedIOBase
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from deeplight.errors import ConfigError, DownloadError
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json
from deeplight.simulate.panorama import MANIFEST, split_drawn_for

API = "https://api.polyhaven.com"
CREDIT = "Powered by Poly Haven (polyhaven.com); the panoramas are CC0"
FORMATS = ("hdr", "exr")
TIMEOUT_S = 30.0
ATTEMPTS = 3
PAUSE_S = 1.0  # before the second attempt; doubled for the third
LARGEST_ANSWER = 4 * 2**20  # bytes of JSON
LARGEST_FILE = 2 * 2**30

_SLUG = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,79}")
_RESOLUTION = re.compile(r"[1-9][0-9]?k")
_PIECE = 2**18


@dataclass(frozen=True)
class PanoramaRow:
    """One line of the manifest, as `simulate` reads it; empty where it is still to be found out."""

    file: str
    split: str
    place: str
    scene: str
    licence: str
    synthetic_ground: str
    slug: str
    source: str


@dataclass(frozen=True)
class Server:
    """Where panoramas come from.

    Attributes:
        api: base address; another one serves a mirror or a test.
        timeout_s: without a byte for so long, an attempt has failed.
        pause_s: before the second attempt.
    """

    api: str = API
    timeout_s: float = TIMEOUT_S
    pause_s: float = PAUSE_S

    def __post_init__(self) -> None:
        _require_web(self.api)
        if not self.timeout_s > 0:
            raise ConfigError("a timeout above 0 seconds", f"{self.timeout_s}", "correct it")

    def answer(self, path: str) -> dict[str, Any]:
        """Ask the API; raises DownloadError."""
        address = f"{self.api.rstrip('/')}/{path}"
        content = self._attempts(lambda: self._read(address), address)
        try:
            found = parse_json(content)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise DownloadError(f"a JSON object from {address}", "something else", "check --api")
        return found

    def fetch(self, file: "RemoteFile", target: Path, progress: Callable[[int], None]) -> None:
        """Download to `target`, whole or not at all; go on with `<target>.part` if there is one.

        Raises:
            DownloadError: the server does not answer, or what came is not what was announced.
            OSError: the file cannot be written.
        """
        part = target.with_name(target.name + ".part")
        self._attempts(lambda: self._append(file, part, progress), file.url)
        if _md5(part) != file.md5:
            part.unlink()
            expected = f"{target.name} with MD5 {file.md5}"
            raise DownloadError(expected, "other bytes", "run it again, or check --api")
        part.replace(target)

    def _attempts(self, once: Callable[[], Any], address: str) -> Any:
        pause = self.pause_s
        for attempt in range(ATTEMPTS):
            try:
                return once()
            except urllib.error.HTTPError as error:
                reason = f"{error.code} {error.reason}"
                if error.code < 500 and error.code != 429:
                    break  # it would say so again
            except (urllib.error.URLError, HTTPException, TimeoutError, ConnectionError) as error:
                reason = str(getattr(error, "reason", error)) or type(error).__name__
            if attempt < ATTEMPTS - 1:
                time.sleep(pause)
                pause *= 2
        raise DownloadError(
            f"an answer from {address}", reason, "check the name, the network, --api"
        )

    def _open(self, address: str, first_byte: int = 0) -> Any:
        headers = {"User-Agent": f"deeplight/{version('deeplight')}"}
        if first_byte:
            headers["Range"] = f"bytes={first_byte}-"
        return _opener().open(
            urllib.request.Request(address, headers=headers), timeout=self.timeout_s
        )

    def _read(self, address: str) -> bytes:
        with self._open(address) as response:
            content: bytes = response.read(LARGEST_ANSWER + 1)
        if len(content) > LARGEST_ANSWER:
            raise DownloadError(f"a short answer from {address}", "megabytes", "check --api")
        return content

    def _append(self, file: "RemoteFile", part: Path, progress: Callable[[int], None]) -> None:
        have = part.stat().st_size if part.exists() else 0
        if have > file.size:
            part.unlink()
            have = 0
        if have == file.size:
            return
        with self._open(file.url, have) as response:
            goes_on = have > 0 and response.status == 206
            with part.open("ab" if goes_on else "wb") as out:
                _copy(response, out, file, have if goes_on else 0, progress)
        if part.stat().st_size < file.size:
            raise ConnectionError("the connection broke off")


@dataclass(frozen=True)
class RemoteFile:
    """What the API announces of one file."""

    url: str
    size: int
    md5: str


def fetch_panoramas(
    rows: Sequence[PanoramaRow],
    folder: Path,
    server: Server,
    resolution: str = "1k",
    kind: str = "hdr",
    progress: Callable[[str, int, int], None] = lambda slug, size, piece: None,
) -> Path:
    """Fetch every panorama that is not there yet and write the manifest; give its path.

    The manifest is written after each panorama, so that a run cut short has what it fetched.
    Lines of an earlier manifest in the folder stay.

    Args:
        rows: what to fetch, from `rows_of` or `rows_in`.
        resolution: "1k" is 1024 x 512.
        kind: "hdr" or "exr".
        progress: called with a slug, the number of bytes, and how many came.

    Raises:
        ConfigError: a resolution or a format that does not exist.
        DownloadError: the server does not have one, does not answer or sends something else.
        OSError: the folder cannot be written.
    """
    if not _RESOLUTION.fullmatch(resolution) or kind not in FORMATS:
        expected = f"a resolution as 1k or 4k and a format of {', '.join(FORMATS)}"
        raise ConfigError(expected, f"{resolution} {kind}", "correct it")
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / MANIFEST
    done = {row.file: row for row in (rows_in(manifest) if manifest.is_file() else ())}
    for row in rows:
        remote = _announced(server.answer(f"files/{row.slug}"), row.slug, resolution, kind)
        target = folder / f"{row.slug}.{kind}"
        if not (target.is_file() and _md5(target) == remote.md5):
            server.fetch(remote, target, partial(progress, row.slug, remote.size))
        known = done.get(target.name, row)
        done[target.name] = _completed(known, target.name, remote.url, server)
        _write(manifest, done.values())
    return manifest


def rows_of(slugs: Sequence[str]) -> list[PanoramaRow]:
    """What to fetch, by name; the API gives the rest.

    Raises:
        ConfigError: a name that Poly Haven could not have.
    """
    return [
        PanoramaRow("", "", "", "", "", "", _checked(slug), "") for slug in dict.fromkeys(slugs)
    ]


@reads_as(ConfigError)
def rows_in(manifest: Path) -> list[PanoramaRow]:
    """What to fetch, from a CSV with a column `slug`, or `file` named by it; the rest is kept.

    Raises:
        ConfigError: no such table.
        OSError: it cannot be read.
    """
    try:
        with manifest.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"a CSV table in UTF-8 in {manifest}", f"{error}", "repair it") from None
    names = [field.name for field in fields(PanoramaRow)]
    found = []
    for line in lines:
        known = {name: line.get(name) or "" for name in names}
        known["slug"] = _checked(known["slug"] or Path(known["file"]).stem)
        found.append(PanoramaRow(**known))
    if not found:
        raise ConfigError(f"lines with a slug in {manifest}", "none", "add some")
    return found


def _checked(slug: str) -> str:
    """The name becomes part of an address and of a file's name, so it may hold nothing else."""
    if not _SLUG.fullmatch(slug):
        expected = "a Poly Haven name of letters, digits, _ and -"
        raise ConfigError(expected, repr(slug), "copy it from the panorama's address")
    return slug


def _announced(files: dict[str, Any], slug: str, resolution: str, kind: str) -> RemoteFile:
    try:
        stated = files["hdri"][resolution][kind]
        remote = RemoteFile(str(stated["url"]), int(stated["size"]), str(stated["md5"]).lower())
    except (KeyError, TypeError, ValueError):
        got = "no such file announced"
        raise DownloadError(f"{slug} as {resolution} {kind}", got, "choose another") from None
    _require_web(remote.url)
    if not (0 < remote.size <= LARGEST_FILE and re.fullmatch(r"[0-9a-f]{32}", remote.md5)):
        expected = f"a size up to {LARGEST_FILE // 2**30} GiB and an MD5 of {slug}"
        raise DownloadError(expected, f"{remote.size} bytes, {remote.md5!r}", "check --api")
    return remote


def _completed(row: PanoramaRow, file: str, source: str, server: Server) -> PanoramaRow:
    """The manifest's line, with what the API knows where nobody has said it."""
    if row.file == file and row.split and row.place and row.scene and row.licence:
        return row
    info = server.answer(f"info/{row.slug}")
    attributes = info.get("attributes")
    scene = attributes.get("environment") if isinstance(attributes, dict) else None
    categories = [str(c).lower() for c in info.get("categories") or () if isinstance(c, str)]
    if scene not in ("indoor", "outdoor"):
        scene = "indoor" if "indoor" in categories else "outdoor"
    sky = "pure skies" in [*categories, str(info.get("category", "")).lower()]
    return PanoramaRow(
        file,
        row.split or split_drawn_for(row.slug),
        row.place or row.slug,
        row.scene or scene,
        row.licence or "CC0 - Poly Haven",
        row.synthetic_ground or str(sky).lower(),
        row.slug,
        row.source or source,
    )


def _write(manifest: Path, rows: Iterable[PanoramaRow]) -> None:
    with (
        replacing(manifest) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, [field.name for field in fields(PanoramaRow)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in sorted(rows, key=lambda row: row.file))


def _copy(
    response: BufferedIOBase,
    out: BufferedIOBase,
    file: RemoteFile,
    have: int,
    progress: Callable[[int], None],
) -> None:
    """Copy up to the announced size, so that a lying server cannot fill the disk."""
    while have < file.size and (piece := response.read(min(_PIECE, file.size - have))):
        out.write(piece)
        have += len(piece)
        progress(len(piece))


def _md5(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()


def _require_web(address: str) -> None:
    """Refuse what urllib would open too: file: and ftp: addresses."""
    if urlsplit(address).scheme not in ("http", "https") or not urlsplit(address).netloc:
        raise DownloadError("a web address (http, https)", repr(address), "check --api")


def _opener() -> urllib.request.OpenerDirector:
    """One that follows redirects within the web and knows no other kind of address."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPDefaultErrorHandler(),
        urllib.request.HTTPRedirectHandler(),
        urllib.request.HTTPErrorProcessor(),
    ):
        opener.add_handler(handler)
    return opener
