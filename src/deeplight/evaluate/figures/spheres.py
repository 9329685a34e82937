"""The piece every figure is made of: an input next to its spheres, filmed and rendered."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera_response import encode, soft_clip
from deeplight.dataset import DataSet, Example
from deeplight.dataset.contact_sheet import GAP, PAPER, Picture, column, enlarged, label, row
from deeplight.evaluate.scores import Report, rendered_radiance
from deeplight.sphere import SphereView

SPHERE_PX = 64
ORDER = ("diffuse", "matte_silver", "mirror")  # top to bottom, as in the paper


def block(report: Report, data: DataSet, position: int, names: Sequence[str]) -> Picture:
    """One example: its input, the filmed spheres, and those in the light of each estimator.

    Args:
        position: of the example in the report.
    """
    example = example_at(report, data, position)
    shown = column([title("input", example.background.shape[1]), example.background])
    columns = [titled("filmed", filmed_column(example, data))]
    columns += [titled(name, answer_column(report, data, position, name)) for name in names]
    return row([shown, *columns], GAP // 2)


def example_at(report: Report, data: DataSet, position: int) -> Example:
    """The example at a position in the report."""
    return data.index(report.split)[int(report.numbers[position])]


def filmed_column(example: Example, data: DataSet) -> Picture:
    """The three filmed spheres, on top of each other."""
    pixels = {name: crop / 255 for name, crop in example.spheres.items()}
    return _column(pixels, data.rigs[example.meta.rig].views)


def answer_column(report: Report, data: DataSet, position: int, name: str) -> Picture:
    """The three spheres in the light that an estimator answered, as the camera would show them."""
    index = data.index(report.split)
    rig = str(index.rigs[int(report.numbers[position])])
    answer = np.asarray(report.log_radiance[name][position : position + 1])
    rendered = rendered_radiance(data.bases(rig, answer.shape[1]), answer)
    with np.errstate(invalid="ignore"):
        pixels = {sphere: encode(soft_clip(r[0])) for sphere, r in rendered.items()}
    return _column(pixels, data.rigs[rig].views)


def titled(name: str, picture: Picture) -> Picture:
    return column([title(name, picture.shape[1]), picture])


def title(name: str, width: int) -> Picture:
    return column([label(line, width) for line in title_lines(name)])


def title_lines(name: str) -> tuple[str, str]:
    """Two lines as short as can be, since a name is longer than a sphere is wide."""
    words = name.split("_")
    splits = [(" ".join(words[:n]), " ".join(words[n:])) for n in range(1, len(words) + 1)]
    return min(splits, key=lambda lines: max(len(line) for line in lines))


def _column(
    pixels: Mapping[str, Float[np.ndarray, "size size 3"]], views: Mapping[str, SphereView]
) -> Picture:
    return column([enlarged(_cut_out(pixels[name], views[name]), SPHERE_PX) for name in ORDER])


def _cut_out(
    pixels: Float[np.ndarray, "size size 3"], view: SphereView
) -> UInt8[np.ndarray, "size size 3"]:
    alpha = view.alpha()[..., None]
    shown = alpha * np.clip(np.nan_to_num(pixels), 0, 1) * 255 + (1 - alpha) * PAPER
    picture: np.ndarray = np.floor(shown + 0.5).astype(np.uint8)
    return picture
