"""A file is written whole or not at all."""

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import ConfigError, ImageFileError
from deeplight.io import atomic
from deeplight.io.atomic import check_writable, fitted, only_run, replacing
from deeplight.io.photograph import write_photograph
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.io.video_writer import VideoWriter

NOISE = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)


def test_the_file_appears_only_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "new" / "light.exr"
    with replacing(target) as temporary:
        temporary.write_text("whole")
        assert not target.exists()
        assert temporary.parent == target.parent  # a rename across disks would not be atomic
        assert temporary.suffix == ".exr"
    assert target.read_text() == "whole"
    assert [entry.name for entry in target.parent.iterdir()] == ["light.exr"]


def test_a_full_disk_is_said_by_the_name_of_the_file(tmp_path: Path) -> None:
    target = tmp_path / "light.npz"
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as a write raises it
    with pytest.raises(OSError, match="light") as caught, replacing(target):
        raise full
    assert caught.value.filename == str(target)
    other = OSError(errno.EIO, os.strerror(errno.EIO))  # perhaps of what is read meanwhile
    with pytest.raises(OSError) as caught, replacing(target):  # noqa: PT011
        raise other
    assert caught.value.filename is None


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_keeps_the_old_file_and_leaves_nothing(
    tmp_path: Path, failure: type[BaseException]
) -> None:
    target = tmp_path / "light.exr"
    target.write_text("old")

    def write() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise failure

    with pytest.raises(failure):
        write()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.skipif(os.name == "nt", reason="files are for nobody or everybody there")
@pytest.mark.parametrize("made", [0o600, 0o666])
def test_who_may_read_a_file_is_not_for_a_library_to_say(tmp_path: Path, made: int) -> None:
    (tmp_path / "own").touch()
    with replacing(tmp_path / "weights.safetensors") as temporary:
        temporary.write_text("whole")
        temporary.chmod(made)
    modes = {(tmp_path / name).stat().st_mode for name in ("own", "weights.safetensors")}
    assert len(modes) == 1


def test_a_block_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "light.exr"):
        pass


