"""From radiance to pixel values and back: exposure, white balance, soft clip, gamma.

Radiance is relative to the camera's white: linear 1.0 is where a pixel saturates. A pixel
is gamma-encoded and lies in 0 to 1.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError

GAMMA = 2.2  # section 3.4
SOFT_CLIP_N = 40.0  # equation 3
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (ITU-R BT.709)
LUMINANCE.setflags(write=False)
_FAR = 24.0  # its exponential is lost in float32's rounding, its square in float64's

Values = Float[np.ndarray, "*batch"]


def soft_clip(radiance: Values, n: float = SOFT_CLIP_N) -> Values:
    """Differentiable clip at 1: equation 3, written as 1 - softplus(-n (p - 1)) / n.

    Never above 1; 1 - ln 2 / n at p = 1. Below 0.8 it changes values by less than 1e-5.
    Black comes out at -1e-19, not 0, so encoding clamps at 0.
    """
    below = np.asarray(-n * (radiance - 1), order="C")
    soft = np.asarray(np.maximum(below, 0))
    # That is the softplus to the last bit, but for what lies near the clip.
    far = _FAR if soft.dtype == np.float32 else 2 * _FAR
    near = np.flatnonzero(np.abs(below) < far)
    soft.reshape(-1)[near] = np.logaddexp(0, below.reshape(-1)[near])
    result: np.ndarray = 1 - soft / n
    return result.astype(radiance.dtype)


def encode(radiance: Values, gamma: float = GAMMA) -> Values:
    """Gamma-encode clipped radiance: x^(1 / gamma), with negatives taken as 0."""
    return np.maximum(radiance, 0) ** np.asarray(1 / gamma, radiance.dtype)


def decode(pixel: Values, gamma: float = GAMMA) -> Values:
    """Linear radiance of gamma-encoded pixels: x^gamma."""
    return np.maximum(pixel, 0) ** np.asarray(gamma, pixel.dtype)


@dataclass(frozen=True)
class CameraResponse:
    """How a camera turns scene radiance into pixel values.

    Attributes:
        gamma: exponent of the encoding.
        soft_clip_n: sharpness of the clip (equation 3).
        exposure_stops: doublings of the scene's radiance before the clip.
        white_balance: gain of red, green and blue before the clip.

    Examples:
        >>> grey = np.array([[0.5, 0.5, 0.5], [8.0, 8.0, 8.0]])
        >>> deeplight.CameraResponse(exposure_stops=-1.0).pixel_from_radiance(grey).round(3)
        array([[0.533, 0.533, 0.533],
               [1.   , 1.   , 1.   ]])
    """

    gamma: float = GAMMA
    soft_clip_n: float = SOFT_CLIP_N
    exposure_stops: float = 0.0
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        if self.gamma <= 0 or self.soft_clip_n <= 0 or min(self.white_balance) <= 0:
            raise ShapeError("positive gamma, clip and white balance", f"{self}", "correct them")

    @property
    def gain(self) -> Float[np.ndarray, "3"]:
        """Factor on each colour channel: exposure times white balance."""
        return np.asarray(self.white_balance, np.float32) * np.float32(2.0**self.exposure_stops)

    def pixel_from_radiance(
        self, radiance: Float[np.ndarray, "*batch 3"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Pixel values, 0 to 1, of scene radiance."""
        return encode(soft_clip(radiance * self.gain, self.soft_clip_n), self.gamma)

    def radiance_from_pixel(
        self, pixel: Float[np.ndarray, "*batch 3"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Scene radiance of pixel values below the clip; a clipped pixel gives a lower bound."""
        unclipped = decode(pixel, self.gamma)
        n, top = self.soft_clip_n, np.asarray(1 - 1e-6, pixel.dtype)
        # Inverse of the soft clip: p = 1 - ln(exp(n (1 - y)) - 1) / n.
        linear = 1 - np.log(np.expm1(n * (1 - np.minimum(unclipped, top)))) / n
        red, green, blue = self.gain
        # By one number where it is one: numpy is slow where its inner loop is a pixel's three.
        gain = red if red == green == blue else self.gain
        return (linear / gain).astype(pixel.dtype)
