"""A rival's answers to a data set, as the folder of panoramas that `evaluate --panoramas` reads."""

from collections.abc import Callable, Sequence
from pathlib import Path

from deeplight.dataset import SplitIndex
from deeplight.evaluate.rivals.rival import Rival
from deeplight.io.radiance import write_exr
from deeplight.preprocess import landscape_background


def write_answers(
    rival: Rival,
    index: SplitIndex,
    numbers: Sequence[int],
    folder: Path,
    progress: Callable[[int], None] = lambda examples: None,
) -> None:
    """Answer examples from their landscape views (section 4.3).

    Panoramas are taken as the camera's frame, so no elevation goes with them: Hold-Geoffroy 2017 is
    turned by the elevation it predicts, Gardner 2017 predicts none and stays upright (section 4.3).

    Raises:
        DataSetError: an example cannot be read.
        OSError: the folder cannot be written.
    """
    for number in numbers:
        photo, _ = index.pixels(number)
        radiance = rival.panorama(landscape_background(photo))
        write_exr(folder / f"{index.keys[number]}.exr", radiance)
        progress(1)
