"""A rival's answers to a data set, as the folder of panoramas that `evaluate --panoramas` reads."""

from collections.abc import Callable
from pathlib import Path

from deeplight.dataset import DataSet
from deeplight.evaluate.rivals.training import Rival
from deeplight.io.radiance import write_exr
from deeplight.preprocess import landscape_background


def write_answers(
    rival: Rival,
    data: DataSet,
    split: str,
    folder: Path,
    progress: Callable[[int], None] = lambda examples: None,
) -> int:
    """Answer every example from its landscape view (section 4.3); give how many there are.

    Panoramas are taken as the camera's frame, so no elevation goes with them: Hold-Geoffroy 2017 is
    turned by the elevation it predicts, Gardner 2017 predicts none and stays upright (section 4.3).

    Raises:
        DataSetError: no such split, or an example cannot be read.
        OSError: the folder cannot be written.
    """
    index = data.index(split)
    for number in range(len(index)):
        photo, _ = index.pixels(number)
        radiance = rival.panorama(landscape_background(photo))
        write_exr(folder / f"{index.keys[number]}.exr", radiance)
        progress(1)
    return len(index)
