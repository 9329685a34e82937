"""The demo's command and its export: every file, no links, one line for what is missing."""

import hashlib
import http.client
import subprocess
import sys
from pathlib import Path

import pytest

from built_page import FILES, write_site
from deeplight.cli.main import main
from deeplight.demo.site import MODEL, Site, content_type
from deeplight.errors import ConfigError
from deeplight.estimators.onnx import shipped_model
from patience import patient


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_site(tmp_path)


def test_a_page_that_is_not_built_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"in a checkout run: make web$"):
        Site.installed(tmp_path)
    with pytest.raises(ConfigError, match=r"run: make web && pip install \.$"):
        Site.installed(tmp_path / "site-packages" / "deeplight" / "demo" / "site")


def test_the_export_has_every_file_and_no_links(folder: Path, tmp_path: Path) -> None:
    site = Site.installed(folder)
    assert site.copied(tmp_path / "public") == len(FILES) + 1
    written = {
        path.relative_to(tmp_path / "public").as_posix(): path.read_bytes()
        for path in (tmp_path / "public").rglob("*")
        if path.is_file()
    }
    assert written == FILES | {MODEL: shipped_model().read_bytes()}


def test_an_export_with_an_address_has_a_whole_one_for_its_picture(tmp_path: Path) -> None:
    page = b'<meta property="og:image" content="./icons/share.jpg"><img src="./icons/share.jpg">'
    for name, content in {"index.html": page, "service-worker.js": _lists(page)}.items():
        (tmp_path / name).write_bytes(content)
    site = Site.installed(tmp_path)
    site.copied(tmp_path / "public", "https://example.org/a&b")
    new = (tmp_path / "public/index.html").read_bytes()
    assert b'content="https://example.org/a&amp;b/icons/share.jpg"><img src="./icons' in new
    assert (tmp_path / "public/service-worker.js").read_bytes() == _lists(new) != _lists(page)
    for wrong in ("example.org", "ftp://example.org/", "https://example.org/?a"):
        with pytest.raises(ConfigError, match="give the page's address"):
            site.copied(tmp_path / "other", wrong)


def test_an_address_for_a_page_without_a_picture_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="make web"):
        Site.installed(folder).copied(tmp_path / "other", "https://example.org/")


def _lists(page: bytes) -> bytes:
    return b'[["index.html","%s"]]' % hashlib.sha256(page).hexdigest()[:16].encode()


def test_an_export_never_mixes_with_other_files(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").touch()
    with pytest.raises(ConfigError, match="an empty or new folder"):
        Site.installed(folder).copied(tmp_path / "mine")
    with pytest.raises(ConfigError, match="an empty or new folder"):
        Site.installed(folder).copied(tmp_path / "mine/thesis.txt")


def test_every_kind_of_file_has_a_type() -> None:
    assert content_type("a/B.WASM") == "application/wasm"
    assert content_type("noidea.xyz") == "application/octet-stream"


def test_the_command_prints_its_address_and_stops_on_ctrl_c(folder: Path) -> None:
    code = (
        # In the background of a script, where tests may run, Ctrl-C starts out ignored.
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "import sys, pathlib; from deeplight.demo import site; "
        "find = site.Site.installed; "
        f"site.Site.installed = lambda: find(pathlib.Path({str(folder)!r})); "
        "from deeplight.cli.main import main; sys.exit(main(['demo', '--port', '0']))"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout is not None
    line = running.stdout.readline()
    port = int(line.split("http://127.0.0.1:")[1].split("/")[0])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=patient(10))
    connection.request("GET", "/")
    assert connection.getresponse().read() == FILES["index.html"]
    running.send_signal(2)
    out, complaints = running.communicate(timeout=patient(10))
    assert (running.returncode, out.strip(), complaints) == (0, "stopped", "")


def test_the_command_says_in_one_line_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    installed = Site.installed
    monkeypatch.setattr(Site, "installed", lambda: installed(tmp_path))
    assert main(["demo"]) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert complaint.startswith("deeplight demo: expected the built page; got no ")