@pytest.mark.parametrize("letter", ["n", "é", "\udcff"])
def test_a_long_name_is_cut_to_leave_room_and_stays_its_own(letter: str) -> None:
    size = len(os.fsencode(letter))
    short, long, other = letter * (225 // size), letter * (250 // size), letter * (248 // size)
    assert fitted(short) == short
    assert 210 < len(os.fsencode(fitted(long))) <= 225
    assert len({fitted(long), fitted(other), fitted(short)}) == 3


@pytest.mark.parametrize("stem", ["n" * 250, "é" * 125, "n" * 251, "a." + "x" * 240])
def test_a_very_long_name_can_be_written(stem: str, tmp_path: Path) -> None:
    target = tmp_path / (stem + ".exr"[: 255 - len(stem.encode())])
    with replacing(target) as temporary:
        assert len(os.fsencode(temporary.name)) <= 255
        temporary.write_text("whole")
    assert target.read_text() == "whole"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_name_that_is_not_utf8_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / os.fsdecode(b"caf\xe9.exr")
    with replacing(target) as temporary:
        temporary.name.encode()  # image libraries want UTF-8
        temporary.write_text("whole")
    assert [os.fsencode(path.name) for path in tmp_path.iterdir()] == [b"caf\xe9.exr"]


def test_what_cannot_be_named_is_said_before_it_is_written(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="too long"), replacing(tmp_path / ("n" * 256)):
        raise AssertionError("began to write")
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    with pytest.raises(ImageFileError, match="not UTF-8"):
        write_exr(folder / "a.exr", NOISE)
    write_exr(tmp_path / os.fsdecode(b"caf\xe9.exr"), NOISE)


def test_errors_name_the_file_that_was_asked_for(tmp_path: Path) -> None:
    target = tmp_path / "light.exr"
    with pytest.raises(FileNotFoundError) as caught, replacing(target):
        pass
    assert caught.value.filename == str(target)
    target.mkdir()
    with pytest.raises(IsADirectoryError) as caught, replacing(target) as temporary:
        temporary.write_text("whole")
    assert caught.value.filename == str(target)


def test_what_cannot_be_written_is_known_before(tmp_path: Path) -> None:
    check_writable(tmp_path / "a.onnx")
    assert not list(tmp_path.iterdir())
    for path in (tmp_path, tmp_path / "missing" / "a.onnx"):
        with pytest.raises((IsADirectoryError, FileNotFoundError)) as caught:
            check_writable(path)
        assert caught.value.filename == str(path)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.exr"])
def test_an_empty_or_cut_off_file_is_a_full_disk(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("old")
    for content in (b"",) if name == "a.exr" else (b"", b"\x89PNG\r\n"):
        with pytest.raises(OSError, match="No space left"):
            write(tmp_path / name, content)
        assert (tmp_path / name).read_text() == "old"
        assert len(list(tmp_path.iterdir())) == 1


def write(target: Path, content: bytes) -> None:
    with replacing(target) as temporary:
        temporary.write_bytes(content)


FULL = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from deeplight.io.photograph import write_photograph
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.io.photos import write_png
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
noise = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)
folder, most = Path(sys.argv[1]), int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
for name, save in {"a.png": write_photograph, "b.exr": write_photograph, "c.exr": write_exr,
                   "d.hdr": write_hdr}.items():
    try:
        save(folder / name, noise)
    except OSError:
        continue
    sys.exit(f"{name} was written in {most} bytes")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs file size limits")
@pytest.mark.parametrize("most", [1, 4096, 12_000])
def test_a_disk_that_takes_no_more_is_an_error(most: int, tmp_path: Path) -> None:
    command = [sys.executable, "-c", FULL, str(tmp_path), str(most)]
    done = subprocess.run(command, env=os.environ | path_of_ours(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == []


def path_of_ours() -> dict[str, str]:
    return {"PYTHONPATH": os.pathsep.join(sys.path)}


KILLED = """
import sys, time
from pathlib import Path
from deeplight.io.atomic import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs kill")
def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(tmp_path / "a.exr")]
    with subprocess.Popen(command, env=os.environ | path_of_ours(), stdout=-1) as child:
        assert child.stdout is not None
        child.stdout.readline()
        dead = f".b.dl-{atomic._where()}-{2**22 + 1:x}-0badcafe"  # of no process
        (tmp_path / dead).mkdir()
        (tmp_path / dead / "b.exr").touch()
        foreign = tmp_path / ".a.dl-00000000-7fffffff-00000000.exr"  # another machine's
        foreign.write_text("half")
        assert len(list(tmp_path.iterdir())) == 3
        atomic._remove_leftovers.cache_clear()
        write(tmp_path / "b.txt", b"whole")  # another run's file that still lives is kept
        assert len(list(tmp_path.iterdir())) == 3
        child.send_signal(signal.SIGKILL)
    write(tmp_path / "c.txt", b"whole")  # once for each run
    assert len(list(tmp_path.iterdir())) == 4
    atomic._remove_leftovers.cache_clear()
    write(tmp_path / "d.txt", b"whole")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [foreign.name, "b.txt", "c.txt", "d.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs file locks")
def test_a_second_run_into_a_folder_is_refused_while_one_goes(tmp_path: Path) -> None:
    with (
        only_run(tmp_path / "a"),
        only_run(tmp_path / "b"),
        pytest.raises(ConfigError, match="still going"),
        only_run(tmp_path / "a"),
    ):
        raise AssertionError("two at once")
    with only_run(tmp_path / "a"):
        (tmp_path / "a" / "result").touch()
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "result"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs process ids that can be asked")
def test_a_run_that_fails_removes_what_its_ended_workers_left(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "reports"
    folder.mkdir(parents=True)
    of_dead, of_living = (
        folder / f".a.dl-{atomic._where()}-{process:x}-0badcafe.png"
        for process in (2**22 + 1, os.getpid())
    )
    write(folder / "whole.png", b"x" * 9 + b"IEND\xaeB`\x82")  # what is there has been looked at
    for left in (of_dead, of_living):
        left.write_text("half")
    with pytest.raises(OSError, match="full"), only_run(tmp_path / "out"):
        raise OSError("full")
    assert sorted(path.name for path in folder.iterdir()) == [of_living.name, "whole.png"]


def write_video(path: Path, noise: np.ndarray) -> None:
    pixels = (noise[:, :100] * 255).astype(np.uint8)  # rows that are no multiple of 64
    with VideoWriter(path, 100, 64, 30) as video:
        for number in range(8):
            video.write(np.roll(pixels, number, axis=1))


@pytest.mark.parametrize(
    ("name", "save"),
    [
        ("a.exr", write_exr),
        ("a.hdr", write_hdr),
        ("b.exr", write_photograph),
        ("b.png", write_photograph),
        ("c.mp4", write_video),
    ],
)
def test_the_same_values_give_the_same_bytes(
    name: str, save: Callable[[Path, np.ndarray], None], tmp_path: Path, monkeypatch
) -> None:
    if save is write_video:
        pytest.importorskip("av")
    found = set()
    for number in range(4):
        rubbish = np.random.default_rng(number).bytes(20_000 * (number + 1))  # in fresh memory
        save(tmp_path / name, NOISE)
        found.add((tmp_path / name).read_bytes())
        assert rubbish
    assert len(found) == 1
    (content,) = found
    assert b"capDate" not in content  # the time of day, to the second
