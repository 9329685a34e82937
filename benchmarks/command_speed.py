"""How much processor time commands take, next to another checkout of DeepLight, in one run.

git worktree add ../other COMMIT
python benchmarks/command_speed.py ../other [--hdri FOLDER] [--clip CLIP]

Importing the package, estimating the example photos with the other checkout's weights and, if they
are given, simulating a small data set in FOLDER's panoramas and capturing a filmed CLIP, each a
process of its own, in turns so that a busy machine slows both. Children of the processes count.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import tyro

HERE = Path(__file__).resolve().parent.parent
PROGRAM = (sys.executable, "-m", "deeplight")
SIMULATE = ("--recipe.train-takes", "1", "--recipe.eval-takes", "1", "--recipe.frames", "2")


@dataclass(frozen=True)
class Args:
    """Settings of this benchmark."""

    other: tyro.conf.Positional[Path]
    """The other checkout."""
    hdri: Path | None = None
    """A few panoramas."""
    clip: Path | None = None
    """A clip of the three spheres: of `python -m lab.film`, or filmed."""
    turns: int = 3
    """How often each checkout has its turn."""


def commands(args: Args, out: Path) -> dict[str, tuple[str, ...]]:
    """What is timed; `out` is new each time."""
    (weights,) = (args.other / "src" / "deeplight" / "weights").glob("*.onnx")
    photos = str(HERE / "examples" / "photos")
    found: dict[str, tuple[str, ...]] = {
        "import": (sys.executable, "-c", "import deeplight"),
        "estimate": (*PROGRAM, "estimate", photos, "--model", str(weights), "--out", str(out)),
    }
    if args.hdri:
        simulate = ("simulate", "--hdri", str(args.hdri.resolve()), "--workers", "1", *SIMULATE)
        found["simulate"] = (*PROGRAM, *simulate, "--out", str(out))
    if args.clip:
        found["capture"] = (*PROGRAM, "capture", str(args.clip.resolve()), "--out", str(out))
    return found


def seconds(command: tuple[str, ...], checkout: Path) -> float:
    """Processor time of a command and of its children."""
    path = {"PYTHONPATH": str(checkout / "src"), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryFile() as said:
        child = subprocess.Popen(command, env=os.environ | path, stdout=said, stderr=said)
        _, status, usage = os.wait4(child.pid, 0)
        if status:
            said.seek(0)
            raise SystemExit(f"{' '.join(command)}: {said.read().decode(errors='replace')}")
    return usage.ru_utime + usage.ru_stime


def main(args: Args) -> None:
    """Take turns and print every time, and the ratio of the fastest: others slow the rest."""
    args = replace(args, other=args.other.resolve())
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        for name, command in commands(args, out).items():
            taken: dict[Path, list[float]] = {HERE: [], args.other: []}
            for checkout in [HERE, args.other] * (1 + args.turns):
                taken[checkout].append(seconds(command, checkout))
                shutil.rmtree(out, ignore_errors=True)
            here, other = (values[1:] for values in taken.values())  # the first fills caches
            ratio = min(here) / min(other)
            shown = (", ".join(f"{value:.2f}" for value in values) for values in (here, other))
            print("| {} | {} | {} | {:.2f} |".format(name, *shown, ratio), flush=True)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
