"""How long fusing takes on one core: python benchmarks/fuse_speed.py PANORAMAS

Prints processor time: of `Session.add` on 720p frames without the network, of an environment, and
of `deeplight fuse` next to decoding the same clip: 30 s of 1080 x 1920, one turn by hand; and what
memory the command needs at most for the first third, all of it, and three times that. With a second
argument the clip is kept there, or taken from there; a third films its first frames only.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import math
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import av
import cv2
import numpy as np

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD, PinholeCamera
from deeplight.camera_response import encode
from deeplight.estimators.open import open_model
from deeplight.frames import turned, world_from_camera
from deeplight.fuse.fuse import fuse_frames
from deeplight.fuse.session import Session
from deeplight.fuse.sources import read_frames
from deeplight.io.video import video_frames
from deeplight.io.video_writer import VideoWriter
from deeplight.mappings import latlong
from deeplight.simulate.panorama import load, places_in
from lab.pans import Pan, Sweep, Troubles, film_pan

SIZE, FRAMES, RATE_HZ = (1080, 1920), 900, 30.0  # of the clip
QUALITY = 18  # about the bit rate of a phone
MAP_STEP = 8  # where a pixel looks is worked out for every eighth, and interpolated
HEIGHTS = (64, 256, 512)
RUNS = 3  # of each length, of whose memory the middle counts
Result = TypeVar("Result")
_PEAK = (  # not getrusage: its peak is at least that of the process which started this one
    "import sys; from deeplight.cli.main import main; main(sys.argv[1:]);"
    "print(next(line.split()[1] for line in open('/proc/self/status') if 'VmHWM' in line))"
)


def main(panoramas: str, clip: str | None = None, frames: str = str(FRAMES)) -> None:
    cv2.setNumThreads(1)
    place = next(place for place in places_in(Path(panoramas)) if place.split == "val")
    panorama = load(place)
    pan = film_pan(panorama, Sweep(36), Troubles(), np.random.default_rng(1), (1280, 720))
    session_times(pan)
    with TemporaryDirectory() as folder:
        path = Path(clip or Path(folder) / "clip.mp4")
        if not path.exists():
            film_clip(panorama, path, int(frames))
        clip_times(path)
        for part in (1 / 3, 1, 3):
            clip_memory(path, Path(folder), part)


def film_clip(panorama: np.ndarray, path: Path, frames: int) -> None:
    """A turn by hand or its beginning: smooth shake, exposure fixed, grain of a sensor."""
    rng = np.random.default_rng(2)
    rows, columns, _ = panorama.shape
    pixels = encode(np.minimum(panorama * (0.18 / np.median(panorama)), 1)) * 255
    pixels = np.concatenate([pixels, pixels[:, :1]], axis=1).astype(np.uint8)
    few = (SIZE[0] // MAP_STEP, SIZE[1] // MAP_STEP)
    rays = PinholeCamera(*few, TRAINED_VERTICAL_FOV_RAD).rays().astype(np.float32)
    shake = cv2.GaussianBlur(rng.normal(0, 0.06, (FRAMES, 3)), (1, 31), 7)
    grain = rng.normal(0, 2.5, (2 * SIZE[1], 2 * SIZE[0], 1)).astype(np.int8)
    with VideoWriter(path, *SIZE, RATE_HZ, quality=QUALITY) as writer:
        for k in range(frames):
            yaw, pitch, roll = shake[k] + (2 * np.pi * k / FRAMES, -0.17, 0)
            at = turned(rays, world_from_camera(yaw, pitch, roll))
            row, column = latlong.position(at, rows, columns)
            column = (column - column[0, 0] + columns / 2) % columns - columns / 2 + column[0, 0]
            smooth = [cv2.resize(part.astype(np.float32), SIZE) for part in (column, row)]
            seen = cv2.remap(pixels, smooth[0] % columns, smooth[1], cv2.INTER_LINEAR)
            top, left = rng.integers(0, SIZE[1]), rng.integers(0, SIZE[0])
            noise = grain[top : top + SIZE[1], left : left + SIZE[0]]
            writer.write(np.clip(seen.astype(np.int16) + noise, 0, 255).astype(np.uint8))


def session_times(pan: Pan) -> None:
    """Two turns; the second one is timed, when every frame takes another one's place."""
    grey = np.full((32, 32, 3), -1, np.float32)
    session = Session(pan.camera.vertical_fov_rad, lambda _: grey)
    times = []
    for frame in [*pan.frames, *pan.frames]:
        start = time.process_time()
        session.add(frame.pixels, frame.rotation)
        times.append(1e3 * (time.process_time() - start))
    half = np.array(times[len(times) // 2 :])
    kept = f"{len(session.views)} views kept"
    print(
        f"Session.add: median {np.median(half):.1f} ms, 90 % {np.quantile(half, 0.9):.1f}, {kept}"
    )
    for height in HEIGHTS:
        start = time.process_time()
        session.environment(height=height)
        print(f"environment of {height} rows: {time.process_time() - start:.2f} s")


def clip_times(path: Path) -> None:
    """Decoding and fusing of a clip."""
    size = path.stat().st_size / 1e6
    begin = time.process_time()
    count = timed("decode", lambda: sum(1 for _ in video_frames(path)))
    decoding = time.process_time() - begin
    timed("decode to RGB", lambda: sum(still.rgb().size for still in video_frames(path)))
    begin = time.process_time()
    frames = timed("choose frames", lambda: read_frames([path], None))
    model = open_model(threads=1)
    fused = timed("place, estimate and fuse", lambda: fuse_frames(frames, model))
    ratio = (time.process_time() - begin) / decoding
    print(f"{count} frames, {size:.0f} MB, {len(frames)} chosen, {len(fused.placed)} placed")
    print(f"fusing takes {ratio:.2f} times as long as decoding")


def clip_memory(path: Path, folder: Path, part: float) -> None:
    """Peak memory of `deeplight fuse` on a part of a clip, or on it several times over."""
    cut = folder / "cut.mp4"
    with av.open(str(cut), "w") as out:
        stream, begin = None, 0
        for _ in range(math.ceil(part)):
            with av.open(str(path)) as film:
                of_clip = film.streams.video[0]
                stream = stream or out.add_stream_from_template(of_clip)
                ticks = int((of_clip.duration or 0) * min(part, 1))
                for packet in film.demux(of_clip):
                    if packet.pts is not None and packet.dts is not None and packet.pts < ticks:
                        packet.pts, packet.dts = packet.pts + begin, packet.dts + begin
                        packet.stream = stream
                        out.mux(packet)
            begin += ticks
    words = [sys.executable, "-c", _PEAK, "fuse", str(cut), "--out", str(folder / "out")]
    peaks = []
    for _ in range(RUNS):  # the allocator's luck is worth 5 MB
        output = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        peaks.append(int(output.split()[-1]) / 1024)
    print(f"{part * FRAMES / RATE_HZ:.0f} s: at most {statistics.median(peaks):.0f} MB of memory")


def timed(name: str, work: Callable[[], Result]) -> Result:
    """Run and print how much processor time it took."""
    start = time.process_time()
    result = work()
    print(f"{name}: {time.process_time() - start:.1f} s")
    return result


if __name__ == "__main__":
    main(*sys.argv[1:])
