"""Capture in trouble: killed, a full disk, files that lie, clips as phones turn them."""

import ctypes
import hashlib
import json
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from clips import GREYS, HEIGHT, WIDTH, paper_located, picture, write_clip
from deeplight.capture import clip as clip_module
from deeplight.cli.main import main
from deeplight.dataset import open_dataset
from deeplight.io import video
from deeplight.io.photos import encode_png
from deeplight.sphere import SPHERES


@pytest.fixture
def known_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answer with the rig that was drawn, at once."""
    monkeypatch.setattr(clip_module, "locate", paper_located)


def captured(clip: Path, out: Path, *words: str) -> int:
    return main(["capture", str(clip), "--out", str(out), "--workers", "1", *words])


def report(out: Path, stem: str) -> dict:  # type: ignore[type-arg]
    return json.loads((out / "reports" / f"{stem}.json").read_text())


def digests(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


RUN = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from clips import paper_located
from deeplight.capture import clip
from deeplight.cli.main import main
clip.locate = paper_located
sys.exit(main(sys.argv[1:]))
"""


def begun(clips: Path, out: Path) -> "subprocess.Popen[bytes]":
    words = ["capture", str(clips), "--out", str(out), "--workers", "1"]
    tests = Path(__file__).parent.parent
    return subprocess.Popen(
        [sys.executable, "-c", RUN, str(tests), *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_killed_at_random_moments_it_ends_with_the_same_bytes(tmp_path: Path) -> None:
    """SIGKILL: no handler runs. Some kills fall into the first clip, some into later ones."""
    for name in "abc":
        write_clip(tmp_path / "clips" / f"{name}.mp4", [picture(3 * n) for n in range(45)])
    assert begun(tmp_path / "clips", tmp_path / "whole").wait() == 0
    out, rng, killed = tmp_path / "killed", random.Random(4), 0
    for _ in range(5):
        running = begun(tmp_path / "clips", out)
        before = set(out.rglob("*"))
        while running.poll() is None and set(out.rglob("*")) <= before:
            time.sleep(0.005)  # until it writes
        time.sleep(rng.uniform(0, 0.5))
        running.send_signal(signal.SIGKILL)
        killed += running.wait() == -signal.SIGKILL
    assert killed >= 2
    assert begun(tmp_path / "clips", out).wait() == 0
    assert digests(out) == digests(tmp_path / "whole")


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file may grow over 20 kB."""
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, usual[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, usual)


@pytest.mark.usefixtures("known_rig")
def test_a_full_disk_is_one_line_and_then_it_goes_on(
    tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    clip, out = write_clip(tmp_path / "a.mp4"), tmp_path / "data"
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    request.getfixturevalue("small_disk")
    assert captured(clip, out) == 2
    resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "too large" in lines[0]
    assert not [path for path in out.rglob("*") if path.suffix == ".tar"]
    assert captured(clip, out) == 0
    assert report(out, "a")["frames"]["kept"] == 10


def test_a_folder_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = write_clip(tmp_path / "a.mp4")
    (tmp_path / "taken").write_text("a file, no folder")
    assert captured(clip, tmp_path / "taken" / "data") == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "Not a directory" in lines[0]


def bomb(path: Path, side: int, claimed: int) -> Path:
    """A clip of PNG pictures whose header claims another size."""
    content = encode_png(np.zeros((side, side, 3), np.uint8))
    with av.open(str(path), "w") as container:
        stream = container.add_stream("png", rate=30)
        stream.width = stream.height = claimed
        stream.pix_fmt = "rgb24"
        for number in range(3):
            packet = av.Packet(content)
            packet.pts = packet.dts = number
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            container.mux(packet)
    return path


def peak_kb() -> int:
    """Most memory held since the last call of this; what is free goes back to the system first.

    `make test` has the process keep freed memory, in which a large frame would not be noticed.
    """
    status = Path("/proc/self/status").read_text()
    if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    return int(status.split("VmHWM:")[1].split()[0])


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="only Linux reports it")
@pytest.mark.parametrize("claimed", [64, 6400])
def test_huge_frames_are_refused_before_they_are_decoded(
    tmp_path: Path, claimed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = bomb(tmp_path / "a.mov", 6400, claimed)
    peak_kb()
    before = peak_kb()
    assert captured(clip, tmp_path / "data") == 2
    assert "36 megapixels" in capsys.readouterr().err.splitlines()[0]
    assert peak_kb() - before < 80_000  # a frame has 123 MB
    with av.open(str(clip)) as container:  # the twin: opened without a limit it is decoded
        assert container.streams.video[0].width == 6400
    assert peak_kb() - before > 100_000


def test_the_same_file_is_read_where_it_is_small(tmp_path: Path) -> None:
    assert len(list(video.video_frames(bomb(tmp_path / "a.mov", 64, 64)))) == 3


def test_frames_that_change_their_size_are_refused(tmp_path: Path) -> None:
    clip = tmp_path / "a.mov"
    with av.open(str(clip), "w") as container:
        stream = container.add_stream("png", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "rgb24"
        for number, side in enumerate((64, 64, 80)):
            packet = av.Packet(encode_png(np.zeros((side, side, 3), np.uint8)))
            packet.pts = packet.dts = number
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            container.mux(packet)
    with pytest.raises(video.ImageFileError, match="change their size"):
        list(video.video_frames(clip))


@pytest.mark.usefixtures("known_rig")
@pytest.mark.parametrize(
    ("rotation_deg", "stretch"), [(90, 1.0), (180, 1.0), (270, 1.0), (0, 1.15)]
)
def test_turned_and_uneven_clips_give_the_same_crops(
    tmp_path: Path, rotation_deg: int, stretch: float
) -> None:
    clip = write_clip(tmp_path / "a.mp4", None, rotation_deg, stretch)
    assert captured(clip, tmp_path / "data") == 0
    data = open_dataset(tmp_path / "data")
    examples = [e for split in data.splits for e in data.examples(split)]
    assert len(examples) == 10
    view = data.rigs[examples[0].meta.rig].views
    for name in SPHERES:
        middle = examples[0].spheres[name][view[name].mask()]
        assert abs(np.median(middle) - GREYS[name]) <= 4
    times = [example.meta.details["time_s"] for example in examples]
    pauses = np.diff(times)
    assert pauses[-1] / pauses[0] == pytest.approx(stretch**8, rel=0.05)


def test_one_frame_is_too_few_to_find_spheres_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = write_clip(tmp_path / "a.mp4", [picture(0)])
    assert captured(clip, tmp_path / "data") == 2
    assert "longer clip" in capsys.readouterr().err.splitlines()[0]
    assert report(tmp_path / "data", "a")["status"] == "failed"


@pytest.mark.usefixtures("known_rig")
def test_a_wide_clip_sees_66_degrees_along_its_long_side(tmp_path: Path) -> None:
    """Unless set otherwise; a tall one sees them vertically, as ever."""
    clip = write_clip(tmp_path / "tall.mp4")
    assert captured(clip, tmp_path / "tall") == 0
    record = report(tmp_path / "tall", "tall")
    assert record["video"]["vertical_fov_deg"] == 66
    assert record["warnings"] == []
    assert clip_module.frame_photo(HEIGHT, WIDTH).vertical_fov_rad == np.radians(66)
    wide = clip_module.frame_photo(1080, 1920).vertical_fov_rad
    assert np.tan(wide / 2) * 16 / 9 == pytest.approx(np.tan(np.radians(33)))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("rig.json", b"", "rig file"),
        ("rig.json", b"[1, 2]", "rig file"),
        ("rig.json", b"{" * 100_000, "rig file"),
        ("rig.json", b'{"tag": {"id": 0}, "spheres": {}}', "size_m|mirror|rig file"),
        ("clips.csv", b"\xff\xfe\x00nonsense", "UTF-8"),
        ("clips.csv", b"clip,place\na.mp4,hall\n", "row 1 without scene, split"),
        ("clips.csv", b"clip,place,scene,split\na.mp4,hall,indoor,never\n", "never"),
    ],
)
def test_a_wrong_rig_or_table_is_one_line_before_any_work(
    tmp_path: Path, name: str, content: bytes, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    clip, file = write_clip(tmp_path / "a.mp4"), tmp_path / name
    file.write_bytes(content)
    assert captured(clip, tmp_path / "data", f"--{file.stem}", str(file)) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert any(word in lines[0] for word in message.split("|"))
    assert not (tmp_path / "data").exists()
