"""Kill a command again and again, let it end once, and compare with a run that was left alone.

python -m lab.kills "deeplight simulate --hdri panoramas --out {out}" --kills 10

Each kill is a SIGKILL of the whole process group at a random moment; the run after it goes on in
the same folder. Nothing finished may be lost, nothing half-written may stay, and the bytes must be
those of the undisturbed run.
"""

import filecmp
import os
import random
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import tyro

from deeplight.cli.main import run_command
from deeplight.errors import ConfigError


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.kills`."""

    command: Annotated[str, tyro.conf.Positional]
    """The command; {out} stands for its output folder."""
    kills: int = 10
    """How often it is killed."""
    seed: int = 0
    """Of the moments."""
    ignore: tuple[str, ...] = ("run.toml",)
    """Names of files that may differ, such as records of times; * stands for anything."""


def run(args: Args) -> None:
    """Print what differs; exit code 1 if anything does."""
    if "{out}" not in args.command:
        raise ConfigError("a command with {out}", args.command, "put {out} where its output goes")
    with TemporaryDirectory() as folder:
        whole, killed = Path(folder) / "whole", Path(folder) / "killed"
        began = time.monotonic()
        started(args.command, whole).communicate()
        took = time.monotonic() - began
        moments, kills, finished = random.Random(args.seed), 0, 0
        while kills < args.kills and finished < 5 * args.kills:
            child = started(args.command, killed)
            try:
                child.wait(moments.uniform(0.05, 1) * took)
                finished += 1
                shutil.rmtree(killed, ignore_errors=True)  # it was faster: from the start again
            except subprocess.TimeoutExpired:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()
                kills += 1
        last = started(args.command, killed)
        said = last.communicate()[1]
        differ = differing(whole, killed, args.ignore)
    print(f"{kills} kills of {took:.1f} s runs, exit code {last.returncode}")
    for name in differ:
        print(f"  {name}")
    if last.returncode or differ:
        print(said)
        sys.exit(1)


def is_ignored(path: Path, ignore: Sequence[str]) -> bool:
    """Whether the name of a file fits one of the patterns of what may differ."""
    return any(fnmatch(path.name, pattern) for pattern in ignore)


def differing(one: Path, other: Path, ignore: Sequence[str] = ()) -> list[str]:
    """Name the files that only one of two folders has, or that hold other bytes."""
    names = {
        path.relative_to(folder)
        for folder in (one, other)
        for path in folder.rglob("*")
        if not path.is_dir() and not is_ignored(path, ignore)
    }
    return [
        str(name)
        for name in sorted(names)
        if not (one / name).exists()
        or not (other / name).exists()
        or not filecmp.cmp(one / name, other / name, shallow=False)
    ]


def started(command: str, out: Path, before: Sequence[str] = ()) -> subprocess.Popen[str]:
    """Begin a command in a process group of its own, with `before` in front of its words."""
    words = [word.replace("{out}", str(out)) for word in shlex.split(command)]
    if words[0] == "deeplight":
        words[:1] = [sys.executable, "-m", "deeplight"]
    words = [*before, *words]
    return subprocess.Popen(words, stdout=-3, stderr=-1, text=True, start_new_session=True)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.kills", sys.modules[__name__], sys.argv[1:]))
