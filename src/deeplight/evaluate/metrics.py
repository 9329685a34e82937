"""How far a lighting estimate is from what was filmed, example by example.

All metrics compare rendered spheres with filmed 8-bit spheres (section 4.1). A value that cannot
be computed is NaN and stays NaN: whoever averages has to leave it out and say how many there were.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

Images = Float[np.ndarray, "examples size size 3"]
Mask = Bool[np.ndarray, "size size"]


class AngularError(NamedTuple):
    """Mean angle per example, and how many of its masked pixels had none."""

    degrees: Float64[np.ndarray, " examples"]
    black_pixels: Int64[np.ndarray, " examples"]


def masked_l1(predicted: Images, filmed: Images, mask: Mask) -> Float64[np.ndarray, " examples"]:
    """Mean absolute difference of pixel values over masked pixels and channels.

    L1 of Table 1 and equation 4, as a mean. Both are gamma-encoded, 0 to 1; the prediction was
    soft-clipped in linear before. The filmed pixels are taken as they are: soft-clipping them too,
    as equation 4 does when read literally, would move a saturated pixel from 1 to 0.983 of white.

    Returns:
        0 is perfect, 1 the worst; NaN where a masked value is NaN.
    """
    difference = np.abs(predicted[:, mask].astype(np.float64) - filmed[:, mask])
    mean: np.ndarray = difference.mean((1, 2))
    return mean


def angular_error_rgb(predicted: Images, filmed: Images, mask: Mask) -> AngularError:
    """Angle between the linear colours of each pixel, averaged over the masked pixels.

    theta_rgb of Table 1: the metric of white balance algorithms (Hordley and Finlayson 2004). It
    does not see brightness, only colour. A pixel that is black in either picture has no colour: it
    is left out and counted.

    Args:
        predicted, filmed: linear, of the diffuse sphere, in any unit.

    Returns:
        Degrees, 0 to 90 for colours >= 0; NaN where a masked value is not finite or all pixels are
        black.
    """
    a, b = predicted[:, mask].astype(np.float64), filmed[:, mask].astype(np.float64)
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    black = lengths == 0
    # atan2 of |a x b| and a.b instead of arccos(a.b): exact for small angles too.
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    angles = np.where(black, 0.0, np.degrees(np.arctan2(sine, (a * b).sum(-1))))
    coloured = (~black).sum(1)
    with np.errstate(invalid="ignore"):
        degrees = np.where(coloured > 0, angles.sum(1) / coloured, np.nan)
    degrees[~np.isfinite(a).all((1, 2))] = np.nan
    return AngularError(degrees, black.sum(1))


def relative_radiance_error(
    predicted: Images, filmed: Images, mask: Mask
) -> Float64[np.ndarray, "examples 3"]:
    """(sum predicted - sum filmed) / sum filmed over the masked pixels, per channel.

    Of the linear diffuse sphere: how much too bright (+) or too dark (-) the light is (the box plot
    of relative radiance accuracy). The prediction is not clipped. Where the filmed sphere is
    clipped, the true radiance is larger than its pixels say, and the error here is too large.

    Returns:
        -1 to infinity, 0 is perfect; NaN where a channel of the filmed sphere is all black or the
        prediction is not finite.
    """
    a = predicted[:, mask].astype(np.float64).sum(1)
    b = filmed[:, mask].astype(np.float64).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error: np.ndarray = np.where((b > 0) & np.isfinite(a), (a - b) / b, np.nan)
    return error


def mirror_detail(
    predicted: Images, filmed: Images, mask: Mask
) -> Float64[np.ndarray, " examples"]:
    """How sharp the rendered mirror sphere is next to the filmed one: 1 is as sharp, 0 is flat.

    The measure of frequency is the mean absolute difference of neighbouring pixel values, both
    within the mask; the quotient of the two pictures' is given. Where the difference lies does not
    matter, so this says nothing about being right: read it next to the mirror's L1.

    Returns:
        NaN where the filmed sphere is flat or the prediction is not finite.
    """
    own, wanted = _variation(predicted, mask), _variation(filmed, mask)
    with np.errstate(divide="ignore", invalid="ignore"):
        detail: np.ndarray = np.where((wanted > 0) & np.isfinite(own), own / wanted, np.nan)
    return detail


def _variation(pictures: Images, mask: Mask) -> Float64[np.ndarray, " examples"]:
    pixels = np.where(mask[..., None], pictures, 0).astype(np.float64)
    across, down = mask[:, 1:] & mask[:, :-1], mask[1:] & mask[:-1]
    with np.errstate(invalid="ignore"):
        steps = np.abs(np.diff(pixels, axis=2))[:, across].sum((1, 2))
        steps = steps + np.abs(np.diff(pixels, axis=1))[:, down].sum((1, 2))
    total: np.ndarray = steps / (3 * (across.sum() + down.sum()))
    return total
