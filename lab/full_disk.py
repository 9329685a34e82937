"""Let the disk run full under a command at random moments, and see what it says and leaves.

python -m lab.full_disk "deeplight simulate --hdri panoramas --out {out}" --moments 10

The output folder lies on a disk in memory that holds a random share of what the command writes
(Linux with user namespaces; no rights are needed). With exit code 0 everything must be there and
have the bytes of an undisturbed run. Otherwise the code is 2 with one line and no traceback, what
has its name is whole, and the next run with room completes it and takes temporary files away.
"""

import random
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import tyro

from deeplight.cli.main import run_command
from deeplight.errors import ConfigError
from lab.kills import differing, is_ignored, started

_ON_SMALL_DISK = """
mount -t tmpfs -o size="$1" tmpfs "$2" || exit 99
disk=$2 kept=$3
shift 3
"$@"
code=$?
cp -a "$disk/." "$kept"
exit $code
"""
_NO_DISK = 99


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.full_disk`."""

    command: Annotated[str, tyro.conf.Positional]
    """The command; {out} stands for its output folder."""
    moments: int = 10
    """How often it runs on a disk that is too small."""
    most: float = 0.98
    """The largest disk, as a share of what is there at the end; more than 1 for a command that
    keeps temporary files meanwhile."""
    seed: int = 0
    """Of the sizes."""
    ignore: tuple[str, ...] = ("run.toml",)
    """Names of files that may differ, such as records of times; * stands for anything."""

    meanwhile: tuple[str, ...] = ()
    """Names of files that hold something else before the end, such as the best so far; they are
    compared after the next run."""


def run(args: Args) -> None:
    """Print what each run did; exit code 1 if any was wrong."""
    if "{out}" not in args.command:
        raise ConfigError("a command with {out}", args.command, "put {out} where its output goes")
    draws, faults, codes = random.Random(args.seed), [], []
    with TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        said = started(args.command, whole).communicate()[1]
        needed = sum(size_on_disk(path) for path in whole.rglob("*")) if whole.exists() else 0
        if not needed:
            raise ConfigError("a command that writes something", said[-300:], "correct it")
        for number in range(args.moments):
            room = max(8192, round(draws.uniform(0.02, args.most) * needed))
            kept = Path(folder) / f"kept{number}"
            code, said = on_small_disk(args.command, room, Path(folder) / "disk", kept)
            codes.append(code)
            found = wrong(code, said, whole, kept, args.ignore, args.meanwhile)
            if not found:
                found = wrong_after_next(args.command, whole, kept / "out", args.ignore)
            print(f"{room} of {needed} bytes: exit code {code} {' '.join(found) or 'right'}")
            faults += found
            shutil.rmtree(kept, ignore_errors=True)
    print(f"{args.moments} full disks, exit codes {sorted(codes)}, {len(faults)} faults")
    if faults:
        sys.exit(1)


def size_on_disk(path: Path) -> int:
    """Give the bytes that a file or folder takes of a disk in memory."""
    return -(-path.lstat().st_size // 4096) * 4096 if path.is_file() else 0


def on_small_disk(command: str, room: int, disk: Path, kept: Path) -> tuple[int, str]:
    """Run a command whose output goes to a disk of `room` bytes; what it held is in `kept`."""
    disk.mkdir(exist_ok=True)
    kept.mkdir()
    before = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", _ON_SMALL_DISK, "sh"]
    child = started(command, disk / "out", [*before, str(room), str(disk), str(kept)])
    said = child.communicate()[1]
    if child.returncode == _NO_DISK:
        raise ConfigError("Linux with user namespaces", said.strip(), "run it there")
    return child.returncode, said


def wrong(
    code: int,
    said: str,
    whole: Path,
    kept: Path,
    ignore: Sequence[str] = (),
    meanwhile: Sequence[str] = (),
) -> list[str]:
    """Name what is wrong with a run on a full disk."""
    got = kept / "out"
    if code == 0:
        return differing(whole, got, ignore) if got.exists() else ["nothing written"]
    faults = [] if code == 2 else [f"exit code {code}: {said[-500:]}"]
    if "Traceback" in said:
        faults.append(f"a traceback: {said[-2000:]}")
    for path in sorted(kept.rglob("*")):
        name = path.relative_to(kept)
        # Hidden: what the next run goes on with, and temporary files of workers that were ended
        # when another one met the full disk. It takes them away, which is checked.
        is_hidden = any(part.startswith(".") for part in name.parts)
        if path.is_dir() or is_hidden or is_ignored(path, (*ignore, *meanwhile)):
            continue
        right = whole / path.relative_to(got) if path.is_relative_to(got) else None
        if right is None or not right.exists() or right.read_bytes() != path.read_bytes():
            faults.append(f"{name} of {path.stat().st_size} bytes")
    return faults


def wrong_after_next(command: str, whole: Path, out: Path, ignore: Sequence[str]) -> list[str]:
    """Run again with room, and name what differs from the undisturbed run."""
    child = started(command, out)
    said = child.communicate()[1]
    if child.returncode:
        return [f"the next run: exit code {child.returncode}: {said[-500:]}"]
    return [f"after the next run: {name}" for name in differing(whole, out, ignore)]


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.full_disk", sys.modules[__name__], sys.argv[1:]))
