"""The network's answer, which it gives in the frame of what it was shown, in the photo's frame.

Of a photo lying on its side the network is shown a view that looks further down than the photo
(`preprocess.slid_into_photo`). Its map is turned back, and its lamps by themselves: drawn again
they stay as sharp as they were.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float32

from deeplight.frames import rotation
from deeplight.lamp import Lamp
from deeplight.lobe import LEAST_RADIANCE, lobe_on_ball
from deeplight.mappings import mirror_ball
from deeplight.mappings.resample import sample_ball

Ball = Float32[np.ndarray, "size size 3"]
Answer = tuple[Ball, tuple[Lamp, ...], Mapping[str, float]]


def seen_from_photo(
    log_radiance: Ball, lamps: Sequence[Lamp], heads: Mapping[str, float], pitch_rad: float
) -> Answer:
    """Turn an answer from the frame of the view into that of the photo.

    Args:
        log_radiance: ln radiance on the mirror ball, which holds the lamps.
        lamps: the network's.
        heads: what else it says; its pitch becomes the photo's.
        pitch_rad: how far up the view looks from the photo's axis; 0 changes nothing.
    """
    if pitch_rad == 0:
        return log_radiance, tuple(lamps), heads
    photo_from_view = rotation("x", pitch_rad)
    size = len(log_radiance)
    soft = np.exp(log_radiance) - sum(lobe_on_ball(lamp, size) for lamp in lamps)
    directions = mirror_ball.pixel_directions(size).reshape(-1, 3) @ photo_from_view
    soft = sample_ball(np.log(np.maximum(soft, np.float32(LEAST_RADIANCE))), directions).reshape(
        size, size, 3
    )
    moved = tuple(lamp.turned(photo_from_view) for lamp in lamps)
    light = np.exp(soft) + sum(lobe_on_ball(lamp, size) for lamp in moved)
    if "pitch_rad" in heads:
        heads = {**heads, "pitch_rad": heads["pitch_rad"] - pitch_rad}
    return np.log(light).astype(np.float32), moved, heads
