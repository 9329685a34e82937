"""Draw docs/pictures/reflectance.png: why the mirror's basis is not photographed.

python docs/pictures/make_reflectance.py STAGE

STAGE is a folder of `python -m lab.light_stage`. Every ball is 32 x 32 pixels, rendered
with the basis measured from its photographs, or with the mirror's one-hot basis.
"""

import sys
from pathlib import Path

import numpy as np

from deeplight.camera_response import CameraResponse
from deeplight.dataset.contact_sheet import column, enlarged, label, row
from deeplight.io.photos import write_png
from deeplight.light_stage.measure import MeasureSettings, measure
from deeplight.light_stage.picture import made_up_light
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.relight import relight

SIZE = 190
RESPONSE = CameraResponse()


def ball(radiance: np.ndarray, text: str) -> np.ndarray:
    """One sphere with a line of text."""
    pixels = RESPONSE.pixel_from_radiance(radiance.astype(np.float32))
    picture = np.floor(pixels * 255 + 0.5).astype(np.uint8)
    return column([enlarged(picture, SIZE), label(text, SIZE)])


def strip(name: str, basis: ReflectanceBasis) -> np.ndarray:
    """A basis in white light and in light with edges."""
    furnace = basis.furnace()
    inside = furnace[basis.view.mask()]
    white = np.repeat(furnace[..., None], 3, axis=2)
    title = f"white light: {inside.min():.2f} to {inside.max():.2f}"
    balls = [ball(white, title), ball(relight(basis, made_up_light(32)), "made-up light")]
    return column([label(name, 2 * SIZE + 6), row(balls, 6)])


def main(stage: str) -> None:
    how = MeasureSettings(photographed_mirror=True, passes=1)
    bases = measure(Path(stage), how).bases
    one_hot = analytic_basis("mirror", bases["mirror"].view)
    strips = [
        strip("mirror, one-hot", one_hot),
        strip("mirror, photographed", bases["mirror"]),
        strip("matte silver, photographed", bases["matte_silver"]),
    ]
    write_png(Path(__file__).parent / "reflectance.png", row(strips, 14))


if __name__ == "__main__":
    main(*sys.argv[1:])
