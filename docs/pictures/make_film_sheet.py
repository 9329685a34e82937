"""Draw docs/pictures/films.jpg: python docs/pictures/make_film_sheet.py FOLDER_OF_FILMS.

The middle frame of each clip of a folder that `python -m lab.film` made, with its
trouble's name; only of CC0 panoramas (the shipped one: Poly Haven), because it is shipped.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.dataset.contact_sheet import column, grid, label
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg
from deeplight.io.video import video_frames

HEIGHT, COLUMNS, MOST = 240, 9, 27


def tile(clip: Path) -> np.ndarray:
    truth = json.loads(clip.with_suffix(".truth.json").read_text())
    shown = sum(not frame["dropped"] for frame in truth["frames"])
    still = next(still for still in video_frames(clip) if still.number == shown // 2)
    picture = Image.fromarray(np.ascontiguousarray(still.rgb()))
    picture.thumbnail((HEIGHT * 9 // 16, HEIGHT))
    framed = np.full((HEIGHT, HEIGHT * 9 // 16, 3), 30, np.uint8)
    framed[: picture.height, : picture.width] = picture
    return column([framed, label(", ".join(truth["trouble"]) or truth["scene"], framed.shape[1])])


def main() -> None:
    truths = sorted(Path(sys.argv[1]).glob("clips/*.truth.json"))
    clips = [p for p in truths if json.loads(p.read_text())["licence"].startswith("CC0")][:MOST]
    tiles = [tile(path.with_name(path.name.replace(".truth.json", ".mp4"))) for path in clips]
    out = Path(__file__).with_name("films.jpg")
    with replacing(out) as temporary:
        temporary.write_bytes(encode_jpeg(grid(tiles, COLUMNS), quality=72))
    sys.stdout.write(f"{out}: {out.stat().st_size // 1000} kB\n")


if __name__ == "__main__":
    main()
