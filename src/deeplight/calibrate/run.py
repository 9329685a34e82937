"""From data sets of one's own clips to a model of one's own."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from deeplight.calibrate.gains import GainCalibration, find_gains, views_of
from deeplight.calibrate.model import write_with_gains
from deeplight.dataset import open_dataset
from deeplight.errors import InputError
from deeplight.estimators.onnx import OnnxEstimator, shipped_model
from deeplight.evaluate.models import NamedModel


def calibrate_model(
    data: Sequence[Path],
    out: Path,
    weights: Path | None = None,
    progress: Callable[[int], None] = lambda examples: None,
    camera: str | None = None,
) -> GainCalibration:
    """Write a model whose light suits the phone that filmed some data sets; only if it is better.

    Args:
        data: folders of data sets of three-sphere clips, as `deeplight capture` makes them.
        out: the .onnx to write.
        weights: the exported model to start from; left out, the shipped one.
        progress: called with the number of examples looked at since the last call.
        camera: make and model, as EXIF of its photos has them; left out, what the clips say. Photos
            of other cameras will get `weights`' own light. Empty: all photos get the new one.

    Raises:
        InputError: clips of several cameras, too few places, or a model that is not better in
            places left out; a data set or a model that cannot be read. Nothing is written.
        OSError: `out` cannot be written.
    """
    source = shipped_model() if weights is None else weights
    model = NamedModel("model", OnnxEstimator(weights))
    views = [part for folder in data for part in views_of(model, open_dataset(folder), progress)]
    filmed_with = frozenset[str]().union(*(part.cameras for part in views))
    if camera is None and len(filmed_with) > 1:
        do = "calibrate a model for each"
        raise InputError("clips of one camera", " and ".join(sorted(filmed_with)), do)
    found = find_gains(views)
    red, green, blue = found.log_gains
    note = f"calibrated in {found.places} places: ln gains {red:+.3f} {green:+.3f} {blue:+.3f}"
    found = replace(found, camera="".join(filmed_with) if camera is None else camera)
    write_with_gains(source, out, found.log_gains, note, found.camera)
    return found
