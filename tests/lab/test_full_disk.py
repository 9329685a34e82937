"""The command that lets disks run full: a careful writer passes, a careless one is found."""

import sys
from pathlib import Path

import pytest

from deeplight.errors import ConfigError
from lab.full_disk import Args, on_small_disk, run, wrong

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's namespaces")

CAREFUL = """
import sys
from pathlib import Path
from deeplight.io.atomic import replacing
try:
    for number in range(4):
        with replacing(Path(sys.argv[1]) / f"{number}.bin") as temporary:
            temporary.write_bytes(bytes([number]) * 40_000)
except OSError as error:
    sys.exit(2)
"""
CARELESS = """
import contextlib, sys
from pathlib import Path
Path(sys.argv[1]).mkdir(exist_ok=True)
for number in range(4):
    with contextlib.suppress(OSError):
        (Path(sys.argv[1]) / f"{number}.bin").write_bytes(bytes([number]) * 40_000)
"""


def command(folder: Path, script: str) -> str:
    (folder / "script.py").write_text(script)
    return f"{sys.executable} {folder / 'script.py'} {{out}}"


def has_small_disks(folder: Path) -> bool:
    try:
        return on_small_disk("true {out}", 100_000, folder / "disk", folder / "kept")[0] == 0
    except (ConfigError, FileNotFoundError):
        return False


def test_a_careful_writer_passes_and_a_careless_one_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if not has_small_disks(tmp_path):
        pytest.skip("needs user namespaces that may mount")
    run(Args(command(tmp_path, CAREFUL), moments=2))
    assert "2 full disks, exit codes [2, 2], 0 faults" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        run(Args(command(tmp_path, CARELESS), moments=1))
    assert "exit code 0" in capsys.readouterr().out


def test_what_is_wrong_is_named(tmp_path: Path) -> None:
    whole, kept = tmp_path / "whole", tmp_path / "kept"
    for folder in (whole, kept / "out"):
        folder.mkdir(parents=True)
        (folder / "a.bin").write_text("whole")
    assert wrong(2, "no space", whole, kept) == []
    assert wrong(0, "", whole, kept) == []
    assert "exit code 1" in wrong(1, "", whole, kept)[0]
    assert "traceback" in wrong(2, "Traceback", whole, kept)[0]
    (kept / "out" / ".a.dl-0-0-0.bin").write_text("half")  # which the next run takes away
    assert wrong(2, "", whole, kept) == []
    assert wrong(0, "", whole, kept) == [".a.dl-0-0-0.bin"]
    (kept / "out" / ".a.dl-0-0-0.bin").unlink()
    (kept / "out" / "a.tmp").write_text("half")
    assert wrong(2, "", whole, kept) == ["out/a.tmp of 4 bytes"]
    (kept / "out" / "a.tmp").unlink()
    (kept / "out" / "a.bin").write_text("half")
    assert wrong(0, "", whole, kept) == ["a.bin"]
