"""What two opposite views of a place give: Cheng et al. 2018's setting, answered by `fuse`.

Cheng, Shi, Chen, Deng, Zhang, "Learning scene illumination by pairwise photos from rear and front
mobile cameras", CGF 2018, learn light from a photo of the rear camera and one of the front camera
taken at once. Here the rear view of an example is photographed again in the panorama that it was
filmed in, and the front camera looks the other way; each has its own exposure and white balance.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.dataset import SplitIndex
from deeplight.errors import DataSetError
from deeplight.estimators.network import NetworkEstimator
from deeplight.frames import Rotation, turned
from deeplight.fuse.frame import SourceFrame
from deeplight.fuse.fuse import FRONT_FROM_BACK, FuseSettings, fuse_frames
from deeplight.io.environment_file import read_environment
from deeplight.io.radiance import write_exr
from deeplight.mappings import latlong, resample
from deeplight.simulate.panorama import WORKING_HEIGHT
from deeplight.simulate.phone import PHONES, develop, draw_automatics, metered

NAME = "fuse_opposite_views"
SIZE = (480, 270)
"""Rows and columns of the photos: the whole 9:16 frame."""
ROWS = 64
"""Of the panoramas that are written."""
_SENSOR_PIXELS = 16
Panorama = Float[np.ndarray, "height width 3"]


def write_opposite_views(
    index: SplitIndex,
    numbers: Sequence[int],
    hdri: Path,
    estimator: NetworkEstimator,
    folder: Path,
    progress: Callable[[int], None] = lambda examples: None,
) -> None:
    """Answer examples of simulated takes from a rear and a front photo, as panoramas by key.

    Args:
        hdri: folder of the panoramas that the takes were filmed in.

    Raises:
        DataSetError: an example does not say its pose and exposure: it is not simulated.
    """
    for number in numbers:
        meta = index[number].meta
        if not {"world_from_camera", "log_gain"} <= meta.details.keys():
            expected = f"pose and exposure of {index.keys[number]}, as simulated takes have them"
            raise DataSetError(expected, "none", "take a data set of `deeplight simulate`")
        pose = np.array(meta.details["world_from_camera"])
        gain = np.exp(np.array(meta.details["log_gain"], np.float32))
        panorama = _panorama(hdri / meta.source)
        random = np.random.default_rng(number)
        rear = photographed(panorama, pose, random, gain)
        front = photographed(panorama, pose @ FRONT_FROM_BACK, random)
        frames = [_frame("rear", rear), _frame("front", front)]
        fused = fuse_frames(frames[:1], estimator, FuseSettings(height=ROWS), frames[1])
        write_exr(folder / f"{index.keys[number]}.exr", fused.environment.radiance)
        progress(1)


def photographed(
    panorama: Panorama,
    pose: Rotation,
    random: np.random.Generator,
    gain: Float[np.ndarray, "3"] | None = None,
) -> np.ndarray:
    """A phone's 8-bit photo; without `gain` the camera meters for itself.

    Args:
        pose: world_from_camera.
        gain: of the camera's white over the panorama's radiance, by channel.
    """
    height, width = SIZE
    automatics = draw_automatics(PHONES["paper"], random)
    camera = PinholeCamera(width, height, PHONES["paper"].vertical_fov_rad)
    seen = resample.sample_latlong(panorama, turned(camera.rays().astype(np.float32), pose))
    if gain is None:
        small = resample.shrink_latlong(panorama, 32)
        illuminant = np.average(small, axis=(0, 1), weights=latlong.solid_angles(32, 64))
        gain = metered(seen[::8, ::8].reshape(-1, 3), illuminant, automatics).gain
    return develop(seen, gain, automatics, _SENSOR_PIXELS, random)


def _frame(name: str, pixels: np.ndarray) -> SourceFrame:
    return SourceFrame(name, pixels, 0, vertical_fov_rad=PHONES["paper"].vertical_fov_rad)


@lru_cache(maxsize=1)
def _panorama(path: Path) -> Panorama:
    return read_environment(path, max_height=WORKING_HEIGHT).radiance
