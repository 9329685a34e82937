"""What a camera adds to a picture: blur and grain, measured in the photo, given to the render."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera_response import LUMINANCE

MOST_BLUR_PX = 2.5
_BLOCK = 16
_FLAT_SHARE = 0.25  # of the blocks: those with the least structure show the noise
_EDGE_QUANTILE = 0.99  # gradients above it are edges
_SHARP_QUANTILE = 0.25  # of the edges' blurs: the sharper ones are in focus
_RENDERED_BLUR_PX = 0.62  # what this measure finds in an edge averaged over pixels, unblurred
_REBLUR_PX = 1.0


@dataclass(frozen=True, eq=False)
class Look:
    """A photo's own blur and grain.

    Attributes:
        blur_px: standard deviation of the blur beyond that of a pixel's size.
        grain: covariance of the noise in red, green and blue, pixel values 0 to 1.
    """

    blur_px: float
    grain: Float[np.ndarray, "3 3"]


NO_LOOK = Look(0.0, np.zeros((3, 3)))


def look_of(photo: UInt8[np.ndarray, "height width 3"]) -> Look:
    """Measure a photo."""
    pixels = photo.astype(np.float32) / 255
    return Look(_blur_px(pixels @ LUMINANCE.astype(np.float32)), _grain(pixels))


def grain(look: Look, height: int, width: int, seed: int) -> Float[np.ndarray, "height width 3"]:
    """Noise like the photo's, to be added to pixel values; its pixels are independent."""
    values, axes = np.linalg.eigh(look.grain)
    spread = axes * np.sqrt(np.maximum(values, 0))
    draws = np.random.default_rng(seed).standard_normal((height, width, 3), np.float32)
    noise: np.ndarray = draws @ spread.T.astype(np.float32)
    return noise


def blurred(
    values: Float[np.ndarray, "height width n"], sigma_px: float
) -> Float[np.ndarray, "height width n"]:
    """Gaussian blur; the edges are continued."""
    reach = int(np.ceil(3 * sigma_px))
    if reach == 0 or sigma_px < 0.1:
        return values
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma_px) ** 2)
    kernel = (kernel / kernel.sum()).astype(values.dtype)
    for axis in (0, 1):
        padded = np.pad(values, [(reach, reach) if a == axis else (0, 0) for a in range(3)], "edge")
        size = values.shape[axis]
        values = sum(
            weight * padded.take(range(k, k + size), axis) for k, weight in enumerate(kernel)
        )
    return values


def _blur_px(luma: Float[np.ndarray, "height width"]) -> float:
    """Blur of the photo's sharper edges, from how much more a known blur softens them.

    Zhuo and Sim 2011: an edge of blur s has its gradient divided by R = sqrt(1 + b^2 / s^2) when
    blurred by b more, so s = b / sqrt(R^2 - 1).
    """
    steep = _steepness(luma)
    again = _steepness(blurred(luma[..., None], _REBLUR_PX)[..., 0])
    edges = steep >= max(float(np.quantile(steep, _EDGE_QUANTILE)), 0.02)
    if edges.sum() < 20:
        return 0.0
    ratio = np.maximum(steep[edges] / np.maximum(again[edges], 1e-6), 1.001)
    sigma = float(np.quantile(_REBLUR_PX / np.sqrt(ratio**2 - 1), _SHARP_QUANTILE))
    return float(np.sqrt(np.clip(sigma**2 - _RENDERED_BLUR_PX**2, 0, MOST_BLUR_PX**2)))


def _steepness(luma: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    down, right = np.gradient(luma)
    return np.hypot(down, right)


def _grain(pixels: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "3 3"]:
    """Noise of the flattest blocks, after a filter that takes out planes and edges.

    The filter is Immerkaer's (1996), the difference of two Laplacians; it multiplies the variance
    of independent noise by 36.
    """
    rows = pixels[:-2] - 2 * pixels[1:-1] + pixels[2:]
    left = rows[:, :-2] - 2 * rows[:, 1:-1] + rows[:, 2:]
    height, width = (n // _BLOCK for n in left.shape[:2])
    if height * width < 16:
        return np.zeros((3, 3))
    blocks = left[: height * _BLOCK, : width * _BLOCK].reshape(height, _BLOCK, width, _BLOCK, 3)
    blocks = blocks.swapaxes(1, 2).reshape(-1, _BLOCK * _BLOCK, 3)
    energy = (blocks**2).sum((1, 2))
    energy[energy < 1e-9] = np.inf  # clipped or painted: no noise to see
    count = int(_FLAT_SHARE * len(blocks))
    flat = blocks[np.argsort(energy)[:count]][np.sort(energy)[:count] < np.inf]
    if not len(flat):
        return np.zeros((3, 3))
    values = flat.reshape(-1, 3).astype(float)
    return values.T @ values / len(values) / 36
