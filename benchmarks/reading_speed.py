"""How long clean files take to read, next to another checkout of DeepLight, in one run.

git worktree add ../other COMMIT; python benchmarks/reading_speed.py --other ../other/src

Processor time of the fastest of many readings, in turns so that a busy machine slows both; a photo
of 12 megapixels, a panorama of 2048 x 1024 as .exr and .hdr, a film of 30 frames 1080 x 1920, and
a gently curved mesh of 40,000 quads.
"""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tyro

HERE = Path(__file__).resolve().parent.parent / "src"
KINDS = ("photo.jpg", "light.exr", "light.hdr", "film.mp4", "mesh.obj")


@dataclass(frozen=True)
class Args:
    """Settings of this benchmark."""

    other: Path | None = None
    """`src` of the other checkout."""
    turns: int = 4
    """How often each checkout has its turn."""
    folder: Path | None = None
    """Measure the checkout on the path with the files of this folder, and print seconds."""


def write(folder: Path) -> None:
    """Make the files, of smooth noise."""
    from deeplight.io.photos import encode_jpeg
    from deeplight.io.radiance import write_hdr
    from deeplight.io.video_writer import VideoWriter

    coarse = np.random.default_rng(0).uniform(0, 255, (60, 80, 3)).astype(np.float32)
    (folder / KINDS[0]).write_bytes(encode_jpeg(cv2.resize(coarse, (4000, 3000)).astype(np.uint8)))
    light = cv2.resize(coarse / 100, (2048, 1024))
    write_hdr(folder / KINDS[1], light)
    write_hdr(folder / KINDS[2], light)
    with VideoWriter(folder / KINDS[3], 1080, 1920, 30) as video:
        for n in range(30):
            frame = cv2.resize(np.roll(coarse, n, axis=1), (1080, 1920))
            video.write(frame.clip(0, 255).astype(np.uint8))
    rows, columns = np.indices((201, 201)).reshape(2, -1)
    text = "".join(
        f"v {x:.4f} {y:.4f} {(x * x + y * y) / 400:.4f}\n"
        for x, y in zip(columns, rows, strict=True)
    )
    starts = 1 + (201 * rows + columns)[(rows < 200) & (columns < 200)]
    text += "".join(f"f {v}/{v} {v + 1}/{v} {v + 202}/{v} {v + 201}/{v}\n" for v in starts)
    (folder / KINDS[4]).write_text(text)


def measure(folder: Path) -> None:
    """Print the processor seconds of the fastest of some readings of each kind."""
    from deeplight.compose.mesh_file import read_meshes
    from deeplight.io.photos import read_photo
    from deeplight.io.radiance import read_hdr
    from deeplight.io.video import video_frames

    def read(path: Path) -> None:
        if path.suffix == ".mp4":
            for frame in video_frames(path):
                frame.rgb()
        elif path.suffix == ".jpg":
            read_photo(path)
        elif path.suffix == ".obj":
            read_meshes(path, 1_000_000)
        else:
            read_hdr(path)

    for kind in KINDS:
        best = np.inf
        for _ in range(5):
            start = time.process_time()
            read(folder / kind)
            best = min(best, time.process_time() - start)
        print(best)


def main(args: Args) -> None:
    """Take turns and print the ratio of the fastest."""
    if args.folder is not None:
        measure(args.folder)
        return
    assert args.other is not None, "--other SRC"
    best = np.full((2, len(KINDS)), np.inf)
    with tempfile.TemporaryDirectory() as name:
        write(Path(name))
        for _ in range(args.turns):
            for i, source in enumerate((HERE, args.other.resolve())):
                command = [sys.executable, __file__, "--folder", name]
                environment = os.environ | {"PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
                said = subprocess.run(
                    command, env=environment, check=True, capture_output=True, text=True
                )
                best[i] = np.minimum(best[i], [float(word) for word in said.stdout.split()])
    for kind, (here, there) in zip(KINDS, best.T, strict=True):
        print(
            f"{kind}: {1000 * here:.0f} ms, there {1000 * there:.0f} ms, ratio {here / there:.3f}"
        )


if __name__ == "__main__":
    main(tyro.cli(Args))
