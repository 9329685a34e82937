"""Baseline: the photo itself, stretched over the hemisphere in front and mirrored behind.

Khan, Reinhard, Fleming and Buelthoff, "Image-based material editing", SIGGRAPH 2006.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Int

from deeplight.camera_response import decode
from deeplight.evaluate.baselines.baseline import DARKEST, Baseline
from deeplight.lighting import LIGHTING_SIZE
from deeplight.mappings import mirror_ball

_SAMPLES = 4  # along each side of a pixel of the ball


class Khan2006(Baseline):
    """The linear photo as an extruded hemisphere: direction (x, y, z) shows photo point (x, y).

    x = -1 and 1 are the photo's left and right edge, y = -1 and 1 its lower and upper one, and the
    sign of z does not matter: what lies behind the camera mirrors what it sees. The method was made
    for HDR photos; from an 8-bit one no light is brighter than the camera's white.
    """

    @property
    def name(self) -> str:
        return "khan_2006"

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        count, _, height, width = inputs.shape
        linear = decode(np.clip(inputs + np.float32(0.5), 0, 1)).reshape(count, 3, -1)
        pixel, share = _shown_pixels(height, width)
        radiance = np.einsum("ncls,ls->ncl", linear[:, :, pixel], share)
        shape = (count, 3, LIGHTING_SIZE, LIGHTING_SIZE)
        log_radiance: np.ndarray = np.log(np.maximum(radiance, DARKEST)).reshape(shape)
        return np.ascontiguousarray(log_radiance.transpose(0, 2, 3, 1))


@lru_cache(maxsize=2)
def _shown_pixels(
    height: int, width: int
) -> tuple[Int[np.ndarray, "lights samples"], Float32[np.ndarray, "lights samples"]]:
    """Which photo pixels a pixel of the ball shows, and the share of each; shares sum to 1 or 0."""
    directions, inside = mirror_ball.subpixels(LIGHTING_SIZE, _SAMPLES)
    column = np.clip(((directions[..., 0] + 1) / 2 * width).astype(int), 0, width - 1)
    row = np.clip(((1 - directions[..., 1]) / 2 * height).astype(int), 0, height - 1)
    share = inside / np.maximum(inside.sum(1, keepdims=True), 1)
    return row * width + column, share.astype(np.float32)
