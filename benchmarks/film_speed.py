"""How long one frame of a simulated film takes, encoding included, on one core.

OMP_NUM_THREADS=1 python benchmarks/film_speed.py FOLDER_OF_PANORAMAS

Films clips of 20 frames at 1080 x 1920 in the first place of the folder, without trouble and with
those that cost most. Prints processor time, which other programs do not disturb, for setting a
clip up and for each frame after it.
"""

import sys
import tempfile
import time
from pathlib import Path

from deeplight.io.video_writer import VideoWriter
from deeplight.simulate import panorama
from lab.film.clip import Clip
from lab.film.recipe import FilmRecipe

FRAMES = 20


def measure(folder: Path, troubles: tuple[str, ...]) -> tuple[float, float, float]:
    """Seconds of set-up, seconds a frame, and kilobytes a frame."""
    place = next(p for p in panorama.places_in(folder) if not p.synthetic_ground)
    radiance = panorama.load(place)
    recipe = FilmRecipe(seconds=FRAMES / 30)
    start = time.process_time()
    clip = Clip(radiance, place.scene, recipe, troubles, [0, 0, 0])
    frames = clip.frames()
    first = next(frames)
    set_up = time.process_time() - start
    camera, codec = clip.camera, "libx265" if "hlg10" in troubles else "libx264"
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "film.mp4"
        with VideoWriter(path, camera.width, camera.height, 30, codec) as video:
            start = time.process_time()
            video.write(first.pixels, first.time_s)
            for frame in frames:
                video.write(frame.pixels, frame.time_s)
        seconds = time.process_time() - start
        return set_up, seconds / FRAMES, path.stat().st_size / FRAMES / 1000


def main() -> None:
    print("| clip | set-up, s | a frame, s | kB a frame |\n|---|---|---|---|")
    for troubles in ((), ("blur",), ("hlg10",)):
        set_up, frame, size = measure(Path(sys.argv[1]), troubles)
        print(f"| {' '.join(troubles) or 'plain'} | {set_up:.1f} | {frame:.2f} | {size:.0f} |")


if __name__ == "__main__":
    main()
