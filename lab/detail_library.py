"""Make the small library of places that `estimate --fill` takes detail from.

python -m lab.detail_library HDRI_FOLDER [--places 40]

Takes panoramas that are CC0 of Poly Haven, of places to train on, with a real ground; the most
different ones first, by their smooth light. Writes weights/detail.npz and DETAIL_LICENSES.md next
to it into the package.
"""

import argparse
from pathlib import Path

import numpy as np

from deeplight.estimators.fill import FILE, picture_of, smooth_of
from deeplight.io.atomic import replacing
from deeplight.io.environment_file import read_environment
from deeplight.io.photos import encode_jpeg
from deeplight.report.table import read_table
from deeplight.simulate.panorama import MANIFEST

WEIGHTS = Path(__file__).resolve().parents[1] / "src" / "deeplight" / "weights"
LICENCES = ("CC0 - Poly Haven / HDRI Haven", "CC0 - Poly Haven")
QUALITY = 88
HEAD = """# Where the detail of `estimate --fill` comes from

Each place in `detail.npz` is a panorama of [Poly Haven](https://polyhaven.com), which gives them
away under [CC0](https://creativecommons.org/publicdomain/zero/1.0/), reduced to 128 x 256 ratios to
its own smooth light. All are places that the shipped network was trained on; none is a validation
or test place. `python -m lab.detail_library` made it.

"""


def main(args: argparse.Namespace) -> None:
    rows = list(usable(args.folder))
    panoramas = [read_environment(args.folder / row["file"]).latlong(256) for row in rows]
    smooth = np.stack([smooth_of(panorama) for panorama in panoramas])
    chosen = different(smooth.reshape(len(smooth), -1), args.places)
    pictures = [encode_jpeg(picture_of(panoramas[n]), QUALITY) for n in chosen]
    with replacing(WEIGHTS / FILE) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            names=np.array([rows[n]["slug"] for n in chosen]),
            kinds=np.array([rows[n]["scene"] for n in chosen]),
            smooth=smooth[chosen].astype(np.float16),
            sizes=np.array([len(picture) for picture in pictures]),
            pictures=np.frombuffer(b"".join(pictures), np.uint8),
        )
    lines = [f"- [{rows[n]['slug']}](https://polyhaven.com/a/{rows[n]['slug']})" for n in chosen]
    with replacing(WEIGHTS / "DETAIL_LICENSES.md") as temporary:
        temporary.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(chosen)} of {len(rows)} places, {(WEIGHTS / FILE).stat().st_size / 1e6:.2f} MB")


def usable(folder: Path) -> list[dict[str, str]]:
    """Rows of the manifest that may be shipped; one panorama a place."""
    places: dict[str, dict[str, str]] = {}
    for row in read_table(folder / MANIFEST, ("file", "slug", "place", "scene")):
        clear = row["licence"] in LICENCES and row["split"] == "train"
        if clear and row["synthetic_ground"] == "false":
            places.setdefault(row["place"], row)
    return list(places.values())


def different(values: np.ndarray, count: int) -> list[int]:
    """Numbers of the rows that are farthest from those taken before; the first is the middle."""
    centred = values - values.mean(1, keepdims=True)
    apart = np.linalg.norm(centred[:, None] - centred[None], axis=-1)
    taken = [int(apart.sum(1).argmin())]
    while len(taken) < min(count, len(values)):
        taken.append(int(apart[taken].min(0).argmax()))
    return taken


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--places", type=int, default=40)
    main(parser.parse_args())
